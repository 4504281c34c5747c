"""Source folders: which clip files they hold, and which of them are new or changed since they were taken in."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import pyarrow as pa
from motionlake.columns import texts
from motionlake.errors import UserError
from motionlake.formats.limits_config import Limits, raised
from motionlake.lake.catalog import Connection, fetch, rows_of
from motionlake.lake.citations import Source, source_from
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.motion.rigs_config import RigsConfig
from motionlake.motion.units import UNITS
from motionlake.names import folded, kept, on_disk
from motionlake.stages.source_files import SourceFile, SourceFiles, content_hash, scan

UPS = ("x", "y", "z", "-x", "-y", "-z")
FRAMES_VERSION = 1
HASHED_TOGETHER = 256
Hashing: TypeAlias = Callable[[int, int], None]  # told of (files hashed, all files)


AUTO: Final = "auto"  # undoes an option that was given before


@dataclass(frozen=True)
class IngestOptions:
    """What the user said of a source folder; None leaves it to the file and its rig.

    Attributes:
        up: axis of the files that points up.
        unit: length unit of the files: a name of `UNITS` or metres per unit as a number.
        fps: frames a second.
        rig: name of the rig map.
        licence: recorded with every clip; None takes that of the source.
        labels, segments: files; None means labels.csv and segments.csv in the source folder, where they are.
        ignored: paths that were removed for good and are not taken in again.
        source: what SOURCE.json of the folder said of it.
    """

    up: str | None = None
    unit: str | None = None
    fps: float | None = None
    rig: str | None = None
    licence: str | None = None
    labels: str | None = None
    segments: str | None = None
    ignored: tuple[str, ...] = ()
    source: Source | None = None

    @property
    def recorded_licence(self) -> str | None:
        """The licence that goes with every clip."""
        return self.licence or (self.source.licence if self.source else None) or None

    @property
    def metres_per_unit(self) -> float | None:
        return None if self.unit is None else (UNITS.get(self.unit) or float(self.unit))

    def shaping(self) -> dict[str, Any]:
        """The options that shape frames (labels and licence do not)."""
        return {"up": self.up, "unit": self.unit, "fps": self.fps, "rig": self.rig}


def check_options(options: IngestOptions) -> None:
    """Raises `UserError` on an option no file could satisfy."""
    if options.up not in (None, AUTO) and options.up not in UPS:
        raise UserError(f"--up {options.up}: use one of {', '.join(UPS)}")
    if options.unit not in (None, AUTO) and options.unit not in UNITS:
        try:
            fits = 0 < float(options.unit) < 1000
        except ValueError:
            fits = False
        if not fits:
            raise UserError(f"--unit {options.unit}: use one of {', '.join(UNITS)}, or metres per unit as a number")
    if options.fps is not None and not 1 <= options.fps <= 1000:
        raise UserError(f"--fps {options.fps:g}: use a rate from 1 to 1000")


@dataclass(frozen=True)
class Root:
    """One source folder of a dataset.

    Attributes:
        root: its path as the lake keeps it.
    """

    dataset: str
    root: str
    options: IngestOptions

    @property
    def folder(self) -> Path:
        """Where it is: a folder, or a single file."""
        return Path(on_disk(self.root))

    @property
    def base(self) -> Path:
        """The folder that paths are relative to."""
        folder = self.folder
        return folder.parent if folder.is_file() else folder

    @property
    def kept_base(self) -> str:
        """`base` as the lake keeps it."""
        return kept(self.base)

    def shaping_hash(self, config: LakeConfig, lake: Lake, without: Path | None = None) -> str:
        """sha256 over all that shapes frames but the files, as if one of the user's rig maps were not there."""
        rigs = config.of(RigsConfig)
        asked = [] if rigs == RigsConfig() else [rigs]  # lakes of before there was such a table keep their hash
        shaping = self.options.shaping(), user_rigs_hash(lake, without)
        return config_hash("frames", FRAMES_VERSION, config.frames, *shaping, *asked)

    def reason(self, config: LakeConfig, lake: Lake, before: str) -> str:
        """Why files that were shaped as the hash `before` says are read again."""
        for rig in sorted(lake.rigs.glob("*.toml")):
            if self.shaping_hash(config, lake, without=rig) == before:
                return f"{lake.relative(rig)} is new"
        return "the options of `ingest`, a rig map in rigs/, or [frames] or [rigs] in config.toml changed"


