"""Synthetic clips in the lake: made once, with their lineage, found like any other and left out, taken out again."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from motionlake.deephums.config import DescriptorsConfig
from motionlake.formats import read_clips
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.config import load_config
from motionlake.lake.frames import read_clip
from motionlake.lake.layout import open_lake
from motionlake.motion.kinematics import solve
from motionlake.retrieval.sql_functions import connect
from motionlake.stages.descriptor_network import training_set
from motionlake.stages.generator_model import motion_set
from motionlake.stages.model_kind import Selection
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.reader import LakeReader
from motionlake.stages.word_network import training_sample

from tests.lakes import Changed, Run, assert_same, files, motionlake, query, tables

SECONDS = 2.0


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    """The small lake with a generator that has seen its clips once."""
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("synthesis") / "lake"))
    with (lake / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write('[synthesis]\nrecipe = "networks"\nepochs = 1\n')
    run = motionlake("train", "synthesis", "--json", "--lake", lake)
    assert run.status == 0, run.err
    return lake


@pytest.fixture(scope="module")
def classes(trained: Path) -> tuple[str, str]:
    """Two classes with a clip that is long enough to start from."""
    rows = query(trained, "SELECT label FROM clips GROUP BY ALL ORDER BY max(seconds) DESC, label LIMIT 2")
    return rows[0][0], rows[1][0]


@pytest.fixture(scope="module")
def made(trained: Path, classes: tuple[str, str], scheduler: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The trained lake with three motions of one class and three of two, and every stage made for them."""
    lake = Path(shutil.copytree(trained, tmp_path_factory.mktemp("synthesis") / "made"))
    for wanted in (classes[:1], classes):
        run = synthesize(lake, scheduler, *wanted)
        assert run.status == 0, run.err
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    return lake


@pytest.fixture
def own(trained: Path, tmp_path: Path) -> Path:
    """The trained lake, to change."""
    return Path(shutil.copytree(trained, tmp_path / "own"))


def synthesize(lake: Path, scheduler: str, *wanted: str, more: tuple[str | Path, ...] = (), count: int = 3) -> Run:
    named = [word for name in wanted for word in ("--class", name)]
    numbers = ("--seconds", str(SECONDS), "--count", str(count), "--seed", "7", "--json")
    return motionlake("synthesize", *named, *numbers, *more, "--lake", lake, "--scheduler", scheduler)


def test_clips_have_their_lineage(made: Path, classes: tuple[str, str]) -> None:
    rows = query(
        made,
        "SELECT c.clip, c.label, c.format, c.frames / c.fps, s.model, s.classes, s.seconds, s.seed, s.number, "
        "s.seed_clip, s.seed_start, s.seed_stop, o.label, o.frames, s.licences "
        "FROM synthetic s JOIN clips c USING (clip) JOIN clips o ON o.clip = s.seed_clip ORDER BY ALL",
    )
    assert len(rows) == query(made, "SELECT count(*) FROM clips WHERE format = 'synthetic'")[0][0] == 6
    for clip, label, kind, seconds, model, wanted, asked, seed, number, _, start, stop, own, frames, licences in rows:
        stem = "+".join(wanted)
        assert query(made, "SELECT DISTINCT fps FROM frames WHERE clip = $clip", clip=clip) == [(30.0,)]
        assert clip == f"synthetic/{stem}-s7-{number:04d}"
        assert (kind, model, asked, seed, licences) == ("synthetic", "synthesis-1", SECONDS, 7, [])
        assert seconds == pytest.approx(SECONDS, abs=0.05)
        assert label == (wanted[0] if len(wanted) == 1 else None)
        assert own == wanted[0]
        assert 0 <= start < stop <= frames
    spans = query(
        made,
        "SELECT clip, list(s.label ORDER BY start), min(start) = 0 AND max(stop) = any_value(frames), "
        "sum(stop - start) = any_value(frames) FROM segments s JOIN clips USING (clip) WHERE format = 'synthetic' "
        "GROUP BY clip",
    )
    assert len(spans) == 3
    assert all(labels == list(classes) and whole and once for _, labels, whole, once in spans)


