"""Synthesis measured: by generators whose measures are known beforehand, on a lake, drawn, and refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.evaluation.synthesis import UNITS, SynthesisEvaluation, SynthesisPlan, measure_generator
from motionlake.evaluation.synthesis.errors import MILLISECONDS, errors_at
from motionlake.evaluation.synthesis.trials import RealMotion, following
from motionlake.glogen.config import SynthesisConfig
from motionlake.glogen.generator import EmbeddedMotions, TrainingMotion, embed_motions
from motionlake.glogen.generator_training import train_generator
from motionlake.lake.catalog import writing
from motionlake.lake.file_list import sums_of
from motionlake.lake.layout import open_lake
from motionlake.lake.models import add_model, next_file, save_model
from motionlake.motion.generation import GeneratedMotion, MotionRequest
from motionlake.motion.skeleton import INDEX, JOINTS, PARENTS, body_poses
from motionlake.pictures.maps import beside_map, generator_map
from motionlake.pictures.synthesis import recognised_figure, synthesis_pictures

from tests.lakes import Changed, motionlake, query
from tests.test_pictures import NASTY, assert_readable, standing

FPS = 30.0
THREE = SynthesisPlan(count=3)
SEED = 13  # frames at the clip's rate
REST = np.array([standing(1)[0, j] - standing(1)[0, p] if p >= 0 else np.zeros(3) for j, p in enumerate(PARENTS)])
MOVES = {"wave": ("left_wrist", 1), "push": ("right_wrist", 2), "nod": ("head", 0)}


def clip(label: str, number: int, fps: float = FPS) -> RealMotion:
    """A body that walks and moves one joint, each number at its own frequency."""
    seconds = np.arange(round(fps * (2.0 + 0.1 * number))) / fps
    body = standing(len(seconds))
    joint, axis = MOVES[label]
    body[:, INDEX[joint], axis] += 0.2 * np.sin((3 + 0.4 * number) * seconds)
    body[..., 2] += 0.5 * seconds[:, None]
    return RealMotion(f"{label}_{number}", "made", label, body, fps, REST)


TRAINING = [clip(label, number) for label in MOVES for number in range(5)]
TEST = [clip(label, number, 60.0 if number == 7 else FPS) for label in MOVES for number in (6, 7)]


def describe(motions: Sequence[tuple[Float64Array, float]]) -> Float64Array:
    """How much each joint moves: tells the classes apart."""
    return np.stack([np.log(1e-3 + body_poses(positions).std(axis=0)).ravel() for positions, _ in motions])


@dataclass
class Fake:
    """Makes `motion(wish, frames)`, [frames, 21, 3] at 30 a second after the first `SEED` frames of the seed."""

    motion: Callable[[MotionRequest, int], Float64Array]

    @property
    def classes(self) -> list[str]:
        return sorted(MOVES)

    def generate(self, wishes: Sequence[MotionRequest]) -> list[GeneratedMotion]:
        if any(len(wish.start.positions) < 2 * SEED for wish in wishes):
            raise ValueError("too short a seed")
        found = [self.motion(wish, max(2, round(wish.seconds * FPS))) for wish in wishes]
        turns = [np.zeros((len(one), len(JOINTS), 4)) for one in found]
        return [GeneratedMotion(one, q, REST, FPS, (0,), 0, SEED) for one, q in zip(found, turns, strict=True)]


def truly(wish: MotionRequest, frames: int) -> Float64Array:
    """What really follows, or a real test clip of the class."""
    real = {c.clip: c for c in TEST}[wish.start.clip]
    if wish.classes != (real.label,):
        real = {c.clip: c for c in TEST}[f"{wish.classes[0]}_7"]  # the longest
    after = following(real, SEED, FPS)
    return np.concatenate([after, np.repeat(after[-1:], max(0, frames - len(after)), axis=0)])[:frames]


def held(wish: MotionRequest, frames: int) -> Float64Array:
    return np.repeat(wish.start.positions[SEED - 1 : SEED].astype(float), frames, axis=0)


def copied(wish: MotionRequest, frames: int) -> Float64Array:
    """A stretch from the middle of a training clip of the class."""
    return clip(wish.classes[0], 4).positions[5 : 5 + frames]


def measured(
    motion: Callable[[MotionRequest, int], Float64Array], plan: SynthesisPlan = THREE, **other: Any
) -> SynthesisEvaluation:
    def safe(wish: MotionRequest, frames: int) -> Float64Array:
        known = {c.clip for c in TEST}
        return motion(wish, frames) if wish.start.clip in known else held(wish, frames)

    given_: dict[str, Any] = {"test": TEST, "training": TRAINING, "describe": describe, "plan": plan}
    return measure_generator(Fake(safe), **given_ | other)


def test_a_generator_of_the_truth_makes_no_errors() -> None:
    found = measured(truly).found
    assert found["mean_per_joint_error"] == pytest.approx(0, abs=1e-9)
    assert found["sparse"]["euclidean"] == pytest.approx(0, abs=1e-9)
    assert found["likeness"]["made"]["fid"] == pytest.approx(0, abs=1e-9)
    assert found["likeness"]["training"]["fid"] > 1e-4  # other clips are other vectors
    assert found["likeness"]["made"]["coverage"] == found["likeness"]["made"]["precision"] == 1
    assert (found["diversity"]["ratio"], found["pose_spread"]["ratio"]) == pytest.approx((1, 1))
    assert found["recognised"]["made"] == found["recognised"]["own_seeds"] == 1
    assert found["usual"]["made"] == pytest.approx(found["usual"]["real"], abs=0.2)
    assert found["bone_length_drift"]["worst"]["made"] > 10  # the fake bodies stretch
    assert (found["slide_speed"]["made"], found["travel_speed"]["made"]) == pytest.approx((0.5, 0.5))
    assert found["skate_ratio"]["made"] == found["skate_ratio"]["real"]
    assert found["transitions"]["n"] == 9
    assert found["transitions"]["jump_mm"]["real"] < 5
    assert found["n"] == {
        "test": 6, "training": 15, "own_seeds": 6, "other_seeds": 9, "classes": 3, "test_clips": 6
    }  # fmt: skip
    assert found["errors_ms"]["640"] == pytest.approx(0, abs=1e-9)
    still = found["zero_velocity"]["errors_ms"]
    expected = []
    for real in TEST:
        after = following(real, SEED, FPS)
        expected.append(errors_at(np.repeat(real.positions[SEED - 1][None], len(after), axis=0), after, FPS))
    for time, row in zip(MILLISECONDS, 1000 * np.mean(expected, axis=0), strict=True):
        assert still[str(time)] == pytest.approx(row[0])
        assert found["zero_velocity"]["euclidean_ms"][str(time)] == pytest.approx(row[1])


def test_what_follows_is_real_time_at_any_rate() -> None:
    fast, slow = clip("wave", 7, 120.0), clip("wave", 7, 30.0)
    np.testing.assert_allclose(following(fast, 45, FPS)[:40], slow.positions[12:52], atol=1e-9)  # 44 / 120 = 11 / 30
    np.testing.assert_allclose(following(slow, 12, FPS), slow.positions[12:])
    halves = list(replace(slow, positions=slow.positions[:70]).pieces(1.0))
    assert [len(each.positions) for each in halves] == [30, 40]


def test_a_generator_that_freezes_or_copies_is_seen_through() -> None:
    still = measured(held).found
    assert still["mean_per_joint_error"] == still["zero_velocity"]["mean_per_joint_error"] > 1
    assert still["errors_ms"] == still["zero_velocity"]["errors_ms"]
    assert still["usual"]["made"] == 0
    assert still["transitions"]["seconds"] is None
    assert still["transitions"]["soon"]["made"] == 0
    assert still["likeness"]["made"]["fid"] > still["likeness"]["training"]["fid"]
    assert still["jerk"]["made"] == 0
    assert still["travel_speed"]["made"] == 0
    assert still["recognised"]["made"] < still["recognised"]["real"] == 1
    copying = measured(copied, SynthesisPlan(count=3, seconds=0.8)).found
    true = measured(truly, SynthesisPlan(count=3)).found
    assert copying["nearest_real"]["made"]["median"] < 1e-3 < copying["nearest_real"]["test"]["median"]
    assert copying["nearest_real"]["near"] == 1
    assert copying["nearest_real"]["z"] < -2
    assert copying["nearest_real"]["unseen"]["ratio"] < 1
    assert true["nearest_real"]["ratio"] == pytest.approx(1, abs=0.3)
    assert true["by_class"]["nod"]["recognised"]["n"] == 3


def test_nothing_is_compared_with_its_own_clip() -> None:
    found = measured(truly, test=TEST, training=TEST).found
    assert found["nearest_real"]["made"]["median"] > 1e-3  # else each would find itself
    one = [each for each in TEST if each.label == "nod"]
    alone = measured(truly, test=one, training=TRAINING).found
    assert alone["recognised"] is None
    assert alone["likeness"]["other_seeds"] is alone["transitions"] is None
    assert alone["n"]["other_seeds"] == 0


def test_clips_too_short_to_start_from_are_left_out() -> None:
    short = replace(TEST[0], clip="short", positions=TEST[0].positions[: 2 * SEED - 1])
    brief = replace(TEST[0], clip="brief", positions=TEST[0].positions[: 2 * SEED])
    assert measured(truly, test=[short, *TEST]).found["n"]["test"] == len(TEST)
    found = measured(held, test=[brief, *TEST]).found
    assert found["n_ms"]["640"] == len(TEST)
    assert found["n_ms"]["400"] == len(TEST) + 1  # goes on for 13 frames


def test_pictures_can_be_read() -> None:
    done = measured(truly)
    names = dict(zip(sorted(MOVES), NASTY[1:], strict=False))
    trials = [replace(trial, wanted=names[trial.wanted]) for trial in done.trials]
    renamed = replace(done, trials=trials, real_classes=[names[label] for label in done.real_classes])
    found = synthesis_pictures(renamed)
    assert [each.name for each in found] == ["errors", "made-and-real", "strips", "measures", "recognised"]
    many = [f"class number {i}" for i in range(40)]
    points = np.random.default_rng(0).random((40, 5)).astype(np.float32)
    assert_readable(beside_map(points, many, points, many, NASTY[4], NASTY[1]))
    assert_readable(generator_map(EmbeddedMotions(many, points, points), NASTY[4], NASTY[1]))
    assert_readable(recognised_figure(dict.fromkeys([*many, *NASTY], (0.0, 1.0)), NASTY[4], NASTY[1]))


def test_clips_are_embedded_and_drawn_as_the_generator_reads_them() -> None:
    short = replace(TEST[0], clip="short", positions=TEST[0].positions[:SEED])
    read = [TrainingMotion(one.positions, one.fps, one.label) for one in (short, *TEST)]
    generator = train_generator(read[1:], SynthesisConfig(epochs=1))
    found = embed_motions(generator, read)
    assert found.labels == [one.label for one in TEST]
    assert found.with_class.shape == found.alone.shape == (len(TEST), 4 * generator.glogen.recipe.embedding)
    # The prior moves every motion of a class alike.
    moved = found.with_class - found.alone
    same = np.array(found.labels) == found.labels[0]
    assert np.ptp(moved[same], axis=0).max() < 1e-4 < np.ptp(moved, axis=0).max()
    drawn = synthesis_pictures(replace(measured(truly), embedded=found))
    assert "generator" in [each.name for each in drawn]


@pytest.fixture(scope="module")
def made_lake(built_lake: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small lake with splits and a generator that has hardly been trained."""
    import shutil

    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("synthesis") / "lake"))
    change(
        root,
        """UPDATE clips SET split = if(place % 2 = 1, 'train', 'test'), label = 'class ' || (place // 2 % 2) FROM (
            SELECT clip AS named, row_number() OVER (ORDER BY clip) AS place FROM clips WHERE label IS NOT NULL
        ) WHERE clip = named""",
    )
    labels = [label for (label,) in query(root, "SELECT DISTINCT label FROM clips WHERE label IS NOT NULL ORDER BY 1")]
    motions = [
        TrainingMotion(clip("wave", number).positions, FPS, labels[number % len(labels)])
        for number in range(2 * len(labels))
    ]
    trained = train_generator(motions, SynthesisConfig(epochs=1))
    lake = open_lake(root)
    with writing(lake) as con:
        file = next_file(con, "synthesis", ".safetensors")
        save_model(lake, file, trained.save)
        metrics = {"split": "train", "dataset": None, "loss": [1.0]}
        add_model(
            con, "synthesis", key="", data_hash="", config={}, metrics=metrics, file=sums_of(lake, file), seconds=0
        )
    return root


