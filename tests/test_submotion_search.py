"""Sub-motion search: the second network's file, the stage "submotions", and `motionlake find --method submotion`."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from motionlake.deephums.config import LONGEST, PRETRAINED_DESCRIPTORS, PRETRAINED_SUBMOTION, SHORT, SubmotionConfig
from motionlake.deephums.piece_encoder import PieceEncoder, greatest
from motionlake.deephums.sequence import clip_sequence, frames_of, in_sequence, piece_windows
from motionlake.deephums.submotion_encoder import load_encoder
from motionlake.deephums.submotions import TOGETHER, TrainedSubmotion, load_submotion, train_submotion
from motionlake.deephums.submotions import network_of as own_network
from motionlake.jobs.session import session
from motionlake.lake.catalog import writing
from motionlake.lake.config import load_config
from motionlake.lake.frames import Frames, read_part
from motionlake.lake.layout import open_lake
from motionlake.lake.parts import write_part
from motionlake.motion.features import WordConfig
from motionlake.retrieval.sql_functions import connect
from motionlake.retrieval.submotion_search import Piece, place
from motionlake.stages import submotions
from motionlake.stages.reader import lake_reader
from motionlake.stages.stage import Shard, ShardResult
from motionlake.stages.submotions import SUBMOTIONS

from tests.lakes import QUICK, Changed, Run, catalog, motionlake, query

ROWS = "SELECT clip, start, stop, descriptor FROM submotions ORDER BY clip, start"
HALF = 2.0**-11  # relative error of half precision
Rows = dict[tuple[str, int, int], np.ndarray]


def run(lake: Path, scheduler: str, *words: str) -> dict[str, int]:
    """Shards made by each stage."""
    done = motionlake("run", *words, "--lake", lake, "--scheduler", scheduler, "--json")
    assert done.status == 0, done.err
    return {row["stage"]: row["shards"] for row in done.json}


def find(lake: Path, clip: str | Path, start: int, stop: int, *words: str | int) -> Run:
    asked = ["find", clip, "--from", start, "--to", stop, "--method", "submotion", *words]
    return motionlake(*map(str, asked), "--lake", lake, "--json")


def served(lake: Path) -> tuple[str, Rows]:
    """The one network that is served, and what it makes of every window."""
    ((model,),) = query(lake, "SELECT DISTINCT model FROM submotions")
    return model, {tuple(row[:3]): np.array(row[3], dtype=np.float32) for row in query(lake, ROWS)}


def motions(lake: Path) -> dict[str, tuple[Frames, float]]:
    rates = dict(query(lake, "SELECT clip, fps FROM clips"))
    parts = [read_part(part) for part in sorted(lake.glob("frames/*/*.parquet"))]
    return {clip.clip: (clip, rates[clip.clip]) for part in parts for clip in part if clip.clip in rates}


def network_of(lake: Path, model: str) -> TrainedSubmotion:
    ((file,),) = query(lake, "SELECT file FROM models WHERE model = $model", model=model)
    return load_submotion(lake / file)


def assert_windows(lake: Path, rows: Rows, model: str) -> None:
    """Every window of every clip as the network sees it, in half precision."""
    network, found = network_of(lake, model), dict(rows)
    for clip, (motion, fps) in motions(lake).items():
        positions = motion.positions.astype(float)
        windows = piece_windows(len(positions), fps)
        seen = network.embed_windows(clip_sequence(positions, fps), in_sequence(windows, len(positions), fps))
        for (start, stop), wanted in zip(windows, seen, strict=True):
            np.testing.assert_allclose(found.pop((clip, start, stop)), wanted, rtol=HALF, atol=1e-6)
    assert not found


def longest(lake: Path, count: int) -> list[tuple[str, int]]:
    text = "SELECT clip, frames FROM clips ORDER BY frames / fps DESC, clip LIMIT $count"
    return query(lake, text, count=count)


@given(frames=st.integers(1, 5000), fps=st.sampled_from([12.0, 24.0, 29.97, 30.0, 60.0, 119.88, 120.0]))
def test_long_and_short_windows_cover_a_clip_and_overlap_by_half(frames: int, fps: float) -> None:
    found = piece_windows(frames, fps)
    assert found == sorted(set(found))
    widths = {stop - start for start, stop in found}
    for width in widths:
        starts = [start for start, stop in found if stop - start == width]
        assert (starts[0], starts[-1] + width) == (0, frames)
        assert np.diff(starts).max(initial=0) <= (width + 1) / 2 + 1
        assert len(clip_sequence(np.random.default_rng(0).random((width, 21, 3)), fps)) == frames_of(width, fps)
    assert frames_of(max(widths), fps) <= LONGEST
    assert frames_of(min(widths), fps) <= SHORT
    whole = frames_of(frames, fps) <= LONGEST or frames <= max(widths)
    assert (max(widths) == frames) == whole


@pytest.mark.parametrize("recipe", ["default", "deephums"])
def test_windows_are_what_they_are_one_by_one(recipe: str) -> None:
    """Those of one length go through the network together, more of them than go at a time, among others."""
    rng = np.random.default_rng(1)
    torch.manual_seed(0)
    config = SubmotionConfig(recipe=recipe, hidden=16)
    made = TrainedSubmotion(config, own_network(config).eval(), {})
    counts = rng.permutation([24] * (TOGETHER + 3) + [150] * 3 + [9, 77])
    windows = [rng.standard_normal((count, 15, 3)).astype(np.float32) for count in counts.tolist()]
    alone = np.concatenate([made.embed([window]) for window in windows])
    np.testing.assert_allclose(made.embed(windows), alone, atol=2e-6)
    assert made.embed([]).shape == (0, 512)


@given(data=st.data(), frames=st.integers(1, 400), fps=st.sampled_from([12.0, 29.97, 30.0, 60.0, 120.0]))
def test_windows_of_a_clip_are_those_of_its_sequence(data: st.DataObject, frames: int, fps: float) -> None:
    start = data.draw(st.integers(0, frames - 1))
    stop = data.draw(st.integers(start + 1, frames))
    ((first, last),) = in_sequence([(start, stop)], frames, fps).tolist()
    assert 0 <= first < last <= frames_of(frames, fps)
    assert abs(first / 30 - start / fps) <= 0.5 / 30 + 1e-9 or last == frames_of(frames, fps)
    assert abs((last - 1) / 30 - (stop - 1) / fps) <= 0.5 / 30 + 1e-9
    assert in_sequence([(0, frames)], frames, fps).tolist() == [[0, frames_of(frames, fps)]]


@given(data=st.data(), count=st.integers(1, 40))
def test_the_greatest_of_windows_is_that_of_each(data: st.DataObject, count: int) -> None:
    frames = np.random.default_rng(count).standard_normal((count, 3)).astype(np.float32)
    pairs = st.tuples(st.integers(0, count - 1), st.integers(1, count)).filter(lambda pair: pair[0] < pair[1])
    windows = np.array(data.draw(st.lists(pairs, min_size=1, max_size=9)), dtype=np.int64)
    wanted = np.stack([frames[first:last].max(axis=0) for first, last in windows.tolist()])
    np.testing.assert_array_equal(greatest(frames, windows), wanted)


@pytest.mark.parametrize("recipe", ["default", "deephums"])
def test_windows_are_pieces_but_for_what_lies_beyond_their_ends(recipe: str) -> None:
    """A window that is the whole clip is what the clip is; another sees two frames of the clip at either end."""
    torch.manual_seed(0)
    config = SubmotionConfig(recipe=recipe, hidden=16)
    made = TrainedSubmotion(config, own_network(config).eval(), {})
    clip = np.random.default_rng(2).standard_normal((90, 15, 3)).astype(np.float32)
    whole, part = made.embed_windows(clip, np.array([(0, 90), (20, 50)]))
    np.testing.assert_allclose(whole, made.embed([clip])[0], atol=2e-6)
    assert (np.abs(part - made.embed([clip[20:50]])[0]).max() < 2e-6) == (recipe == "deephums")
    padded = clip.copy()
    padded[:18], padded[53:] = 7.0, -7.0
    (beyond,) = made.embed_windows(padded, np.array([(20, 50)]))
    np.testing.assert_allclose(beyond, part, atol=2e-6)


@pytest.mark.parametrize("recipe", ["default", "deephums"])
def test_a_network_is_the_same_after_reading_it_back(tmp_path: Path, recipe: str) -> None:
    rng = np.random.default_rng(0)
    clips = [rng.standard_normal((count, 15, 3)).astype(np.float32) for count in (20, 33, 41)]
    targets = rng.standard_normal((3, 512)).astype(np.float32) if recipe == "deephums" else None
    config = SubmotionConfig(recipe=recipe, steps=2, hidden=16)
    network, losses = train_submotion(clips, config, targets=targets)
    made = TrainedSubmotion(config, network, {"loss": losses[-1]})
    made.save(tmp_path / "submotion.safetensors")
    read = load_submotion(tmp_path / "submotion.safetensors")
    assert (read.config, read.metrics) == (made.config, made.metrics)
    np.testing.assert_array_equal(read.embed(clips), made.embed(clips))
    np.testing.assert_allclose(np.linalg.norm(read.embed(clips), axis=1), 1, atol=1e-5)
    with pytest.raises(ValueError, match="holds no submotion network"):
        load_submotion(PRETRAINED_DESCRIPTORS.file)


@given(seed=st.integers(0, 99), count=st.integers(1, 180), still=st.booleans())
def test_pieces_are_the_same_without_torch(seed: int, count: int, still: bool) -> None:
    """Of real joints: of length about one, so that bones are not all shorter than the least."""
    rng = np.random.default_rng(seed)
    piece = rng.normal(0, 0.5, (count, 15, 3)).astype(np.float32)
    if still:
        piece[:] = piece[0]
    own, other = load_encoder(PRETRAINED_SUBMOTION.file), load_submotion(PRETRAINED_SUBMOTION.file)
    assert isinstance(own, PieceEncoder)
    np.testing.assert_allclose(
        own.embed([piece, piece[: count // 2 + 1]]), other.embed([piece, piece[: count // 2 + 1]]), atol=2e-6
    )
    starts = rng.integers(0, count, 5)
    windows = np.stack([starts, rng.integers(starts + 1, count + 1)], axis=1)
    np.testing.assert_allclose(own.embed_windows(piece, windows), other.embed_windows(piece, windows), atol=2e-6)


def test_the_thesis_s_network_is_read_with_torch(tmp_path: Path) -> None:
    config = SubmotionConfig(recipe="deephums", hidden=16)
    TrainedSubmotion(config, own_network(config).eval(), {}).save(tmp_path / "submotion.safetensors")
    assert isinstance(load_encoder(tmp_path / "submotion.safetensors"), TrainedSubmotion)
    with pytest.raises(ValueError, match="holds no submotion network"):
        load_encoder(PRETRAINED_DESCRIPTORS.file)


def test_the_pretrained_network_is_the_one_its_description_names() -> None:
    network, about = load_submotion(PRETRAINED_SUBMOTION.file), PRETRAINED_SUBMOTION.about()
    assert set(about["sets"]) == {"cmu_dance", "cmu_bvh", "cmu_exercises", "cmu_86"}
    assert network.metrics["data_sha256"] == about["data_sha256"]
    assert PRETRAINED_SUBMOTION.fits(SubmotionConfig(seed=4, steps=7))
    for other in (SubmotionConfig(weights="own"), SubmotionConfig(recipe="deephums"), SubmotionConfig(hidden=99)):
        assert not PRETRAINED_SUBMOTION.fits(other)


@pytest.mark.parametrize("fps", [12.0, 24.0, 30.0, 120.0])
def test_a_place_is_in_the_frames_of_its_clip(fps: float) -> None:
    config, ratio = WordConfig(), fps / 24
    features = np.random.default_rng(0).standard_normal((40, config.dimension)).astype(np.float32)
    row: dict[str, Any] = {"clip": "a", "fps": fps, "frames": round(39 * ratio) + 1}
    sequence = np.zeros((10, 15, 3), dtype=np.float32)
    for start, stop in ((0, 9), (12, 30), (25, 40)):
        ends = round(start * ratio), min(round(stop * ratio), row["frames"])
        for own in (None, ("b", 0, 10**6)):
            assert place(Piece(sequence, features[start:stop], own), row, features, config)[:2] == ends
        barred = Piece(sequence, features[start:stop], ("a", *ends))
        first, last, _ = place(barred, row, features, config)
        assert 0 <= first < last <= ends[0] or ends[1] <= first < last <= row["frames"]


def test_every_window_is_in_the_lake(built_lake: Path) -> None:
    model, rows = served(built_lake)
    assert model == "submotion-1"
    assert_windows(built_lake, rows, model)
    assert {clip for clip, _, _ in rows} == {row[0] for row in query(built_lake, "SELECT clip FROM clips")}


def test_a_long_clip_has_many_windows(lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    con = Changed(lake)
    con.execute("DELETE FROM manifest WHERE stage = 'submotions'")
    con.close()
    monkeypatch.setattr("motionlake.deephums.sequence.LONGEST", 16)
    target = open_lake(lake)
    with lake_reader(target, load_config(target.config_file)) as at:
        shards = SUBMOTIONS.plan(at)
    with session(target, "test", lambda stage, done, total: None, lambda line: None) as job:
        job.execute(SUBMOTIONS, shards, here=True)
    model, rows = served(lake)
    clips = [clip for clip, _, _ in rows]
    assert len(clips) > 2 * len(set(clips))
    assert_windows(lake, rows, model)
    clip, frames = longest(lake, 1)[0]
    ((fps,),) = query(lake, "SELECT fps FROM clips WHERE clip = $clip", clip=clip)
    stop = round(12 * fps / 30)
    hits = find(lake, clip, 0, stop, "-k", 1000).json
    (own,) = [hit for hit in hits if hit["clip"] == clip]  # its other windows hold the rest of the clip
    assert stop <= own["start"] < own["stop"] <= frames
    known = network_of(lake, model).embed([clip_sequence(motions(lake)[clip][0].positions[:stop].astype(float), fps)])
    others = [row for (name, start, _), row in rows.items() if name == clip and start >= stop]
    assert own["distance"] == pytest.approx(np.linalg.norm(known - np.array(others), axis=1).min(), abs=1e-5)


def test_a_new_clip_costs_one_part_and_takes_it_along(lake: Path, clips_folder: Path, scheduler: str) -> None:
    _, before = served(lake)
    source = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".npz", ".bvh"))
    folder = lake.parent / "more"
    folder.mkdir()
    shutil.copyfile(source, folder / source.name)
    assert motionlake("ingest", folder, "--lake", lake, "--scheduler", scheduler).status == 0
    due = {row["stage"]: row["due"] for row in motionlake("status", "--lake", lake, "--json").json["stages"]}
    assert due["submotions"] == 1
    assert run(lake, scheduler, "submotions") == {"submotions": 1}
    model, after = served(lake)
    assert len(after) > len(before)
    assert_windows(lake, after, model)
    assert motionlake("remove", "--dataset", "more", "--lake", lake).status == 0
    assert served(lake)[1].keys() == before.keys()


def test_a_network_trained_anew_replaces_all_windows(lake: Path, scheduler: str) -> None:
    (lake / "config.toml").write_text(QUICK + "[submotion]\nsteps = 2\nseed = 3\n", encoding="utf-8")
    con = Changed(lake)
    con.execute("UPDATE clips SET split = CASE rowid % 2 WHEN 0 THEN 'train' ELSE 'test' END")
    con.close()
    _, before = served(lake)
    said = motionlake("train", "submotion", "--split", "train", "--lake", lake, "--json")
    assert said.status == 0, said.err
    metrics = said.json["metrics"]
    assert said.json["model"] == "submotion-2"
    ((count,),) = query(lake, "SELECT count(*) FROM clips WHERE split = 'train'")
    assert (metrics["split"], metrics["clips"]) == ("train", count)
    assert served(lake)[0] == "submotion-1", "served until the windows of the new network are there"
    run(lake, scheduler, "submotions")
    model, after = served(lake)
    assert model == "submotion-2"
    assert_windows(lake, after, model)
    assert max(np.abs(after[row] - before[row]).max() for row in after) > 1e-3
    assert run(lake, scheduler, "submotions") == {"submotions": 0}
    run(lake, scheduler, "submotions", "--refit")
    assert served(lake)[0] == "submotion-3"
    said = motionlake("train", "submotion", "--split", "valid", "--lake", lake)
    assert (said.status, said.err.count("\n")) == (2, 1)
    assert "no clip is of split 'valid'" in said.err


def test_windows_of_two_networks_never_stand_together(lake: Path) -> None:
    shard = Shard("submotions", "0" * 64, "another part", "clips", {"model": "submotion-9"}, 1)
    target = open_lake(lake)
    write_part(target.path(SUBMOTIONS.file(shard.key)), submotions.ROWS.empty_table(), {})
    with writing(target) as con:
        SUBMOTIONS.load(con, target.root, [ShardResult(shard, 0, 0, (), 0.0)])
    assert query(lake, "FROM submotions") == []


def test_by_the_thesis_pieces_are_compared_with_descriptors(lake: Path, scheduler: str) -> None:
    (lake / "config.toml").write_text(QUICK + '[submotion]\nrecipe = "deephums"\nsteps = 2\n', encoding="utf-8")
    run(lake, scheduler, "submotions")
    model, rows = served(lake)
    ((metrics,),) = query(lake, "SELECT metrics->>'descriptors' FROM models WHERE model = $model", model=model)
    known = {clip: np.array(row) for clip, row in query(lake, "SELECT clip, descriptor FROM descriptors")}
    assert metrics == "descriptors-1"
    assert {clip for clip, _, _ in rows} == known.keys()
    for (clip, start, stop), row in rows.items():
        np.testing.assert_allclose(row, known[clip], rtol=HALF, atol=2e-5)
        assert (start, stop) == (0, len(motions(lake)[clip][0].positions))
    clip, frames = longest(lake, 1)[0]
    assert find(lake, clip, 0, frames, "-k", 3).status == 0


@pytest.mark.recordings
def test_a_piece_is_found_in_its_clip_and_where_it_was(built_lake: Path, recordings: Path) -> None:
    ranks = []
    for clip, frames in longest(built_lake, 4):
        for start, stop in ((frames // 4, 3 * frames // 4), (frames // 2, frames)):
            hits = find(built_lake, clip, start, stop, "-k", 2, "--own").json
            (hit,) = [hit for hit in hits if hit["clip"] == clip]
            ranks.append(hit["rank"])
            overlap = min(stop, hit["stop"]) - max(start, hit["start"])
            assert overlap >= 0.75 * (max(stop, hit["stop"]) - min(start, hit["start"]))
            assert hit["distance"] >= hits[0]["distance"]
    assert ranks.count(1) > len(ranks) / 2, "takes of one person may be taken for one another"


def test_every_way_to_ask_gives_the_same_answer(built_lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    clip, frames = longest(built_lake, 1)[0]
    start = frames // 4
    found = find(built_lake, clip, start, frames, "-k", 5).json
    assert len(found) == 5
    assert all(hit["clip"] != clip for hit in found), "its only window overlaps the piece"
    text = f"FROM find_submotion('{clip}', {start}, NULL, k := 5)"
    assert motionlake("sql", text, "--lake", built_lake, "--json").json == found
    own = find(built_lake, clip, start, frames, "-k", 6, "--own").json
    assert [hit for hit in own if hit["clip"] != clip] == [hit | {"rank": hit["rank"] + 1} for hit in found]
    of_file = find(built_lake, clips_folder / clip.partition("/")[2], start, frames, "-k", 6).json
    assert [hit["clip"] for hit in of_file] == [hit["clip"] for hit in own]
    np.testing.assert_allclose([hit["distance"] for hit in of_file], [hit["distance"] for hit in own], atol=1e-3)
    picture = tmp_path / "hits.png"
    assert find(built_lake, clip, start, frames, "-k", 2, "--picture", str(picture)).status == 0
    assert picture.stat().st_size > 1000
    assert find(built_lake, clip, start, frames, "--dataset", "elsewhere").json == []


def test_clips_are_ranked_by_their_nearest_window_in_plain_duckdb(lake: Path) -> None:
    _, rows = served(lake)
    (clip, _, stop), asked = min(rows.items())
    assert len(rows) > len({name for name, _, _ in rows})
    best: dict[str, tuple[float, int, int]] = {}
    for (name, start, end), row in rows.items():
        best[name] = min(best.get(name, (9.0, 0, 0)), (float(np.linalg.norm(row - asked)), start, end))
    with catalog(lake) as plain:
        text = "SELECT * FROM clips_holding($row, k := $k)"
        found = plain.execute(text, {"row": asked.tolist(), "k": 1000}).fetchall()
        without = plain.execute(
            "SELECT clip, start FROM clips_holding($row, k := 1000, without := $clip, first := 0, last := $last)",
            {"row": asked.tolist(), "clip": clip, "last": 1_000_000},
        ).fetchall()
    assert [row[1] for row in found] == sorted(best, key=lambda name: (best[name][0], name))
    assert [row[0] for row in found] == list(range(1, len(best) + 1))
    for _, name, start, end, distance, *_ in found:
        assert (distance, start, end) == (pytest.approx(best[name][0], abs=1e-5), *best[name][1:])
    assert found[0][1:4] == (clip, 0, stop)
    assert {row[0] for row in without} == best.keys() - {clip}


def test_mistakes_are_met_with_one_clear_line(lake: Path, scheduler: str) -> None:
    clip, frames = longest(lake, 1)[0]
    for asked, said in (
        ((clip, frames, frames + 9), f"has frames 0 to {frames}"),
        ((clip, 9, 4), f"has frames 0 to {frames}"),
        ((clip, 0, 2), "a piece to find needs at least 8"),
        ((clip, 0, frames, "--method", "sound"), "--method sound: not one of fused, words, alignment, submotion"),
        (("nowhere", 0, 9), "no such clip"),
    ):
        done = find(lake, *asked)
        assert (done.status, done.err.count("\n")) == (2, 1), done.err
        assert said in done.err
    con = Changed(lake)
    con.execute("DELETE FROM submotion_parts")
    con.execute("DELETE FROM manifest WHERE stage = 'submotions'")
    con.close()
    assert "has no windows to find pieces in yet" in find(lake, clip, 0, frames).err
    connect(lake).close()
    assert motionlake("status", "--lake", lake).status == 0
    assert run(lake, scheduler, "submotions") == {"submotions": 1}
    assert find(lake, clip, 0, frames).status == 0
