"""Made motion beside real motion: what is left out, whether likeness and copies tell real from changed motion, moments
of errors, the blind page."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis.motions import Stretch
from motionlake.matching.generator import MatchingGenerator
from motionlake.motion.generation import FPS, MotionRequest
from motionlake.motion.resampling import interpolated
from motionlake.motion.skeleton import PARENTS, body_poses, mirrored_positions

from bench.canonical_sets import load
from bench.classes import ACTIONS, CLASSES, GOING, OTHERS
from bench.glogen import sets
from bench.glogen.controls import held, shuffled
from bench.glogen.dense import HORIZON, apart
from bench.glogen.material import frames_of
from bench.made import blind, errors
from bench.made.splits import FOLDS, SPLITS, clips_of, parted, real, rigid
from bench.made.windows import SPACES, all_windows, copies, intervals, likeness, paces, windows
from bench.matching_clips import database_of, seed_of
from bench.record import recordings as folder_of_recordings

pytestmark = pytest.mark.recordings


def test_six_actions_are_those_that_a_seed_draws(recordings: Path) -> None:
    with (folder_of_recordings() / "utd_mhad" / "labels.csv").open(newline="") as handle:
        names = sorted({row["label"] for row in csv.DictReader(handle)})
    drawn = np.random.default_rng(0).choice(len(names), len(ACTIONS), replace=False)
    assert tuple(names[i] for i in sorted(drawn.tolist())) == ACTIONS


def test_other_sets_have_every_class_of_clips_enough_and_long_enough(recordings: Path) -> None:
    found = []
    for folder in ("hdm05", "bandai1"):
        seconds: dict[str, list[float]] = {}
        for clip in load(folder):
            seconds.setdefault(clip.label, []).append(len(clip.positions) / clip.fps)
        found += [f"{folder} {name}" for name, own in seconds.items() if len(own) >= 10 and np.median(own) >= 1.2]
    assert sorted(found) == sorted(OTHERS)


def test_networks_and_matching_are_measured_by_the_same_clips(recordings: Path) -> None:
    assert {name: sets.SETS[name] for name in GOING} == dict(GOING)
    assert [clip.name for clip in sets.clips_of("run")] == [clip.name for clip in clips_of("run")]


def test_rigid_recordings_are_as_near_as_bones_of_constant_length_can_be(recordings: Path) -> None:
    motion, parents = real(clips_of("squat")[0]), np.array(PARENTS[1:])
    kept = rigid(motion)
    lengths, recorded = (
        np.linalg.norm(each.positions[:, 1:] - each.positions[:, parents], axis=2) for each in (kept, motion)
    )
    assert (recorded.max(axis=0) > 1.2 * recorded.min(axis=0)).any(), "a depth sensor's bones change their length"
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape))
    np.testing.assert_array_equal(kept.positions[:, 0], motion.positions[:, 0])
    directions = motion.positions.copy()
    for joint, parent in enumerate(parents, start=1):
        bones = motion.positions[:, joint] - motion.positions[:, parent]
        unit = bones / np.maximum(np.linalg.norm(bones, axis=1, keepdims=True), 1e-9)
        directions[:, joint] = directions[:, parent] + lengths[0, joint - 1] * unit
    off, other = (np.linalg.norm(p - motion.positions, axis=2).mean() for p in (kept.positions, directions))
    assert off < 0.9 * other
    walk = real(clips_of("walk")[0])
    np.testing.assert_allclose(rigid(walk).positions, walk.positions, atol=1e-3)


@pytest.mark.parametrize("split", ["salsa", "walk, other subjects", "actions, other subjects", "hdm05, other subjects"])
def test_what_is_left_out_is_not_known(recordings: Path, split: str) -> None:
    left: list[tuple[str, str, str]] = []
    for fold in range(FOLDS):
        known, test = parted(split, fold)
        assert known
        assert test
        key = "subject" if SPLITS[split].by == "subject" else "name"
        assert not {getattr(c, key) for c in known} & {getattr(c, key) for c in test}
        left += [(clip.label, clip.name, clip.subject) for clip in test]
    whole = [(c.label, c.name, c.subject) for label in SPLITS[split].classes for c in clips_of(label)]
    assert sorted(left) == sorted(whole)


@cache
def walks() -> tuple[list[Stretch], list[Stretch], list[Stretch]]:
    """Unseen, known, and others of neither: real walks."""
    every = [real(clip) for clip in clips_of("walk")]
    return every[::3], every[1::3], every[2::3]


def shares(made: Sequence[Stretch], space: str, name: str = "coverage") -> float:
    unseen, known, _ = walks()
    found = likeness(unseen, known, made, SPACES[space])
    assert found is not None
    return float(found["made"][name] / found["known"][name])


@pytest.mark.parametrize("space", SPACES)
def test_real_motion_is_like_real_motion_and_changed_motion_is_not(recordings: Path, space: str) -> None:
    _, known, others = walks()
    assert shares(known, space) == pytest.approx(1)
    assert shares(known, space, "density") == pytest.approx(1)
    assert shares(others, space) > 0.8
    for changed in ([held(one) for one in others], [shuffled(one) for one in others], [others[0]] * len(others)):
        assert shares(changed, space) < 0.5


def test_an_interval_says_how_far_a_share_may_be_off(recordings: Path) -> None:
    unseen, known, others = walks()

    def interval(made: Sequence[Stretch], folds: int = 1) -> list[float]:
        found = likeness(unseen, known, made, SPACES["paces"])
        assert found is not None
        balls = found["balls"]
        for side in ("made", "known"):
            inside = getattr(balls, side)
            assert inside.any(axis=1).mean() == pytest.approx(found[side]["coverage"])
            assert inside.sum() / (3 * inside.shape[1]) == pytest.approx(found[side]["density"])
        return intervals([balls] * folds)["coverage"]

    low, high = interval(known)
    assert 0.7 < low < 1 < high < 1.4
    low, high = interval(others)
    assert low < shares(others, "paces") < high
    assert np.ptp(interval(others, folds=4)) == pytest.approx((high - low) / 2, rel=0.25)
    assert interval([held(one) for one in others])[1] < 0.5


def test_paces_tell_that_walks_are_too_fast(recordings: Path) -> None:
    others = walks()[2]
    fast = [replace(m, positions=interpolated(m.positions, np.arange(0, len(m.positions) - 1, 1.5))) for m in others]
    assert shares(fast, "paces") < 0.5


def test_paces_are_those_of_a_body_of_any_size_that_stands_anywhere(recordings: Path) -> None:
    motion = walks()[0][0].positions
    own = paces([motion], FPS)
    np.testing.assert_allclose(paces([2 * motion + np.array([3.0, 0.0, 1.0])], FPS), own, atol=1e-9)
    faster = paces([motion[::2]], FPS)
    assert np.median(faster - own) == pytest.approx(np.log(2), abs=0.4)


def test_windows_follow_one_another_and_hold_all_of_a_short_motion(recordings: Path) -> None:
    motion = walks()[0][0]
    count = len(motion.positions)
    found = windows([motion], 0.5)
    assert len(found) == count // 15
    np.testing.assert_array_equal(np.concatenate(found), motion.positions[: 15 * len(found)])
    (whole,) = windows([motion], count / FPS)
    assert len(whole) == count
    assert len(all_windows([motion], 0.5)) == 2 * (count - 14)


def test_copies_are_told_from_unseen_motion_mirrored_ones_too(recordings: Path) -> None:
    unseen, known, others = walks()
    fresh = copies(unseen, known, others)
    again = copies(unseen, known, known)
    turned = [replace(m, positions=np.asarray(mirrored_positions(m.positions), dtype=float)) for m in known]
    mirrored = copies(unseen, known, turned)
    assert fresh is not None
    assert fresh["z"] > -3
    assert fresh["near"] < 0.25
    assert fresh["made_known"] > 0.5 * fresh["unseen_known"]
    for copied in (again, mirrored):
        assert copied is not None
        assert copied["z"] < -3
        assert copied["near"] > 0.9
        assert copied["made_known"] < 0.2 * copied["made_unseen"]


def test_all_methods_are_asked_at_the_same_moment(recordings: Path) -> None:
    moments = errors.moments_of("run", 0) + errors.moments_of("indian", 1)
    assert len({moment.clip.name for moment in moments}) > 4
    for moment in moments:
        given = errors._given(moment)
        whole = real(moment.clip).positions
        np.testing.assert_allclose(given.positions[-1], whole[moment.frame])
        assert len(given.positions) >= 24
        truth = frames_of(moment.asked.piece.motion)[moment.asked.start + 1 :][:HORIZON]
        if len(truth) == HORIZON:
            assert np.nanmax(np.abs(apart(truth, moment.asked, moment.asked.start))) < 1e-5


def test_matching_that_knows_the_clip_goes_on_as_it_does(recordings: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And it plays what comes after the given frames, not the last of them again."""
    clips = clips_of("run")
    knowing = MatchingGenerator(database_of(clips))
    monkeypatch.setattr(errors, "matching", lambda split, fold: knowing)
    known = _pose_errors("matching")
    monkeypatch.undo()
    unknown, still = _pose_errors("matching"), _pose_errors("zero_velocity")
    assert (known < unknown).all()
    assert known.mean() < 0.75 * unknown.mean()
    assert (unknown < still).all()
    for clip in clips[:4]:
        (made,) = knowing.generate([MotionRequest(("run",), 0.5, 0, seed_of(clip), temperature=0.0)])
        after = body_poses(real(clip, made.seed_stop - 1).positions)
        made_poses = body_poses(made.positions[:6])
        off = [np.linalg.norm(made_poses - after[late : late + 6], axis=-1).mean() for late in (0, 1)]
        assert off[1] < 0.6 * off[0]


