"""The recorded clips that motions start from: those of the class, else what begins most like it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.errors import UserError
from motionlake.glogen.config import MATCHING
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.lake.verdicts import good_rows
from motionlake.motion.generation import FPS, SHORTEST
from motionlake.stages.frames import first_body
from motionlake.stages.generator_model import classed_motions, long_enough, recipe_of
from motionlake.stages.source_files import content_hash
from motionlake.stages.synthesis import check_classes, open_generator
from motionlake.stages.synthesis_control import Request
from motionlake.stages.training_clips import check_chosen, frames_of_clips

if TYPE_CHECKING:
    from motionlake.lake.frames import Frames
    from motionlake.motion.canonicalise import CanonicalMotion
    from motionlake.motion.generation import MotionGenerator, SeedClip

# Of clips of no known class: how many are looked at, seconds of the pieces of a clip, and how many of these.
LOOKED_AT: Final = 200
PIECE: Final = 4.0
MOST_PIECES: Final = 10
BESIDE: Final = 1.25  # where none begins like the class: how many times as far as the nearest one others may be


@dataclass(frozen=True)
class Start:
    """Frames [start, stop) of a recorded clip that a motion may start from, and the body [21 x 3] it then has.

    With `outside`, `clip` is the path of a file.
    """

    clip: str
    dataset: str
    part: str
    fps: float
    start: int
    stop: int
    content_hash: str
    licence: str | None
    rest_offsets: tuple[float, ...]
    outside: bool = False


def find_starts(con: Connection, lake: Lake, model: Model, request: Request) -> list[Start]:
    """What the motions of a request may start from, by clip and frame.

    Recorded motion of the first class; where the lake knows of none, what begins most like it (networks only).

    Raises:
        UserError: the generator does not know a class, the clip to start from is synthetic, the file cannot be read, or
            no recorded clip of the first class is long enough.
    """
    check_classes(model, request.classes)
    if request.start is not None and request.outside:
        return [_outside(lake, Path(request.start))]
    if request.start is not None:
        row = fetch(con, "clip", {"clip": request.start})[0]
        if row["format"] == "synthetic" and not request.keyframes:
            raise UserError(f"{request.start}: is synthetic; start from a recorded clip")
        return [_start(row | {"start": 0, "stop": row["frames"]})]
    wanted = request.classes[0]
    rows = classed_motions(con, request.split, wanted)
    if not rows:
        return _alike(con, lake, model, request)
    return _long(con, lake, rows, request, f" of class {wanted}")


def _long(con: Connection, lake: Lake, rows: Sequence[Mapping[str, Any]], request: Request, which: str) -> list[Start]:
    """Those of recorded motions that are good and long enough to start from. Raises `UserError` where there is none."""
    good = good_rows(con, rows, request.min_quality, "clips to start from")
    long = [_start(row) for row in good if long_enough(row)]
    if not long:
        raise UserError(
            f"{lake.root}: the {len(good)} recorded motions{which} are too short to start from; name another clip with "
            "--from CLIP"
        )
    return long


def _alike(con: Connection, lake: Lake, model: Model, request: Request) -> list[Start]:
    """Recorded clips of no known class, or pieces of them, that begin like the first class; else the most like it.

    Raises:
        UserError: the generator plays recorded frames, and there are none of the class; or no clip is long enough.
    """
    wanted = request.classes[0]
    check_chosen(con, lake, request.split, None)
    rows = fetch(con, "recorded_motions", {"split": request.split})
    if recipe_of(model) == MATCHING or not rows or classed_motions(con, None, wanted):
        where = f" of split {request.split}" if request.split else ""
        raise UserError(
            f"{lake.root}: has no recorded clip{where} of class {wanted} to start from; name another with --from CLIP"
        )
    return _likely(lake, open_generator(lake, model), _long(con, lake, rows, request, ""), wanted)


def _likely(lake: Lake, generator: MotionGenerator, starts: Sequence[Start], label: str) -> list[Start]:
    """Those of some starts, cut to pieces, that begin like motion of a class; where none does, the nearest ones."""
    from motionlake.glogen.generator import TrainedGenerator
    from motionlake.glogen.likeness import start_distances

    if not isinstance(generator, TrainedGenerator):
        return list(starts)
    chosen = [starts[int(i)] for i in np.linspace(0, len(starts) - 1, min(LOOKED_AT, len(starts))).round()]
    pieces = [piece for start in chosen for piece in _pieces(start)]
    seeds = seed_clips(lake, pieces)
    apart = start_distances(generator, [seeds[piece] for piece in pieces], label)
    reach = max(1.0, BESIDE * min(apart))
    return [piece for piece, distance in zip(pieces, apart, strict=True) if distance <= reach]


def _pieces(start: Start) -> list[Start]:
    """A start cut to pieces of a few seconds each, from whose beginning a motion then starts."""
    length, least = round(PIECE * start.fps), round(SHORTEST / FPS * start.fps) + 1
    firsts = range(start.start, max(start.start + 1, start.stop - least), length)
    return [replace(start, start=first, stop=min(first + length, start.stop)) for first in firsts[:MOST_PIECES]]


def seed_clips(lake: Lake, starts: Iterable[Start]) -> dict[Start, SeedClip]:
    """The frames of starts."""
    from motionlake.motion.generation import SeedClip

    ordered = sorted(set(starts), key=lambda start: (start.clip, start.start, start.stop))
    clips: dict[str, Frames | CanonicalMotion] = {
        clip.clip: clip for clip in frames_of_clips(lake, [asdict(s) for s in ordered if not s.outside])
    }
    found = {}
    for start in ordered:
        whole = first_body(lake, Path(start.clip))[1] if start.outside else clips[start.clip]
        own = slice(start.start, start.stop)
        positions, rotations = whole.positions[own].astype(float), whole.rotations[own].astype(float)
        offsets = np.array(start.rest_offsets, dtype=float).reshape(-1, 3)
        found[start] = SeedClip(start.clip, positions, start.fps, offsets, rotations)
    return found


def _start(row: Mapping[str, Any]) -> Start:
    names = ("clip", "dataset", "part", "fps", "start", "stop", "content_hash", "licence")
    return Start(**{name: row[name] for name in names}, rest_offsets=tuple(row["rest_offsets"]))


def _outside(lake: Lake, path: Path) -> Start:
    body, motion = first_body(lake, path)
    offsets = tuple(motion.rest_offsets.ravel().tolist())
    content = content_hash(path)
    return Start(str(path), "", "", body.fps, 0, len(motion.positions), content, None, offsets, outside=True)
