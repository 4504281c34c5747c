"""Clip files that need not be in the lake."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from motionlake.errors import ClipError, UserError
from motionlake.lake.layout import Lake
from motionlake.motion.clip import SourceClip
from motionlake.motion.rigs import load_rigs
from motionlake.stages.frames import canonical_motions
from motionlake.stages.sources import IngestOptions

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion


def first_body(lake: Lake, path: Path, options: IngestOptions | None = None) -> tuple[SourceClip, CanonicalMotion]:
    """A clip file's first body, and its canonical motion.

    Raises:
        UserError: the file cannot be read.
    """
    try:
        clip, motion, _ = next(iter(canonical_motions(path, load_rigs(lake.rigs), options or IngestOptions())))
    except ClipError as error:
        raise UserError(f"{path}: {error}") from error
    return clip, motion
