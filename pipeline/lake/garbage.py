"""Parts that nothing names any more, and what killed runs left behind."""

from __future__ import annotations

from collections.abc import Iterable

from motionlake.lake.catalog import fetch, reading, remove_stale_copies
from motionlake.lake.layout import Lake


def collect_garbage(lake: Lake, folders: Iterable[str]) -> int:
    """Delete parts in folders of the lake that the catalog does not name; returns how many.

    The caller holds the lake's lock.
    """
    remove_stale_copies(lake)
    with reading(lake) as con:
        live = {row["file"] for row in fetch(con, "live_files")}
    deleted = 0
    for folder in folders:
        for path in lake.root.joinpath(folder).rglob("*"):
            if path.is_file() and lake.relative(path) not in live:
                path.unlink()
                deleted += 1
    return deleted
