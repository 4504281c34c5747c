"""Alignment on a lake: every way to ask gives the same answer, in frames, and mistakes are met with one clear line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.strings import LakeStrings, read_strings
from motionlake.pesta import nearest as whole
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.matches import best_matches
from motionlake.pesta.nearest import symmetric_costs
from motionlake.pesta.scan import end_costs
from motionlake.pesta.strings import Repository
from motionlake.retrieval.alignment import AlignmentRangeSearcher, AlignmentSearcher
from motionlake.retrieval.hits import OPTIONAL, Hit
from motionlake.retrieval.protocol import Query, Scope
from motionlake.stages.postures import codes_of_clips

from tests.lakes import QUICK, motionlake, query
from tests.test_tandem import naive_reduction


class Aligner:
    """Both ways to align on one lake; the strings are read once."""

    def __init__(self, lake: Lake, strings: LakeStrings) -> None:
        self.lake, self.strings = lake, strings

    def ranges(self, **how: Any) -> AlignmentRangeSearcher:
        return AlignmentRangeSearcher(self.lake, strings=self.strings, **how)

    def in_clip(self, clip: str, start: int, stop: int, k: int, dataset: str | None = None, **how: Any) -> list[Hit]:
        return self.ranges(**how).search([Query(clip, start, stop)], k, Scope(dataset))[0]

    def in_symbols(self, symbols: Any, k: int, model: str | None = None, **how: Any) -> list[Hit]:
        return self.ranges(**how).in_symbols(symbols, k, model=model)

    def whole(self, clip: str, k: int, dataset: str | None = None, **how: Any) -> list[Hit]:
        return AlignmentSearcher(self.lake, strings=self.strings, **how).search([Query(clip)], k, Scope(dataset))[0]


@pytest.fixture(scope="module")
def aligner(built_lake: Path) -> Aligner:
    lake = open_lake(built_lake)
    with reading(lake) as con:
        return Aligner(lake, read_strings(con))


def strings(lake: Path) -> dict[str, list[tuple[int, int, int]]]:
    """(symbol, start, stop) of every clip, by plain SQL."""
    return {
        clip: query(lake, "SELECT symbol, start, stop FROM clip_symbols($clip)", clip=clip)
        for (clip,) in query(lake, "SELECT clip FROM symbol_strings ORDER BY clip")
    }


def by_sql(lake: Path, text: str) -> list[dict[str, Any]]:
    """The rows of a query, without the columns that answers need not have where they are NULL."""
    run = motionlake("sql", text, "--trusted", "--lake", lake, "--json")
    assert run.status == 0, run.err
    return without_nulls(run.json)


def without_nulls(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Answers without what they need not have, where it is None."""
    return [{k: v for k, v in row.items() if v is not None or k not in OPTIONAL} for row in rows]


def longest(lake: Path) -> tuple[str, int]:
    rows = query(lake, "SELECT clip, frames FROM clips JOIN symbol_strings USING (clip) ORDER BY -len(symbols), clip")
    return rows[0]


OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"method": "dtw"},
    {"method": "sw"},
    {"stride": 3},
    {"dataset": "clips", "stride": 1},
)


@pytest.mark.parametrize("wanted", OPTIONS, ids=lambda w: "-".join(map(str, w.values())) or "default")
def test_every_way_to_ask_gives_the_same_answer(built_lake: Path, aligner: Aligner, wanted: dict[str, Any]) -> None:
    clip, frames = longest(built_lake)
    names = {"dataset": ("--dataset", "dataset"), "method": ("--method", "method"), "stride": ("--stride", "stride")}
    flags = [word for name, value in wanted.items() for word in (names[name][0], value)]
    arguments = "".join(f", {names[name][1]} := {value!r}" for name, value in wanted.items())
    ask = ["align", clip, *flags, "-k", 4, "--lake", built_lake, "--json"]
    found = motionlake(*ask, "--from", 1, "--to", frames - 1).json
    assert found
    assert [hit.as_row() for hit in aligner.in_clip(clip, 1, frames - 1, 4, **wanted)] == found
    text = f"FROM align_motion('{clip}', 1, {frames - 1}, k := 4{arguments})"
    assert by_sql(built_lake, text) == found
    ranked = motionlake(*ask, "--whole").json
    assert [hit.as_row() for hit in aligner.whole(clip, 4, **wanted)] == ranked
    text = f"FROM aligned_clips('{clip}', k := 4{arguments})"
    assert by_sql(built_lake, text) == ranked


