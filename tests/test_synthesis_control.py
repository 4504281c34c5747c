"""What a request of motion says of time and way: read, refused in one clear line, and done in a lake in three ways."""

from __future__ import annotations

import csv
import json
import math
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motionlake.api import Lake
from motionlake.arrays import Float64Array
from motionlake.errors import UserError
from motionlake.lake.models import Model
from motionlake.motion.skeleton import body_length
from motionlake.stages.synthesis_control import Request, shaping
from motionlake.stages.synthesis_diversity import SHIFTS, distance, floor_of, poses
from motionlake.stages.synthesis_options import facing_of, path_of, path_text, timed_classes
from motionlake.stages.synthesis_settling import settled

from tests.lakes import Changed, Run, query
from tests.lakes import motionlake as command

SPEEDS = {"walk": [0.9, 1.2, 1.6], "run": [2.5, 3.0, 3.5], "dance": None}
MODEL = Model(
    "synthesis-1",
    "synthesis",
    "",
    "",
    {"class_names": sorted(SPEEDS), "speeds": SPEEDS, "aside": {"walk": 0.01, "dance": 0.4}},
)


def asked(*classes: str, seconds: float | None = None, **more: object) -> Request:
    return settled(Request(classes or ("walk",), seconds, **more), MODEL)  # type: ignore[arg-type]


def test_seconds_of_classes() -> None:
    assert timed_classes(["walk", "run"]) == (("walk", "run"), None)
    assert timed_classes(["walk:3", "turn left:0.5"]) == (("walk", "turn left"), (3.0, 0.5))
    assert timed_classes(["a:b:2"]) == (("a:b",), (2.0,))
    assert timed_classes(["a:b"]) == (("a:b",), None)
    assert timed_classes([]) == ((), None)
    assert timed_classes(["walk:3", "run"]) == (("walk", "run"), (3.0, None))
    assert timed_classes(["walk:3,turn_left:1,kick"]) == (("walk", "turn_left", "kick"), (3.0, 1.0, None))
    assert timed_classes(["walk,kick"]) == (("walk", "kick"), None)
    assert timed_classes(["run, leap:3"]) == (("run, leap",), (3.0,))
    with pytest.raises(UserError, match="walk: must last more than 0 seconds"):
        timed_classes(["walk:0"])


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("x,z\n0,0\n0,2\n", [(0, 0), (0, 2)]), ("0,0\n1,2\n\n", [(0, 0), (1, 2)]),
        ("time,z,x\n0,0,0\n1,2,1\n", [(0, 0), (1, 2)]), ("X, Z\n0, 0\n1, 2\n", [(0, 0), (1, 2)]),
    ],
)  # fmt: skip
def test_a_file_of_points(tmp_path: Path, text: str, points: Sequence[tuple[float, float]]) -> None:
    file = tmp_path / "way.csv"
    file.write_text(text, encoding="utf-8")
    np.testing.assert_allclose(path_of(path_text(str(file))).points, path_of(path_text(points)).points)
    with pytest.raises(UserError, match="files are not read here"):
        path_text(str(file), files=False)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,z\n0,0\n", "one point"), ("", "one point"), ("a,b\n0,0\n", "no columns x and z"),
        ("x,z\n0,0\n0\n", "row 3 holds no point"), ("0,0\n0,nan\n", "row 2 holds no point"),
    ],
)  # fmt: skip
def test_a_file_that_holds_no_path(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "way.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=said):
        path_text(file)


@pytest.mark.parametrize(
    "text", ["circle:x", "circle:0", "oval", "1,2", "1,2;3", "1,2;1,2", "nowhere.csv", "0,0;inf,1"]
)
def test_what_is_no_path(text: str) -> None:
    with pytest.raises(UserError, match="path"):
        path_text(text)


def test_seconds_and_speed_follow_from_one_another() -> None:
    assert asked().seconds == 8.0
    assert asked("walk", "run", shares=(3.0, 2.0)).seconds == 5.0
    way = asked(path="0,0;0,12")
    assert (way.seconds, way.speed) == pytest.approx((10.0, 1.2), rel=0.01)
    assert asked(path="0,0;0,12", seconds=8.0).speed == pytest.approx(1.5, rel=0.01)
    assert asked(path="0,0;0,12", speed=1.0).seconds == pytest.approx(12.0, rel=0.01)
    assert asked(path="circle:2", seconds=30.0).speed == pytest.approx(1.2)
    loop = asked(path="circle:2", seconds=20.0, loop=True)
    assert loop.speed is not None
    assert loop.speed * 20 == pytest.approx(2 * path_of("circle:2").length)
    assert asked("walk", "run", path="eight", shares=(3.0, 2.0)).speed is None
    assert facing_of("path") is None
    assert facing_of("90") == 90.0


@pytest.mark.parametrize(
    ("wish", "said"),
    [
        ({"path": "0,0;0,100", "seconds": 1.0}, "walk goes .* not 100; 100.* m need"),
        ({"path": "0,0;0,5", "seconds": 60.0}, "walk goes"), ({"speed": 9.0}, "walk goes"),
        ({"speed": -1.0}, "more than 0 metres a second"), ({"speed": float("nan")}, "more than 0 metres a second"),
        ({"classes": ("dance",), "path": "circle"}, "stays where it is"),
        ({"classes": ("walk", "run"), "path": "circle"}, "say how long each lasts"),
        ({"classes": ("walk", "run"), "shares": (1.0, 2.0), "seconds": 9.0}, "last 3 seconds together"),
        ({"facing": 90.0}, "give --path"),
        ({"facing": 90.0, "path": "circle"}, "going ahead alone"),
        ({"path": "circle", "pace": 2.0}, "leave --pace out"),
        ({"loop": True, "from_end": True, "start": "a"}, "--continue"), ({"loop": True, "seconds": 1.0}, "2 at least"),
        ({"loop": True, "path": "0,0;0,5"}, "ends where it begins"), ({"seconds": 1e9}, "at most"),
        ({"classes": ()}, "name one class"), ({"classes": ("moonwalk",)}, "knows no such class"),
    ],
)  # fmt: skip
def test_what_does_not_fit_together(wish: dict[str, object], said: str) -> None:
    whole = {"classes": ("walk",), "seconds": None} | wish
    with pytest.raises(UserError, match=said):
        settled(Request(**whole), MODEL)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wish", [{"path": "circle"}, {"speed": 1.0}, {"loop": True}, {"from_end": True}, {"shares": (1.0,)}]
)
def test_networks_that_cannot_say_what_can(wish: dict[str, object]) -> None:
    networks = replace(MODEL, metrics={"class_names": ["walk"], "recipe": "networks"})
    request = Request(("walk",), None, **wish)  # type: ignore[arg-type]
    with pytest.raises(UserError, match=r'recipe "networks" .*"matching" can: label recordings of walk in labels.csv'):
        settled(request, networks)
    with pytest.raises(UserError, match=r'"matching" can: set \[synthesis\] recipe = "auto" in config.toml'):
        settled(request, networks, "networks")