def test_licences_of_training_clips_and_seed_clip_are_kept(own: Path, clips_folder: Path, scheduler: str) -> None:
    source = Path(shutil.copytree(clips_folder, own.parent / "clips"))
    run = motionlake("ingest", source, "--licence", "CC0", "--dataset", "free", "--lake", own, "--scheduler", scheduler)
    assert run.status == 0, run.err
    run = motionlake("train", "synthesis", "--dataset", "free", "--json", "--lake", own)
    assert run.json["metrics"]["licences"] == ["CC0"]
    assert run.json["metrics"]["datasets"] == ["free"]
    assert run.json["metrics"]["filled"] == sorted(
        {joint for (joints,) in query(own, "SELECT filled FROM clips WHERE dataset = 'free'") for joint in joints}
    )
    clip = query(own, "SELECT clip FROM clips WHERE dataset = 'free' ORDER BY seconds DESC, clip LIMIT 1")[0][0]
    wanted = run.json["metrics"]["class_names"][0]
    run = synthesize(own, scheduler, wanted, more=("--from", clip), count=1)
    assert run.status == 0, run.err
    found = query(own, "SELECT licence, licences, datasets, seed_clip FROM synthetic JOIN clips USING (clip)")
    assert found == [("CC0", ["CC0"], ["free"], clip)]
    file = source / query(own, "SELECT path FROM clips WHERE clip = $clip", clip=clip)[0][0]
    run = synthesize(own, scheduler, wanted, more=("--from", file, "--dataset", "outside"), count=1)
    assert run.status == 0, run.err
    found = query(own, "SELECT dataset, seed_clip, content_hash FROM synthetic JOIN clips USING (clip) ORDER BY ALL")
    assert [row[:2] for row in found] == [("outside", str(file)), ("synthetic", clip)]
    assert motionlake("remove", "--dataset", "outside", "--lake", own).status == 0


def test_the_same_command_makes_the_same_clips_once(
    own: Path, made: Path, classes: tuple[str, str], scheduler: str, tmp_path: Path
) -> None:
    other = Path(shutil.copytree(own, tmp_path / "other"))
    first = synthesize(own, scheduler, *classes, count=40).json
    before = tables(own)
    again = synthesize(own, scheduler, *classes, count=40).json
    assert (first["made"], first["there"], again["made"], again["there"]) == (40, 0, 0, 40)
    assert again["clips"] == first["clips"]
    assert again["seconds"] == first["seconds"] == pytest.approx(40 * SECONDS, rel=0.03)
    assert_same(before, tables(own))
    assert synthesize(other, scheduler, *classes, count=40).status == 0
    assert_same(before, tables(other))
    text = "SELECT clip, content_hash FROM clips WHERE format = 'synthetic' ORDER BY clip"
    fewer = [row for row in query(made, text) if "+" in row[0]]
    assert fewer == query(own, text)[:3], "a motion depends on how many others are made"
    assert len({content for _, content in query(own, text)}) == 40, "two motions are the same"


def test_motions_start_from_clips_that_are_good_enough(own: Path, classes: tuple[str, str], scheduler: str) -> None:
    first = {row[0] for row in query(own, "SELECT clip FROM clips WHERE label = $label", label=classes[0])}
    said = synthesize(own, scheduler, classes[0], more=("--min-quality", "ok")).err
    assert "make them with `motionlake run quality`" in said
    with Changed(own) as con:
        con.execute("CREATE OR REPLACE MACRO quality_verdict(name) AS 'bad'")
    said = synthesize(own, scheduler, classes[0], more=("--min-quality", "ok")).err
    assert f"of {len(first)} clips to start from none is as good" in said
    with Changed(own) as con:
        con.execute("CREATE OR REPLACE MACRO quality_verdict(name) AS 'ok'")
    assert synthesize(own, scheduler, classes[0], more=("--min-quality", "ok")).json["made"] == 3


def test_more_of_the_same_adds_to_what_is_there(own: Path, classes: tuple[str, str], scheduler: str) -> None:
    assert synthesize(own, scheduler, classes[0], count=2).status == 0
    more = synthesize(own, scheduler, classes[0], count=5).json
    assert (more["made"], more["there"]) == (3, 2)
    frames = query(own, "SELECT clip, count(*), max(frame) + 1 FROM frames WHERE dataset = 'synthetic' GROUP BY clip")
    assert frames
    assert len(frames) == 5
    assert all(rows == last for _, rows, last in frames)


