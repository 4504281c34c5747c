"""Query by example inside sequences: a sliding signature, against its definition and on recordings put end to end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.deep_motifs import query_by_example
from motionlake.deep_motifs.emd import emd
from motionlake.deep_motifs.query_by_example import (
    ExampleQuery,
    RangeHit,
    distances_along,
    find_ranges,
    window_ranges,
    words_within,
)
from motionlake.deep_motifs.signatures import Corpus, CorpusClip, signature
from motionlake.errors import UserError
from motionlake.formats import read_clips
from motionlake.formats.write.bvh import write_bvh
from motionlake.lake.layout import open_lake
from motionlake.motion.features import WordConfig
from motionlake.retrieval.fused_ranges import FusedRangeSearcher
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.query_by_example import WordsSearcher

from bench.example_queries import Query as LabelledQuery
from bench.example_queries import Takes
from bench.query_by_example import answers, frame_distances_along, printed
from tests.lakes import motionlake, query

K = 8


def made_corpus(seed: int, lengths: list[int], motifs: int = K) -> Corpus:
    """Clips of so many words that linger in motifs, 5 frames a word and 20 to each."""
    rng = np.random.default_rng(seed)
    runs = [np.repeat(rng.integers(0, motifs, n), rng.integers(1, 4, n))[:n] for n in lengths]
    starts = np.concatenate([np.arange(n) * 5 for n in lengths])
    return Corpus(
        [CorpusClip(f"set/{i:02}", f"set{i % 2}", None, None, None, 30.0, 5 * n + 17) for i, n in enumerate(lengths)],
        np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        np.concatenate(runs).astype(np.int32),
        starts,
        starts + 20,
        rng.standard_normal((motifs, 3)).astype(np.float32),
        rng.uniform(1, 3, motifs),
        np.ones(motifs),
        "motifs-1",
    )


def by_definition(
    corpus: Corpus, asked: ExampleQuery, k: int, without: tuple[int, int, int] | None
) -> list[tuple[str, int, int, float]]:
    """Every window compared, sorted by distance, clip and start; those that overlap a better one struck out."""

    def signed(motifs: np.ndarray) -> np.ndarray:
        return signature(np.bincount(motifs, minlength=len(corpus.idf)), corpus.idf)

    sides = [signed(m) for m in (asked.motifs, asked.mirrored) if m is not None]
    windows = []
    for i, clip in enumerate(corpus.clips):
        words = corpus.words_of(i)
        motifs, starts, stops = corpus.motifs[words], corpus.starts[words], corpus.stops[words]
        width = min(asked.n_words, len(motifs))
        for w in range(len(motifs) - width + 1):
            start, stop = int(starts[w]), int(stops[w + width - 1])
            if without and without[0] == i and start < without[2] and stop > without[1]:
                continue
            window = signed(motifs[w : w + width])
            windows.append((min(emd(side, window, corpus.ground) for side in sides), clip.clip, start, stop))
    hits: list[tuple[str, int, int, float]] = []
    for distance, name, start, stop in sorted(windows):
        if len(hits) < k and all(name != c or stop <= a or start >= b for c, a, b, _ in hits):
            hits.append((name, start, stop, distance))
    return hits


def rows(hits: list[RangeHit]) -> list[tuple[str, int, int, float]]:
    return [(h.clip, h.start, h.stop, h.distance) for h in hits]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    lengths=st.lists(st.integers(1, 40), min_size=1, max_size=6),
    n_words=st.integers(2, 7),
    k=st.integers(1, 12),
    mirrored=st.booleans(),
    ahead=st.sampled_from([1, 4]),
    without=st.sampled_from([None, (0, 10, 40)]),
)
def test_hits_are_those_of_comparing_every_window(
    seed: int,
    lengths: list[int],
    n_words: int,
    k: int,
    mirrored: bool,
    ahead: int,
    without: tuple[int, int, int] | None,
) -> None:
    corpus = made_corpus(seed, lengths)
    rng = np.random.default_rng(seed + 1)
    motifs = rng.integers(0, K, (2, n_words)).astype(np.int32)
    asked = ExampleQuery(motifs[0], motifs[1] if mirrored else None)
    expected = by_definition(corpus, asked, k, without)
    with mock.patch.object(query_by_example, "_AHEAD", ahead):
        assert rows(find_ranges(corpus, asked, k, without=without)) == expected
    hits = find_ranges(corpus, asked, 1000, without=without)
    assert rows(hits)[:k] == expected
    assert [h.rank for h in hits] == list(range(1, len(hits) + 1))


def test_a_hit_says_whether_the_mirrored_query_was_nearer() -> None:
    corpus = made_corpus(0, [12, 12])
    motifs = corpus.motifs[:4]
    other = np.full(4, (motifs[0] + 1) % K, dtype=np.int32)
    assert not find_ranges(corpus, ExampleQuery(motifs, other), 1)[0].mirrored
    assert find_ranges(corpus, ExampleQuery(other, motifs), 1)[0].mirrored


def test_distances_along_a_clip() -> None:
    corpus = made_corpus(3, [25, 3])
    asked = ExampleQuery(corpus.motifs[4:9])
    along = distances_along(corpus, 0, asked)
    ranges = window_ranges(corpus, 0, 5)
    assert along.shape == (21,)
    assert along[4] == 0
    frames = frame_distances_along(corpus, 0, asked)
    assert frames.shape == (corpus.clips[0].frames,)
    for frame in range(len(frames)):
        covering = [d for (start, stop), d in zip(ranges, along, strict=True) if start <= frame < stop]
        assert frames[frame] == (min(covering) if covering else frames[ranges[-1, 1] - 1])
    assert len(distances_along(corpus, 1, asked)) == 1  # shorter than the query: compared as a whole


def test_only_whole_words_are_asked_for() -> None:
    starts, stops = np.array([0, 5, 10, 15]), np.array([20, 25, 30, 33])
    assert words_within(starts, stops, 0, 33) == slice(0, 4)
    assert words_within(starts, stops, 1, 30) == slice(1, 3)
    assert words_within(starts, stops, 5, 25) == slice(1, 2)
    assert words_within(starts, stops, 6, 24).start == words_within(starts, stops, 6, 24).stop


@pytest.mark.parametrize("count", [0, 1])
def test_a_query_of_less_than_two_words_is_refused(count: int) -> None:
    with pytest.raises(UserError, match="the query is too short"):
        ExampleQuery(np.zeros(count, dtype=np.int32))


def longest(lake: Path) -> tuple[str, int]:
    return query(lake, "SELECT clip, frames FROM clips JOIN signatures USING (clip) ORDER BY words DESC, clip LIMIT 1")[
        0
    ]


@pytest.mark.parametrize("mirrored", [False, True])
def test_every_way_to_ask_gives_the_same_answer(built_lake: Path, clips_folder: Path, mirrored: bool) -> None:
    clip, frames = longest(built_lake)
    flag = ["--mirrored"] if mirrored else []
    words = ["-k", 5, "--lake", built_lake, "--json"]
    found = motionlake("find", clip, "--from", frames // 4, "--to", frames, *flag, *words).json
    assert len(found) == 5
    text = f"FROM find_motion('{clip}', {frames // 4}, NULL, k := 5, mirrored := {mirrored})"
    assert motionlake("sql", text, "--lake", built_lake, "--json").json == found
    asked, scope = Query(clip, frames // 4), Scope(mirrored=mirrored)
    (hits,) = FusedRangeSearcher(open_lake(built_lake)).search([asked], 5, scope)
    assert [h.as_row() for h in hits] == found
    (hits,) = WordsSearcher(open_lake(built_lake)).search([asked], 5, scope)
    by_words = motionlake("find", clip, "--from", frames // 4, *flag, "--method", "words", *words).json
    assert [h.as_row() for h in hits] == by_words
    file = clips_folder / clip.partition("/")[2]
    for method, least in (("fused", 5e-3), ("words", 1e-6)):
        ask = ["find", file, "--from", frames // 4, *flag, "--method", method, "-k", 6, "--lake", built_lake, "--json"]
        own = [row for row in motionlake(*ask).json if row["clip"] == clip and row["stop"] > frames // 4]
        # A file is not in the lake: its own range is an answer.
        assert own[0]["distance"] == pytest.approx(0, abs=least)
    assert all(row["clip"] != clip or row["stop"] <= frames // 4 for row in found)


def test_the_bench_scores_what_the_command_prints(built_lake: Path) -> None:
    clip, _ = longest(built_lake)
    lake = open_lake(built_lake)
    searcher = FusedRangeSearcher(lake)
    corpus = searcher.corpus
    labels = [np.full(round((each.frames - 1) / each.fps * 24) + 1, "some") for each in corpus.clips]
    takes = Takes(corpus, [], labels, [], WordConfig())
    asked = LabelledQuery(corpus.positions[clip], 2, 5, "some")
    part = takes.asked(asked)
    edges = ["--from", part.start, "--to", part.stop]
    found = motionlake("find", clip, *edges, "-k", 9999, "--lake", lake.root, "--json").json
    rows = [(row["clip"], range(row["start"], row["stop"]), row["distance"]) for row in found]
    scored = printed(takes, answers(takes, [asked], searcher))(asked)
    for at, (along, known) in enumerate(zip(scored, corpus.clips, strict=True)):
        for i, distance in enumerate(along.tolist()):
            frame = min(round(i / 24 * known.fps), known.frames - 1)
            over = [away for name, frames, away in rows if name == known.clip and frame in frames]
            assert over in ([distance], []), (at, i)
            assert over or known.clip == clip


def test_hits_lie_in_their_clips_and_may_be_kept_to_a_dataset(built_lake: Path) -> None:
    clip, _ = longest(built_lake)
    lengths = dict(query(built_lake, "SELECT clip, frames FROM clips"))
    found = motionlake("find", clip, "-k", 50, "--lake", built_lake, "--json").json
    assert found
    for row in found:
        assert 0 <= row["start"] < row["stop"] <= lengths[row["clip"]]
    assert motionlake("find", clip, "--dataset", "elsewhere", "--lake", built_lake, "--json").json == []


def test_mistakes_are_met_with_one_clear_line(built_lake: Path, tmp_path: Path) -> None:
    clip, frames = longest(built_lake)
    for words, said in (
        (["--from", 0, "--to", 2], "too short to compare; take a range of at least 0.6 s"),
        (["--from", frames], f"has frames 0 to {frames}"),
        (["--from", 9, "--to", 4], f"has frames 0 to {frames}"),
    ):
        run = motionlake("find", clip, *words, "--lake", built_lake)
        assert (run.status, run.err.count("\n")) == (2, 1)
        assert said in run.err
    empty = tmp_path / "empty"
    assert motionlake("init", empty).status == 0
    assert "motionlake run all" in motionlake("find", clip, "--lake", empty).err
    assert "no such clip" in motionlake("find", "nowhere", "--lake", built_lake).err


@pytest.mark.recordings
def test_a_motion_is_found_where_it_was_put_in(lake: Path, recordings: Path, scheduler: str, tmp_path: Path) -> None:
    """Real recordings of one rig put end to end: each is found in its own part of the whole."""
    paths = [recordings / f"bandai1/clips/dataset-1_{name}_normal_001.bvh" for name in ("slash", "bow", "walk")]
    parts = [read_clips(path)[0] for path in paths]
    (tmp_path / "joined").mkdir()
    joined = replace(parts[0], channels=np.concatenate([part.channels for part in parts]))
    write_bvh(joined, tmp_path / "joined" / "long.bvh")
    for words in (["ingest", tmp_path / "joined"], ["run", "all"]):
        run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
    begin = 0
    for path, part in zip(paths, parts, strict=True):
        frames = len(part.channels)
        words = ["--from", round(0.1 * frames), "--to", round(0.9 * frames), "--dataset", "joined", "-k", 1]
        (hit,) = motionlake("find", path, *words, "--lake", lake, "--json").json
        assert hit["clip"] == "joined/long.bvh"
        overlap = min(hit["stop"], begin + frames) - max(hit["start"], begin)
        assert overlap >= 0.8 * (hit["stop"] - hit["start"])
        begin += frames
