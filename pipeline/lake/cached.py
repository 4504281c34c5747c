"""What comes from buckets and is worked on without being told where to lie: copies of lakes, in the user's cache."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from pathlib import Path

from motionlake.arrays import StepProgress
from motionlake.errors import UserError
from motionlake.lake.bucket import Bucket
from motionlake.lake.copies import bring_up_to_date
from motionlake.lake.lacking import fetch_when_read
from motionlake.lake.layout import Lake


def copy_of(bucket: Bucket, progress: StepProgress, notice: Callable[[str], None] = lambda line: None) -> Path:
    """The user's copy of the lake in a bucket, up to date; an empty folder where none was published.

    This process fetches files of it when it first reads them.

    Args:
        bucket: where the lake is.
        progress: told of files that are fetched now.
        notice: told of files that take long to fetch.

    Raises:
        UserError: the bucket cannot be read, or the copy cannot be brought up to date.
    """
    folder = cache_folder("lakes") / own_name(bucket.address)
    folder.mkdir(parents=True, exist_ok=True)
    bring_up_to_date(Lake(folder), bucket, progress, part=True)
    fetch_when_read(Lake(folder), bucket, notice)
    return folder


def cache_folder(what: str) -> Path:
    """Where copies of some kind lie."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    if not base.is_absolute():
        raise UserError(f"XDG_CACHE_HOME {base}: name a folder from the root, in which copies may lie")
    return base / "motionlake" / what


def own_name(address: str) -> str:
    """A name that tells a person what lies there, and is of this address alone."""
    said = re.sub(r"[^A-Za-z0-9.-]+", "-", address.partition("://")[2]).strip("-.")[-60:]
    return f"{said}-{hashlib.sha256(address.encode()).hexdigest()[:12]}"