def test_what_is_not_asked_for_changes_no_key() -> None:
    assert sorted(shaping(Request(("walk",), 8.0))) == ["classes", "pace", "seconds", "seed", "temperature"]
    assert "path" in shaping(Request(("walk",), 8.0, path="circle"))


@pytest.fixture(scope="module")
def matching(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    """The small lake, whose clips are labelled, with a generator that plays recorded frames."""
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("matching") / "lake"))
    run = command("run", "synth", "--lake", lake)
    assert run.status == 0, run.err
    assert "(matching), which takes seconds" in run.err
    return lake


def synthesize(lake: Path, scheduler: str, *words: str | Path) -> Run:
    return command("synthesize", *words, "--seed", "7", "--json", "--lake", lake, "--scheduler", scheduler)


@pytest.fixture(scope="module")
def label(matching: Path) -> str:
    rows = query(matching, "SELECT label FROM clips WHERE label IS NOT NULL ORDER BY seconds DESC, clip LIMIT 1")
    return str(rows[0][0])


@pytest.fixture(scope="module")
def speed(matching: Path, label: str) -> float:
    """Metres a second between the slowest and the fastest of the class; any, where it stays in its place."""
    (told,) = query(matching, "SELECT metrics FROM models WHERE kind = 'synthesis'")
    rates = json.loads(told[0])["speeds"][label]
    return float(rates[1]) if rates else 0.8


def test_command_sql_and_python_make_the_same_motion(
    matching: Path, label: str, speed: float, scheduler: str, tmp_path: Path
) -> None:
    lineage = tmp_path / "from.csv"
    words = ("--class", f"{label}:3", "--path", "circle:2", "--speed", f"{speed}", "--count", "2", "--lineage", lineage)
    run = synthesize(matching, scheduler, *words)
    assert run.status == 0, run.err
    assert (run.json["made"], run.json["seconds"]) == (2, pytest.approx(6.0, abs=0.1))
    with lineage.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert {row["clip"] for row in rows} == set(run.json["clips"])
    ((config,),) = query(matching, "SELECT DISTINCT config FROM synthetic")
    assert json.loads(config)["control"] == {"path": "circle:2", "speed": speed, "shares": [3.0]}
    recorded = {clip for (clip,) in query(matching, "SELECT clip FROM clips WHERE format <> 'synthetic'")}
    assert {row["source"] for row in rows} <= recorded
    first = [row for row in rows if row["clip"] == run.json["clips"][0]]
    assert [int(row["start"]) for row in first] == [0, *(int(row["stop"]) for row in first[:-1])]
    text = (
        "SELECT source, root_x, root_z FROM synthesize([$label], path := 'circle:2', speed := $speed, seed := 7) "
        "ORDER BY frame"
    )
    with Lake(matching) as lake:
        made = lake.sql(text, {"label": f"{label}:3", "speed": speed}).fetchall()
        motion = lake.synthesize(f"{label}:3", path="circle:2", speed=speed, seed=7)
    assert made[0][0] == first[0]["source"]
    assert int(first[-1]["stop"]) == len(made) == 90
    kept = query(
        matching, "SELECT root_x, root_z FROM frames WHERE clip = $clip ORDER BY frame", clip=run.json["clips"][0]
    )
    np.testing.assert_allclose([row[1:] for row in made], kept, atol=1e-3)
    np.testing.assert_allclose(motion.root[:, [0, 2]], kept, atol=1e-3)


