"""A dataset into a folder: what is missing is fetched, checked and unpacked, and SOURCE.json says where it comes from.

Below the folder lie one folder a file of the recipe, `labels.csv` where names tell labels, `fetched.json` (what was
fetched), `SOURCE.json`, and while it is at work `.fetch/`, which holds what has arrived so far.
"""

from __future__ import annotations

import csv
import fcntl
import hashlib
import json
import os
import re
import shutil
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.errors import UserError
from motionlake.formats import is_clip
from motionlake.lake.citations import FILE, source_json
from motionlake.lake.parts import replacing, sync_folder
from motionlake.names import kept
from motionlake.recipes.download import Arriving, Patience, ResumingDownloader
from motionlake.recipes.recipe import WRITTEN, Recipe, RecipeFile
from motionlake.recipes.unpack import unpack

FETCHED: Final = "fetched.json"
LABELS: Final = "labels.csv"
_WORK: Final = ".fetch"


@dataclass(frozen=True)
class Fetched:
    """What a call came to.

    Attributes:
        fetched: names of the files that were fetched or unpacked now.
        there: names of those that were there already.
        labelled: clip files that labels.csv was written for now.
    """

    folder: Path
    fetched: tuple[str, ...]
    there: tuple[str, ...]
    labelled: int


def fetch_dataset(
    recipe: Recipe,
    folder: Path,
    *,
    again: bool = False,
    arriving: Arriving,
    notice: Callable[[str], object],
    patience: Patience | None = None,
) -> Fetched:
    """Bring a folder to what a recipe says; whatever a killed call has left is used.

    Args:
        again: fetch also what is there.
        arriving: told how far a download has come.
        notice: told what a person should know.

    Raises:
        UserError: a file cannot be had, is not what it should be, or must be put there by hand.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with _at_work(folder) as work:
        known = _known(folder)
        fetched, there = [], []
        for file in recipe.files:
            if not again and _is_there(folder, file, known):
                there.append(file.name)
                continue
            archive = (
                _download(file, work, known.get(file.name), arriving, notice, patience or Patience())
                if file.url
                else folder / file.name
            )
            if not archive.is_file():  # behind a form, and nobody has put it there
                continue
            known[file.name] = {"url": file.url, **_sums(archive)}
            _put(archive, file, folder, work)
            with replacing(folder / FETCHED) as temporary:
                temporary.write_text(json.dumps(known, indent=2, sort_keys=True) + "\n", encoding="utf-8")
            if file.url:
                archive.unlink(missing_ok=True)
            fetched.append(file.name)
        if recipe.by_hand and not _holds_files(folder, recipe):
            raise UserError(f"{folder}: holds no files of {recipe.name} yet; {recipe.by_hand}")
        labelled = _write_labels(folder, recipe.labels) if recipe.labels else 0
        files = [{"name": file.name, **known[file.name]} for file in recipe.files if file.name in known]
        with replacing(folder / FILE) as temporary:
            temporary.write_text(source_json(recipe.source, files, recipe.version), encoding="utf-8")
    return Fetched(folder, tuple(fetched), tuple(there), labelled)


@contextmanager
def _at_work(folder: Path) -> Iterator[Path]:
    """The folder for what is on its way, which one call at a time has; it goes when it is empty."""
    work = folder / _WORK
    work.mkdir(exist_ok=True)
    with (work / "lock").open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(f"{folder}: another motionlake fetches into it; wait for its end") from error
        for stale in (*work.glob("new-*"), *work.glob("old-*"), *work.glob("tmp*")):
            _remove(stale)
        yield work
        if [path.name for path in work.iterdir()] == ["lock"]:
            shutil.rmtree(work)


def _known(folder: Path) -> dict[str, dict[str, Any]]:
    """What fetched.json says was fetched."""
    file = folder / FETCHED
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        if all(re.fullmatch("[0-9a-f]{64}", one["sha256"]) and one["size"] >= 0 for one in found.values()):
            return dict(found)
    except FileNotFoundError:
        return {}
    except (ValueError, KeyError, TypeError, AttributeError):
        pass
    raise UserError(f"{file}: is damaged; delete it, and what it told of is fetched again")


def _is_there(folder: Path, file: RecipeFile, known: dict[str, dict[str, Any]]) -> bool:
    """Whether a file, as the recipe has it now, was fetched and lies unpacked."""
    last = known.get(file.name)
    same = last is not None and last["url"] == file.url and file.sha256 in ("", last["sha256"])
    return same and (folder / file.into).is_dir()


def _sums(path: Path) -> dict[str, Any]:
    with path.open("rb") as handle:
        return {"sha256": hashlib.file_digest(handle, "sha256").hexdigest(), "size": path.stat().st_size}


def _download(
    file: RecipeFile,
    work: Path,
    last: dict[str, Any] | None,
    arriving: Arriving,
    notice: Callable[[str], object],
    patience: Patience,
) -> Path:
    """Fetch a file whole, with the hash that the recipe declares, or that it had the last time."""
    import pooch

    pooch.get_logger().setLevel("WARNING")
    part = work / f"{file.name}.part"
    _check_room(file, work, part)
    before = f"sha256:{last['sha256']}" if last and last["url"] == file.url else None
    wanted = file.known_hash or before
    if wanted is None and file.url.startswith("http:"):
        notice(f"{file.url}: is fetched without https, and no hash of it is known: nothing tells what has arrived")
    while True:
        downloader = ResumingDownloader(file, part, arriving, notice, patience)
        try:
            found = pooch.retrieve(file.url, wanted, fname=file.name, path=work, downloader=downloader)
        except ValueError as error:
            downloader.forget()
            if downloader.resumed:
                notice(f"{file.name}: is not what it should be once put together; all of it is fetched again")
                continue
            why = "the recipe says" if file.known_hash else f"{FETCHED} says it had before (delete that to take it)"
            raise UserError(f"{file.url}: has another hash than {why}, {wanted}; it is thrown away") from error
        downloader.forget()
        return Path(found)


def _check_room(file: RecipeFile, work: Path, part: Path) -> None:
    arrived = part.stat().st_size if part.exists() else 0
    needed, free = (file.size or 0) - arrived, shutil.disk_usage(work).free
    if needed > free:
        raise UserError(
            f"{work.parent}: {needed} bytes of {file.name} are missing, and {free} are free; make room there"
        )


def _put(archive: Path, file: RecipeFile, folder: Path, work: Path) -> None:
    """Unpack a file, or copy it, and let the whole take the place of what is there."""
    new = work / f"new-{uuid.uuid4().hex[:12]}"
    if file.unpack == "none":
        new.mkdir()
        shutil.copyfile(archive, new / file.name)
        with (new / file.name).open("rb") as handle:
            os.fsync(handle.fileno())
    else:
        try:
            unpack(archive, file.unpack, new, file.only)
        except UserError:
            shutil.rmtree(new)
            if file.url:  # else the same file would be refused for ever
                archive.unlink()
            raise
    target = folder / file.into
    if target.exists():
        target.rename(work / f"old-{uuid.uuid4().hex[:12]}")
    new.rename(target)
    sync_folder(folder)
    for old in work.glob("old-*"):
        _remove(old)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def _holds_files(folder: Path, recipe: Recipe) -> bool:
    """Whether a person has put files there, beside what motionlake writes."""
    return any(path.name not in WRITTEN and not path.name.startswith(".") for path in folder.iterdir())


def _write_labels(folder: Path, pattern: str) -> int:
    """labels.csv by the names of clip files, unless there is one; returns how many files it names."""
    if (folder / LABELS).exists():
        return 0
    names = re.compile(pattern)
    columns = sorted(names.groupindex, key=lambda name: (name != "label", name))
    rows = []
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and _WORK not in p.parts):
        found = names.fullmatch(path.name)
        if found and is_clip(path):
            rows.append({"file": kept(path.relative_to(folder)), **found.groupdict("")})
    if rows:
        with replacing(folder / LABELS) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, ["file", *columns])
            writer.writeheader()
            writer.writerows(rows)
    return len(rows)
