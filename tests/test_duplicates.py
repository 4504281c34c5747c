"""Near-duplicates: real clips copied as people copy them are found, other takes of the same action are not."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.deep_motifs.duplicates import MAX_DISTANCE, Track, align, poses
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.motion.features import WordConfig

from bench.copies import COPIES, write_copies
from tests.lakes import motionlake, query, quick_lake

# Squats and kicks of two performers each, several takes by either: what looks alike and is no copy.
TAKES = {
    "hdm05": (
        "squat1Reps/HDM_bd_squat1Reps_003_120.amc", "squat1Reps/HDM_bd_squat1Reps_004_120.amc",
        "squat1Reps/HDM_tr_squat1Reps_046_120.amc", "squat1Reps/HDM_tr_squat1Reps_047_120.amc",
        "kickLFront1Reps/HDM_bd_kickLFront1Reps_001_120.amc", "kickLFront1Reps/HDM_bd_kickLFront1Reps_002_120.amc",
    ),
    "utd_mhad": tuple(f"a20_s{s}_t{t}.npz" for s in (2, 8) for t in (1, 2, 3)),
}  # fmt: skip


@dataclass(frozen=True)
class Copied:
    """A lake of takes and copies of them, and each copy's source and kind."""

    lake: Path
    sources: dict[str, str]

    def kind(self, copy: str) -> str:
        return copy.removeprefix("copies/").partition("_")[0]

    def pairs(self, *, mirrored: bool) -> set[tuple[str, str, bool]]:
        flags = {copy: self.kind(copy) in ("mirrored", "all") for copy in self.sources}
        return {(source, copy, flags[copy]) for copy, source in self.sources.items() if mirrored or not flags[copy]}


@pytest.fixture(scope="module")
def copied(recordings: Path, scheduler: str, tmp_path_factory: pytest.TempPathFactory) -> Copied:
    folder = tmp_path_factory.mktemp("copied")
    for name, files in TAKES.items():
        for file in (*files, *(p.name for p in (recordings / name / "clips").glob("*.asf"))):
            target = folder / "clips" / Path(file).name
            target.parent.mkdir(exist_ok=True)
            shutil.copyfile(recordings / name / "clips" / file, target)
    lake = quick_lake(folder / "lake")

    def take_in(source: Path) -> None:
        for words in (["ingest", source], ["run", "all"]):
            run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
            assert run.status == 0, run.err

    take_in(folder / "clips")
    opened = open_lake(lake)
    with reading(opened) as con:
        clips = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
        made = write_copies(con, opened, clips, folder / "copies", list(COPIES))
    take_in(folder / "copies")
    return Copied(lake, {f"copies/{name}": source for name, source in made.items()})


def found(lake: Path, *words: str | float) -> set[tuple[str, str, bool]]:
    rows = motionlake("duplicates", *words, "--lake", lake, "--json").json
    return {(row["clip"], row["other"], row["mirrored"]) for row in rows}


@pytest.mark.recordings
def test_every_copy_is_found_and_no_other_take(copied: Copied) -> None:
    assert len(copied.sources) == 12
    assert {copied.kind(copy) for copy in copied.sources} == set(COPIES)
    assert found(copied.lake, "--mirrored") == copied.pairs(mirrored=True)
    assert found(copied.lake) == copied.pairs(mirrored=False)
    assert found(copied.lake, "--mirrored", "--across") == copied.pairs(mirrored=True)
    assert found(copied.lake, "--mirrored", "--dataset", "clips") == set()
    # The limit is what keeps takes apart: without it they would be pairs.
    assert len(found(copied.lake, "--dataset", "clips", "--max-distance", 0.9)) > 0


@pytest.mark.recordings
def test_a_pair_says_where_the_copy_lies(copied: Copied) -> None:
    seconds = dict(query(copied.lake, "SELECT clip, seconds FROM clips"))
    for row in motionlake("duplicates", "--mirrored", "--lake", copied.lake, "--json").json:
        source, copy = row["clip"], row["other"]
        assert 0 <= row["distance"] <= MAX_DISTANCE
        cut = 0.05 * seconds[source] if copied.kind(copy) in ("trimmed", "all") else 0.0
        assert row["offset_seconds"] == pytest.approx(cut, abs=0.03)
        assert row["overlap_seconds"] == pytest.approx(seconds[copy], abs=0.1)


