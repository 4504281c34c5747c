"""The recorded clips that synthesis is measured by, and the motions generated from them.

Each generated motion continues a recorded clip, and is compared with what follows there, or with a clip of its class.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from motionlake.arrays import Float64Array, FloatArray, StepProgress
from motionlake.errors import UserError
from motionlake.evaluation.clips import LEAVE_ONE_OUT, read_frames, split_of
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.motion.calibration import recorded_range
from motionlake.motion.generation import GeneratedMotion, MotionGenerator, MotionRequest, SeedClip
from motionlake.motion.ground import Ground, ground_of
from motionlake.motion.resampling import TOLERANCE, beside
from motionlake.retrieval.labelled_clips import FramedClip, check_column

# Of more than these, clips are taken at even distances of their names.
MOST_TEST: Final = 1000
MOST_TRAINING: Final = 2000
LEAST_FRAMES: Final = 2  # of a clip between its calibration poses


@dataclass(frozen=True)
class RealMotion:
    """A real clip, or a range of one.

    Attributes:
        clip: its name.
        dataset: it belongs to.
        label: its class.
        positions: [F, 21, 3] canonical joints, metres, y up.
        fps: frames a second.
        rest_offsets: [21, 3] of its body, metres.
        rotations: [F, 21, 4] local; None where they are not known.
        floor: the ground of the recording that it is a range of; None: its own.
    """

    clip: str
    dataset: str
    label: str
    positions: Float64Array
    fps: float
    rest_offsets: Float64Array
    rotations: FloatArray | None = None
    floor: Ground | None = None

    @property
    def ground(self) -> Ground:
        """What its body stands on."""
        return ground_of(self.positions) if self.floor is None else self.floor

    def cut(self, start: int, stop: int) -> RealMotion:
        """Frames [start, stop) of it, on the same ground."""
        turned = None if self.rotations is None else self.rotations[start:stop]
        return replace(self, positions=self.positions[start:stop], rotations=turned, floor=self.ground)

    def pieces(self, seconds: float) -> Iterator[RealMotion]:
        """One after the other, `seconds` long each; a rest that is shorter goes with the piece before it."""
        frames = max(2, round(seconds * self.fps))
        count = max(1, len(self.positions) // frames)
        for i in range(count):
            stop = len(self.positions) if i == count - 1 else (i + 1) * frames
            yield self.cut(i * frames, stop)


@dataclass(frozen=True)
class RealClips:
    """What a generator is measured by.

    Attributes:
        test: clips to go on from, and to compare with.
        training: clips that classes are learned from, and that might be copied.
        protocol: in words.
        split: of the test clips; None where there are no splits.
        strangers: how many labelled clips of the test split are of no class of the generator.
    """

    test: list[RealMotion]
    training: list[RealMotion]
    protocol: str
    split: str | None
    strangers: int


@dataclass(frozen=True, kw_only=True)
class _Row(FramedClip):
    """Labelled frames [start, stop) of a clip of the lake."""

    split: str | None
    rest_offsets: tuple[float, ...]
    start: int
    stop: int
    label: str


def real_clips(
    con: Connection, lake: Lake, classes: Collection[str], *, dataset: str | None, split: str | None,
    repository: str | None, column: str,
) -> RealClips:  # fmt: skip
    """The clips of a generator's classes: those of one split to test, those of another as training clips.

    Where no labelled clip is of these splits and none is asked for, every clip is both, and no clip is compared with
    itself.

    Args:
        con, lake: the lake.
        classes: the generator's.
        dataset: its clips only.
        split, repository: values of the column split; "test" and "train" where they are not given.
        column: what says the class of clips.

    Raises:
        UserError: no such column or split, no labelled clips, or none of the generator's classes.
    """
    check_column(con, column)
    found = fetch(con, "synthesis_clips", {"dataset": dataset, "column": column})
    rows = [_Row(**row | {"rest_offsets": tuple(row["rest_offsets"])}) for row in found]
    if not rows:
        where = f" of dataset {dataset}" if dataset else ""
        raise UserError(f"no clip{where} has a {column}; synthesis is measured by labelled clips (labels.csv)")
    parted = split_of([row.split for row in rows], split, repository)
    test, training = (
        [rows[i] for i in side if rows[i].label in classes] for side in (parted.queries, parted.repository)
    )
    if not test:
        raise UserError(
            f"none of the {len(parted.queries)} clips to test by is of a class that the generator knows "
            f"({', '.join(sorted(classes)[:5])}{', …' if len(classes) > 5 else ''}); --label-column names another "
            "column of labels.csv"
        )
    queries, known = _spread(test, MOST_TEST), _spread(training, MOST_TRAINING)
    motions = _motions(lake, list(dict.fromkeys([*queries, *known])))
    queries, known = ([row for row in some if row in motions] for some in (queries, known))
    protocol = "{} clips, {} clips known".format(*parted.names) if parted.names else LEAVE_ONE_OUT
    return RealClips(
        [motions[row] for row in queries], [motions[row] for row in known], protocol,
        parted.names[0] if parted.names else None, len(parted.queries) - len(test),
    )  # fmt: skip


def _spread(rows: list[_Row], most: int) -> list[_Row]:
    """At most so many, at even distances."""
    at = np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(int)
    return [rows[i] for i in at]


def _motions(lake: Lake, rows: Sequence[_Row]) -> dict[_Row, RealMotion]:
    """Of each row the frames between the calibration poses of its clip, two at least."""
    ranges: dict[str, list[_Row]] = {}
    for row in rows:
        ranges.setdefault(row.clip, []).append(row)
    found: dict[_Row, RealMotion] = {}
    for clip in read_frames(lake, [some[0] for some in ranges.values()]):
        first, last = recorded_range(clip.positions, clip.fps)
        for row in ranges[clip.clip]:
            offsets = np.asarray(row.rest_offsets, dtype=np.float64).reshape(-1, 3)
            positions = clip.positions.astype(np.float64)
            whole = RealMotion(
                clip.clip, row.dataset, row.label, positions, clip.fps, offsets, clip.rotations,
                ground_of(positions[first:last]),
            )  # fmt: skip
            start, stop = max(row.start, first), min(row.stop, last)
            if stop - start >= LEAST_FRAMES:
                found[row] = whole.cut(start, stop)
    return found


AT_ONCE: Final = 64  # motions that a generator makes in one go
LEAST: Final = 0.3  # seconds of a real clip after the seed


@dataclass(frozen=True, eq=False)
class SeededClip:
    """A recorded clip whose first poses are the seed of a generated motion.

    Attributes:
        motion: the clip.
        stop: the frame after the seed.
        after: [F, 21, 3] the recorded frames after the seed, at `fps`; frame k is (k + 1) / fps after its last frame.
        fps: the generator's.
        chance: the seed of the request, which picks the part of a long clip.
    """

    motion: RealMotion
    stop: int
    after: Float64Array
    fps: float
    chance: int

    @property
    def last_pose(self) -> Float64Array:
        """[21, 3] the seed's."""
        return np.asarray(self.motion.positions[self.stop - 1])

    @property
    def seconds(self) -> float:
        return len(self.after) / self.fps


