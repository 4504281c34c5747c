"""What a second run does: nothing that is done already, and no more than what has changed asks for."""

from __future__ import annotations

import csv
import gzip
import shutil
from pathlib import Path

import pytest

from tests.lakes import QUICK, Run, assert_same, files, motionlake, query, tables, write_labels


def ingest(source: Path, lake: Path, scheduler: str, *more: str | Path) -> Run:
    return motionlake("ingest", source, "--lake", lake, "--scheduler", scheduler, "--json", *more)


def run_all(lake: Path, scheduler: str, *more: str) -> dict[str, int]:
    """Shards made, by stage."""
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler, "--json", *more)
    assert run.status == 0, run.err
    return {row["stage"]: row["shards"] for row in run.json}


@pytest.fixture(scope="module")
def taken_in(tmp_path_factory: pytest.TempPathFactory, built_lake: Path, clips_folder: Path, scheduler: str) -> Path:
    """A folder with a copy of the clips under their own name, and a lake that has taken in these and no others."""
    folder = tmp_path_factory.mktemp("mine")
    lake = Path(shutil.copytree(built_lake, folder / "lake"))
    source = Path(shutil.copytree(clips_folder, folder / "clips"))
    motionlake("remove", "--dataset", "clips", "--lake", lake)
    run = ingest(source, lake, scheduler)
    assert run.status == 0, run.err
    run_all(lake, scheduler)
    shutil.copytree(source, folder / "untouched")
    return folder


@pytest.fixture
def source(taken_in: Path) -> Path:
    """The copy of the clips as it was taken in, so that a test may change it."""
    shutil.rmtree(taken_in / "clips")
    return Path(shutil.copytree(taken_in / "untouched", taken_in / "clips"))


@pytest.fixture
def own_lake(tmp_path: Path, taken_in: Path) -> Path:
    """A copy of the lake that has taken in `source`."""
    return Path(shutil.copytree(taken_in / "lake", tmp_path / "lake"))


def clip_files(source: Path) -> list[Path]:
    return sorted(p for p in source.rglob("*") if p.suffix in {".bvh", ".amc", ".npz", ".skeleton", ".txt"})


def test_a_second_run_does_nothing(lake: Path, clips_folder: Path, scheduler: str) -> None:
    before, held, stamps = tables(lake), files(lake), query(lake, "FROM manifest ORDER BY ALL")
    run = ingest(clips_folder, lake, scheduler)
    assert run.status == 0
    assert (run.json["clips"], run.json["unchanged"]) == (0, len(clip_files(clips_folder)))
    assert set(run_all(lake, scheduler).values()) == {0}
    assert_same(before, tables(lake))
    assert query(lake, "FROM manifest ORDER BY ALL") == stamps
    assert files(lake) == held


def test_a_file_with_a_new_date_and_the_old_content_is_not_read_again(
    own_lake: Path, source: Path, scheduler: str
) -> None:
    stamps = query(own_lake, "FROM manifest ORDER BY ALL")
    clip_files(source)[0].touch()
    assert ingest(source, own_lake, scheduler).json["clips"] == 0
    assert query(own_lake, "FROM manifest ORDER BY ALL") == stamps
    assert ingest(source, own_lake, scheduler).json["unchanged"] == len(clip_files(source))


def test_one_new_clip_costs_one_clip(own_lake: Path, source: Path, scheduler: str) -> None:
    before, held = tables(own_lake), files(own_lake)
    first = clip_files(source)[0]
    shutil.copyfile(first, first.with_name("twin" + first.suffix))
    for companion in first.parent.glob("*.asf"):
        companion.touch()
    report = ingest(source, own_lake, scheduler).json
    assert report["clips"] == 1
    assert run_all(own_lake, scheduler) == {
        "frames": 0,
        "words": 1,
        "embed": 1,
        "motifs": 1,
        "signatures": 1,
        "mirrored": 1,
        "postures": 1,
        "symbols": 1,
        "moves": 1,
        "descriptors": 1,
        "submotions": 1,
        "graph": 1,
        "shortlist": 0,
        "windows": 0,
    }
    after = tables(own_lake)
    assert len(after["clips"]) == len(before["clips"]) + 1
    assert set(before["signatures"]) < set(after["signatures"])
    assert after["models"] == before["models"]
    assert after["motifs"] == before["motifs"]
    assert after["postures"] == before["postures"]
    assert set(before["symbol_strings"]) < set(after["symbol_strings"])
    kept = {file for file in held if not file.startswith("graph/")}  # of which every clip may be a neighbour
    assert kept < files(own_lake)
    twins = query(
        own_lake,
        "SELECT signature FROM signatures JOIN clips USING (clip) WHERE path IN ($first, $twin)",
        first=first.relative_to(source).as_posix(),
        twin=first.with_name("twin" + first.suffix).relative_to(source).as_posix(),
    )
    assert len(twins) == 2
    assert twins[0] == twins[1]


