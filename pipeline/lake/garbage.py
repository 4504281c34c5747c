"""What killed runs left in a lake, and parts that its catalog does not name."""

from __future__ import annotations

from collections.abc import Iterable

from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.lake.lock import unread


def remove_stale_copies(lake: Lake) -> None:
    """Delete the unfinished files of killed runs in the lake's own folder; the caller holds the lake's lock."""
    for pattern in (".*.tmp", ".*.tmp.wal", ".probe-*"):
        for path in lake.root.glob(pattern):
            if not path.is_dir():
                path.unlink(missing_ok=True)


def collect_garbage(lake: Lake, folders: Iterable[str]) -> None:
    """Delete what killed runs left, and, while nobody reads, parts in folders of the lake that the catalog does not
    name: views read whatever parts there are.

    The caller holds the lake's lock.
    """
    remove_stale_copies(lake)
    with reading(lake) as con:
        live = {row["file"] for row in fetch(con, "live_files")}
    dead = [lake.root / file for file in lake.files(folders) if file not in live]
    unfinished = [path for path in dead if path.name.startswith(".")]
    for path in unfinished:
        path.unlink()
    if len(dead) > len(unfinished):
        with unread(lake) as alone:
            for path in dead if alone else ():
                path.unlink(missing_ok=True)
