"""Files that a copy of a lake lacks, fetched from its bucket."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Final

from motionlake.lake.bucket import Bucket, Stored
from motionlake.lake.file_list import FileSums
from motionlake.lake.integrity import fetched_by
from motionlake.lake.layout import Lake
from motionlake.lake.origin import Origin
from motionlake.lake.parts import replacing
from motionlake.lake.stores import move_all

LONG: Final = 50e6  # bytes of which a person is told before they are fetched


def bring_file(lake: Lake, bucket: Bucket, stored: Stored) -> int:
    """Put a file of a version where it belongs, with the time at which it was written; its bytes."""
    with replacing(lake.path(stored.file)) as temporary:
        bucket.get(stored, temporary)
        os.utime(temporary, ns=(stored.mtime_ns, stored.mtime_ns))
    return stored.size


def as_stored(file: FileSums) -> Stored:
    """A file of a catalog as versions name it."""
    return Stored(file.file, file.size, file.sha256, file.mtime_ns)


def fetch_when_read(lake: Lake, bucket: Bucket, notice: Callable[[str], None]) -> None:
    """Have this process fetch what a copy lacks from the bucket when it first reads it.

    Args:
        notice: told of what takes long.
    """

    def fetch(files: Sequence[FileSums]) -> None:
        size = sum(file.size for file in files)
        if size > LONG:
            notice(f"{bucket.address}: fetching {len(files)} files, {size / 1e6:.0f} MB")
        move_all(lambda each: bring_file(lake, bucket, as_stored(each)), files, lambda what, done, total: None)

    part = any(each.part for each in Origin.all(lake).values())
    fetched_by(lake, fetch if part else None)