def change(lake: Path, statement: str, **parameters: Any) -> None:
    with Changed(lake) as con:
        con.execute(statement, parameters)


def test_a_lake_with_a_generator_is_measured(made_lake: Path, tmp_path: Path) -> None:
    words = ("evaluate", "synthesis", "--count", "2", "--lake", made_lake)
    run = motionlake(*words, "--json", "--pictures", tmp_path / "figures")
    assert run.status == 0, run.err
    found = run.json
    assert found["protocol"] == "test clips, train clips known"
    assert found["warning"] is None
    assert found["model"] == {"model": "synthesis-1", "split": "train", "dataset": None}
    assert {*UNITS} - {"fid"} <= set(found)
    assert found["angular_range"]["left_wrist"]["made"] is not None
    tested = dict(
        query(made_lake, "SELECT label, count(*) FROM clips WHERE split = 'test' AND label IS NOT NULL GROUP BY ALL")
    )
    assert 0 < found["n"]["test"] <= sum(tested.values()) == found["n"]["test_clips"]
    assert found["n"]["other_seeds"] == 2 * found["n"]["classes"]
    assert set(found["by_class"]) <= set(tested)
    assert found["bone_length_drift"]["worst"]["made"] < 0.5
    assert {path.stem for path in (tmp_path / "figures").iterdir()} >= {"errors", "made-and-real", "strips", "measures"}
    assert motionlake(*words, "--json").json == found
    table = motionlake(*words)
    assert "error at 640 ms" in table.out
    assert "bone-length drift" in table.out
    assert "skate ratio: share of frames" in table.out


