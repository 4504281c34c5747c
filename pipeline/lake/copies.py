"""A lake that is shared through a bucket: what changed goes there as a new version (push), and comes from there (pull).

Everybody works on a copy in a folder of their own, and `bucket.json` in it says which version of each bucket that is.
A copy may lack files, which are fetched when they are first read.
A push that is killed leaves the version before; a pull leaves the copy as it was, with some files more that the next
one need not get.
"""

from __future__ import annotations

import os
import socket
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Final

from motionlake.arrays import StepProgress
from motionlake.errors import UserError, user_name
from motionlake.lake.bucket import Bucket, ConflictError, Stored, Version
from motionlake.lake.catalog import reading
from motionlake.lake.catalog_file import announce_anew, announce_catalog, catalog_written, known_sums, sums_of_file
from motionlake.lake.file_list import FileSums, listed_in
from motionlake.lake.garbage import collect_garbage
from motionlake.lake.integrity import fault, sound
from motionlake.lake.lacking import as_stored, bring_file
from motionlake.lake.layout import Lake
from motionlake.lake.lock import locked
from motionlake.lake.origin import Origin, origin_file
from motionlake.lake.parts import replacing
from motionlake.lake.stores import move_all

_OWN: Final = ("catalog.duckdb", "annotations.jsonl", "config.toml")  # beside what the catalog lists


@dataclass(frozen=True)
class Moved:
    """What a push or a pull has done.

    Attributes:
        address: of the bucket.
        version: that the copy now is.
        files, bytes: that went or came; the others were there.
    """

    address: str
    version: int
    files: int
    bytes: int


def changed(lake: Lake, origin: Origin) -> bool:
    """Whether a copy holds what its version does not."""
    return not origin.taking and {each.file: each.sha256 for each in _own_files(lake)} != dict(origin.own)


def push(lake: Lake, bucket: Bucket, progress: StepProgress, *, instead: bool = False) -> Moved:
    """Publish a lake as the next version; the caller holds its lock.

    Args:
        lake: whose files are all sound.
        bucket: where to.
        progress: told of files.
        instead: even where the latest version is not the one that this copy was made of.

    Raises:
        ConflictError: the latest version is not that one, or becomes another meanwhile.
        DamagedError: a file is not as it was written.
        UserError: a pull was not finished.
    """
    unfinished = next((each.address for each in Origin.all(lake).values() if each.taking), None)
    if unfinished is not None:
        raise UserError(
            f"{lake.root}: a pull was not finished; `motionlake pull {unfinished} --lake {lake.root}` does it"
        )
    latest = bucket.latest()
    origin = _origin_of(lake, bucket, latest)
    known = origin.number if origin else 0
    if latest is not None and latest.number != known and not instead:
        raise ConflictError(
            f"{bucket.address}: {latest.by} has published version {latest.number}, which {lake.root} does not hold; "
            + _choices(lake, bucket)
        )
    files = _files(lake)
    if latest is not None and known == latest.number and _same(latest.files, files):
        _origin(bucket, latest, origin).keep(lake)
        return Moved(bucket.address, known, 0, 0)
    there = {each.sha256 for each in latest.files} if latest else set()
    lacking = list({each.sha256: each for each in files if each.sha256 not in there}.values())

    def bring(stored: Stored) -> int:
        if bucket.has(stored):
            return 0
        bucket.put(lake.path(stored.file) if _is_own(stored.file) else sound(lake, stored.file), stored)
        return stored.size

    sent = move_all(bring, lacking, progress)
    version = Version(
        (latest.number if latest else 0) + 1, f"{user_name(os.geteuid())} on {socket.gethostname()}",
        datetime.now(UTC).isoformat(timespec="seconds"), tuple(files), uuid.uuid4().hex,
    )  # fmt: skip
    replace(origin or Origin(bucket.address, 0, {}), token=version.token).keep(lake)
    try:
        bucket.publish(version)
    except ConflictError as error:
        raise ConflictError(f"{error}; {_choices(lake, bucket)}") from error
    _origin(bucket, version, origin).keep(lake)
    return Moved(bucket.address, version.number, sum(size > 0 for size in sent), sum(sent))


