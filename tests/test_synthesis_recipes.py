"""Which generator makes a motion: recorded frames of labelled classes, networks of others; and what is said of it."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from motionlake.api import Lake
from motionlake.glogen.config import PRETRAINED_GENERATOR, SynthesisConfig
from motionlake.glogen.generator import load_generator
from motionlake.glogen.likeness import start_distances
from motionlake.matching import DATABASE_VERSION
from motionlake.matching.building import build_database
from motionlake.motion.sides import names_a_side
from motionlake.stages.generator_model import GENERATOR
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesize import clip_path

from bench.matching import clips_of
from bench.matching_clips import matching_clip, seed_of
from tests.lakes import Changed, Run, query
from tests.lakes import motionlake as command

ROOT = Path(__file__).parents[1]
LABELLED = "SELECT label FROM clips WHERE label IS NOT NULL AND format <> 'synthetic' ORDER BY seconds DESC, clip"


@pytest.fixture(scope="module")
def auto(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    """The small lake, whose clips are labelled, as `run synth` leaves it by default."""
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("auto") / "lake"))
    run = command("run", "synth", "--lake", lake)
    assert run.status == 0, run.err
    return lake


@pytest.fixture(scope="module")
def label(auto: Path) -> str:
    return str(query(auto, LABELLED)[0][0])


def synthesize(lake: Path, scheduler: str, *words: str) -> Run:
    return command("synthesize", *words, "--json", "--lake", lake, "--scheduler", scheduler)


def test_classes_with_labels_are_matched_and_others_made_by_networks(auto: Path, label: str, scheduler: str) -> None:
    run = synthesize(auto, scheduler, "--class", label, "--seconds", "1")
    assert run.status == 0, run.err
    count = query(auto, "SELECT count(*) FROM clips WHERE label = $l AND format <> 'synthetic'", l=label)[0][0]
    assert (run.json["recipe"], run.json["model"]) == ("matching", "synthesis-1")
    assert f"synthesize: {label} by motion matching (synthesis-1), since the lake has recordings that are" in run.err
    assert 0 < int(run.json["why"].rpartition("(")[2].partition(" ")[0]) <= count
    run = synthesize(auto, scheduler, "--class", "salsa", "--seconds", "1", "--count", "2")
    assert run.status == 0, run.err
    assert (run.json["recipe"], run.json["model"]) == ("networks", "pretrained")
    assert "salsa by networks (pretrained), since no recording of the lake is labelled salsa" in run.err
    rows = query(auto, "SELECT DISTINCT model, config, datasets FROM synthetic WHERE clip IN $c", c=run.json["clips"])
    assert [(row[0], json.loads(row[1])["recipe"], row[2]) for row in rows] == [
        ("pretrained", "networks", PRETRAINED_GENERATOR.about()["datasets"])
    ]
    again = synthesize(auto, scheduler, "--class", "salsa", "--seconds", "1", "--count", "2")
    assert (again.json["made"], again.json["there"]) == (0, 2)
    by = {row["class"]: (row["recipe"], row["model"]) for row in synthesize(auto, scheduler, "--classes").json["by"]}
    assert by[label] == ("matching", "synthesis-1")
    assert by["salsa"] == ("networks", "pretrained")


def test_sql_and_python_choose_alike(auto: Path, label: str) -> None:
    text = "SELECT root_x, root_z FROM synthesize('salsa', seconds := 1, seed := 2) ORDER BY frame"
    with Lake(auto) as lake:
        np.testing.assert_allclose(
            lake.sql(text).fetchall(), lake.synthesize("salsa", 1.0, seed=2).root[:, [0, 2]], atol=1e-3
        )
        rows = lake.sql(f"SELECT source FROM synthesize(['{label}'], seconds := 1)").fetchall()
        assert {row[0] is not None for row in rows} == {True}
        rows = lake.sql("SELECT source FROM synthesize(['salsa'], seconds := 1)").fetchall()
        assert {row[0] for row in rows} == {None}


def test_what_no_generator_can_is_one_line_that_says_how(auto: Path, label: str, scheduler: str) -> None:
    asked = {
        ("--class", "salsa", "--class", label): ("no generator knows them all", "label recordings of each"),
        ("--class", "salsa", "--path", "eight"): (
            '"networks" follows no path',
            "label recordings of salsa in labels.csv",
        ),
        ("--class", "moonwalk"): ("synthesis-1 and pretrained know no such class", "--classes"),
        ("--class", f"{label}:2,{label}", "--seconds", "1"): ("leaves no time",),
        ("--class", label, "--path", "0,0;0,9999", "--seconds", "1"): (label,),
    }
    for words, parts in asked.items():
        run = synthesize(auto, scheduler, *words)
        assert (run.status, len(run.err.strip().splitlines())) == (2, 1), run.err
        assert all(part in run.err for part in parts), run.err


def test_labels_that_come_later_are_told_of(auto: Path, label: str, scheduler: str, tmp_path: Path) -> None:
    lake = Path(shutil.copytree(auto, tmp_path / "lake"))
    with Changed(lake) as con:
        con.execute("UPDATE clips SET label = 'hopping' WHERE label = $l AND format <> 'synthetic'", {"l": label})
    run = synthesize(lake, scheduler, "--class", "hopping")
    assert (run.status, len(run.err.strip().splitlines())) == (2, 1)
    assert "was made without the" in run.err
    assert "`motionlake train synthesis`" in run.err
    assert command("train", "synthesis", "--lake", lake).status == 0
    assert synthesize(lake, scheduler, "--class", "hopping", "--seconds", "1").json["recipe"] == "matching"


def test_labelled_ranges_alone_train_nothing_for_minutes(lake: Path, scheduler: str) -> None:
    with Changed(lake) as con:
        con.execute("DELETE FROM segments")
        con.execute("INSERT INTO segments SELECT clip, 0, frames, 'moves' FROM clips WHERE seconds > 1 LIMIT 3")
        con.execute("UPDATE clips SET label = NULL")
    run = command("run", "synth", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert "(matching), which takes seconds, since the lake has 3 labelled clips or ranges" in run.err
    assert synthesize(lake, scheduler, "--class", "moves", "--seconds", "1").json["recipe"] == "matching"


def test_a_database_of_an_earlier_version_is_made_anew(
    auto: Path, label: str, scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lake = Path(shutil.copytree(auto, tmp_path / "lake"))
    networks = GENERATOR.keyed(SynthesisConfig().networks())
    monkeypatch.setattr("motionlake.stages.generator_model.DATABASE_VERSION", DATABASE_VERSION + 1)
    assert GENERATOR.keyed(SynthesisConfig().networks()) == networks, "networks play no recorded frames"
    run = synthesize(lake, scheduler, "--class", label, "--seconds", "1")
    assert run.status == 2
    assert "by an earlier version; make one for these with" in run.err
    assert command("run", "synth", "--lake", lake, "--scheduler", scheduler).status == 0
    assert synthesize(lake, scheduler, "--class", label, "--seconds", "1").json["model"] == "synthesis-2"


def test_pretrained_networks_give_way_to_labels(lake: Path, scheduler: str) -> None:
    labels = query(lake, "SELECT clip, label FROM clips")
    with Changed(lake) as con:
        con.execute("UPDATE clips SET label = NULL")
        con.execute("DELETE FROM segments")
    common = ("--lake", lake, "--scheduler", scheduler)
    assert "takes the pretrained generator" in command("run", "synth", *common).err
    assert synthesize(lake, scheduler, "--class", "walk", "--seconds", "1").json["recipe"] == "networks"
    with Changed(lake) as con:
        for clip, name in labels:
            con.execute("UPDATE clips SET label = $l WHERE clip = $c", {"l": name, "c": clip})
    run = synthesize(lake, scheduler, "--class", "walk", "--seconds", "1")
    assert (run.status, len(run.err.strip().splitlines())) == (2, 1)
    assert "synthesis-1 is of networks, and recordings of the lake are labelled" in run.err
    assert "`motionlake run synth`, which takes seconds" in run.err
    stages = json.loads(command("status", "--json", "--lake", lake).out)["stages"]
    assert next(row["due"] for row in stages if row["stage"] == "synth") == 1
    assert command("run", "synth", *common).status == 0
    # The copy of the package's networks that the lake has still makes what no recording is labelled with.
    run = synthesize(lake, scheduler, "--class", "salsa", "--seconds", "1")
    assert (run.json["recipe"], run.json["model"]) == ("networks", "synthesis-1")


def test_configurations_that_say_default_mean_networks() -> None:
    assert SynthesisConfig(recipe="default") == SynthesisConfig(recipe="networks")
    assert SynthesisConfig(recipe="networks").kept()["recipe"] == "default"
    assert SynthesisConfig().resolved(labelled=True).recipe == "matching"
    assert SynthesisConfig().resolved(labelled=False).recipe == "networks"
    assert SynthesisConfig(weights="pretrained").resolved(labelled=True).recipe == "networks"
    with pytest.raises(ValueError, match="auto, matching, networks, glogen"):
        SynthesisConfig(recipe="best")


def test_what_a_motion_starts_from_is_in_its_name() -> None:
    names = {
        clip_path(Request(("walk",), 8.0, **more), 1)
        for more in (
            {}, {"start": "a"}, {"start": "b"}, {"start": "a", "outside": True}, {"start": "a", "from_end": True},
            {"start": "b", "from_end": True}, {"split": "test"}, {"min_quality": "ok"},
        )
    }  # fmt: skip
    assert len(names) == 8
    assert "walk-s0-0001" in names


def test_motions_from_two_clips_do_not_replace_one_another(auto: Path, label: str, scheduler: str) -> None:
    clips = [
        row[0]
        for row in query(auto, "SELECT clip FROM clips WHERE format <> 'synthetic' ORDER BY seconds DESC LIMIT 2")
    ]
    made = [
        synthesize(auto, scheduler, "--class", label, "--seconds", "1", "--from", clip, "--dataset", "two").json[
            "clips"
        ][0]
        for clip in clips
    ]
    assert len(set(made)) == 2
    rows = query(auto, "SELECT clip, seed_clip FROM synthetic WHERE clip LIKE 'two/%'")
    assert dict(rows) == dict(zip(made, clips, strict=True))


def test_the_demo_s_labels_name_every_motion_once() -> None:
    with (ROOT / "docs" / "demo" / "labels.csv").open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert len({row["file"] for row in rows}) == len(rows) == 20
    assert {"walk", "run", "dance", "kick", "turn_left"} <= {row["label"] for row in rows}


@pytest.mark.parametrize(
    ("name", "sided"),
    [
        ("turn_left", True), ("Right-hand wave", True), ("draw circle (clockwise)", True), ("counterclockwise", True),
        ("draw_circle_counter-clockwise", True), ("walk", False), ("leftover", False), ("upright", False),
    ],
)  # fmt: skip
def test_names_that_say_a_side(name: str, sided: bool) -> None:
    assert names_a_side(name) is sided


@pytest.mark.recordings
def test_what_is_of_one_side_is_not_mirrored(recordings: Path) -> None:
    clips = clips_of("walk")[:3]
    names = ("walk", "turn left", "turn right")
    data = build_database([matching_clip(c, name) for name, c in zip(names, clips, strict=True)])
    for target, name in enumerate(data.classes):
        mirrored = data.rows[target][data.rows[target] >= len(data)]
        assert len(mirrored) == (len(data.frames[target]) if name == "walk" else 0)
        assert np.isfinite(data.speeds(target)).all()


@pytest.mark.recordings
def test_networks_start_walks_from_walks(recordings: Path) -> None:
    generator = load_generator(PRETRAINED_GENERATOR.file)
    walks, dances = ([seed_of(c) for c in clips_of(name)[:20:2]] for name in ("walk", "martial"))
    near, far = (start_distances(generator, seeds, "walk") for seeds in (walks, dances))
    assert np.median(near) <= 1 < np.median(far)
    assert np.mean(np.array(near) <= 1) > 0.7
    assert np.mean(np.array(far) <= 1) < 0.3