@dataclass(frozen=True)
class Trial:
    """A generated motion and what it is compared with.

    Attributes:
        wanted: its class.
        made: the motion.
        seed: the clip that it continues.
        real: the recorded clip of its class that it is compared with; the recorded continuation where that is the seed.
    """

    wanted: str
    made: GeneratedMotion
    seed: SeededClip
    real: SeededClip


def seeded_clips(
    generator: MotionGenerator, motions: Sequence[RealMotion], seed: int, what: str, progress: StepProgress
) -> list[SeededClip]:
    """The clips that are long enough to be continued, each with the recorded frames after its seed.

    Raises:
        UserError: none is.
    """
    requests = [_request(motion, motion.label, 1e-3, seed + i, 0.0) for i, motion in enumerate(motions)]
    found: list[SeededClip] = []
    refused = "no clips"
    for start in range(0, len(requests), AT_ONCE):
        made, reason = _those_possible(generator, requests[start : start + AT_ONCE])
        refused = reason or refused
        for i, one in enumerate(made, start):
            if one is not None:
                after = following(motions[i], one.seed_stop, one.fps)
                if len(after) >= LEAST * one.fps:
                    found.append(SeededClip(motions[i], one.seed_stop, after, one.fps, requests[i].seed))
        progress(what, min(start + AT_ONCE, len(requests)), len(requests))
    if not found:
        raise UserError(f"none of {len(motions)} clips is long enough to go on from and compare with ({refused})")
    return found


