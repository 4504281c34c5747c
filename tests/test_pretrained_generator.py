"""The pretrained generator: what it is, and lakes that know of no clip's class making motion with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motionlake.glogen.config import PRETRAINED_GENERATOR, SynthesisConfig
from motionlake.glogen.generator import load_generator
from motionlake.motion.generation import MotionRequest, SeedClip
from motionlake.motion.skeleton import JOINTS, PARENTS

from tests.lakes import Changed, motionlake, query
from tests.test_pictures import standing


@pytest.fixture
def bare(lake: Path) -> Path:
    """A lake that knows of no clip's class."""
    con = Changed(lake)
    con.execute("UPDATE clips SET label = NULL")
    con.execute("DELETE FROM segments")
    con.close()
    return lake


def test_the_pretrained_generator_is_the_one_its_description_names() -> None:
    generator, about = load_generator(PRETRAINED_GENERATOR.file), PRETRAINED_GENERATOR.about()
    assert generator.classes == about["class_names"] == sorted(about["class_names"])
    assert generator.config.recipe == SynthesisConfig(recipe=about["recipe"]).recipe == "networks"
    assert generator.metrics["data_sha256"] == about["data_sha256"]
    assert set(about["sets"]) <= {"cmu_dance", "cmu_bvh", "cmu_exercises", "cmu_86"}
    assert set(about["filled"]) <= set(JOINTS)
    assert PRETRAINED_GENERATOR.file.stat().st_size < 20_000_000
    assert PRETRAINED_GENERATOR.fits(SynthesisConfig())
    assert PRETRAINED_GENERATOR.fits(SynthesisConfig(weights="pretrained", seed=3))
    for other in ({"weights": "own"}, {"recipe": "glogen"}, {"epochs": 2}):
        assert not PRETRAINED_GENERATOR.fits(SynthesisConfig(**other))


def test_every_class_of_it_makes_motion_from_a_body_that_stands() -> None:
    generator = load_generator(PRETRAINED_GENERATOR.file)
    body = standing(60)
    offsets = body[0] - body[0, np.maximum(PARENTS, 0)]
    seed = SeedClip("stands", body, 30.0, offsets)
    made = generator.generate([MotionRequest((name,), 2.0, 5, seed) for name in generator.classes])
    for one in made:
        assert one.positions.shape == (60, len(JOINTS), 3)
        assert np.isfinite(one.positions).all()
        moved = np.linalg.norm(np.diff(one.positions, axis=0), axis=2).max() * 30
        assert 0.1 < moved < 20  # metres a second


def test_a_lake_without_labels_makes_motion_pretrained(bare: Path, scheduler: str) -> None:
    common = ("--lake", bare, "--scheduler", scheduler)
    run = motionlake("run", "synth", *common)
    assert run.status == 0, run.err
    assert "synth: takes the pretrained generator; `motionlake train synthesis` trains one on this lake" in run.err
    about = PRETRAINED_GENERATOR.about()
    assert motionlake("synthesize", "--classes", "--json", "--lake", bare).json == {
        "model": "synthesis-1",
        "classes": about["class_names"],
        "by": [{"class": name, "recipe": "networks", "model": "synthesis-1"} for name in about["class_names"]],
    }
    run = motionlake("synthesize", "--class", "walk", "--seconds", "1", "--count", "3", "--json", *common)
    assert run.status == 0, run.err
    rows = query(
        bare,
        "SELECT s.model, c.label, s.datasets, list_contains(s.licences, $licence), o.format <> 'synthetic' "
        "FROM synthetic s JOIN clips c USING (clip) JOIN clips o ON o.clip = s.seed_clip",
        licence=about["licences"][0],
    )
    assert rows == [("synthesis-1", "walk", about["sets"], True, True)] * 3
    assert motionlake("sql", "FROM synthesize('run', seconds := 1)", "--json", "--lake", bare).status == 0
    # Synthetic clips have a class, but nothing is learned from them: the lake still knows of none.
    assert "synth: will not train; synthesis-1 makes motion" in motionlake("run", "synth", *common).err
    run = motionlake("train", "synthesis", "--lake", bare)
    assert (run.status, "has a label, and a generator learns motion by class" in run.err) == (2, True)


def test_a_lake_with_labels_takes_it_if_told_to(lake: Path, scheduler: str) -> None:
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write('[synthesis]\nweights = "pretrained"\n')
    run = motionlake("run", "synth", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert query(lake, "SELECT metrics FROM models WHERE kind = 'synthesis'")[0][0].count('"pretrained":true') == 1


def test_weights_of_another_name_are_refused(lake: Path) -> None:
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write('[synthesis]\nweights = "mine"\n')
    run = motionlake("run", "synth", "--lake", lake)
    assert (run.status, "weights is 'mine', not one of auto, pretrained, own" in run.err) == (2, True)
