"""Actions, which are done once, told from motion that goes on; an action ends with the motion that is made of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from motionlake.matching.actions import comes_to_rest, has_a_course
from motionlake.matching.course import Part, Start
from motionlake.matching.database import MotionDatabase
from motionlake.matching.generator import MatchingGenerator
from motionlake.matching.played import IN_TIME, STRETCH
from motionlake.matching.player import Player
from motionlake.motion.generation import FPS, MotionRequest

from bench.canonical_sets import LabelledClip, LabelledSet, Row, read
from bench.classes import CLASSES
from bench.matching_clips import database_of, seed_of

HDM05 = ("depositFloorR", "elbowToKnee1RepsLelbowStart", "grabHighR", "jogLeftCircle4StepsRstart", "kickLFront1Reps")


def actions(data: MotionDatabase) -> list[bool]:
    return [data.is_action(target) for target in range(len(data.classes))]


def labelled(*names: str) -> Callable[[Row], bool]:
    return lambda row: row["label"] in names


@cache
def hdm05() -> list[LabelledClip]:
    return read(LabelledSet("hdm05", "label", labelled(*HDM05)))


@pytest.mark.recordings
def test_actions_of_sets_that_are_cut_tight_are_told(recordings: Path) -> None:
    """They end while the body still moves."""
    data = database_of(hdm05())
    assert actions(data) == [True] * len(HDM05)
    assert not all(data.is_resting(target) for target in range(len(HDM05)))
    going = database_of([clip for name in ("walk", "run", "salsa") for clip in read(CLASSES[name])[:9]])
    assert actions(going) == [False] * 3
    styles = database_of(read(LabelledSet("bandai1", "label", labelled("walk", "run"))))
    assert actions(styles) == [False] * 2


def test_a_course_is_told_by_where_alike_poses_are() -> None:
    places, clips = np.tile(np.linspace(0, 1, 50), 4), np.repeat(np.arange(4), 50)
    rng = np.random.default_rng(0)
    along = places[:, None] + 0.01 * rng.standard_normal((200, 1))
    phases = 8 * np.pi * places + rng.uniform(0, 2 * np.pi, 4)[clips]
    again = np.stack([np.sin(phases), np.cos(phases)], axis=1) + 0.1 * rng.standard_normal((200, 2))
    assert has_a_course(along, clips, places, along, clips, places)
    assert not has_a_course(again, clips, places, again, clips, places)
    alone = np.zeros(200, dtype=np.int64)
    assert not has_a_course(along, alone, places, along, alone, places), "one recording tells nothing"


def test_rest_is_a_slow_end_of_short_recordings() -> None:
    speeds = np.concatenate([np.full(55, 1.0), np.full(5, 0.1)] * 3)
    pieces = np.array([(0, 60), (60, 120), (120, 180)])
    assert comes_to_rest(speeds, pieces)
    assert not comes_to_rest(speeds[::-1], pieces)
    assert not comes_to_rest(np.repeat(speeds, 4), 4 * pieces), "eight seconds are no action"


@pytest.mark.recordings
def test_an_action_that_ends_moving_is_played_to_its_end_and_never_stands_still(recordings: Path) -> None:
    data = database_of([clip for clip in hdm05() if clip.subject != "tr"])
    lengths = {name: stop - start for name, (start, stop, *_) in zip(data.clips, data.pieces.tolist(), strict=True)}
    ends, paces = [], []
    for i, clip in enumerate(c for c in hdm05() if c.subject == "tr"):
        seconds = len(clip.positions) / clip.fps - 0.5
        if seconds < 0.7:
            continue
        (made,) = MatchingGenerator(data).generate([MotionRequest((clip.label,), seconds, i, seed_of(clip))])
        moved = np.abs(np.diff(made.positions, axis=0)).max(axis=(1, 2))
        assert moved.min() > 1e-4
        source = made.sources[-1]
        ends.append(lengths[source.clip] - 1 - (source.last - 1) / 120 * FPS)
        if source.start == 0:
            paces.append((source.last - source.first) / 120 / ((source.stop - source.start) / FPS))
    assert np.mean(np.abs(ends) < 6) > 0.8, "frames of the recording that are left over"
    assert min(paces) > 1 / STRETCH - 0.05
    assert max(paces) < STRETCH + 0.05


@pytest.mark.recordings
def test_the_last_action_of_several_ends_with_the_motion(recordings: Path) -> None:
    data = database_of(hdm05())
    lengths = {name: stop - start for name, (start, stop, *_) in zip(data.clips, data.pieces.tolist(), strict=True)}
    left = []
    for seed in range(8):
        start = seed_of(hdm05()[seed])
        asked = MotionRequest((HDM05[2], HDM05[4]), 4.0, seed, start, shares=(2.0, 2.0))
        (made,) = MatchingGenerator(data).generate([asked])
        source = made.sources[-1]
        left.append(lengths[source.clip] - 1 - (source.last - 1) / 120 * FPS)
    assert np.mean(np.abs(left) < 6) > 0.7


@pytest.mark.parametrize("rests", [False, True])
@pytest.mark.parametrize("over", [-8, -3, 0, 3, 8])
@pytest.mark.parametrize("pace", [0.8, 1.0, 1.3])
@pytest.mark.recordings
def test_an_action_is_over_in_the_last_frame(
    recordings: Path, monkeypatch: pytest.MonkeyPatch, rests: bool, over: int, pace: float
) -> None:
    """Seen: another recording was joined for the last two frames, and a body at rest was frozen for half a second."""
    data = database_of([clip for clip in hdm05() if clip.label.startswith("jog")])
    monkeypatch.setattr(MotionDatabase, "is_resting", lambda data, target: rests)
    lengths = data.pieces[:, 1] - data.pieces[:, 0]
    first = int(data.pieces[lengths.argmax(), 0])
    frames = round((int(lengths.max()) - 1) / pace) + over
    step = np.array([*data.steps[first], data.turns[first]], dtype=float)
    player = Player(data, [Part(0, 0)], frames, np.random.default_rng(0), pace=pace, temperature=0.0)
    course = player.run(Start(data.features[first], 0.0, step, np.zeros(2), 0.0))
    assert course.jumps == [0]
    steps = np.diff(course.at)
    assert steps.min() > 0.3 * pace
    assert steps.max() < STRETCH * pace + 1e-9
    left = float(data.pieces[data.piece_of[int(course.at[-1])], 1]) - 1 - course.at[-1]
    assert left < 1e-6 or (rests and left <= IN_TIME * pace)