def test_all_answers_that_are_near_enough(built_lake: Path) -> None:
    clip, frames = longest(built_lake)
    asked: tuple[list[Any], ...] = (
        ["align", clip, "--from", 1, "--to", frames // 2],
        ["find", clip, "--from", 1, "--to", frames // 2],
        ["search", clip],
    )
    for words in asked:
        ask = [*words, "--lake", built_lake, "--json"]
        every = motionlake(*ask, "-k", 10_000).json
        limit = every[-1]["distance"]
        near = [row for row in every if row["distance"] < limit]
        assert motionlake(*ask, "--below", limit).json == near
        assert motionlake(*ask, "--below", limit, "-k", 3).json == near[:3]
    assert len(near) > 10  # more than there are without --below
    ask = ["align", clip, "--window", 6, "--lake", built_lake, "--json"]
    every = motionlake(*ask, "-k", 10_000).json
    limit = sorted(row["distance"] for row in every)[len(every) // 2]
    assert motionlake(*ask, "--below", limit).json == [row for row in every if row["distance"] < limit]


@pytest.mark.parametrize("method", ["sta", "dtw", "sw"])
def test_hits_are_the_matches_of_the_strings_in_frames(built_lake: Path, aligner: Aligner, method: str) -> None:
    known, (clip, frames) = strings(built_lake), longest(built_lake)
    rates = dict(query(built_lake, "SELECT clip, fps FROM clips"))
    names = list(known)
    first, last = frames // 4, frames - frames // 8
    searcher = aligner.ranges(method=method, paths=True)
    asked = searcher.symbols_of(Query(clip, first, last))
    distances = np.array(query(built_lake, "SELECT distance FROM posture_distances ORDER BY a, b"), dtype=np.float32)
    side = int(len(distances) ** 0.5)
    ground = distances.reshape(side, side)
    others = Repository.of([[s for s, _, _ in string] for name, string in known.items() if name != clip])
    config = AlignmentConfig(method)  # type: ignore[arg-type]
    (hits,) = searcher.search([Query(clip, first, last)], 20)
    # In other clips the first answer to each match is one of its occurrences, at its cost.
    expected = [match.cost for match in best_matches(asked.symbols, others, ground, 20, config)]
    costs = [hit.cost for hit in hits if hit.clip != clip]
    assert costs
    assert costs[0] == pytest.approx(expected[0], abs=1e-5)
    assert len(hits) > 3
    for rank, hit in enumerate(hits, start=1):
        assert hit.start is not None
        assert hit.stop is not None
        assert hit.rank == rank
        assert hit.distance == pytest.approx((hit.cost or 0.0) / len(asked.symbols), abs=1e-5)
        assert (hit.start_seconds, hit.seconds) == (
            hit.start / rates[hit.clip],
            (hit.stop - hit.start) / rates[hit.clip],
        )
        assert hit.clip != clip or hit.stop <= first or hit.start >= last
        # Its frames alone, reduced for themselves, are matched at no higher a cost.
        own = stretch(aligner, hit.clip, hit.start, hit.stop)
        ends = end_costs(asked.symbols, Repository.of([own]), ground, config)
        assert ends.min() <= (hit.cost or 0.0) + 1e-4
        assert hit.path is not None
        assert hit.path[0].clip[0] == hit.start
        assert hit.path[-1].clip[1] == hit.stop
        for step, after in pairwise(hit.path):
            assert step.query[0] <= after.query[0]
            assert step.clip[0] <= after.clip[0]
        assert all(first <= a < b <= last or a == b for a, b in (step.query for step in hit.path))
    for one, other in combinations(hits, 2):
        assert one.clip != other.clip or one.stop <= other.start or other.stop <= one.start  # type: ignore[operator]
    assert names == sorted(names)


def stretch(aligner: Aligner, clip: str, start: int, stop: int) -> list[int]:
    """The symbols of frames of a clip, from the codes that are kept, reduced naively."""
    with reading(aligner.lake) as con:
        codes = codes_of_clips(con, aligner.lake, aligner.strings.model, [clip])[clip].tolist()
    known = aligner.strings.clips[aligner.strings.positions[clip]]
    nearest = [sample_of(frame, known.fps, len(codes)) for frame in range(start, stop)]
    word = [codes[k] for k in range(nearest[0], nearest[-1] + 1)]
    return [word[k] for k in naive_reduction(word)]


def sample_of(frame: int, fps: float, samples: int) -> int:
    """The sample nearest to a frame, of two the later."""
    return min(range(samples), key=lambda k: (round(abs(k * fps / 30 - frame), 6), -k))


def test_a_file_outside_the_lake_is_answered_like_its_clip(
    built_lake: Path, clips_folder: Path, aligner: Aligner
) -> None:
    clip, _ = longest(built_lake)
    file = clips_folder / clip.partition("/")[2]
    of_file = motionlake("align", file, "-k", 6, "--lake", built_lake, "--json").json
    symbols = [symbol for symbol, _, _ in strings(built_lake)[clip]]
    assert [without_speed(row) for row in of_file] == [hit.as_row() for hit in aligner.in_symbols(symbols, 6)]
    own = next(row for row in of_file if row["clip"] == clip)
    assert own["cost"] == pytest.approx(0, abs=1e-6)  # a file is not in the lake: its own range is an answer
    assert all(row["clip"] != clip for row in motionlake("align", clip, "--lake", built_lake, "--json").json)
    ranked = motionlake("align", file, "--whole", "-k", 6, "--lake", built_lake, "--json").json
    of_clip = motionlake("align", clip, "--whole", "-k", 5, "--lake", built_lake, "--json").json
    assert [row["clip"] for row in ranked if row["clip"] != clip] == [row["clip"] for row in of_clip]
    assert [row["distance"] for row in ranked if row["clip"] == clip] == pytest.approx([0], abs=1e-6)


def without_speed(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name != "speed"}


@pytest.mark.parametrize("method", ["sta", "sw"])
@pytest.mark.parametrize("both", ["max", "mean", "query"])
def test_whole_clips_are_ranked_by_both_ways(
    aligner: Aligner, both: Any, method: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("BATCH", "FIRST", "OF_EACH"):
        monkeypatch.setattr(whole, name, 2)
    kept = aligner.strings
    searcher = AlignmentSearcher(aligner.lake, strings=kept, method=method, ways=both)
    costs = symmetric_costs(kept.repository, kept.distances, AlignmentConfig(method), both=both)
    names = [c.clip for c in kept.clips]
    for i in np.flatnonzero(kept.repository.lengths >= 2).tolist():
        others = [j for j in range(len(names)) if j != i]
        expected = sorted((float(costs[i, j]), names[j]) for j in others)[:5]
        found = searcher.whole(searcher.symbols_of(Query(names[i])), 5)
        assert [h.distance for h in found] == pytest.approx([cost for cost, _ in expected], abs=1e-6)
        for hit, (cost, name) in zip(found, expected, strict=True):
            assert hit.clip == name or sum(abs(c - cost) < 1e-6 for c, _ in expected) > 1


def test_a_match_may_cross_from_clip_to_clip(built_lake: Path, aligner: Aligner) -> None:
    known = list(strings(built_lake).items())
    about = {clip: (fps, frames) for clip, fps, frames in query(built_lake, "SELECT clip, fps, frames FROM clips")}
    (before, head), (after, tail) = next(
        pair for pair in pairwise(known) if len(pair[0][1]) > 2 and len(pair[1][1]) > 2
    )
    asked = [symbol for symbol, _, _ in head[-3:] + tail[:3]]
    hit = aligner.in_symbols(asked, 1, boundaries="crossed", stride=1)[0]
    assert (hit.clip, hit.stop_clip, hit.cost) == (before, after, 0)
    assert (hit.start, hit.stop) == (head[-3][1], tail[2][2])
    (fps, frames), (next_fps, _) = about[before], about[after]
    assert hit.seconds == pytest.approx((frames - hit.start) / fps + hit.stop / next_fps)
    assert all(hit.distance > 0 for hit in aligner.in_symbols(asked, 3, stride=1))


def test_a_long_query_answers_for_its_ranges(built_lake: Path, clips_folder: Path, aligner: Aligner) -> None:
    clip, frames = longest(built_lake)
    known = strings(built_lake)[clip]
    outside = aligner.ranges().long_query(Query(clips_folder / clip.partition("/")[2]))
    top = outside.matches(None, None, 1)[0]
    assert (top.clip, top.start, top.stop) == (clip, 0, frames)
    assert top.cost == pytest.approx(0, abs=1e-6)
    kept = aligner.ranges().long_query(Query(clip))
    for first in range(len(known) - 1):
        start, stop = known[first][1], known[first + 1][2]
        if start == known[first][2] or known[first + 1][1] == stop:
            continue  # at a low rate a symbol may stand for no frame
        for hit in kept.matches(start, stop, 5, paths=True):
            assert hit.start is not None
            assert hit.stop is not None
            assert hit.clip != clip or hit.stop <= start or hit.start >= stop
            assert hit.path is not None
            assert all(start <= a <= b <= stop for a, b in (step.query for step in hit.path))
            assert (hit.path[0].clip[0], hit.path[-1].clip[1]) == (hit.start, hit.stop)


def test_windows_of_a_clip_are_asked_for_in_the_shell_and_in_sql(built_lake: Path, aligner: Aligner) -> None:
    """As their ranges one by one: windows of four symbols that slide by one."""
    clip, _ = longest(built_lake)
    known = strings(built_lake)[clip]
    assert len(known) > 5
    rows = motionlake("align", clip, "--window", 4, "-k", 2, "--lake", built_lake, "--json").json
    text = f"FROM align_windows('{clip}', 4, k := 2)"
    assert by_sql(built_lake, text) == rows
    long, expected = aligner.ranges().long_query(Query(clip), window=4), []
    for first in range(len(known) - 3):
        start, stop = known[first][1], known[first + 3][2]
        if start < stop:
            hits = long.matches(start, stop, 2)
            expected += [{"query_start": start, "query_stop": stop, **hit.as_row()} for hit in hits]
    assert rows == expected
    one = motionlake("align", clip, "--window", 4000, "-k", 2, "--lake", built_lake, "--json").json
    assert [(row["query_start"], row["query_stop"]) for row in one] == [(known[0][1], known[-1][2])] * 2


def test_a_string_of_symbols_is_answered_in_sql(built_lake: Path, aligner: Aligner) -> None:
    clip, _ = longest(built_lake)
    asked = f"(SELECT symbols FROM symbol_strings WHERE clip = '{clip}'), k := 3"
    symbols = query(built_lake, "SELECT symbols FROM symbol_strings WHERE clip = $clip", clip=clip)[0][0]
    found = by_sql(built_lake, f"FROM align_symbols({asked}, model := 'postures-1')")
    assert found == [hit.as_row() for hit in aligner.in_symbols(symbols, 3, model="postures-1")]
    assert clip in {hit["clip"] for hit in found if hit["distance"] == 0}  # beside others of the same string
    other = motionlake("sql", f"FROM align_symbols({asked}, model := 'postures-7')", "--lake", built_lake)
    assert other.status == 2
    assert "a string over postures-7 does not compare with strings over postures-1; make it again" in other.err


def test_config_says_how_to_align_and_redoes_the_graph_alone(lake: Path, scheduler: str) -> None:
    clip, _ = longest(lake)
    ask = ["align", clip, "-k", 5, "--lake", lake, "--json"]
    expected = motionlake(*ask, "--method", "dtw").json
    assert expected != motionlake(*ask).json
    (lake / "config.toml").write_text(QUICK + '[alignment]\nmethod = "dtw"\n', encoding="utf-8")
    assert load_config(lake / "config.toml").alignment.method == "dtw"
    assert motionlake(*ask).json == expected
    again = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler, "--json").json
    assert {row["stage"] for row in again if row["shards"]} == {"graph"}


def test_mistakes_are_met_with_one_clear_line(built_lake: Path, tmp_path: Path, aligner: Aligner) -> None:
    clip, frames = longest(built_lake)
    (_, start, stop), *_ = [row for row in strings(built_lake)[clip] if row[2] > row[1]]
    for words, said in (
        ([clip, "--from", start, "--to", stop], "are one symbol, a posture that is held"),
        ([clip, "--from", frames], f"has frames 0 to {frames}"),
        ([clip, "--from", 9, "--to", 4], f"has frames 0 to {frames}"),
        ([clip, "--stride", 0], "stride is 0"),
        ([clip, "--stride", 20000], "stride is 20000: it is a whole number from 1 to 64"),
        ([clip, "--window", 9, "--whole", "--mirrored"], "--window: looks for many ranges at once; leave --whole and"),
        ([clip, "--window", 9, "--picture", "hits.html"], "--window: answers many queries; leave --picture out"),
        ([clip, "--window", 9, "--gaps"], "aligned without gaps: switch gaps off"),
        ([clip, "--gaps", "--method", "sw"], 'gaps are an option of "sta"'),
        ([clip, "--boundaries", "open"], "boundaries is 'open', not one of kept, crossed, dropped"),
        ([clip, "--whole", "--boundaries", "crossed"], "--whole: compares whole clips; leave --boundaries out"),
        ([clip, "--whole", "--ways", "all"], "ways is 'all', not one of max, mean, query"),
        ([clip, "--ways", "query"], "--ways: is for --whole"),
        ([clip, "--window", 9, "--ways", "query"], "--ways: is for --whole"),
        ([clip, "--window", 9, "--method", "sw"], "by sta or dtw, not by sw"),
        ([clip, "--method", "guess"], "not one of sta, dtw, sw"),
        ([clip, "--path"], "--path: needs --json"),
        (["nowhere"], "no such clip"),
    ):
        run = motionlake("align", *words, "--lake", built_lake)
        assert (run.status, run.err.count("\n"), run.out) == (2, 1, "")
        assert said in run.err
    for text, said in (
        ("align_symbols([]::INTEGER[])", "is empty"),
        ("align_symbols([3])", "one symbol"),
        ("align_symbols([3, 4000])", "symbol 4000"),
        ("align_motion('nowhere', NULL, NULL)", "nowhere: no such clip"),
        (f"align_motion('{clip}', NULL, NULL, stride := 0)", "stride is 0"),
        (f"align_motion('{clip}', NULL, NULL, k := -1)", "k is -1"),
        (f"align_motion('{clip}', boundaries := 'open')", "boundaries is 'open'"),
        (f"align_windows('{clip}', gaps := true)", "switch gaps off"),
        (f"aligned_clips('{clip}', ways := 'all')", "ways is 'all'"),
        (f"align_windows('{clip}', 1)", "window is 1: it has at least 2 symbols"),
        ("aligned_clips('nowhere')", "nowhere: no such clip"),
        (f"aligned_clips('{clip}', k := -1)", "k is -1"),
    ):
        run = motionlake("sql", f"FROM {text}", "--lake", built_lake)
        assert (run.status, run.err.count("\n")) == (2, 1), run.err
        assert said in run.err
    with pytest.raises(UserError, match="sw"):
        aligner.ranges(method="sw").long_query(Query(clip))
    with pytest.raises(UserError, match="ways is 'all'"):
        AlignmentSearcher(aligner.lake, strings=aligner.strings, ways="all")
    empty = tmp_path / "empty"
    assert motionlake("init", empty).status == 0
    assert "motionlake run all" in motionlake("align", clip, "--lake", empty).err
    assert motionlake("align", clip, "--dataset", "elsewhere", "--lake", built_lake, "--json").json == []