def test_other_options_replace_clips_of_the_same_name(own: Path, classes: tuple[str, str], scheduler: str) -> None:
    text = "SELECT clip, pace, content_hash FROM synthetic JOIN clips USING (clip) ORDER BY clip"
    assert synthesize(own, scheduler, classes[0]).status == 0
    before = query(own, text)
    replaced = synthesize(own, scheduler, classes[0], more=("--pace", "1.5"), count=2).json
    assert (replaced["made"], replaced["there"]) == (2, 0)
    after = query(own, text)
    assert [row[:2] for row in after] == [(clip, 1.5 if i < 2 else 1.0) for i, (clip, _, _) in enumerate(before)]
    assert [a[2] == b[2] for a, b in zip(after, before, strict=True)] == [False, False, True]
    counts = query(own, "SELECT count(*), count(DISTINCT (clip, frame)) FROM frames WHERE dataset = 'synthetic'")
    assert counts[0][0] == counts[0][1]


def test_bvh_files_give_back_the_joints(own: Path, classes: tuple[str, str], scheduler: str, tmp_path: Path) -> None:
    run = synthesize(own, scheduler, *classes, more=("--bvh", tmp_path / "new" / "bvh"), count=2)
    assert run.json["files"] == 2
    rows = query(own, "SELECT clip, path, part, body_height FROM clips WHERE format = 'synthetic' ORDER BY clip")
    assert len(rows) == 2
    for clip, path, part, height in rows:
        frames = read_clip(own / f"frames/dataset=synthetic/{part}.parquet", clip)
        written = [tmp_path / "new" / "bvh" / f"{path}.bvh"]
        for rig in ("own", "canonical"):
            written.append(tmp_path / f"{rig}.bvh")
            assert motionlake("export", clip, "--rig", rig, "-o", written[-1], "--lake", own).status == 0
        for file in written:
            again = solve(read_clips(file)[0])
            error = np.linalg.norm(again.positions / 100 - frames.positions, axis=-1)
            assert error.max() < 0.01 * height, file


def test_search_finds_synthetic_clips_and_leaves_them_out(made: Path) -> None:
    synthetic, real = (
        {row[0] for row in query(made, f"SELECT clip FROM clips WHERE (format = 'synthetic') = {wanted}")}
        for wanted in ("true", "false")
    )
    clip = min(synthetic)
    commands: list[tuple[str | Path, ...]] = [
        *(
            ("search", clip, "-k", "100", "--method", name)
            for name in ("signature", "alignment", "descriptor", "fused")
        ),
        ("search", clip, "-k", "100", "--mirrored"),
        ("find", clip, "--to", "40", "-k", "100"),
        ("find", clip, "--to", "40", "-k", "100", "--method", "submotion"),
        ("align", clip, "--to", "40", "-k", "100"),
        ("cluster", "-k", "3"),
    ]
    for words in commands:
        found, recorded = (
            {row["clip"] for row in motionlake(*words, *more, "--json", "--lake", made).json}
            for more in ((), ("--recorded-only",))
        )
        assert found & synthetic - {clip}, words
        assert found & real, words
        assert recorded, words
        assert recorded <= real, words
    pairs = motionlake("duplicates", "--max-distance", "0.9", "--recorded-only", "--json", "--lake", made).json
    assert {name for pair in pairs for name in (pair["clip"], pair["other"])} <= real
    with connect(made) as con:
        for macro in ("nearest_clips", "similar_clips", "aligned_clips"):
            everything = con.execute(f"SELECT clip FROM {macro}($clip, 100)", {"clip": clip}).fetchall()
            recorded_only = con.execute(
                f"SELECT clip FROM {macro}($clip, 100, recorded_only := true)", {"clip": clip}
            ).fetchall()
            assert {row[0] for row in everything} == (synthetic | real) - {clip}, macro
            assert {row[0] for row in recorded_only} == real, macro
        piece = "$clip, 0, 40"
        for call in (f"find_motion({piece}", f"find_submotion({piece}", f"align_motion({piece}", "aligned_clips($clip"):
            found, recorded = (
                {row[0] for row in con.execute(f"SELECT clip FROM {call}, k := 100{more})", {"clip": clip}).fetchall()}
                for more in ("", ", recorded_only := true")
            )
            assert found & synthetic, call
            assert recorded, call
            assert recorded <= real, call