@pytest.mark.recordings
def test_sql_gives_the_same_pairs(copied: Copied) -> None:
    rows = motionlake("duplicates", "--mirrored", "--lake", copied.lake, "--json").json
    text = "FROM near_duplicates(mirrored := true)"
    assert motionlake("sql", text, "--lake", copied.lake, "--json").json == rows
    nearer = [row for row in rows if not row["mirrored"] and row["distance"] <= 0.01]
    text = "FROM near_duplicates(0.01, across := true)"
    assert motionlake("sql", text, "--lake", copied.lake, "--json").json == nearer


def test_mistakes_are_met_with_one_clear_line(lake: Path, tmp_path: Path) -> None:
    for words, said in (
        (["--max-distance", 1.5], "between 0 and 1"),
        (["--dataset", "clips", "--across"], "choose one"),
    ):
        run = motionlake("duplicates", *words, "--lake", lake)
        assert (run.status, run.err.count("\n")) == (2, 1)
        assert said in run.err
    empty = tmp_path / "empty"
    assert motionlake("init", empty).status == 0
    assert "no signatures yet" in motionlake("duplicates", "--lake", empty).err


def by_definition(first: np.ndarray, second: np.ndarray, share: float) -> tuple[float, int]:
    """Every whole offset with enough overlap, compared frame by frame."""
    least = max(1, int(np.ceil(share * min(len(first), len(second)))))
    best = (np.inf, 0)
    for offset in range(-len(second) + 1, len(first)):
        pairs = [(first[j + offset], second[j]) for j in range(len(second)) if 0 <= j + offset < len(first)]
        if len(pairs) >= least:
            gaps = np.array([a.astype(float) - b for a, b in pairs])
            best = min(best, (np.linalg.norm(gaps - gaps.mean(axis=0), axis=-1).mean(), offset))
    return best


@settings(max_examples=60, deadline=None)
@given(
    n=st.integers(4, 14),
    m=st.integers(4, 14),
    share=st.floats(0.5, 1.0),
    seed=st.integers(0, 10_000),
    loose=st.floats(1.0, 2.0),
)
def test_alignment_is_the_best_of_all_offsets(n: int, m: int, share: float, seed: int, loose: float) -> None:
    rng = np.random.default_rng(seed)
    first, second = (rng.standard_normal((count, 4, 3)).astype(np.float32) for count in (n, m))
    distance, offset = by_definition(first, second, share)
    whole = align(Track.of(first), Track.of(second), share)
    assert whole.distance <= distance + 1e-6  # parts of a frame may do better
    if whole.offset == offset:
        assert whole.distance == pytest.approx(distance, abs=1e-6)
    limited = align(Track.of(first), Track.of(second), share, distance * loose + 1e-6)
    assert limited == whole
    assert align(Track.of(first), Track.of(second), share, whole.distance / 2 - 1e-6).distance == np.inf


@pytest.mark.parametrize("shift", [0.0, 2.0, 3.5, -1.25])
def test_a_copy_between_frames_is_found_at_its_offset(shift: float) -> None:
    def curve(instants: np.ndarray) -> np.ndarray:
        phases = np.arange(12).reshape(4, 3)
        return np.sin(instants[:, None, None] * 0.3 + phases).astype(np.float32)

    first, second = curve(np.arange(40.0)), curve(np.arange(30.0) + shift) + np.float32(0.5)  # a constant is no matter
    found = align(Track.of(first), Track.of(second), 0.8)
    assert found.offset == shift
    assert found.distance < 0.02
    assert align(Track.of(first), Track.of(second), 0.8, found.distance * 1.01) == found


@pytest.mark.parametrize("config", [WordConfig(), WordConfig(joints="deep_motifs16"), WordConfig.deep_motifs()])
def test_poses_do_not_depend_on_the_length_of_bones(config: WordConfig) -> None:
    features = np.random.default_rng(0).standard_normal((5, config.dimension)).astype(np.float32)
    found = poses(features, config)
    joints = len(config.joint_indices)
    if config.representation == "positions":
        np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-5)
        longer = features.copy()
        longer[:, : 3 * joints] *= 1.7
        np.testing.assert_allclose(poses(longer, config), found, atol=1e-5)
    else:
        np.testing.assert_allclose(poses(-features, config), found, atol=1e-5)  # q and -q are one rotation