def test_a_changed_clip_replaces_its_rows(own_lake: Path, source: Path, scheduler: str) -> None:
    first, second = clip_files(source)[:2]
    shutil.copyfile(second, first)
    assert ingest(source, own_lake, scheduler).json["clips"] == 1
    run_all(own_lake, scheduler)
    names = [p.relative_to(source).as_posix() for p in (first, second)]
    rows = query(own_lake, "SELECT path, frames, content_hash, signature FROM clips JOIN signatures USING (clip)")
    found = {path: rest for path, *rest in rows}
    assert found[names[0]] == found[names[1]]
    assert len(rows) == len(clip_files(source))
    assert query(own_lake, "SELECT count(*), count(DISTINCT (clip, frame)) FROM frames") == query(
        own_lake, "SELECT sum(frames), sum(frames) FROM clips"
    )


def test_changed_labels_recompute_nothing(own_lake: Path, source: Path, scheduler: str) -> None:
    stamps = query(own_lake, "FROM manifest ORDER BY ALL")
    with (source / "labels.csv").open(encoding="utf-8") as handle:
        rows = [{**row, "label": f"new {i}"} for i, row in enumerate(csv.DictReader(handle))]
    twice = {**rows[0], "label": "overruled"}
    write_labels(source / "labels.csv", [twice, *rows, {**twice, "file": "../../outside.bvh"}])
    write_labels(
        source / "segments.csv",
        [{"file": rows[0]["file"], "start": "0", "stop": "9", "label": "a"},
         {"file": rows[0]["file"], "start": "5", "stop": "12", "label": "b"}],
    )  # fmt: skip
    run = ingest(source, own_lake, scheduler)
    assert run.json["clips"] == 0
    assert "labels.csv: 1 of" in run.err
    assert set(run_all(own_lake, scheduler).values()) == {0}
    assert query(own_lake, "FROM manifest ORDER BY ALL") == stamps
    assert {r[0] for r in query(own_lake, "SELECT label FROM clips")} == {row["label"] for row in rows}
    assert query(own_lake, "SELECT start, stop, label FROM segments ORDER BY start") == [(0, 9, "a"), (5, 12, "b")]


@pytest.mark.parametrize(
    ("config", "redone"),
    [
        (QUICK.replace("k = 12", "k = 9"), {"motifs", "signatures", "mirrored", "graph"}),
        (QUICK.replace("max_words = 500", "max_words = 60"), {"embed", "motifs", "signatures", "mirrored", "graph"}),
        (QUICK + "[words]\nstride = 8\n", {"words", "embed", "motifs", "signatures", "mirrored", "graph"}),
        (QUICK.replace("m = 40", "m = 30"), {"postures", "symbols", "graph"}),
        (QUICK + "[symbols]\nruns = false\n", {"symbols", "graph"}),
        (QUICK + "[alignment]\nstride = 3\n", {"graph"}),
        (QUICK + "[descriptors]\nseed = 1\n", {"descriptors", "graph"}),
        (QUICK + "[submotion]\nseed = 1\n", {"submotions"}),
    ],
)
def test_a_changed_configuration_redoes_its_stage_and_what_hangs_on_it(
    lake: Path, scheduler: str, config: str, redone: set[str]
) -> None:
    frames = query(lake, "FROM manifest WHERE stage = 'frames' ORDER BY ALL")
    (lake / "config.toml").write_text(config, encoding="utf-8")
    made = run_all(lake, scheduler)
    assert {stage for stage, shards in made.items() if shards} == redone
    assert query(lake, "FROM manifest WHERE stage = 'frames' ORDER BY ALL") == frames
    assert set(run_all(lake, scheduler).values()) == {0}


