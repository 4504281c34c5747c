"""Ranges of clips as queries: what a file of their frames would be asked, in every way to ask; on recordings of boxing
and jumping, and on what else is at hand."""

from __future__ import annotations

import os
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake import Lake as OpenLake
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.motion.features import word_features
from motionlake.pesta.matches import best_matches
from motionlake.retrieval.alignment import AlignmentRangeSearcher
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Query, Scope
from motionlake.stages.postures import codes_of_clips

from bench.pesta.cut_files import cut_file, reduced
from tests.lakes import made_once, motionlake, query
from tests.test_align import by_sql

POSTURES = '[postures]\ndictionary = "kmeans"\nm = 200\nweights = "own"\n'
TAKES = ("13_29", "14_20")
RANGES = ((240, 360), (180, 420), (150, 270), (1600, 1720), (1234, 1377), (3000, 3400))
OWN = Scope(own=True)


@pytest.fixture(scope="module")
def takes() -> Path:
    data = os.environ.get("MOTIONLAKE_DATA")
    if not data:
        pytest.skip("needs MOTIONLAKE_DATA")
    return Path(data) / "cmu_exercises" / "clips"


@pytest.fixture(scope="module")
def boxing(shared: Path, takes: Path, scheduler: str) -> Path:
    """A lake of two takes of exercises that repeat."""

    def build(lake: Path) -> None:
        sources = lake.parent / "exercises"
        sources.mkdir()
        for name in (*(f"{take}.amc" for take in TAKES), "standin_01.asf"):
            shutil.copyfile(takes / name, sources / name)
        assert motionlake("init", lake).status == 0
        (lake / "config.toml").write_text(POSTURES, encoding="utf-8")
        for words in (["ingest", sources], ["run", "postures"], ["run", "symbols"]):
            run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
            assert run.status == 0, run.err

    return made_once(shared / "lakes" / "boxing", build)


@pytest.fixture(scope="module")
def searcher(boxing: Path) -> AlignmentRangeSearcher:
    return AlignmentRangeSearcher(open_lake(boxing), paths=True)


def clip_of(searcher: AlignmentRangeSearcher, take: str) -> str:
    return next(clip.clip for clip in searcher.strings.clips if take in clip.clip)


def told(hits: list[Hit]) -> list[tuple[Any, ...]]:
    return [(hit.clip, hit.start, hit.stop, round(hit.cost or 0, 4), hit.cycles) for hit in hits]


@pytest.mark.parametrize("take", TAKES)
@pytest.mark.parametrize(("start", "stop"), RANGES)
def test_a_range_is_asked_for_like_a_file_of_its_frames(
    searcher: AlignmentRangeSearcher, takes: Path, take: str, start: int, stop: int, tmp_path: Path
) -> None:
    file = cut_file(takes / f"{take}.amc", start, stop, tmp_path)
    lake, dictionary = searcher.lake, searcher.clip_strings.dictionary
    motion = query_motion(lake, Query(file))
    codes = dictionary.encode(word_features(*motion.cut(), motion.fps, dictionary.config.frames))
    part = Query(clip_of(searcher, take), start, stop)
    assert searcher.symbols_of(part).symbols.tolist() == reduced(codes.tolist())
    of_range, of_file = (searcher.search([each], 10, OWN)[0] for each in (part, Query(file)))
    assert told(of_range) == told(of_file)
    # The file with more frames around, of which the same are asked for.
    whole = Query(takes / f"{take}.amc", start, stop)
    assert told(searcher.search([whole], 10, OWN)[0]) == told(of_file)


def test_a_cycle_of_boxing_finds_the_other_cycles(searcher: AlignmentRangeSearcher) -> None:
    """The frames lie within one symbol of the take, whose repeats are folded."""
    clip = clip_of(searcher, "13_29")
    for start, stop in RANGES[:2]:
        asked = searcher.symbols_of(Query(clip, start, stop))
        (hits,) = searcher.search([Query(clip, start, stop)], 5)
        assert len(asked.symbols) > 3
        assert len(hits) == 5
        for hit in hits:
            assert 0.4 * (stop - start) < (hit.stop or 0) - (hit.start or 0) < 2.5 * (stop - start)
            assert hit.speed is not None
            assert 0.3 < hit.speed < 3
            assert hit.clip != clip or (hit.stop or 0) <= start or (hit.start or 0) >= stop


def test_other_cycles_of_the_same_repeat_are_answers(searcher: AlignmentRangeSearcher) -> None:
    """The take's string has one instance of the punches, whose frames are the query's; the next cycles follow."""
    clip = clip_of(searcher, "13_29")
    (hits,) = searcher.search([Query(clip, 150, 270)], 4)
    assert any(hit.clip == clip and 270 <= (hit.start or 0) < 300 and hit.cost == 0 for hit in hits)


