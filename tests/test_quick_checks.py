"""What is looked at first because it is quick says the same as what it stands for, written plainly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.formats.bvh import _CHANNELS, _channels_named
from motionlake.formats.clip_checks import check_clip, most_of
from motionlake.formats.repair import FARTHEST, missing_samples
from motionlake.lake.frames import columns_of
from motionlake.motion.calibration import AROUND, SEAM, STEPS, jumps
from motionlake.motion.clip import ChannelKind, Hierarchy, SourceClip
from motionlake.motion.features import body_length
from motionlake.motion.runs import runs
from motionlake.motion.skeleton import INDEX

SEEDS = st.integers(0, 2**32 - 1)
ODD = st.sampled_from([0.0, np.nan, np.inf, -np.inf, 9e4, -2e5, 9e5, 1.1e6, 1e9, 1e200])


def walk(seed: int) -> Float64Array:
    """[F, 21, 3] joints that go at random, and leap now and then."""
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0, rng.choice([0.001, 0.01, 0.03]), (rng.integers(3, 90), 21, 3)), axis=0)
    for at in rng.integers(0, len(path), rng.integers(0, 4)):
        path[at:] += rng.normal(0, 0.2, (21, 3))
    return np.asarray(path)


def plain_jumps(positions: Float64Array) -> list[tuple[int, int, float]]:
    if len(positions) < 2 * AROUND + 2:
        return []
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=2)
    mean, jumped = steps.mean(axis=1), np.zeros(len(steps), bool)
    padded = np.pad(steps, ((AROUND, AROUND), (0, 0)), mode="reflect")
    for i in range(len(steps)):
        beside = np.delete(padded[i : i + 2 * AROUND + 1], AROUND, axis=0)
        around = max(row.mean() for row in beside)
        alone = (steps[i] > 2 * beside.max(axis=0)).mean() > 0.5
        jumped[i] = mean[i] > STEPS * around and mean[i] - around > SEAM and alone
    return [(start, stop, float(mean[start:stop].max())) for start, stop in runs(jumped, 1)]


@given(SEEDS)
def test_jumps(seed: int) -> None:
    positions = walk(seed)
    assert [tuple(jump) for jump in jumps(positions)] == plain_jumps(positions)


@given(SEEDS)
def test_body_length(seed: int) -> None:
    positions = walk(seed)

    def bone(start: str, end: str) -> float:
        return float(np.median(np.linalg.norm(positions[:, INDEX[end]] - positions[:, INDEX[start]], axis=-1)))

    legs = [bone(f"{side}_hip", f"{side}_knee") + bone(f"{side}_knee", f"{side}_ankle") for side in ("left", "right")]
    assert body_length(positions) == pytest.approx(sum(legs) / 2 + bone("hips", "neck"), rel=1e-12)


@given(SEEDS, st.lists(st.tuples(SEEDS, ODD), max_size=8))
def test_missing_samples(seed: int, odd: list[tuple[int, float]]) -> None:
    positions = np.random.default_rng(seed).normal(size=(9, 4, 3))
    for at, value in odd:
        positions.flat[at % positions.size] = value
    if seed % 3 == 0:
        positions[seed % 9, seed % 4] = 0.0
    lacking = np.array([[not (np.abs(j) <= FARTHEST).all() or not j.any() for j in frame] for frame in positions])
    broken = ~(np.abs(positions[:, 0]) <= FARTHEST).all(axis=1)
    if (broken | ~positions[:, 0].any(axis=1)).all():  # centred at the root: it stands where all others do too
        lacking[:, 0] = broken | ~positions.any(axis=(1, 2))
    np.testing.assert_array_equal(missing_samples(positions), lacking)


@given(st.sampled_from(ChannelKind), st.lists(st.tuples(SEEDS, ODD), max_size=4))
def test_numbers_of_a_clip(kind: ChannelKind, odd: list[tuple[int, float]]) -> None:
    tree = Hierarchy.of_positions(("a", "b"), (-1, 0))
    if kind is ChannelKind.EULER:
        tree = replace(tree, kind=kind, channels=(("Xposition", "Xrotation"), ("Zrotation",)))
    columns = sum(map(len, tree.channels))
    channels = np.ones((5, columns))
    for at, value in odd:
        channels.flat[at % channels.size] = value
    clip = SourceClip(tree, channels, 30.0)
    if (np.abs(channels) <= most_of(tree)).all():
        check_clip(clip)
    else:
        with pytest.raises(ClipError, match=r"is not finite|which is absurd"):
            check_clip(clip)


@pytest.mark.parametrize(("value", "said"), [(np.nan, "without a finite offset"), (1e9, "absurdly long")])
def test_offsets_of_a_clip(value: float, said: str) -> None:
    tree = Hierarchy.of_positions(("a", "b"), (-1, 0))
    clip = SourceClip(replace(tree, offsets=np.array([[0.0, 0, 0], [0, value, 0]])), np.ones((3, 6)), 30.0)
    with pytest.raises(ClipError, match=said):
        check_clip(clip)


@pytest.mark.parametrize("parents", [(0, 0), (-1, 1), (-1, -1), (-1, 5), (-1,)])
def test_trees_of_a_clip(parents: tuple[int, ...]) -> None:
    tree = replace(Hierarchy.of_positions(("a", "b"), (-1, 0)), parents=parents)
    with pytest.raises(ClipError, match="form no tree"):
        check_clip(SourceClip(tree, np.ones((3, 6)), 30.0))


@given(st.lists(st.sampled_from(["Xposition", "xPOSITION", "Yrotation", "Zrotation", "W"]), max_size=4))
def test_channels_by_their_words(words: list[str]) -> None:
    names = [_CHANNELS.get(word.lower()) for word in words]
    sound = None not in names and len(set(names)) == len(names)
    assert _channels_named(tuple(words)) == (tuple(names) if sound else ())


@given(SEEDS, st.integers(0, 5), st.integers(1, 4))
def test_columns(seed: int, rows: int, columns: int) -> None:
    matrix = np.random.default_rng(seed).normal(size=(rows, columns)).astype(np.float32)
    found = columns_of(matrix)
    assert [column.to_pylist() for column in found] == matrix.T.tolist()
