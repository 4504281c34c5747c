"""Pieces in a very large lake: the numbers of windows in its shortlist, and answers by them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.retrieval import window_shortlist
from motionlake.retrieval.lake_shortlist import shortlist_of
from motionlake.retrieval.registry import searcher
from motionlake.retrieval.submotion_search import SubmotionSearcher
from motionlake.retrieval.window_scan import WindowScan
from motionlake.retrieval.window_shortlist import WindowShortlist, nearest_of_clips
from motionlake.stages import shortlist_windows, windows
from motionlake.stages.shortlist_before import rows_by_file, same_rows
from motionlake.stages.shortlist_files import is_of_windows
from motionlake.stages.shortlist_windows import DIRECTIONS, ShortlistWindows, kind_of

from tests import test_shortlist
from tests.lakes import made_clips, motionlake, query
from tests.test_submotion_search import find, longest, run
from tests.test_windows import with_newer_vectors


@contextmanager
def few() -> Iterator[None]:
    """Within the block any lake is a very large one."""
    with test_shortlist.few(), pytest.MonkeyPatch.context() as patched:
        patched.setattr(windows, "MOST", 1)
        yield


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory, built_lake: Path, scheduler: str) -> Path:
    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("window-shortlist") / "lake"))
    with few():
        done = run(root, scheduler, "windows") | run(root, scheduler, "shortlist")
        assert (done["windows"] > 0, done["shortlist"]) == (True, 1)
        assert run(root, scheduler, "all")["shortlist"] == 0
    return root


def held(root: Path) -> ShortlistWindows:
    lake = open_lake(root)
    with few(), reading(lake) as con:
        found = ShortlistWindows.open(lake, shortlist_of(lake), kind_of(con))
    assert found is not None
    return found


def scan_of(root: Path, *, exact: bool = False) -> object:
    return cast(SubmotionSearcher, searcher("range", "submotion", open_lake(root), exact=exact))._scan


def test_numbers_are_where_windows_lie(large: Path) -> None:
    """Every window of every clip, in the order of its clip's windows, to half of a whole number."""
    found = held(large)
    seen = 0
    for row, windows_of_clip in enumerate(found.rows.of(np.arange(len(found.clips)))):
        exact = found.directions.project(windows_of_clip["vector"].astype(np.float32))
        places = found.numbers[found.starts[row] : found.starts[row + 1]]
        np.testing.assert_allclose(places, np.clip(exact, -127, 127), atol=0.51)
        seen += len(places)
    assert seen == len(found.numbers) == found.starts[-1]
    assert found.numbers.shape[1] == len(found.steps) == DIRECTIONS
    assert np.abs(found.numbers.astype(int)).max() <= 127
    assert (np.abs(found.numbers.astype(int)).max(axis=0)[:16] > 40).all(), "along the first directions"
    assert found.steps[:16].min() > found.steps[-16:].max() > 0, "along the first windows differ most"


def windows_by_clip(root: Path) -> dict[str, dict[tuple[int, int], list[float]]]:
    """Of the lake's clips, the vector of each window, by its bounds."""
    found: dict[str, dict[tuple[int, int], list[float]]] = {}
    rows = query(root, "SELECT clip, start, stop, descriptor FROM submotions JOIN clips USING (clip, part)")
    for clip, start, stop, vector in rows:
        found.setdefault(clip, {})[start, stop] = vector
    return found


def assert_windows_are_those_of_parts(root: Path) -> None:
    found, parts = held(root), windows_by_clip(root)
    names = found.clips["clip"].to_pylist()
    for clip, rows in zip(names, found.rows.of(np.arange(len(names))), strict=True):
        wanted, bounds = parts.pop(clip, {}), list(zip(rows["start"].tolist(), rows["stop"].tolist(), strict=True))
        assert sorted(bounds) == sorted(wanted)
        np.testing.assert_array_equal(rows["vector"], np.array([wanted[b] for b in bounds]).reshape(-1, 512))
    assert not parts


def test_vectors_are_those_of_parts(large: Path) -> None:
    assert_windows_are_those_of_parts(large)


def test_answers_are_those_of_every_window(large: Path, built_lake: Path) -> None:
    with few():
        assert isinstance(scan_of(large), WindowShortlist)
        assert isinstance(scan_of(large, exact=True), WindowScan)
        for clip, _ in longest(built_lake, 4):
            for words in ([], ["--mirrored"], ["--own"], ["--dataset", clip.partition("/")[0]], ["-k", 3]):
                asked = find(built_lake, clip, 3, 33, *words)
                assert asked.status == 0, asked.err
                assert find(large, clip, 3, 33, *words).json == asked.json
    assert scan_of(large) is not None, "a lake that is not so large compares codes"
    assert not isinstance(scan_of(large), WindowShortlist)