def test_every_way_to_ask_gives_the_same_answer(boxing: Path, searcher: AlignmentRangeSearcher) -> None:
    clip = clip_of(searcher, "13_29")
    command = motionlake("align", clip, "--from", 240, "--to", 360, "-k", 4, "--lake", boxing, "--json").json
    assert len(command) == 4
    assert {"cycles", "speed"} <= set(command[0])
    text = f"FROM align_motion('{clip}', 240, 360, k := 4)"
    assert by_sql(boxing, text) == command
    assert list(OpenLake(boxing).align(clip, 240, 360, k=4)) == command
    whole = motionlake("search", clip, "--method", "alignment", "-k", 1, "--lake", boxing, "--json").json
    assert [row["clip"] for row in whole] == [clip_of(searcher, "14_20")]


def codes_within(searcher: AlignmentRangeSearcher, clip: str, start: int, stop: int) -> list[int]:
    """The codes that are kept of the samples nearest to frames, of 120 a second."""
    with reading(searcher.lake) as con:
        codes = codes_of_clips(con, searcher.lake, searcher.strings.model, [clip])[clip]
    nearest = {min((frame + 2) // 4, len(codes) - 1) for frame in range(start, stop)}
    return [int(codes[k]) for k in sorted(nearest)]


@pytest.mark.parametrize(("start", "stop"), RANGES)
def test_ranges_of_a_long_query_are_reduced_for_themselves(
    searcher: AlignmentRangeSearcher, start: int, stop: int
) -> None:
    clip = clip_of(searcher, "13_29")
    long = searcher.long_query(Query(clip))
    part = long.part(start, stop)
    assert part.symbols.tolist() == reduced(codes_within(searcher, clip, start, stop))
    hits = long.matches(start, stop, 5, paths=True)
    assert len(hits) == 5
    place = long.place(part)
    if place is None:  # within a repeat: aligned by itself
        strings = searcher.strings
        fresh = best_matches(part.symbols, strings.repository, strings.distances, 40, searcher.config)
        elsewhere = [match.cost for match in fresh if strings.clips[match.clip].clip != clip]
        assert min(hit.cost or 0 for hit in hits if hit.clip != clip) == pytest.approx(elsewhere[0], abs=1e-5)
    else:
        assert long.query.symbols[place : place + len(part.symbols)].tolist() == part.symbols.tolist()
    for hit in hits:
        assert hit.path is not None
        assert all(start <= a < b <= stop for a, b in (step.query for step in hit.path))
        assert (hit.path[0].clip[0], hit.path[-1].clip[1]) == (hit.start, hit.stop)
        assert hit.clip != clip or (hit.stop or 0) <= start or (hit.start or 0) >= stop


def test_frames_of_answers_reduce_to_what_was_asked_for(searcher: AlignmentRangeSearcher) -> None:
    """Frames that are aligned one after the other at no cost have the query's own string."""
    clip, found = clip_of(searcher, "13_29"), 0
    for start in range(150, 3000, 150):
        asked = searcher.symbols_of(Query(clip, start, start + 120))
        (hits,) = searcher.search([Query(clip, start, start + 120)], 10)
        for hit in hits:
            assert hit.path is not None
            steps = [step.query for step in hit.path], [step.clip for step in hit.path]
            in_full = all(one[1] == other[0] for side in steps for one, other in pairwise(side))
            if hit.cost == 0 and in_full:  # nothing is strided over
                codes = codes_within(searcher, hit.clip, hit.start or 0, hit.stop or 0)
                assert reduced(codes) == asked.symbols.tolist()
                found += 1
    assert found > 3


def test_a_mistake_is_met_with_one_clear_line(boxing: Path, searcher: AlignmentRangeSearcher) -> None:
    clip = clip_of(searcher, "13_29")
    run = motionlake("align", clip, "--from", 240, "--to", 241, "--lake", boxing)
    assert (run.status, run.err.count("\n")) == (2, 1)
    assert "are one symbol" in run.err
    with pytest.raises(UserError, match="are not a range of them"):
        searcher.long_query(Query(clip)).matches(9, 4, 1)


def test_strings_are_read_as_they_were_made(boxing: Path, tmp_path: Path) -> None:
    """Settings that have changed since do not change the frames of answers."""
    lake = Path(shutil.copytree(boxing, tmp_path / "lake"))
    clip = query(lake, "SELECT clip FROM clips ORDER BY clip")[0][0]
    (lake / "config.toml").write_text(f"{POSTURES}[symbols]\nrepeats = false\n", encoding="utf-8")
    with pytest.warns(UserWarning, match="since the last run"):
        kept = AlignmentRangeSearcher(open_lake(lake))
    string = kept.clip_strings.of(clip)
    assert np.array_equal(string.folded.starts, kept.strings.string_of(kept.strings.positions[clip]).starts)