def user_rigs_hash(lake: Lake, without: Path | None = None) -> str:
    """sha256 over the user's rig maps; the package's own are covered by `FRAMES_VERSION`."""
    digest = hashlib.sha256()
    for path in sorted(set(lake.rigs.glob("*.toml")) - {without}):
        digest.update(os.fsencode(path.name) + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def known_roots(con: Connection) -> list[Root]:
    rows = fetch(con, "roots")
    return [Root(r["dataset"], r["root"], options_from(json.loads(r["options"]))) for r in rows]


def check_apart(con: Connection, datasets: Iterable[str]) -> None:
    """Raises `UserError` for a new dataset whose folder some file systems take for that of another one."""
    known = {row["dataset"] for name in ("roots", "synthetic_datasets") for row in fetch(con, name)}
    new = set(datasets) - known
    for name in sorted(new):
        alike = [other for other in sorted(known | new) if other != name and folded(other) == folded(name)]
        if alike:
            raise UserError(
                f"dataset {name}: is the same as {alike[0]} where case does not count; give it another name "
                "(--dataset NAME)"
            )


def options_json(options: IngestOptions) -> str:
    """As `roots` keeps them; `ignored` and `source` only where there are such."""
    kept = {k: v for k, v in asdict(options).items() if v or k not in ("ignored", "source")}
    return json.dumps(kept, sort_keys=True)


def options_from(kept: Mapping[str, Any]) -> IngestOptions:
    """What `options_json` wrote; options of a later motionlake are ignored."""
    known = {field.name: kept[field.name] for field in fields(IngestOptions) if field.name in kept}
    source = source_from(kept["source"]) if kept.get("source") else None
    return IngestOptions(**{**known, "ignored": tuple(kept.get("ignored", ())), "source": source})


@dataclass(frozen=True)
class Difference:
    """What a root holds against what the lake knows of it.

    Attributes:
        changed: new or changed files, hashed, by path.
        touched: files with a new date and the old content.
        unchanged: how many have the content they had.
        gone: paths in the lake without a file.
        again: how many of the changed have their old content, and are read by other rigs or options.
        before: hash of what shaped those.
    """

    changed: list[SourceFile]
    touched: list[SourceFile]
    unchanged: int
    gone: list[str]
    again: int = 0
    before: str = ""


class _Known(NamedTuple):
    """What the lake knows of a file that differs; the columns of the query `files_that_differ`, None for a new one."""

    root: str | None
    size: int | None
    mtime_ns: int | None
    content_hash: str | None
    config_hash: str | None


def compare(
    con: Connection,
    lake: Lake,
    root: Root,
    shaping_hash: str,
    allowed: Limits,
    *,
    checksum: bool = False,
    retry_failed: bool = False,
    progress: Hashing | None = None,
) -> Difference:
    """What is new, changed and gone in a root.

    A file of the recorded size and date counts as unchanged unless `checksum` has every file hashed again.
    `retry_failed` takes rejected files up again; those that a limit turned away are so when it has been raised.

    Raises:
        UserError: the dataset holds synthetic clips, or clips of another root under the same paths.
    """
    folder, base = root.base, root.kept_base
    if root.dataset in {r["dataset"] for r in fetch(con, "synthetic_datasets")}:
        raise UserError(
            f"dataset {root.dataset}: holds synthetic clips; give {root.root} a dataset of its own (--dataset NAME)"
        )
    ignored = frozenset(root.options.ignored)
    found = scan(root.folder, lake)
    if ignored:
        found = found.without(ignored)
    rejects = fetch(con, "rejects_of", {"dataset": root.dataset})
    retried = {r["path"] for r in rejects if retry_failed or raised(r["reason"], allowed)}
    listed = _rows(found)
    given = {"dataset": root.dataset, "root": base}
    asked = {**given, "shaping_hash": shaping_hash, "retried": list(retried), "checksum": checksum}
    differing = {path: _Known(*rest) for path, *rest in rows_of(con, "files_that_differ", listed, asked)}
    suspects = [found[number] for number, path in enumerate(found.paths) if path in differing] if differing else []
    for file in suspects:
        owner = differing[file.path].root
        if owner not in (None, base):
            raise UserError(
                f"{root.root}/{file.path}: dataset {root.dataset} holds a clip of this path from {owner}; "
                "give this folder a dataset of its own (--dataset NAME)"
            )

    def same(file: SourceFile) -> bool:
        """Whether it was read by the rigs and options of now as the bytes that it holds, and not in vain."""
        old = differing[file.path]
        shaped = old.config_hash == shaping_hash and file.path not in retried
        return shaped and old.content_hash == file.content_hash

    hashed = list(_hashed(folder, suspects, allowed.file_bytes, progress))
    changed = [file for file in hashed if not same(file)]
    moved = (file for file in hashed if same(file))
    touched = [f for f in moved if (f.size, f.mtime_ns) != (differing[f.path].size, differing[f.path].mtime_ns)]
    kept = [old for f in changed if (old := differing[f.path]).content_hash == f.content_hash]
    again = [old.config_hash for old in kept if old.config_hash is not None and old.config_hash != shaping_hash]
    gone = [path for (path,) in rows_of(con, "files_not_found", listed, given) if not (folder / on_disk(path)).exists()]
    unchanged = len(found) - len(changed)
    return Difference(changed, touched, unchanged, gone, len(again), again[0] if again else "")


def _rows(found: SourceFiles) -> pa.Table:
    """Files as queries read them; of buffers, since `pa.array` first imports pandas."""
    numbers = (found.sizes, found.dates)
    rest = [pa.Array.from_buffers(pa.int64(), len(found), [None, pa.py_buffer(column)]) for column in numbers]
    return pa.Table.from_arrays([texts(found.paths), *rest], names=["path", "size", "mtime_ns"])


def _hashed(base: Path, files: list[SourceFile], most: int, progress: Hashing | None) -> Iterator[SourceFile]:
    """The files with their hashes; for one of more than `most` bytes, which is not read, its size and date stand."""

    def hashed(file: SourceFile) -> str:
        if file.size > most:
            return hashlib.sha256(f"{file.size} {file.mtime_ns}".encode()).hexdigest()
        return content_hash(base / on_disk(file.path))

    with ThreadPoolExecutor(min(8, os.cpu_count() or 1)) as pool:
        for start in range(0, len(files), HASHED_TOGETHER):
            batch = files[start : start + HASHED_TOGETHER]
            hashes = pool.map(hashed, batch)
            for done, (file, digest) in enumerate(zip(batch, hashes, strict=True), start=start + 1):
                if progress:
                    progress(done, len(files))
                yield SourceFile(file.path, file.size, file.mtime_ns, digest)
