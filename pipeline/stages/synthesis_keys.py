"""Keyframes of requests: which poses of which clips a motion passes through and when, read and put into one world."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.motion.generation import FPS, SeedClip
from motionlake.motion.rotations import from_vectors, multiply, turn_on_ground
from motionlake.motion.skeleton import body_length, facing
from motionlake.stages.frames import first_body
from motionlake.stages.source_files import content_hash
from motionlake.stages.synthesis_control import Keyframe, Request, StyleClip
from motionlake.stages.training_clips import frames_of_clips

if TYPE_CHECKING:
    from motionlake.motion.keyframes import KeyPoses

_TEXT: Final = re.compile(r"(.+)@(\d+\.?\d*|\.\d+)( ?s)?(?:=(\d+\.?\d*|\.\d+)( ?s)?)?")
SAYS: Final = "CLIP@FRAME, or CLIP@FRAME=SECONDS, as in walk_01@120 or walk_01@4s=2.5"
AROUND: Final = 0.1  # seconds before and after a pose, over which it is seen how the body goes


@dataclass(frozen=True)
class Marked:
    """A frame of a clip that is asked for as a keyframe.

    Attributes:
        source: clip of the lake, or clip file.
        place: its frame, from 0, or the seconds from its beginning.
        in_seconds: which of these.
        seconds: of the motion at which it comes; None: as long after the one before it as in their clip.
    """

    source: str | Path
    place: float
    in_seconds: bool = False
    seconds: float | None = None

    @property
    def name(self) -> str:
        return f"{self.source}@{self.place:g}{'s' * self.in_seconds}"


def marked(text: str) -> Marked:
    """What "clip@120", "clip@1.5s" or "clip@120=2.5" says.

    Raises:
        UserError: it says none of these.
    """
    found = _TEXT.fullmatch(text.strip())
    if found is None or (found[3] is None and not found[2].isdigit()):
        raise UserError(f"keyframe {text}: is written {SAYS}")
    seconds = None if found[4] is None else float(found[4])
    return Marked(found[1], float(found[2]), found[3] is not None, seconds)


def with_keyframes(
    con: Connection, lake: Lake, request: Request, frames: Sequence[Marked], rate: float | None = None
) -> Request:
    """The request of motions through frames of clips, by the body of the first.

    Frames of one clip that follow one another keep their places. The first of another clip is put where a body comes to
    that goes as both do, each for half of the time between.

    Args:
        con: to the lake.
        lake: whose rig maps read files.
        request: what else is asked for; where it names no class: the labels of the clips, if they have any.
        frames: two at least; their clips by full names.
        rate: frames a second of the motion; None: 30.

    Raises:
        UserError: fewer than two frames, a frame that its clip does not have, a clip that cannot be read or is of
            another skeleton, or times that do not rise.
    """
    if len(frames) < 2:
        raise UserError(f"a motion passes through two keyframes at least: {SAYS}")
    sources = dict.fromkeys(one.source for one in frames)
    clips = {source: _Clip(*read_source(con, lake, source)) for source in sources}
    at = [_frame(one, clips[one.source]) for one in frames]
    times = _times(frames, at, clips, rate or FPS)
    first = frames[0].source
    classes = request.classes or tuple(sorted({c.label for c in clips.values() if c.label is not None}))
    return replace(
        request, classes=classes, seconds=times[-1], keyframes=tuple(_laid_out(frames, at, times, clips)), rate=rate,
        start=str(first), outside=isinstance(first, Path),
    )  # fmt: skip


def style_of(con: Connection, lake: Lake, source: str | Path) -> StyleClip:
    """The clip of the lake (full name), or the clip file, that a motion is to look like.

    Raises:
        UserError: the file cannot be read.
    """
    if isinstance(source, Path):
        body, motion = first_body(lake, source)
        offsets = tuple(motion.rest_offsets.ravel().tolist())
        return StyleClip(str(source), "", "", body.fps, offsets, content_hash(source), outside=True)
    row: Mapping[str, Any] = fetch(con, "clip", {"clip": source})[0]
    names = ("clip", "dataset", "part", "fps", "content_hash")
    return StyleClip(**{name: row[name] for name in names}, rest_offsets=tuple(row["rest_offsets"]))


def style_frames(lake: Lake, style: StyleClip) -> SeedClip:
    """The frames of the clip of a style."""
    return _of_file(lake, Path(style.clip)) if style.outside else _of_lake(lake, asdict(style))


def key_poses(request: Request) -> KeyPoses:
    """The poses of a request that has keyframes."""
    from motionlake.motion.keyframes import KeyPoses

    rate = request.rate or FPS
    return KeyPoses(
        np.array([round(key.seconds * rate) for key in request.keyframes]),
        np.array([key.hips for key in request.keyframes], dtype=float),
        np.array([key.rotations for key in request.keyframes], dtype=float).reshape(len(request.keyframes), -1, 4),
        fps=rate,
    )


@dataclass(frozen=True)
class _Clip:
    seed: SeedClip
    label: str | None

    @property
    def rotations(self) -> Float64Array:
        assert self.seed.rotations is not None, "clips of a lake and of files have rotations"
        return self.seed.rotations


def read_source(con: Connection, lake: Lake, source: str | Path) -> tuple[SeedClip, str | None]:
    """A clip of the lake, by its full name, or a clip file, and its label.

    Raises:
        UserError: the file cannot be read.
    """
    if isinstance(source, Path):
        return _of_file(lake, source), None
    row = fetch(con, "clip", {"clip": source})[0]
    return _of_lake(lake, row), row["label"]


def _of_file(lake: Lake, file: Path) -> SeedClip:
    body, motion = first_body(lake, file)
    return SeedClip(str(file), motion.positions, body.fps, motion.rest_offsets, motion.rotations)


def _of_lake(lake: Lake, row: Mapping[str, Any]) -> SeedClip:
    (frames,) = frames_of_clips(lake, [row])
    offsets = np.array(row["rest_offsets"], dtype=float).reshape(-1, 3)
    positions, rotations = frames.positions.astype(float), frames.rotations.astype(float)
    return SeedClip(row["clip"], positions, frames.fps, offsets, rotations)


def _frame(one: Marked, clip: _Clip) -> int:
    frame, frames = round(one.place * clip.seed.fps) if one.in_seconds else int(one.place), len(clip.seed.positions)
    if not 0 <= frame < frames:
        raise UserError(
            f"keyframe {one.name}: the clip has frames 0 to {frames - 1} ({(frames - 1) / clip.seed.fps:.2f} s)"
        )
    return frame


def _times(frames: Sequence[Marked], at: Sequence[int], clips: Mapping[Any, _Clip], rate: float) -> list[float]:
    """Seconds of every keyframe, from 0."""
    found: list[float] = []
    for i, one in enumerate(frames):
        before = frames[i - 1] if i else None
        if one.seconds is not None:
            seconds = one.seconds
        elif before is None:
            seconds = 0.0
        elif before.source == one.source:
            seconds = found[-1] + (at[i] - at[i - 1]) / clips[one.source].seed.fps
        else:
            raise UserError(
                f"keyframe {one.name}: is of another clip than the one before it; say when it comes, {one.name}=SECONDS"
            )
        if before is not None and not seconds > found[-1]:
            raise UserError(
                f"keyframe {one.name}: comes at {seconds:.3g} s, {before.name} before it at {found[-1]:.3g}: "
                "times must rise"
            )
        if before is not None and round((seconds - found[0]) * rate) == round((found[-1] - found[0]) * rate):
            raise UserError(
                f"keyframe {one.name}: comes in the frame of {before.name} ({rate:g} frames a second): leave one out"
            )
        found.append(seconds)
    return [seconds - found[0] for seconds in found]


def _laid_out(
    frames: Sequence[Marked], at: Sequence[int], times: Sequence[float], clips: Mapping[Any, _Clip]
) -> list[Keyframe]:
    """The poses by the body of the first clip, in its world."""
    from motionlake.motion.keyframes import ground_below

    body = clips[frames[0].source].seed
    size, ground = body_length(body.rest_offsets), ground_below(body.positions, body.clip)
    if size < 1e-6:
        raise UserError(f"keyframe {frames[0].name}: has a body without length")
    found: list[Keyframe] = []
    turn, moved = 0.0, np.zeros(3)
    for i, one in enumerate(frames):
        clip, frame = clips[one.source], at[i]
        scale = size / body_length(clip.seed.rest_offsets)
        hips = clip.seed.positions[frame, 0] - np.array([0.0, ground_below(clip.seed.positions, clip.seed.clip), 0.0])
        hips = hips * scale + np.array([0.0, ground, 0.0])
        if i and one.source != frames[i - 1].source:
            before, last = clips[frames[i - 1].source], found[-1]
            turn, moved = _led(
                before, at[i - 1], np.array(last.hips), turn, clip, frame, hips, times[i] - times[i - 1], scale
            )
        x, z = turn_on_ground(hips[0], hips[2], turn)
        rotations = clip.rotations[frame].copy()
        rotations[0] = multiply(from_vectors(np.array([0.0, turn, 0.0])), rotations[0])
        place = np.array([x, hips[1], z]) + moved
        found.append(
            Keyframe(str(one.source), frame, times[i], tuple(place.tolist()), tuple(rotations.ravel().tolist()))
        )
    return found


def _led(
    before: _Clip, at: int, place: Float64Array, turned: float, clip: _Clip, frame: int, hips: Float64Array,
    seconds: float, scale: float,
) -> tuple[float, Float64Array]:  # fmt: skip
    """By how much another clip is turned (radians) and moved [3], so that it goes on from a pose at a place."""
    (one, heading), (other, own) = _going(before, at), _going(clip, frame)
    heading += turned
    then = heading + seconds * (one[2] + other[2]) / 2
    turn = then - own
    x, z = (
        sum(ways)
        for ways in zip(
            turn_on_ground(one[0] * scale, one[1] * scale, heading),
            turn_on_ground(other[0] * scale, other[1] * scale, then), strict=True,
        )
    )  # fmt: skip
    there = place[[0, 2]] + seconds / 2 * np.array([x, z])
    from_x, from_z = turn_on_ground(hips[0], hips[2], turn)
    return turn, np.array([there[0] - from_x, 0.0, there[1] - from_z])


def _going(clip: _Clip, frame: int) -> tuple[Float64Array, float]:
    """[3] how the hips go to the left and ahead (metres a second) and turn (radians a second), and where they head."""
    reach = max(1, round(AROUND * clip.seed.fps))
    low, high = max(0, frame - reach), min(len(clip.seed.positions) - 1, frame + reach)
    headings = facing(clip.seed.positions[low : high + 1])
    own = float(headings[frame - low])
    if high == low:
        return np.zeros(3), own
    seconds = (high - low) / clip.seed.fps
    way = clip.seed.positions[high, 0] - clip.seed.positions[low, 0]
    left, ahead = turn_on_ground(way[0], way[2], -own)
    turned = math.remainder(float(headings[-1] - headings[0]), 2 * math.pi)
    return np.array([left, ahead, turned]) / seconds, own