def pull(
    lake: Lake, bucket: Bucket, progress: StepProgress, *, discard: bool = False, part: bool = False
) -> Moved | None:
    """Make a folder the latest version of a lake; the caller holds its lock. None where none was published.

    Args:
        lake: a copy, or a folder without a lake.
        bucket: where from.
        progress: told of files.
        discard: even where the copy holds what no version does.
        part: the catalog, settings and annotations alone; the copy fetches other files when they are first read.

    Raises:
        UserError: the folder holds another lake, or what was not pushed.
    """
    latest = bucket.latest()
    if latest is None:
        return None
    origin = _origin_of(lake, bucket, latest)
    served = origin is not None and origin.number == latest.number and not origin.taking and lake.catalog.is_file()
    if served and origin and not part and not discard:
        return _filled(lake, bucket, progress, origin, latest)
    if lake.catalog.is_file() and not discard:
        if origin is None:
            raise UserError(f"{lake.root}: holds another lake than {bucket.address}; name a folder without one")
        if served:  # in part, and it is to stay so
            return Moved(bucket.address, origin.number, 0, 0)
        if changed(lake, origin):
            raise UserError(
                f"{lake.root}: has changed since version {origin.number}, and {latest.by} has published version "
                f"{latest.number}; {_choices(lake, bucket)}"
            )
    _check_names(lake, latest, bucket)
    before = _listed(lake)
    own = {each.file: each for each in latest.files if _is_own(each.file)}
    others = [each for each in latest.files if each.file not in own]
    if part:  # those that lie there and are others now
        others = [each for each in others if lake.path(each.file).exists()]
    lacking = [each for each in others if not _is_here(lake, each, before)]

    def bring(stored: Stored) -> int:
        return bring_file(lake, bucket, stored)

    came = move_all(bring, lacking, progress)
    replace(origin or Origin(bucket.address, 0, {}), taking=True, token="").keep(lake)
    for path in lake.rigs.glob("*.toml"):
        path.unlink()
    for name in _OWN[1:]:
        lake.path(name).unlink(missing_ok=True)
    came += [bring(each) for name, each in own.items() if name != lake.catalog.name]
    _take_catalog(lake, bucket, own[lake.catalog.name])
    files = {*before, *(each.file for each in latest.files if each.file not in own)}
    collect_garbage(lake, {name.partition("/")[0] for name in files})
    replace(_origin(bucket, latest), part=part).keep(lake)  # last: a pull that is killed before it is done again
    return Moved(bucket.address, latest.number, len(came) + 1, sum(came) + own[lake.catalog.name].size)


def _filled(lake: Lake, bucket: Bucket, progress: StepProgress, origin: Origin, version: Version) -> Moved:
    """Fetch what a copy lacks of its version, which it may have changed."""
    there = {each.sha256 for each in version.files}
    away = [each for each in _listed(lake).values() if each.sha256 in there and not lake.path(each.file).exists()]
    came = move_all(lambda each: bring_file(lake, bucket, as_stored(each)), away, progress)
    if origin.part:
        replace(origin, part=False).keep(lake)
    return Moved(bucket.address, origin.number, len(came), sum(came))


def bring_up_to_date(lake: Lake, bucket: Bucket, progress: StepProgress, *, part: bool = False) -> Moved | None:
    """`pull` where there is something to pull; no lock is taken where there is nothing, as while another command runs.

    Raises:
        UserError: as `pull`; another command writes to the copy.
    """
    latest = bucket.latest()
    origin = _origin_of(lake, bucket, latest)
    if latest is None and origin and origin.number:
        raise UserError(f"{bucket.address}: no lake there any more; {lake.root} is a copy of version {origin.number}")
    if latest is None or (lake.catalog.is_file() and origin and not origin.taking and origin.number == latest.number):
        return None
    with locked(lake, "pull"):
        return pull(lake, bucket, progress, part=part)