def test_motifs_are_frozen_until_they_are_fitted_anew(own_lake: Path, source: Path, scheduler: str) -> None:
    first = clip_files(source)[0]
    shutil.copyfile(first, first.with_name("twin" + first.suffix))
    ingest(source, own_lake, scheduler)
    run_all(own_lake, scheduler)
    frozen = query(own_lake, "SELECT model, sum(words) FROM motifs GROUP BY model")
    assert frozen[0][0] == query(own_lake, "SELECT max(model) FROM models WHERE kind = 'motifs' AND current")[0][0]
    run = motionlake("run", "motifs", "--refit", "--lake", own_lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert query(own_lake, "SELECT DISTINCT model FROM motifs") == [(frozen[0][0],)], "served until signatures agree"
    run_all(own_lake, scheduler)
    fresh = query(own_lake, "SELECT model, sum(words) FROM motifs GROUP BY model")
    assert fresh[0][0] != frozen[0][0]
    assert fresh[0][1] > frozen[0][1]


def test_motifs_fitted_anew_to_the_same_clips_lose_no_signature(own_lake: Path, source: Path, scheduler: str) -> None:
    assert motionlake("run", "motifs", "--refit", "--lake", own_lake, "--scheduler", scheduler).status == 0
    first = clip_files(source)[0]
    shutil.copyfile(first, first.with_name("twin" + first.suffix))
    ingest(source, own_lake, scheduler)
    run_all(own_lake, scheduler)
    clips = query(own_lake, "SELECT clip FROM clips ORDER BY clip")
    assert query(own_lake, "SELECT clip FROM signatures ORDER BY clip") == clips
    assert query(own_lake, "SELECT DISTINCT clip FROM word_motifs ORDER BY clip") == clips


def test_gone_sources_are_reported_and_removed_when_asked(own_lake: Path, source: Path, scheduler: str) -> None:
    clips = len(query(own_lake, "FROM clips"))
    gone = clip_files(source)[0]
    gone.unlink()
    run = ingest(source, own_lake, scheduler)
    assert run.json["gone"] == 1
    assert gone.name in run.err
    assert len(query(own_lake, "FROM clips")) == clips
    assert motionlake("remove", "--gone", "--lake", own_lake).status == 0
    assert len(query(own_lake, "FROM clips")) == clips - 1
    for table in ("words", "word_motifs", "signatures", "symbol_strings", "descriptors", "submotions"):
        assert query(own_lake, f"SELECT count(*) FROM {table} WHERE clip ILIKE '%{gone.name}%'") == [(0,)]
    assert len(query(own_lake, "SELECT DISTINCT clip FROM frames SEMI JOIN clips USING (clip)")) == clips - 1


def test_a_removed_clip_comes_back_with_its_folder(own_lake: Path, source: Path, scheduler: str) -> None:
    before = tables(own_lake)
    name = query(own_lake, "SELECT min(clip) FROM clips")[0][0]
    assert motionlake("remove", name, "--lake", own_lake).status == 0
    assert query(own_lake, "SELECT count(*) FROM clips")[0][0] == len(before["clips"]) - 1
    assert ingest(source, own_lake, scheduler).json["clips"] == 1
    run_all(own_lake, scheduler)
    assert tables(own_lake)["signatures"] == before["signatures"]


def test_clips_are_removed_by_a_condition(lake: Path) -> None:
    condition = "frames = (SELECT max(frames) FROM clips)"
    before = query(lake, "SELECT clip FROM clips ORDER BY clip")
    meant = query(lake, f"SELECT clip FROM clips WHERE {condition} ORDER BY clip")
    words = ("remove", "--where", condition, "--lake", lake)
    assert motionlake(*words, "--dry-run", "--json").json == {"would_remove": [clip for (clip,) in meant]}
    assert query(lake, "SELECT clip FROM clips ORDER BY clip") == before
    assert motionlake(*words, "--json").json["clips"] == len(meant)
    assert query(lake, "SELECT clip FROM clips ORDER BY clip") == sorted(set(before) - set(meant))
    for said, condition in (
        ("there is no clip of which that is true", "frames < 0"),
        ("--where", "no such column"),
        ("--where", "true; DROP TABLE clips"),
    ):
        run = motionlake("remove", "--where", condition, "--lake", lake)
        assert (run.status, run.err.count("\n"), said in run.err) == (2, 1, True)
    assert motionlake("remove", "--dataset", "clips", "--where", "false", "--lake", lake).status == 2


def test_removing_a_dataset_leaves_no_file_behind(lake: Path) -> None:
    assert motionlake("remove", "--dataset", "clips", "--lake", lake).status == 0
    left = {f for f in files(lake) if f.endswith(".parquet") and not f.startswith("models/")}
    assert not left
    kept = {"files", "manifest", "models", "motifs", "postures", "runs", "schema_version", "settings"}
    names = {r[0] for r in query(lake, "SELECT table_name FROM duckdb_tables()")}
    assert kept < names
    for table in names - kept:
        assert query(lake, f"SELECT count(*) FROM {table}") == [(0,)]


def test_a_gzipped_twin_is_the_same_motion(own_lake: Path, source: Path, scheduler: str) -> None:
    first = clip_files(source)[0]
    packed = first.with_name(first.name + ".gz")
    packed.write_bytes(gzip.compress(first.read_bytes()))
    assert ingest(source, own_lake, scheduler).json["clips"] == 1
    text = "SELECT * EXCLUDE (clip) FROM frames WHERE ends_with(clip, '/' || $name) ORDER BY frame"
    rows = query(own_lake, text, name=first.name)
    assert rows == query(own_lake, text, name=packed.name)
    assert rows