def following(motion: RealMotion, stop: int, fps: float) -> Float64Array:
    """[F, 21, 3] a clip at `fps` after frame `stop` - 1, linearly interpolated."""
    step = motion.fps / fps
    count = int(np.floor((len(motion.positions) - stop) / step + TOLERANCE))
    return poses_at(motion.positions, stop - 1 + step * np.arange(1, count + 1))


def poses_at(poses: Float64Array, at: FloatArray) -> Float64Array:
    """[t, J, 3] poses [F, J, 3] at fractional frames [t], by linear interpolation."""
    before, after, share = beside(at, len(poses), TOLERANCE)
    share = np.clip(share, 0, 1)[:, None, None]
    return np.asarray((1 - share) * poses[before] + share * poses[after])


def continued(
    generator: MotionGenerator, seeded: Sequence[SeededClip], *, temperature: float, seconds: float | None, what: str,
    progress: StepProgress,
) -> list[Trial]:  # fmt: skip
    """Continue each clip in its own class, for `seconds`, or for as long as the recording continues."""
    requests = [
        _request(each.motion, each.motion.label, seconds or each.seconds, each.chance, temperature) for each in seeded
    ]
    return _trials(generator, requests, [(each, each) for each in seeded], what, progress)


def from_other_classes(
    generator: MotionGenerator, seeded: Sequence[SeededClip], count: int, *, seconds: float | None, seed: int,
    what: str, progress: StepProgress,
) -> list[Trial]:  # fmt: skip
    """Generate `count` motions of each class that has recorded clips, each from a clip of another class.

    They are compared in turn with real clips of the class, taken evenly. Each is made as long as that goes on (or
    `seconds`) and starts from a clip of the same dataset, drawn at random. Without other classes there are none.
    """
    random = np.random.default_rng(seed)
    pairs = []
    for name in sorted({each.motion.label for each in seeded}):
        real = [each for each in seeded if each.motion.label == name]
        others = [each for each in seeded if each.motion.label != name]
        for i in range(count if others else 0):
            beside = real[i % len(real) if count > len(real) else i * len(real) // count]
            near = [each for each in others if each.motion.dataset == beside.motion.dataset] or others
            pairs.append((near[int(random.integers(len(near)))], beside))
    requests = [
        _request(start.motion, real.motion.label, seconds or real.seconds, seed + i, 1.0)
        for i, (start, real) in enumerate(pairs)
    ]
    return _trials(generator, requests, pairs, what, progress)


def _trials(
    generator: MotionGenerator,
    requests: Sequence[MotionRequest],
    pairs: Sequence[tuple[SeededClip, SeededClip]],
    what: str,
    progress: StepProgress,
) -> list[Trial]:
    found: list[Trial] = []
    for first in range(0, len(requests), AT_ONCE):
        made = generator.generate(requests[first : first + AT_ONCE])
        for one, (start, real) in zip(made, pairs[first : first + AT_ONCE], strict=True):
            found.append(Trial(real.motion.label, one, start, real))
        progress(what, len(found), len(requests))
    return found


def _request(start: RealMotion, label: str, seconds: float, seed: int, temperature: float) -> MotionRequest:
    turned = None if start.rotations is None else start.rotations.astype(np.float64)
    given = SeedClip(start.clip, start.positions, start.fps, start.rest_offsets, turned)
    return MotionRequest((label,), seconds, seed, given, temperature=temperature)


def _those_possible(
    generator: MotionGenerator, requests: Sequence[MotionRequest]
) -> tuple[list[GeneratedMotion | None], str]:
    """What each request gives, None where it cannot be met, and why the last of these could not."""
    try:
        return list(generator.generate(requests)), ""
    except ValueError as error:
        if len(requests) == 1:
            return [None], str(error)
    half = len(requests) // 2
    (first, why), (second, other) = (_those_possible(generator, some) for some in (requests[:half], requests[half:]))
    return [*first, *second], other or why