def push_changes(lake: Lake, bucket: Bucket, progress: StepProgress) -> Moved | None:
    """`push` where a copy holds what no version does; None where there is nothing.

    Raises:
        ConflictError, DamagedError: as `push`.
        UserError: another command writes to the copy.
    """
    origin = Origin.all(lake).get(bucket.address)
    if not lake.catalog.is_file() or (origin and not changed(lake, origin)):
        return None
    with locked(lake, "push"):
        return push(lake, bucket, progress)


def _take_catalog(lake: Lake, bucket: Bucket, stored: Stored) -> None:
    """Last of all: from then on the copy is the version."""
    first = not lake.catalog.is_file()
    with replacing(lake.catalog) as temporary:
        bucket.get(stored, temporary)
        if not first:
            announce_catalog(lake, temporary)
    if first:
        announce_anew(lake)
    catalog_written(lake)


def _choices(lake: Lake, bucket: Bucket) -> str:
    where = f"{bucket.address} --lake {lake.root}"
    return (
        f"`motionlake pull {where} --discard` takes that and loses what changed here, "
        f"`motionlake push {where} --replace` puts this in its place"
    )


def _check_names(lake: Lake, version: Version, bucket: Bucket) -> None:
    """Nothing that is read from a bucket leads out of the lake, or to what only this copy knows."""
    names = [each.file for each in version.files]
    if lake.catalog.name not in names or len(set(names)) != len(names):
        raise UserError(f"{bucket.address}: version {version.number} is no lake")
    for name in names:
        parts = PurePosixPath(name).parts
        plain = "/".join(parts) == name and not any(part.startswith((".", "/")) for part in parts)
        if not plain or name in (origin_file(lake).name, lake.sums.name, lake.service.name):
            raise UserError(f"{bucket.address}: version {version.number} holds {name!r}, which is no file of a lake")
    lake.paths(names)


def _files(lake: Lake) -> list[Stored]:
    """Everything that a version of the lake holds, in the order of names."""
    with reading(lake) as con:
        listed = listed_in(con)
    found = [as_stored(each) for each in listed.values()]
    return sorted([*found, *_own_files(lake)], key=lambda each: each.file)


def _own_files(lake: Lake) -> list[Stored]:
    paths = [lake.root / name for name in _OWN] + sorted(lake.rigs.glob("*.toml"))
    return [_stored(lake, path) for path in paths if path.is_file()]


def _stored(lake: Lake, path: Path) -> Stored:
    found = path.stat()
    listed = known_sums(lake)[path.name] if path == lake.catalog else []  # it was hashed when it was written
    known = [each for each in listed if each["size"] == found.st_size]
    sums = known[0] if len(known) == 1 else sums_of_file(path)
    return Stored(lake.relative(path), sums["size"], sums["sha256"], found.st_mtime_ns)


def _listed(lake: Lake) -> Mapping[str, FileSums]:
    if not lake.catalog.is_file():
        return {}
    with reading(lake) as con:
        return listed_in(con)


def _is_here(lake: Lake, stored: Stored, listed: Mapping[str, FileSums]) -> bool:
    """Whether a folder holds a file: as its catalog lists it, or as a killed pull has left it."""
    path = lake.path(stored.file)
    if not path.is_file() or path.stat().st_size != stored.size:
        return False
    if stored.file in listed:
        return listed[stored.file].sha256 == stored.sha256 and fault(lake, listed[stored.file]) is None
    return bool(sums_of_file(path)["sha256"] == stored.sha256)


def _is_own(file: str) -> bool:
    return file in _OWN or file.startswith("rigs/")


def _origin_of(lake: Lake, bucket: Bucket, latest: Version | None) -> Origin | None:
    """What a copy was made of; the latest version where that is one that it published without hearing of it."""
    origin = Origin.all(lake).get(bucket.address)
    if origin and latest and origin.token == latest.token:
        return _origin(bucket, latest, origin)
    return origin


def _same(before: Sequence[Stored], now: Sequence[Stored]) -> bool:
    return {(each.file, each.sha256) for each in before} == {(each.file, each.sha256) for each in now}


def _origin(bucket: Bucket, version: Version, before: Origin | None = None) -> Origin:
    own = {each.file: each.sha256 for each in version.files if _is_own(each.file)}
    return Origin(bucket.address, version.number, own, token=version.token, part=bool(before and before.part))
