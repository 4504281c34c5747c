"""Clip files that lie in a bucket: fetched into the user's cache, where they are taken in as files are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from motionlake.arrays import StepProgress
from motionlake.errors import UserError
from motionlake.lake.cached import cache_folder, own_name
from motionlake.lake.parts import replacing
from motionlake.lake.stores import FOLDER, Place, move_all


def fetched(address: str | Path, progress: StepProgress) -> Path:
    """A folder that holds what lies below an address, or the one file that it names; only what is new is fetched.

    Files that are gone from the bucket go from the folder.

    Raises:
        UserError: nothing is there, the bucket cannot be read, or an object's name leads out of the folder.
    """
    place = Place.of(address)
    if place.store == FOLDER:
        return Path(place.root)
    files = place.connect()
    base = cache_folder("sources") / own_name(place.address)
    folder = base / PurePosixPath(place.root).name
    with place.told():
        found: dict[str, dict[str, Any]] = files.find(place.root, detail=True)
    single = list(found) == [place.root]
    there = {} if single else {_relative(place, name): (name, info) for name, info in found.items() if name[-1:] != "/"}
    if single:
        there = {folder.name: (place.root, found[place.root])}
    if not there:
        raise UserError(f"{place.address}: no such folder or file there")
    known = _known(base)

    def fetch(name: str) -> int:
        with place.told(), replacing(folder / name) as temporary:
            files.get_file(there[name][0], str(temporary))
            return temporary.stat().st_size

    stamps = {name: _stamp(info) for name, (_, info) in there.items()}
    for name in known:
        if name not in stamps:
            (folder / name).unlink(missing_ok=True)
    move_all(fetch, [name for name in there if not _is_here(folder / name, stamps[name], known.get(name))], progress)
    with replacing(base / "fetched.json") as temporary:
        temporary.write_text(json.dumps(stamps, sort_keys=True), encoding="utf-8")
    return folder / folder.name if single else folder


def _relative(place: Place, name: str) -> str:
    """The name of an object below the address, as the path of a file."""
    relative = name.removeprefix(f"{place.root}/")
    parts = PurePosixPath(relative).parts
    if relative == name or "/".join(parts) != relative or ".." in parts or "\0" in relative:
        raise UserError(f"{place.address}: holds an object {name!r}, whose name is no path below it; rename it there")
    return relative


def _stamp(info: Mapping[str, Any]) -> list[Any]:
    """What changes where an object does."""
    changed = next(
        (info[key] for key in ("ETag", "etag", "LastModified", "updated", "last_modified") if key in info), ""
    )
    return [info["size"], str(changed)]


def _known(base: Path) -> Mapping[str, Any]:
    """What was fetched before; nothing where that is not said as it was written."""
    try:
        found = json.loads((base / "fetched.json").read_bytes())
    except (OSError, ValueError):
        return {}
    plain = isinstance(found, dict) and all(".." not in PurePosixPath(name).parts and name[:1] != "/" for name in found)
    return found if plain else {}


def _is_here(path: Path, stamp: list[Any], before: Any) -> bool:
    return stamp == before and path.is_file() and path.stat().st_size == stamp[0]
