"""Synthesis of motion that cannot be, or is cut short: one clear line, or the same clips in the end."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.lakes import Changed, assert_same, motionlake, query, tables
from tests.test_lake_faults import CATALOG, kill_driver_at

STARTED = ("frames/dataset=synthetic/.*.tmp",)
DONE = ("frames/dataset=synthetic/[!.]*.parquet",)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    """The small lake with a generator that has seen its clips once, and its classes made known."""
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("faults") / "lake"))
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write('[synthesis]\nrecipe = "networks"\nepochs = 1\n')
    run = motionlake("train", "synthesis", "--lake", lake)
    assert run.status == 0, run.err
    return lake


@pytest.fixture
def own(trained: Path, tmp_path: Path) -> Path:
    """The trained lake, to change."""
    return Path(shutil.copytree(trained, tmp_path / "own"))


@pytest.fixture(scope="module")
def name(trained: Path) -> str:
    """A class with a clip that is long enough to start from."""
    rows = query(trained, "SELECT label FROM clips ORDER BY seconds DESC, clip LIMIT 1")
    return str(rows[0][0])


def test_a_killed_driver_goes_on_to_the_same_clips(own: Path, name: str, scheduler: str, tmp_path: Path) -> None:
    other = Path(shutil.copytree(own, tmp_path / "undisturbed"))
    command = ["synthesize", "--class", name, "--seconds", "1", "--count", "80"]
    assert motionlake(*command, "--lake", other, "--scheduler", scheduler).status == 0
    # A request that nobody goes on with: what it planned is forgotten, which may or may not have been served by then.
    assert kill_driver_at(own, [*command, "--seed", "9"], [STARTED]) == 1
    with Changed(own) as con:
        con.execute(
            "INSERT INTO manifest BY NAME SELECT 'synthesize' AS stage, 'none' AS key, 'none' AS part, "
            "'synthetic' AS dataset, 'planned' AS state, 0 AS attempts, 0 AS rows, 0 AS bytes, '{}' AS spec, "
            "[] AS files"
        )
    assert set(query(own, "SELECT state FROM manifest WHERE stage = 'synthesize'")) == {("planned",)}
    assert kill_driver_at(own, command, [(CATALOG,), DONE]) == 2
    there = query(own, "SELECT count(*) FROM synthetic")[0][0]
    run = motionlake(*command, "--json", "--lake", own, "--scheduler", scheduler)
    assert (run.status, run.json["there"], run.json["made"]) == (0, there, 80 - there)
    assert_same(tables(other), tables(own))
    assert not [p for p in own.rglob("*") if p.name.endswith(".tmp")]


def misspelt(name: str) -> str:
    return name[:-1] + "x"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "name one class at least"),
        (("--class", "MISSPELT"), "knows no such class; closest are CLASS"),
        (("--class", "MISSPELT"), "`motionlake synthesize --classes`"),
        (("--class", "CLASS", "--class", "0123456789"), "0123456789: synthesis-1 knows no such class; all "),
        (("--class", "CLASS", "--seconds", "0"), "0 seconds: ask for more than 0"),
        (("--class", "CLASS", "--seconds=-3"), "-3 seconds: ask for more than 0"),
        (("--class", "CLASS", "--seconds", "nan"), "nan seconds: ask for more than 0"),
        (("--class", "CLASS", "--seconds", "1e9"), "at most 3600"),
        (("--class", "CLASS", "--count", "0"), "--count 0: ask for one motion at least"),
        (("--class", "CLASS", "--pace", "0"), "pace 0: must be more than 0"),
        (("--class", "CLASS", "--pace", "inf"), "pace inf: must be more than 0"),
        (("--class", "CLASS", "--temperature=-1"), "temperature -1: must be 0 or more"),
        (("--class", "CLASS", "--seed=-1"), "seed -1: must be 0 or more"),
        (("--class", "CLASS", "--from", "nowhere"), "nowhere: no such clip in the lake"),
        (("--class", "CLASS", "--from", "SHORT"), "to start from it needs"),
        (("--class", "CLASS", "--split", "test"), "no clip has a split"),
        (("--class", "CLASS", "--from", "SHORT", "--split", "test"), "leave one out"),
        (("--class", "CLASS", "--dataset", "clips"), "clips: holds recorded clips"),
        (("--class", "CLASS", "--dataset", "a/b"), "dataset 'a/b': use letters"),
        (("--class", "CLASS", "--bvh", "FILE/folder"), "is no folder and cannot be made one"),
    ],
)
def test_what_cannot_be_made_is_one_clear_line(
    trained: Path, name: str, words: Sequence[str], said: str, tmp_path: Path
) -> None:
    lake, short = trained, query(trained, "SELECT clip FROM clips ORDER BY seconds, clip LIMIT 1")[0][0]
    if "SHORT" in words:
        lake = Path(shutil.copytree(trained, tmp_path / "lake"))
        shorten(lake, short)
    (tmp_path / "file").write_text("", encoding="utf-8")
    folder = str(tmp_path / "file" / "folder")
    meant = {"CLASS": name, "MISSPELT": misspelt(name), "SHORT": short, "FILE/folder": folder}
    run = motionlake("synthesize", *[meant.get(word, word) for word in words], "--lake", lake)
    assert run.status == 2
    lines = [line for line in run.err.splitlines() if line.startswith("motionlake: ")]
    assert len(lines) == 1
    assert said.replace("CLASS", name) in lines[0]
    assert query(lake, "SELECT count(*) FROM manifest WHERE stage = 'synthesize'") == [(0,)]


def shorten(lake: Path, clip: str) -> None:
    """Have the lake say that a clip has three frames."""
    con = Changed(lake)
    con.execute("UPDATE clips SET frames = 3 WHERE clip = $clip", {"clip": clip})
    con.close()


def test_a_class_without_a_clip_to_start_from(own: Path, name: str, scheduler: str) -> None:
    con = Changed(own)
    con.execute("UPDATE clips SET split = 'train', frames = if(label = $name, 3, frames)", {"name": name})
    con.close()
    command = ("synthesize", "--class", name, "--lake", own, "--scheduler", scheduler)
    assert f"of class {name} are too short to start from" in motionlake(*command).err
    assert "no clip is of split 'test'; the splits there are: train" in motionlake(*command, "--split", "test").err
    con = Changed(own)
    con.execute("UPDATE clips SET label = NULL WHERE label = $name", {"name": name})
    con.close()
    run = motionlake(*command, "--seconds", "1")  # from what begins most like it
    assert run.status == 0, run.err
    rows = query(own, "SELECT o.label FROM synthetic JOIN clips o ON o.clip = seed_clip")
    assert [row[0] is None for row in rows] == [False]


def test_no_generator_and_nothing_to_train_one_on(lake: Path, scheduler: str) -> None:
    for command in (("synthesize", "--class", "walk"), ("synthesize", "--classes"), ("sql", "FROM synthesize('walk')")):
        run = motionlake(*command, "--lake", lake)
        assert (run.status, run.err.count("has no generator yet; get one with `motionlake run synth`")) == (
            2,
            1,
        )
    for words, said in (
        (("--split", "train"), "no clip has a split"),
        (("--dataset", "nowhere"), "nowhere: no such dataset in"),
    ):
        run = motionlake("train", "synthesis", *words, "--lake", lake)
        assert (run.status, said in run.err) == (2, True), run.err
    con = Changed(lake)
    con.execute("UPDATE clips SET label = NULL")
    con.close()
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write('[synthesis]\nweights = "own"\n')
    for command in (("train", "synthesis"), ("run", "synth")):
        run = motionlake(*command, "--lake", lake)
        assert (run.status, "has a label, and a generator learns motion by class" in run.err) == (2, True), run.err


def test_a_generator_for_another_configuration_says_so(own: Path, name: str) -> None:
    with (own / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write("seed = 4\n")
    run = motionlake("synthesize", "--class", name, "--lake", own)
    assert (run.status, "synthesis-1 was made for other values of [synthesis]" in run.err) == (2, True)


def test_recorded_clips_do_not_join_synthetic_ones(
    own: Path, name: str, scheduler: str, clips_folder: Path, tmp_path: Path
) -> None:
    assert (
        motionlake("synthesize", "--class", name, "--seconds", "1", "--lake", own, "--scheduler", scheduler).status == 0
    )
    before = tables(own)
    run = motionlake("ingest", clips_folder, "--dataset", "synthetic", "--lake", own, "--scheduler", scheduler)
    assert (run.status, "dataset synthetic: holds synthetic clips" in run.err) == (2, True)
    run = motionlake("synthesize", "--class", name, "--from", f"{name}-s0-0001", "--lake", own)
    assert (run.status, "is synthetic; start from a recorded clip" in run.err) == (2, True)
    assert_same(before, tables(own))


def test_motion_in_sql_is_the_first_of_the_command(own: Path, name: str, scheduler: str) -> None:
    other = query(own, "SELECT label FROM clips WHERE label <> $name ORDER BY seconds DESC, clip LIMIT 1", name=name)[
        0
    ][0]
    command = ("synthesize", "--class", name, "--class", other, "--seconds", "1.5", "--seed", "3", "--pace", "1.2")
    run = motionlake(*command, "--json", "--lake", own, "--scheduler", scheduler)
    assert run.status == 0, run.err
    wanted = f"synthesize(['{name}', '{other}'], seconds := 1.5, seed := 3, pace := 1.2)"
    text = (
        "SELECT count(*) AS frames, (SELECT count(*) FROM frames WHERE dataset = 'synthetic') AS stored, "
        f"(SELECT count(*) FROM (SELECT * EXCLUDE (time, class, seed_clip, source, source_frame) FROM {wanted} "
        "INTERSECT "
        "SELECT * EXCLUDE (clip, dataset, fps) FROM frames WHERE dataset = 'synthetic')) AS same, "
        f"list(DISTINCT class ORDER BY class) AS classes, max(time) AS last FROM {wanted}"
    )
    row = motionlake("sql", text, "--json", "--lake", own).json[0]
    assert row["frames"] == row["stored"] == row["same"] > 30
    assert row["classes"] == sorted([name, other])
    assert row["last"] == pytest.approx((row["frames"] - 1) / 30)
    single = motionlake(
        "sql", f"SELECT DISTINCT class FROM synthesize('{name}', seconds := 1)", "--json", "--lake", own
    )
    assert single.json == [{"class": name}]
    for wrong, said in (
        (f"'{misspelt(name)}'", f"closest are {name}"),
        (f"'{name}', seconds := 0", "0 seconds: ask for more than 0"),
        (f"'{name}', pace := -1", "pace -1: must be more than 0"),
        (f"'{name}', start := 'nowhere'", "nowhere: no such clip"),
    ):
        run = motionlake("sql", f"FROM synthesize({wrong})", "--lake", own)
        assert (run.status, said in run.err, run.err.count("\n")) == (2, True, 1), run.err
