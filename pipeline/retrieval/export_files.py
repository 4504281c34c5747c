"""Clips as files of a format in one folder, with a manifest of what they are and what was done to them."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from motionlake.errors import ClipError, UserError
from motionlake.formats.write.registry import ClipToWrite, SetWriter, Writer
from motionlake.formats.write.stems import clip_stem
from motionlake.formats.write.whole import whole_file
from motionlake.lake.citations import Source
from motionlake.names import json_text, told_apart
from motionlake.retrieval.croissant import CROISSANT, described, set_of_file, table_columns
from motionlake.retrieval.export import ClipExporter
from motionlake.retrieval.selection import ClipRange

MANIFEST: Final = "manifest.json"


@dataclass
class Exported:
    """What an export made: a row a file of the manifest, and (clip, reason) of what it left out.

    `sources` are those of every dataset of the lake.
    """

    folder: Path
    sources: Mapping[str, Sequence[Source]]
    rows: list[dict[str, Any]] = field(default_factory=list)
    failed: list[dict[str, Any]] = field(default_factory=list)


def file_names(chosen: Sequence[ClipRange], suffix: str) -> dict[ClipRange, str]:
    """The file of each range of clips, told apart on every file system."""
    keys = {f"{one.clip}\0{one.start}\0{one.stop}": one for one in chosen}

    def stem(key: str) -> str:
        one = keys[key]
        whole = one.start is None and one.stop is None
        return clip_stem(one.clip) + ("" if whole else f"-{one.start or 0}-{'end' if one.stop is None else one.stop}")

    return {keys[key]: f"{name}{suffix}" for key, name in told_apart(keys, stem).items()}


def check_free(folder: Path, names: Sequence[str], *, overwrite: bool) -> None:
    """Raises `UserError` where the folder is none, or holds what would be written and must not be written over.

    Without `names`, for a set whose files are not known yet, it must be empty.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder}: is no folder; say with --out which folder to write into")
    if not names and not overwrite and folder.exists() and any(folder.iterdir()):
        raise UserError(f"{folder}: is not empty; say another --out, or --overwrite")
    there = [name for name in (MANIFEST, CROISSANT, *names) if (folder / name).exists()]
    if there and not overwrite:
        raise UserError(f"{folder / there[0]}: is there already; say another --out, or --overwrite")


def export_files(
    exporter: ClipExporter,
    chosen: Sequence[ClipRange],
    writer: Writer,
    folder: Path,
    progress: Callable[[int, int], None],
) -> Exported:
    """Write a file a clip, and the manifest last; a clip that cannot be written is noted, and the others go on."""
    done, files = Exported(folder, exporter.sources()), file_names(chosen, writer.suffix)
    folder.mkdir(parents=True, exist_ok=True)
    for number, one in enumerate(chosen):
        progress(number, len(chosen))
        try:
            motion = exporter.ready(one)
            writer.write(motion, folder / files[one])
        except (OSError, MemoryError):  # of the machine, not of the clip
            raise
        except Exception as error:  # one clip's surprise must not cost the others
            done.failed.append(_failure(one, error))
            continue
        done.rows.append(_row(motion, writer.name, files[one]))
    progress(len(chosen), len(chosen))
    _write_manifest(done, folder.name, [row["file"] for row in done.rows])
    return done


def export_set(
    exporter: ClipExporter,
    chosen: Sequence[ClipRange],
    writer: SetWriter,
    folder: Path,
    progress: Callable[[int, int], None],
) -> Exported:
    """Write one set of all clips: beside the folder, into which it is moved once it is whole.

    Raises:
        UserError: no clip could be written.
    """
    done = Exported(folder, exporter.sources())

    def motions() -> Iterator[ClipToWrite]:
        for number, one in enumerate(chosen):
            progress(number, len(chosen))
            try:
                motion = exporter.ready(one)
            except (OSError, MemoryError):
                raise
            except Exception as error:
                done.failed.append(_failure(one, error))
                continue
            done.rows.append(_row(motion, writer.name, "."))
            yield motion
        progress(len(chosen), len(chosen))

    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".export-", dir=folder.parent) as temporary:
        made = Path(temporary) / "set"
        made.mkdir()
        try:
            left_out = dict(writer.write_all(motions(), made))
        except ClipError as error:
            first = done.failed[0]["reason"] if done.failed and not done.rows else error.reason
            raise UserError(f"nothing was written: {first}") from error
        for number, reason in left_out.items():
            row = done.rows[number]
            done.failed.append(_failure(ClipRange(row["clip"], row["start"], row["stop"]), reason))
        done.rows = [row for number, row in enumerate(done.rows) if number not in left_out]
        files = [path.relative_to(made).as_posix() for path in made.rglob("*") if path.is_file()]
        _write_manifest(replace(done, folder=made), folder.name, files)
        _put(made, folder, Path(temporary) / "before")
    return done


def _put(made: Path, folder: Path, before: Path) -> None:
    """Move what was made into a folder; what is there under the same names goes `before`, other things stay.

    Where that fails, what was there comes back.
    """
    folder.mkdir(exist_ok=True)
    before.mkdir()
    try:
        for path in sorted(made.iterdir()):
            if (folder / path.name).exists():
                (folder / path.name).rename(before / path.name)
            path.rename(folder / path.name)
    except OSError:
        for path in before.iterdir():
            if not (folder / path.name).exists():
                path.rename(folder / path.name)
        raise


def _failure(one: ClipRange, error: Exception) -> dict[str, Any]:
    reason = str(error) if isinstance(error, ClipError | UserError) else f"{type(error).__name__}: {error}"
    return {"clip": one.clip, "start": one.start, "stop": one.stop, "reason": reason}


def _row(motion: ClipToWrite, form: str, file: str) -> dict[str, Any]:
    """A clip's row of the manifest."""
    own = {"clip": motion.name, "file": file, "format": form, "frames": len(motion.clip.channels)}
    return {**own, "fps": motion.clip.fps, "unit_metres": motion.metres_per_unit, "up": motion.up, **motion.facts}


def _write_manifest(done: Exported, name: str, files: Iterable[str]) -> None:
    """Write what the folder of a name says of itself and its files, for people and for programs that load data sets."""
    datasets = sorted({row["dataset"] for row in done.rows})
    sources = {name: [asdict(source) for source in done.sources.get(name, ())] for name in datasets}
    found = {"motionlake": version("motionlake"), "clips": done.rows, "sources": sources, "failed": done.failed}
    text = (json_text(found) + "\n").encode()
    files = sorted(files)
    tables = {set_of_file(file): done.folder / file for file in reversed(files) if file.endswith(".parquet")}
    set_of = described(
        name, done.rows, [each for key in datasets for each in done.sources.get(key, ())],
        (MANIFEST, hashlib.sha256(text).hexdigest()), files,
        {key: table_columns(path) for key, path in tables.items()},
    )  # fmt: skip
    with whole_file(done.folder / CROISSANT) as stream:
        stream.write((json_text(set_of) + "\n").encode())
    with whole_file(done.folder / MANIFEST) as stream:
        stream.write(text)
