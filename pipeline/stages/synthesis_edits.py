"""A range of a clip made anew, the rest of it kept: what it is asked as, and the whole clip of what is made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.motion.generation import GeneratedMotion, SeedClip
from motionlake.motion.keyframes import KeyPoses, passed
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesis_keys import Marked, key_poses, read_source, with_keyframes

SHORTEST: Final = 0.2  # seconds of a range


def with_edit(
    con: Connection, lake: Lake, request: Request, source: str | Path, first: float | None, stop: float | None,
    in_seconds: tuple[bool, bool] = (False, False),
) -> Request:  # fmt: skip
    """The request of a clip of which frames [first, stop) are made anew.

    Args:
        con: to the lake.
        lake: whose rig maps read files.
        request: with the class of the range.
        source: clip of the lake, by its full name, or clip file.
        first, stop: frames from 0, or seconds.
        in_seconds: whether these are seconds.

    Raises:
        UserError: no range is given or the clip does not have it, nothing of the clip is left before or after it, it is
            too short, or several classes.
    """
    if first is None or stop is None:
        raise UserError(f"--edit {source}: say which frames are made anew, --from FRAME --to FRAME (or 2s and 3.5s)")
    if len(request.classes) != 1:
        raise UserError(f"--edit {source}: name one class for the range, --class NAME")
    seed, _ = read_source(con, lake, source)
    edges = zip((first, stop), in_seconds, strict=True)
    start, end = (round(place * seed.fps) if timed else int(place) for place, timed in edges)
    frames = len(seed.positions)
    if not 0 < start < end < frames:
        raise UserError(
            f"{source}: frames {start} to {end} cannot be made anew: a range begins after frame 0 and ends before the "
            f"last, {frames - 1}, so that there is something on both sides to join (--continue goes on from an end)"
        )
    if (end - start) / seed.fps < SHORTEST:
        raise UserError(f"{source}: a range of {(end - start) / seed.fps:.2f} s; take {SHORTEST:g} s at least")
    keyed = with_keyframes(con, lake, request, [Marked(source, start - 1), Marked(source, end)], seed.fps)
    return replace(keyed, edited=(start, end), seconds=frames / seed.fps)


def edge_poses(request: Request, seed: SeedClip) -> KeyPoses:
    """The poses before and after the range, and how fast the body goes there."""
    assert request.edited is not None, "a request of a range"
    assert seed.rotations is not None, "clips have rotations"
    first, stop = request.edited
    ends = (max(0, first - 2), min(stop, len(seed.positions) - 2))  # the first of two frames each
    speeds = [passed(seed.positions[at : at + 2, 0], seed.rotations[at : at + 2], seed.fps) for at in ends]
    return replace(key_poses(request), speeds=np.stack(speeds))


def edited_clip(request: Request, made: GeneratedMotion, seed: SeedClip) -> GeneratedMotion:
    """The whole clip, of which the range of a request is what was made; the other frames are those of the clip."""
    assert request.edited is not None, "a request of a range"
    first, stop = request.edited
    assert seed.rotations is not None, "clips have rotations"
    # A depth sensor's joints are not where forward kinematics has them: that passes from one end to the other.
    off = seed.positions[[first - 1, stop]] - made.positions[[0, -1]]
    share = np.linspace(0, 1, len(made.positions))[:, None, None]
    moved = made.positions + (1 - share) * off[0] + share * off[1]
    sources = [replace(one, start=one.start + first - 1, stop=one.stop + first - 1) for one in made.sources]
    return replace(
        made,
        positions=np.concatenate([seed.positions[:first], moved[1:-1], seed.positions[stop:]]),
        rotations=np.concatenate([seed.rotations[:first], made.rotations[1:-1], seed.rotations[stop:]]),
        sources=[replace(one, start=max(one.start, first), stop=min(one.stop, stop)) for one in sources],
        seed_start=0,
        seed_stop=len(seed.positions),
    )
