"""BVH files of clips that were made."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.names import file_name, told_apart

if TYPE_CHECKING:
    from motionlake.jobs.session import Session


def make_folder(folder: Path) -> None:
    """Make the folder; raises `UserError` where nothing can be written to it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--bvh {folder}: is no folder and cannot be made one ({error.strerror})") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UserError(f"--bvh {folder}: cannot be written to")


def write_bvh_files(job: Session, clips: Sequence[str], folder: Path) -> int:
    """Write every clip on the canonical skeleton; returns how many files that are."""
    from motionlake.formats.write.bvh import write_bvh
    from motionlake.lake.raw import own_rig

    job.progress("bvh", 0, len(clips))
    with reading(job.lake) as con:
        dataset = clips[0].partition("/")[0] if clips else ""
        own = [row["clip"] for row in fetch(con, "clip_names") if row["clip"].startswith(f"{dataset}/")]
        names = told_apart(own, lambda name: file_name(name.partition("/")[2]))
        for done, clip in enumerate(clips, start=1):
            write_bvh(own_rig(con, job.lake, clip), folder / f"{names[clip]}.bvh")
            job.progress("bvh", done, len(clips))
    return len(clips)