def test_models_are_not_fitted_to_synthetic_clips(made: Path, trained: Path, tmp_path: Path, scheduler: str) -> None:
    samples, fitted = [], []
    for root in (made, trained):
        lake = open_lake(root)
        config = load_config(lake.config_file)
        with reading(lake) as con:
            described = training_set(con, lake, DescriptorsConfig())
            classed = motion_set(con, lake, config.synthesis)
            taught = [
                fetch(con, f"taught_{kind}", {"datasets": None, "clips": None, "column": "label"})
                for kind in ("clips", "segments")
            ]
            at = LakeReader(con, lake, config)
            drawn = [training_sample(at), POSTURE_DICTIONARY.data(at, Selection()) or []]
        assert described is not None
        assert classed is not None
        sums = [[float(np.abs(features).sum()) for features in sample] for sample in drawn]
        samples.append((described.metrics, classed.metrics, taught, sums))
        copy = Path(shutil.copytree(root, tmp_path / root.name))
        run = motionlake("run", "motifs", "--refit", "--lake", copy, "--scheduler", scheduler)
        assert run.status == 0, run.err
        fitted.append(query(copy, "SELECT motif, words, clips, idf, centroid FROM motifs ORDER BY motif"))
    assert samples[0] == samples[1]
    assert fitted[0] == fitted[1]


def test_what_was_made_is_taken_out_again(own: Path, classes: tuple[str, str], scheduler: str) -> None:
    before, held = tables(own), files(own)
    assert synthesize(own, scheduler, *classes).status == 0
    assert synthesize(own, scheduler, classes[0]).status == 0
    assert motionlake("run", "frames", "--lake", own, "--scheduler", scheduler).status == 0
    assert query(own, "SELECT count(*) FROM synthetic") == [(6,)]
    one = motionlake("remove", f"{classes[0]}-s7-0002", "--json", "--lake", own)
    assert one.json == {"clips": 1, "files": 0}
    assert query(own, "SELECT count(*) FROM synthetic") == [(5,)]
    run = motionlake("remove", "synthetic", "--lake", own)
    assert (run.status, "remove --dataset synthetic" in run.err) == (2, True)
    assert motionlake("remove", "--dataset", "synthetic", "--json", "--lake", own).json == {"clips": 5, "files": 0}
    assert_same(before, tables(own))
    assert files(own) == held


def test_status_counts_what_synthetic_clips_lack(
    made: Path, own: Path, classes: tuple[str, str], scheduler: str
) -> None:
    def stages(lake: Path) -> dict[str, dict[str, int | None]]:
        return {row["stage"]: row for row in motionlake("status", "--json", "--lake", lake).json["stages"]}

    assert stages(own)["synth"]["due"] == 0
    assert "synthesize" not in stages(own)
    assert all(row["due"] in (0, None) for row in stages(made).values())
    assert stages(made)["synthesize"]["shards"] == 2
    assert synthesize(own, scheduler, classes[0]).status == 0
    assert stages(own)["words"]["due"] == stages(own)["descriptors"]["due"] == 1
    (own / "config.toml").write_text("[synthesis]\nseed = 5\n", encoding="utf-8")
    assert stages(own)["synth"]["due"] == 1


def test_the_stage_trains_a_generator_where_none_fits(own: Path) -> None:
    run = motionlake("run", "synth", "--lake", own)
    assert "synth: will not train; synthesis-1" in run.err
    run = motionlake("run", "synth", "--refit", "--lake", own)
    assert "synth: will train" in run.err
    with (own / "config.toml").open("a", encoding="utf-8") as handle:
        handle.write("seed = 3\n")
    assert motionlake("run", "synth", "--lake", own).status == 0
    assert query(own, "SELECT model FROM models WHERE kind = 'synthesis' AND current") == [("synthesis-3",)]


def test_labelled_ranges_of_unlabelled_clips_are_learned_and_started_from(
    own: Path, clips_folder: Path, scheduler: str
) -> None:
    path, frames, fps = query(own, "SELECT path, frames, fps FROM clips ORDER BY seconds DESC, clip LIMIT 1")[0]
    source = Path(shutil.copytree(clips_folder, own.parent / "clips"))
    (source / "labels.csv").unlink()
    first = frames - round(1.0 * fps)
    (source / "segments.csv").write_text(
        f"file,start,stop,label\n{path},0,2,blink\n{path},{first},{frames},wave\n", encoding="utf-8"
    )
    assert motionlake("ingest", source, "--dataset", "ranges", "--lake", own, "--scheduler", scheduler).status == 0
    run = motionlake("train", "synthesis", "--dataset", "ranges", "--json", "--lake", own)
    assert run.status == 0, run.err
    assert run.json["metrics"]["class_names"] == ["wave"]
    assert synthesize(own, scheduler, "wave", count=2).status == 0
    for seed_clip, start, stop in query(own, "SELECT seed_clip, seed_start, seed_stop FROM synthetic"):
        assert seed_clip == f"ranges/{path}"
        assert first <= start < stop <= frames
