"""The comparison of synthesis asks every method for the same frames: one that knows them makes no error."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from motionlake.arrays import Float32Array
from motionlake.evaluation.synthesis.errors import MILLISECONDS
from motionlake.glogen.sparse import JOINT_COLUMNS
from motionlake.glogen.trajectories import FPS, BodyMotion, body_motion
from motionlake.motion.resampling import interpolated
from motionlake.motion.skeleton import INDEX
from numpy.typing import NDArray

from bench.canonical_sets import LabelledClip
from bench.glogen import between, dense, folds, whole
from bench.glogen.material import Material, frames_of
from bench.glogen.motions import DENSE_TASK, Motions, Pasts
from tests.test_pictures import standing

FRAMES = 80


def moving(number: int) -> BodyMotion:
    """A body whose wrist goes up, faster and faster, by the square of the frame: no two steps are alike."""
    body = standing(FRAMES)
    body[:, INDEX["left_wrist"], 1] += (0.004 + 0.001 * number) * np.arange(FRAMES) ** 2 / FPS
    return body_motion(body, FPS)


def material(count: int) -> Material:
    motions = [moving(number) for number in range(count)]
    clips = [LabelledClip(standing(FRAMES), np.zeros(0), FPS, "up", "s", "test", f"up-{i}") for i in range(count)]
    return Material(clips, motions, ["up"])


@dataclass
class Knowing:
    """Goes on as the motions do that it knows: finds the last pose of a past among their frames."""

    motions: list[BodyMotion]
    asked: list[int] = field(default_factory=list)

    def fit(self, data: Motions, seed: int) -> None: ...

    def predict(self, pasts: Pasts, classes: NDArray[np.int64], rng: np.random.Generator | None = None) -> Float32Array:
        self.asked = [len(past) for past in pasts]
        found = []
        for past in pasts:
            apart = [np.abs(frames_of(motion) - past[-1]).max(axis=1) for motion in self.motions]
            motion = frames_of(self.motions[int(np.argmin([each.min() for each in apart]))])
            at = int(min(apart, key=lambda each: float(each.min())).argmin()) + np.arange(1, DENSE_TASK.horizon + 1)
            found.append(motion[np.minimum(at, len(motion) - 1)])
        return np.stack(found)


def test_what_follows_is_taken_from_the_frame_that_a_method_was_given_last() -> None:
    for piece in dense.asked_pieces(material(2)):
        one = dense.Asked.of(piece)
        whole_motion = frames_of(piece.motion)
        np.testing.assert_array_equal(one.known[-1], whole_motion[one.start])
        assert one.start <= piece.sparse.places[4] < one.start + 1
        made = whole_motion[one.start + 1 : one.start + 1 + dense.HORIZON]
        np.testing.assert_allclose(dense.apart(made, one, one.start), 0, atol=1e-6)
        # Sparse poses lie between frames: what goes on from them is compared with what lies between, too.
        place = float(piece.sparse.places[4])
        between = interpolated(whole_motion.astype(float), (place + np.arange(1, dense.HORIZON + 1)).astype(float))
        np.testing.assert_allclose(dense.apart(between.astype(np.float32), one, place), 0, atol=1e-4)
        assert np.abs(dense.apart(made[1:], one, one.start)[:-1]).max() > 1e-3  # a frame too late is an error


def test_beyond_the_end_of_a_clip_there_is_no_truth() -> None:
    (piece,) = dense.asked_pieces(material(1))
    one = dense.Asked.of(piece)
    true = one.true(FRAMES - 1 - 0.2 * FPS)  # 200 ms before the last frame
    assert np.isfinite(true).all(axis=1).tolist() == [ms <= 200 for ms in MILLISECONDS]


def test_every_clip_is_left_out_once() -> None:
    for count in (3, 8, 9, 68):
        held = folds.folds(Material([None] * count, [None] * count, ["up"]))  # type: ignore[list-item]
        assert sorted(i for fold in held for i in fold) == list(range(count))
        assert len(held) == min(count, folds.FOLDS)


def test_what_is_measured_of_folds_is_a_mean_over_all_motions_or_their_extreme() -> None:
    found = folds.means([{"airborne": [2.0, 1.0], "energy": [1.0, 2.0]}, {"airborne": [0.5], "energy": [6.0]}])
    assert found == {"airborne": 2.0, "energy": 3.0, "n": 3}


@pytest.mark.parametrize("name", between.CURVES)
def test_curves_go_through_the_sparse_poses(name: str) -> None:
    (piece,) = dense.asked_pieces(material(1))
    times = between._times(piece)
    assert times[0] == 0
    assert between._asked(piece)[-1] == pytest.approx(times[-1])
    found = between.CURVES[name](piece.sparse.rows, times, times)
    np.testing.assert_allclose(found, piece.sparse.rows[:, JOINT_COLUMNS], atol=1e-9)
    assert 0 < between._error(between.CURVES[name](piece.sparse.rows, times, between._asked(piece)), piece) < 0.01
    assert between._error(frames_of(piece.motion)[1:], piece) == 0


@pytest.mark.parametrize("count", [1, 3])
def test_a_method_that_knows_what_follows_makes_no_error_to_the_end_of_the_clip(count: int) -> None:
    test = whole.question(material(count))
    assert test.lengths == [int(FRAMES - 1 - one.piece.sparse.places[4]) for one in test.asked]
    assert max(test.lengths) > DENSE_TASK.horizon  # it has to go on from its own frames
    known = Knowing([one.piece.motion for one in test.asked])
    made = whole._gone_on(known, test, None)
    for found, true, one in zip(made, test.truth(between=False), test.asked, strict=True):
        np.testing.assert_array_equal(found, true)
        np.testing.assert_array_equal(true[0], frames_of(one.piece.motion)[one.start + 1])
    assert known.asked[0] > len(test.asked[0].known)