def _pose_errors(method: str) -> Float64Array:
    found = errors.measure(errors.Unit("run", method, 0))[method]
    return np.asarray(np.nanmean(np.array(found["pose"], dtype=float), axis=0)[:4])


def _nearest(motion: Float64Array, whole: Float64Array) -> float:
    """Metres that the joints lie apart at most where a clip holds a motion best; samples may lie between frames."""
    starts = range(len(whole) - len(motion) + 1)
    return min(float(np.abs(motion - whole[start : start + len(motion)]).max()) for start in starts)


def test_a_blind_page_does_not_tell_and_guesses_are_judged(recordings: Path, tmp_path: Path) -> None:
    found = blind.pairs(6, 0)
    assert len(found) == 6
    assert len({pair.label for pair in found}) == 6
    for pair in found:
        assert pair.label in CLASSES
        one, other = pair.motions
        assert one.shape == other.shape
        made = pair.motions["AB".index(pair.made)]
        truth = pair.motions["BA".index(pair.made)]
        near, far = (
            min(_nearest(motion, real(c).positions) for c in clips_of(pair.label) if c.name == pair.clip)
            for motion in (truth, made)
        )
        assert near < 0.1 < far
    assert [p.made for p in blind.pairs(6, 0)] == [p.made for p in found]
    page, key = blind.write(found, tmp_path, clips=False)
    text = page.read_text()
    assert not any(word in text for word in ("real", "key", *(pair.clip for pair in found if len(pair.clip) > 3)))
    told = {row["pair"]: row["made"] for row in json.loads(key.read_text())}
    for right in (6, 0):
        rows = [f"{n},{side if right else 'AB'['BA'.index(side)]}" for n, side in told.items()]
        (tmp_path / "guesses.csv").write_text("pair,made\n" + "\n".join(rows) + "\n")
        assert blind.judged(key, tmp_path / "guesses.csv")["right"] == right
    (tmp_path / "guesses.csv").write_text("pair,made\n1,A\n")
    with pytest.raises(ValueError, match="guesses for 1 pairs"):
        blind.judged(key, tmp_path / "guesses.csv")
