"""`motionlake.open_lake`: the examples of its docstrings, and answers beside those of the command line."""

from __future__ import annotations

import doctest
import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import motionlake
import numpy as np
import pyarrow as pa
import pytest
from motionlake.motion.skeleton import JOINTS

from tests.lakes import QUICK, quick_lake, write_labels
from tests.lakes import motionlake as command
from tests.samples import deepmimic_frames, deepmimic_text

NAMES = ("walk", "kick", "run", "dance_a", "jump", "spin")
WALK = "clips/humanoid3d_walk.txt"
DOCUMENTED = (
    "motionlake.api",
    "motionlake.lake.rows",
    "motionlake.lake.clip_dataset",
    "motionlake.motion.canonicalise",
    "motionlake.motion.shown",
    "motionlake.pictures.answers",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, scheduler: str) -> Path:
    """A folder with the lake that the examples speak of, "mylake", and its clips."""
    base = tmp_path_factory.mktemp("api")
    (base / "clips").mkdir()
    rows = []
    for i, name in enumerate(NAMES):
        file = base / "clips" / f"humanoid3d_{name}.txt"
        file.write_text(deepmimic_text(deepmimic_frames(60 + 10 * i)))
        rows.append({"file": file.name, "label": name, "split": "train" if i % 2 else "test"})
    write_labels(base / "clips" / "labels.csv", rows)
    lake = quick_lake(base / "mylake", QUICK + '[synthesis]\nweights = "pretrained"\n')
    for words in (["ingest", base / "clips"], ["run", "all"], ["run", "synth"]):
        run = command(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
    return base


@pytest.fixture
def lake(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[motionlake.Lake]:
    monkeypatch.chdir(folder)
    with motionlake.open_lake("mylake") as lake:
        yield lake


@pytest.mark.parametrize("name", DOCUMENTED)
def test_examples_of_docstrings_run(name: str, lake: motionlake.Lake) -> None:
    module = importlib.import_module(name)
    found = doctest.testmod(module, extraglobs={"lake": lake, "motionlake": motionlake})
    assert found.failed == 0
    assert found.attempted > 0 or name != "motionlake.api"


def test_examples_of_the_guide_run(lake: motionlake.Lake) -> None:
    guide = Path(__file__).parents[1] / "docs" / "python.md"
    blocks = re.findall(r"^```pycon\n(.*?)^```", guide.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    examples = doctest.DocTestParser().get_doctest("\n".join(blocks), {}, guide.name, str(guide), 0)
    found = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(examples)
    assert found.failed == 0
    assert found.attempted > 20


def test_every_method_has_an_example() -> None:
    for name, method in vars(motionlake.Lake).items():
        if not name.startswith("_") and name not in ("path", "close"):
            assert ">>> " in (method.__doc__ or ""), name


@pytest.mark.parametrize(
    ("method", "arguments", "words"),
    [
        ("search", {"k": 3}, ["search", WALK, "-k", "3"]),
        ("search", {"method": "alignment"}, ["search", WALK, "--method", "alignment"]),
        ("search", {"mirrored": True, "dataset": "clips"}, ["search", WALK, "--mirrored", "--dataset", "clips"]),
        ("search", {"exact": True, "method": "moves"}, ["search", WALK, "--exact", "--method", "moves"]),
        (
            "find",
            {"method": "moves", "stop": 40, "exact": True},
            ["find", WALK, "--method", "moves", "--to", "40", "--exact"],
        ),
        ("find", {"start": 5, "stop": 40, "own": True}, ["find", WALK, "--from", "5", "--to", "40", "--own"]),
        ("find", {"method": "submotion", "stop": 30}, ["find", WALK, "--method", "submotion", "--to", "30"]),
        ("align", {"stop": 40, "path": True}, ["align", WALK, "--to", "40", "--path"]),
    ],
)
def test_answers_are_those_of_the_command_line(
    lake: motionlake.Lake, method: str, arguments: dict[str, Any], words: list[str]
) -> None:
    rows = getattr(lake, method)(WALK, **arguments)
    run = command(*words, "--json", "--lake", "mylake")
    assert run.status == 0, run.err
    printed = run.json
    assert len(rows) == len(printed) > 0
    for row, expected in zip(rows, printed, strict=True):
        assert {name: row[name] for name in expected if name in row} == {n: v for n, v in expected.items() if n in row}
        assert set(row) == set(expected) - {"query"}
    outside = getattr(lake, method)(Path(WALK), **{n: v for n, v in arguments.items() if n != "own"})
    assert WALK in [row["clip"] for row in outside]  # a file may find the clip that it became


def test_a_clip_and_its_file_are_one_motion(lake: motionlake.Lake) -> None:
    stored, read = lake.motion("humanoid3d_kick"), lake.motion("clips/humanoid3d_kick.txt")
    outside = lake.motion(Path("clips/humanoid3d_kick.txt").absolute())
    assert type(stored) is type(outside)
    assert (len(stored), stored.fps, stored.joints) == (len(outside), outside.fps, JOINTS)
    for name in ("positions", "rotations", "rest_offsets"):
        np.testing.assert_allclose(getattr(stored, name), getattr(outside, name), atol=2e-3)
        np.testing.assert_allclose(getattr(read, name), getattr(outside, name), atol=2e-3)
    part = stored[10:20]
    assert (len(part), part.seconds) == (10, 10 / 30)
    np.testing.assert_array_equal(part.positions, stored.positions[10:20])
    with pytest.raises(ValueError, match="every frame"):
        stored[::2]


def test_rows_have_python_s_numbers(lake: motionlake.Lake) -> None:
    rows = lake.sql("SELECT sum(frames) AS frames, any_value(attributes) AS attributes FROM clips")
    assert rows.fetchall() == [(510, {})]
    assert rows.arrow().schema.field("frames").type == pa.int64()
    assert rows.df()["frames"].tolist() == rows.pl()["frames"].to_list() == [510]
    assert [row["label"] for row in lake.clips(split="train")] == ["dance_a", "kick", "spin"]
    assert len(lake.clips(subject=None)) == len(NAMES)
    assert lake.frames(where="frames > 90").num_rows == 100 + 110
    assert set(lake.frames(split="test", columns=["clip"]).column("clip").to_pylist()) == {
        row["clip"] for row in lake.clips(split="test")
    }


@pytest.mark.parametrize("method", ["df", "pl"])
def test_a_missing_package_is_named(lake: motionlake.Lake, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    rows = lake.sql("SELECT 1 AS one")
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(motionlake.UserError, match=r"pip install 'motionlake\[frames\]'") as said:
        getattr(rows, method)()
    assert "\n" not in str(said.value)


def test_mistakes_are_said_in_one_line(lake: motionlake.Lake) -> None:
    mistakes: dict[str, Callable[[], object]] = {
        "no lake here": lambda: motionlake.open_lake("clips"),
        "no such clip": lambda: lake.motion("nobody"),
        "SQL: .*nonsense": lambda: lake.sql("SELECT nonsense FROM clips"),
        "SQL: .*nope": lambda: lake.clips("nope = 1"),
        "no column colour": lambda: lake.clips(colour="red"),
        "no statement": lambda: lake.sql("-- nothing"),
        "not one of": lambda: lake.search("humanoid3d_walk", method="luck"),
        "not one of fused, words": lambda: lake.find("humanoid3d_walk", method="luck"),
        "knows no such class": lambda: lake.synthesize("moonwalk"),
        "exact: is for --method alignment, sub": lambda: lake.find("humanoid3d_walk", method="words", exact=True),
        "exact: is for a clip without a text": lambda: lake.search("humanoid3d_walk", text="kick", exact=True),
        "not a range": lambda: lake.find("humanoid3d_walk", 5, 5000),
    }
    for pattern, mistake in mistakes.items():
        with pytest.raises(motionlake.UserError, match=pattern) as said:
            mistake()
        assert "\n" not in str(said.value)


def test_what_runs_add_is_seen(folder: Path, tmp_path: Path, scheduler: str) -> None:
    """A lake that is open answers from the catalog that is served, not from the one that it was opened with."""
    source = tmp_path / "clips"
    source.mkdir()
    (source / "a.txt").write_text(deepmimic_text(deepmimic_frames(50)))
    path = quick_lake(tmp_path / "lake")
    with motionlake.open_lake(path) as lake:
        assert len(lake.clips()) == 0
        assert command("ingest", source, "--lake", path, "--scheduler", scheduler).status == 0
        assert [row["clip"] for row in lake.clips()] == ["clips/a.txt"]
        assert lake.frames("a").num_rows == 50
        with motionlake.open_lake(path) as second:  # a process may have a lake open more than once
            (source / "b.txt").write_text(deepmimic_text(deepmimic_frames(60)))
            assert command("ingest", source, "--lake", path, "--scheduler", scheduler).status == 0
            assert len(second.clips()) == len(lake.clips()) == 2


def test_two_connections_of_a_process_have_the_functions(lake: motionlake.Lake) -> None:
    text = "SELECT count(*) FROM similar_clips($clip, 2)"
    first = motionlake.connect("mylake")
    second = motionlake.connect("mylake")
    try:
        assert (
            first.execute(text, {"clip": WALK}).fetchall() == second.execute(text, {"clip": WALK}).fetchall() == [(2,)]
        )
        assert second.cursor().execute("SELECT count(*) FROM clips").fetchall() == [(6,)]
    finally:
        first.close()
        second.close()


def test_synthesized_motion_is_that_of_sql(lake: motionlake.Lake) -> None:
    motion = lake.synthesize(["walk", "salsa"], 2.0, seed=3, start=WALK)
    text = "SELECT root_x, head_y FROM synthesize(['walk', 'salsa'], 2.0, seed := 3, start := $start) ORDER BY frame"
    stored = np.array(lake.sql(text, {"start": WALK}).fetchall())
    np.testing.assert_allclose(stored[:, 0], motion.positions[:, 0, 0], atol=1e-3)
    np.testing.assert_allclose(stored[:, 1], motion.positions[:, JOINTS.index("head"), 1], atol=1e-3)
    assert not np.allclose(motion.positions, lake.synthesize(["walk", "salsa"], 2.0, seed=4, start=WALK).positions)
