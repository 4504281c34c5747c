"""motionlake push and pull: a lake that is shared through a bucket."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer
from motionlake.cli._output import tell
from motionlake.cli._progress import stage_progress
from motionlake.cli.common import JsonOption, LakeOption, argument
from motionlake.errors import UserError
from motionlake.lake.layout import Lake, lake_folder

if TYPE_CHECKING:
    from motionlake.lake.bucket import Bucket
    from motionlake.lake.copies import Moved

AddressArgument = Annotated[
    str | None,
    argument("Where, such as s3://bucket/lake or file:///mnt/share/lake (default: where this copy came from)."),
]


def push(
    lake: LakeOption,
    address: AddressArgument = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Even where somebody has published a version that this lake lacks.")
    ] = False,
    prune: Annotated[
        bool,
        typer.Option(
            "--prune", help="Also delete there all but the last three versions; let nobody push at the same time."
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Publish a lake in a bucket, as its next version; only what is not there yet is sent.

    Where somebody has published a version since this copy was pulled, nothing is published.

    Example: motionlake push s3://bucket/lake --lake mylake
    """
    from motionlake.lake.copies import push as publish
    from motionlake.lake.integrity import check_files
    from motionlake.lake.lock import locked

    target = lake_folder(lake)
    bucket = _bucket(target, address)
    with locked(target, "push"), stage_progress() as progress:
        check_files(target)
        moved = publish(target, bucket, progress, instead=replace)
        latest = bucket.latest() if prune else None
        if latest is not None:
            bucket.forget(latest)
    _tell(moved, "sent", as_json=as_json)


def pull(
    lake: LakeOption,
    address: AddressArgument = None,
    discard: Annotated[
        bool, typer.Option("--discard", help="Even where this copy has changed; what changed here is lost.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Make a folder a copy of the lake in a bucket, or bring it up to date; only what is new is fetched.

    Example: motionlake pull s3://bucket/lake --lake mylake
    """
    from motionlake.lake.copies import pull as take
    from motionlake.lake.lock import locked

    target = Lake(lake.absolute())
    bucket = _bucket(target, address)
    with locked(target, "pull"), stage_progress() as progress:
        moved = take(target, bucket, progress, discard=discard)
    if moved is None:
        raise UserError(f"{bucket.address}: no lake there; publish one with `motionlake push {bucket.address}`")
    _tell(moved, "fetched", as_json=as_json)


def _bucket(lake: Lake, address: str | None) -> Bucket:
    from motionlake.lake.bucket import Bucket
    from motionlake.lake.origin import Origin

    known = list(Origin.all(lake))
    if address is None and not known:
        raise UserError(
            f"{lake.root}: say where, such as s3://bucket/lake: this folder is no copy of a lake in a bucket"
        )
    return Bucket(known[-1] if address is None else address)


def _tell(moved: Moved, how: str, *, as_json: bool) -> None:
    line = f"{moved.address}: version {moved.version}, {moved.files} files {how}, {moved.bytes / 1e6:.1f} MB"
    tell(asdict(moved), line, as_json=as_json)