def test_a_class_without_seconds_lasts_as_its_recordings_do(matching: Path, label: str) -> None:
    ((usual,),) = query(
        matching,
        "SELECT median(frames / fps) FROM clips WHERE label = $label AND format <> 'synthetic' AND seconds > 0.8",
        label=label,
    )
    with Lake(matching) as lake:
        assert len(lake.synthesize(f"{label}:1,{label}").positions) == pytest.approx(30 * (1 + usual), abs=1)
        assert len(lake.synthesize(f"{label}:1,{label}", 2.5).positions) == 75
        with pytest.raises(UserError, match="--seconds 1 leaves no time for"):
            lake.synthesize(f"{label}:1,{label}", 1.0)


def test_a_motion_goes_on_from_the_end_of_a_clip(matching: Path, label: str, scheduler: str) -> None:
    clip, frames = query(matching, "SELECT clip, frames FROM clips WHERE label = $label LIMIT 1", label=label)[0]
    run = synthesize(matching, scheduler, "--class", label, "--continue", clip, "--seconds", "2", "--dataset", "on")
    assert run.status == 0, run.err
    found = query(matching, "SELECT seed_clip, seed_stop FROM synthetic WHERE clip = $clip", clip=run.json["clips"][0])
    assert found[0][0] == clip
    assert found[0][1] > 0.9 * frames


def test_the_distance_of_motions_is_a_naive_one() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(12, 21, 3)), rng.normal(size=(9, 21, 3))
    found = []
    for shift in range(-SHIFTS, SHIFTS + 1):
        pairs = [(i, i - shift) for i in range(12) if 0 <= i - shift < 9]
        apart = [math.dist(one[i, k], other[j, k]) for i, j in pairs for k in range(21)]
        found.append(sum(apart) / len(apart))
    assert distance(one, other) == pytest.approx(min(found))
    assert distance(one[2:], one) == 0.0
    assert floor_of([one, other]) is None


def test_motions_that_are_asked_to_differ_do_or_are_named(
    matching: Path, label: str, scheduler: str, tmp_path: Path
) -> None:
    matching = Path(shutil.copytree(matching, tmp_path / "lake"))
    with Changed(matching) as con:  # more of one class, so that there are some to measure by
        con.execute("UPDATE clips SET label = $label WHERE format <> 'synthetic' AND seconds > 1", {"label": label})
    words = ("--class", label, "--seconds", "2", "--diverse", "--dataset")
    few = synthesize(matching, scheduler, *words, "few", "--count", "3")
    many = synthesize(matching, scheduler, *words, "many", "--count", "6")
    assert many.status == 0, many.err
    made = [frames_of(matching, clip) for clip in many.json["clips"]]
    sizes = [
        body_length(np.array(offsets).reshape(-1, 3))
        for (offsets,) in query(matching, "SELECT rest_offsets FROM clips WHERE dataset = 'many' ORDER BY clip")
    ]
    seen = [poses(one, 30.0, size) for one, size in zip(made, sizes, strict=True)]
    for i, clip in enumerate(many.json["clips"]):
        near = min((distance(seen[i], seen[j]) for j in range(i)), default=math.inf)
        assert (near < many.json["floor"] - 1e-3) <= (clip in many.json["alike"])
    for clip, own in zip(few.json["clips"], made, strict=False):
        np.testing.assert_allclose(frames_of(matching, clip), own, atol=1e-6)
    # From one clip, with nothing left to chance, all are alike.
    ((start,),) = query(
        matching,
        "SELECT clip FROM clips WHERE label = $label AND format <> 'synthetic' ORDER BY ALL LIMIT 1",
        label=label,
    )
    same = synthesize(
        matching, scheduler, *words, "same", "--count", "3", "--from", start, "--temperature", "0",
    )  # fmt: skip
    assert same.status == 0, same.err
    assert same.json["alike"] == same.json["clips"][1:]
    assert "2 of 3 motions are nearer to another than recorded clips" in same.err


def frames_of(lake: Path, clip: str) -> Float64Array:
    """[F, 21, 3] joints."""
    rows = query(lake, "SELECT COLUMNS('_[xyz]$') FROM frames WHERE clip = $clip ORDER BY frame", clip=clip)
    table = np.array(rows, dtype=float)
    return table.reshape(len(rows), -1, 3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--path", "1,1"), "one point"), (("--path", "nowhere.csv"), "cannot be read"),
        (("--continue", "a", "--from", "b"), "leave one out"), (("--facing", "up"), "degrees"),
        (("--lineage", "nowhere/from.csv"), "nowhere"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(matching: Path, label: str, scheduler: str, words: tuple[str, ...], said: str) -> None:
    run = synthesize(matching, scheduler, "--class", label, *words)
    assert run.status == 2
    assert said in run.err
    assert run.err.count("\n") == 1