def test_few_chosen_clips_hold_the_nearest(large: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(window_shortlist, "NEAR", 4)
    monkeypatch.setattr(window_shortlist, "SPARE", 1)
    same = []
    with few():
        for clip, frames in longest(large, 9):
            assert frames >= 20
            ours, exact = (find(large, clip, 3, frames, "-k", 3, *words).json for words in ([], ["--exact"]))
            same.append(len({row["clip"] for row in ours} & {row["clip"] for row in exact}) / 3)
    assert np.mean(same) > 0.9


def test_clips_that_stay_are_taken_over(
    large: Path, tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, before, read = Path(shutil.copytree(large, tmp_path / "lake")), held(large), []
    own = shortlist_windows._read

    def reading_of(*given: object) -> None:
        read.append(given[0])
        own(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(shortlist_windows, "_read", reading_of)
    made_clips(tmp_path / "more", 2)
    (gone, *_) = [clip for clip, _ in longest(root, 1)]
    assert motionlake("remove", gone, "--lake", root).status == 0
    assert motionlake("ingest", tmp_path / "more", "--lake", root, "--scheduler", scheduler).status == 0
    parts = run(root, scheduler, "all")["submotions"]
    with few():
        assert run(root, scheduler, "windows")["windows"] == parts
        assert motionlake("run", "shortlist", "--lake", root).status == 0
    after = held(root)
    assert len(read) == parts, "those that came"
    assert after.pieces[0] == before.pieces[0]
    assert len(after.pieces) == 2
    assert_windows_are_those_of_parts(root)
    np.testing.assert_array_equal(after.directions.matrix, before.directions.matrix)
    clips = [each.clips["clip"].to_pylist() for each in (before, after)]
    for clip in set(clips[0]) - {gone}:
        old, new = (
            each.numbers[slice(*each.starts[names.index(clip) :][:2])]
            for each, names in zip((before, after), clips, strict=True)
        )
        np.testing.assert_array_equal(old, new)
    came = min(set(clips[1]) - set(clips[0]))
    ((frames,),) = query(root, "SELECT frames FROM clips WHERE clip = $clip", clip=came)
    with few():
        ours, exact = (find(root, came, 0, frames, "--own", *words) for words in ([], ["--exact"]))
    assert ours.json == exact.json
    nearest = {row["clip"] for row in ours.json if row["distance"] == ours.json[0]["distance"]}
    assert came in nearest, "beside its twin, where the lake is of made clips too"


def test_windows_of_another_encoder_are_not_read(large: Path, tmp_path: Path, scheduler: str) -> None:
    root, clip, found = with_newer_vectors(large, tmp_path, scheduler)
    with few():
        assert not isinstance(scan_of(root), WindowShortlist)
        assert find(root, clip, 3, 33).json == found
        assert run(root, scheduler, "all")["shortlist"] == 1
        assert isinstance(scan_of(root), WindowShortlist)
        assert find(root, clip, 3, 33).json == found


@pytest.mark.parametrize("name", ["windows-numbers.npy", "windows.rows"])
def test_damaged_numbers_answer_nothing(large: Path, tmp_path: Path, name: str) -> None:
    root = Path(shutil.copytree(large, tmp_path / "lake"))
    (clip, _), *_ = longest(root, 1)
    (file,) = (path for path in root.glob(f"shortlist/*-{name}") if is_of_windows(path.name))
    file.write_bytes(bytes(byte ^ 1 for byte in file.read_bytes()))
    with few():
        asked = find(root, clip, 3, 33)
        assert (asked.status, asked.out, file.name in asked.err) == (2, "", True)
        assert motionlake("search", clip, "--lake", root).status == 0, "which does not read them"
        assert motionlake("repair", "--lake", root).status == 0
        assert find(root, clip, 3, 33).status == 0


def test_a_clip_is_read_from_its_part_of_today() -> None:
    """The part that held it before still holds it, beside clips that stayed there."""
    clips = pa.table({"clip": ["a", "b", "c", "d"], "part": ["new", "old", "old", "away"]})
    wanted = rows_by_file({"old": "OLD", "new": "NEW"}, clips, np.array([True, True, False, True]))
    assert wanted == {"NEW": {"a": 0}, "OLD": {"b": 1}}


@given(st.integers(0, 1000), st.lists(st.integers(0, 4), min_size=1, max_size=9))
def test_the_nearest_of_each_clip(seed: int, counts: list[int]) -> None:
    rng, starts = np.random.default_rng(seed), np.cumsum([0, *counts])
    places = rng.integers(-127, 128, (starts[-1], 5)).astype(np.int8)
    asked, steps = rng.normal(0, 60, 5).astype(np.float32), rng.uniform(0.1, 3, 5).astype(np.float32)
    squares = np.square((places.astype(np.float64) - asked) * steps)
    found = np.zeros(len(counts), dtype=np.float32)
    nearest_of_clips(places, starts, asked, steps, 0, len(counts), found)
    wanted = [squares.sum(axis=1)[a:b].min(initial=np.inf) for a, b in pairwise(starts)]
    np.testing.assert_allclose(found, wanted, rtol=1e-5)


PAIRS = st.dictionaries(st.sampled_from("abcdefgh"), st.sampled_from(["old", "new", "other"]))


@given(PAIRS, PAIRS)
def test_rows_of_the_same_clip_and_part_are_those_of_a_search_one_by_one(
    before: dict[str, str], today: dict[str, str]
) -> None:
    tables = [pa.table({"clip": pa.array(own, pa.string()), "part": pa.array(own.values(), pa.string())})
              for own in (before, today)]  # fmt: skip
    known = {pair: row for row, pair in enumerate(before.items())}
    wanted = [(known[pair], row) for row, pair in enumerate(today.items()) if pair in known]
    old, new = same_rows(*tables)
    assert list(zip(old.tolist(), new.tolist(), strict=True)) == wanted