def test_a_generator_that_has_seen_the_clips_is_told(made_lake: Path, tmp_path: Path) -> None:
    import shutil

    lake = Path(shutil.copytree(made_lake, tmp_path / "lake"))
    words = ("evaluate", "synthesis", "--count", "1", "--json", "--lake", lake)
    swapped = motionlake(*words, "--split", "train", "--train-split", "test")
    assert "trained on" in swapped.json["warning"]
    assert "warning: " in swapped.err
    change(lake, "UPDATE models SET metrics = $metrics WHERE kind = 'synthesis'", metrics=json.dumps({"split": None}))
    change(lake, "UPDATE clips SET split = NULL")
    alone = motionlake(*words)
    assert alone.json["protocol"] == "leave one out"
    assert "trained on" in alone.json["warning"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--split", "validation"], "no labelled clip has split validation; there are test, train"),
        (["--label-column", "shoes"], "no such column"),
        (["--label-column", "dataset"], "of a class that the generator knows"),
        (["--dataset", "elsewhere"], "no clip of dataset elsewhere has a label"),
        (["--seconds", "0"], "--seconds 0: must be more than 0"),
        (["--piece", "-1"], "--piece -1: must be more than 0"),
    ],
)
def test_what_synthesis_cannot_be_measured_by(made_lake: Path, words: list[str], says: str) -> None:
    run = motionlake("evaluate", "synthesis", *words, "--lake", made_lake)
    assert run.status == 2
    assert says in run.err
    assert run.err.count("\n") == 1


def test_a_lake_without_models_is_told_what_to_do(lake: Path) -> None:
    run = motionlake("evaluate", "synthesis", "--lake", lake)
    assert run.status == 2
    assert "has no generator yet" in run.err
    assert "motionlake train synthesis" in run.err
