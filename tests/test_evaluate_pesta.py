"""PESTA's measures: rankings, curves, confusions, sub-queries and singular pieces by hand, and the command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.evaluation.pesta.framed import Framed
from motionlake.evaluation.pesta.measuring import LabelledRange, Take, class_of, drawn_ranges
from motionlake.evaluation.pesta.robustness import piece_of, singular_clips, singular_pieces
from motionlake.evaluation.pesta.sub_queries import (
    SubQuery,
    ask_all,
    fresh_search,
    long_questions,
    score_sub_queries,
    shared_search,
    sub_queries,
)
from motionlake.evaluation.ranking import (
    by_class,
    confusion,
    leave_one_out,
    others,
    precision_recall,
    ranked_relevance,
    relatives,
    score_rankings,
    share_label,
)
from motionlake.lake.catalog import reading
from motionlake.lake.layout import open_lake
from motionlake.lake.settings import served_config
from motionlake.motion.features import word_features
from motionlake.motion.skeleton import INDEX, facing
from motionlake.pesta.config import AlignmentConfig, Method
from motionlake.pesta.dictionary_fitting import fit_dictionary
from motionlake.pesta.nearest import symmetric_costs
from motionlake.pesta.symbols import SymbolString, symbolise
from motionlake.retrieval.encode import query_motion
from motionlake.retrieval.protocol import Query
from motionlake.stages.model_kind import Selection
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.reader import LakeReader

from tests.lakes import motionlake, query, quick_lake
from tests.test_evaluate import taught_lake

KEYS = ("map", "p_at_2", "p_at_5", "p_at_10", "p_at_15", "p_at_20", "n")


def test_rankings_are_scored_by_hand() -> None:
    rankings = [np.array(row, dtype=bool) for row in ([1, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0] * 6)]
    found = score_rankings(rankings)
    assert found.n == 2  # the third has nothing to find
    assert found.map == pytest.approx(((1 + 2 / 3) / 2 + 1 / 4) / 2)
    assert (found.nn, found.p_at_2) == (1 / 2, 1 / 4)
    assert found.p_at_5 == pytest.approx((2 / 5 + 1 / 5) / 2)
    assert found.p_at_10 == found.p_at_20 == pytest.approx((2 / 6 + 1 / 6) / 2)  # of the six that there are
    classes = by_class(rankings, ["b", "a", "c"])
    assert list(classes) == ["a", "b"]
    assert score_rankings(classes["a"]).map == 1 / 4
    with pytest.raises(ValueError, match="nothing to retrieve"):
        score_rankings(rankings[2:])


def test_a_precision_recall_curve_by_hand() -> None:
    """Four relevant hits at ranks 1, 2, 5 and 10: a half of them takes 2 hits, three quarters 5, all of them 10."""
    hits = np.zeros(12, dtype=bool)
    hits[[0, 1, 4, 9]] = True
    one = np.array([0, 1], dtype=bool)
    assert precision_recall([hits], 4)["precision"] == [1, 1, 3 / 5, 4 / 10]
    assert precision_recall([hits, one, np.zeros(3, dtype=bool)], 4) == {
        "recall": [0.25, 0.5, 0.75, 1],
        "precision": [0.75, 0.75, pytest.approx(0.55), pytest.approx(0.45)],
    }
    assert precision_recall(by_class([hits, one], ["a", "b"])["b"], 4)["precision"] == [0.5] * 4


def test_a_clip_of_several_labels_is_relevant_for_each() -> None:
    carried = [{"walk", "turn"}, {"walk"}, set(), {"turn"}]
    relevant = share_label(["turn", "walk"], carried)
    np.testing.assert_array_equal(relevant, [[1, 0, 0, 1], [1, 1, 0, 0]])
    candidates = np.array([[False, True, True, True], [True, True, True, False]])
    distances = np.array([[0.0, 0.1, 0.2, 0.3], [0.2, 0.2, 0.1, 0.0]])
    hits = ranked_relevance(distances, relevant & candidates, candidates)
    assert [row.tolist() for row in hits] == [[False, False, True], [False, True, True]]  # ties by index
    with pytest.raises(ValueError, match="not fit"):
        ranked_relevance(distances[:, :2], relevant, candidates)


@settings(max_examples=40, deadline=None)
@given(st.integers(3, 12), st.integers(1, 4), st.integers(0, 10_000))
def test_rankings_agree_with_leave_one_out(n: int, classes: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    distances = random.integers(0, 5, (n, n)).astype(float)
    labels = ["x", "x", *(str(c) for c in random.integers(0, classes, n - 2))]
    expected = leave_one_out(distances, labels)
    rankings = ranked_relevance(distances, relatives(labels), others(n))
    found = score_rankings(rankings)
    assert (found.map, found.nn, found.n) == pytest.approx((expected.map, expected.nn, expected.n))
    assert found.p_at_5 == pytest.approx(expected.top5)
    counts = confusion(distances, labels, labels, others(n), top=1)
    assert not relatives(labels).diagonal().any()
    assert np.trace(counts["counts"]) == sum(hits[0] for hits in rankings)


def test_a_confusion_by_hand() -> None:
    distances = np.array([[0.0, 1, 2, 3], [1, 0, 2, 3], [5, 4, 0, 1], [5, 4, 1, 0]])
    labels = ["b", "b", "a", "b"]
    found = confusion(distances, labels, labels, others(4), top=2)
    assert found == {"classes": ["a", "b"], "counts": [[0, 2], [3, 3]]}


def test_singular_pieces_come_from_other_classes_and_rates_nest() -> None:
    lengths, labels = [95, 40, 9, 200, 33], ["a", "a", "b", "b", "c"]
    found = {rate: singular_pieces(lengths, labels, rate, seed=3) for rate in (0.0, 0.25, 0.5, 1.0)}
    assert all(len(rows) == 0 for rows in found[0.0])
    assert [len(rows) for rows in found[0.5]] == [round(0.5 * (n // 10)) for n in lengths]
    for rate, clips in found.items():
        for clip, rows in enumerate(clips):
            for at, source, start in rows.tolist():
                assert at % 10 == 0
                assert at + 10 <= lengths[clip]
                assert labels[source] != labels[clip]
                assert start + 10 <= lengths[source]
            assert len(set(rows[:, 0].tolist())) == len(rows)
            fuller = {tuple(row) for row in found[1.0][clip].tolist()}
            assert {tuple(row) for row in rows.tolist()} <= fuller, rate
    assert [r.tolist() for r in singular_pieces(lengths, labels, 0.5, seed=4)] != [r.tolist() for r in found[0.5]]
    with pytest.raises(ValueError, match="not from 0 to 1"):
        singular_pieces(lengths, labels, 1.5, seed=0)
    with pytest.raises(ValueError, match="no clip of another label"):
        singular_pieces([50, 50], ["a", "a"], 0.1, seed=0)


def even_string(symbols: list[int], frames: int = 10) -> SymbolString:
    """Each symbol stands for as many frames."""
    places = frames * np.arange(len(symbols) + 1)
    return SymbolString(np.array(symbols, dtype=np.int32), places[:-1], places[1:])


def test_windows_of_one_class_are_sub_queries() -> None:
    string = even_string(list(range(20)))
    take = Take(string, ((0, 72, "a"), (72, 160, "b"), (150, 170, "a")))
    # Frames 0 to 120: 72 of a, just 60 %. 40 to 160: 88 of b, 42 of a. 80 to 200: 80 of b. 20 symbols hold no more.
    assert sub_queries(take) == [SubQuery(0, 12, "a"), SubQuery(4, 16, "b"), SubQuery(8, 20, "b")]
    assert sub_queries(take, share=0.7) == [SubQuery(4, 16, "b")]
    assert class_of(0, 120, take.segments) == ("a", 0.6)
    assert class_of(140, 180, take.segments) == ("a", 0.5)  # as many as of b: the first by name
    assert class_of(180, 200, take.segments) == ("", 0.0)
    assert class_of(60, 80, ((50, 70, "x"), (60, 72, "x"))) == ("x", 0.6)  # a frame counts once
    assert sub_queries(Take(even_string(list(range(11))), take.segments)) == []


def test_sub_queries_are_asked_of_the_other_takes() -> None:
    """Three takes; each exercise is a stretch of symbols of its own, "only" is in one take alone."""
    stretches = {"up": range(12), "down": range(20, 32), "only": range(40, 52)}

    def take(*names: str) -> Take:
        symbols = [symbol for name in names for symbol in stretches[name]]
        return Take(even_string(symbols), tuple((120 * i, 120 * i + 120, name) for i, name in enumerate(names)))

    takes = [take("up", "down"), take("down", "up", "only"), take("up", "down", "up")]
    places = np.arange(60, dtype=np.float32)
    distances = np.abs(places[:, None] - places)
    questions = long_questions(takes)
    assert [len(question.elsewhere) for question in questions] == [2, 2, 2]
    for search in (fresh_search, shared_search):
        found = score_sub_queries(questions, distances, AlignmentConfig(stride=2), search)
        labels = [query.label for question in questions for query in question.asked]
        assert found["all_n"] == len(labels)
        assert found["n"] == sum(label != "only" for label in labels)
        assert found["p_at_2"] > 0.9  # each but "only" is shown at least twice elsewhere, or once and half
        assert found["all_p_at_2"] == pytest.approx(found["p_at_2"] * found["n"] / found["all_n"])
        answers = [matches for *_, matches in ask_all(questions, distances, AlignmentConfig(), search)]
        assert sum(map(len, answers)) >= 2 * len(answers) == 2 * len(labels)
    # A class that every other take has under another name is never right.
    renamed = [takes[0], *(Take(t.string, tuple((a, b, f"not {c}") for a, b, c in t.segments)) for t in takes[1:])]
    wrong = score_sub_queries(long_questions(renamed), distances, AlignmentConfig(), fresh_search)
    alone = [query.label for query in (*sub_queries(renamed[0]), *sub_queries(renamed[1]))]
    assert wrong["all_n"] - wrong["n"] == sum(label in stretches or label == "not only" for label in alone)
    with pytest.raises(ValueError, match="nothing to retrieve"):
        score_sub_queries(long_questions(renamed[:2]), distances, AlignmentConfig(), fresh_search)


def test_strings_of_a_lake_are_measured(built_lake: Path, tmp_path: Path) -> None:
    run = motionlake("evaluate", "pesta", "--lake", built_lake, "--json")
    assert run.status == 0, run.err
    found = run.json
    one_way = [f"{method}_one_way" for method in ("sta", "dtw", "sw")]
    assert list(found) == ["sta", "dtw", "sw", *one_way, "signatures", "dtw_frames", "sub_queries"]
    assert found["sub_queries"] is None
    rows = query(
        built_lake,
        "SELECT symbols, label FROM symbol_strings JOIN clips USING (clip) WHERE label IS NOT NULL ORDER BY clip",
    )
    codes = np.array([r[0] for r in query(built_lake, "SELECT code FROM postures ORDER BY symbol")])
    distances = np.linalg.norm(codes[:, None] - codes, axis=2).astype(np.float32)
    labels = [label for _, label in rows]
    ways: tuple[tuple[Method, int], ...] = (("sta", 3), ("dtw", 1), ("sw", 1))
    for method, stride in ways:
        costs = symmetric_costs([s for s, _ in rows], distances, AlignmentConfig(method, stride))
        expected = leave_one_out(costs, labels)
        assert found[method]["map"] == pytest.approx(expected.map, abs=1e-6)
        assert found[method]["n"] == expected.n
        paper = symmetric_costs([s for s, _ in rows], distances, AlignmentConfig(method, stride), both="query")
        assert found[f"{method}_one_way"]["map"] == pytest.approx(leave_one_out(paper, labels).map, abs=1e-6)
    signed = motionlake("evaluate", "signatures", "--lake", built_lake, "--json").json
    assert found["signatures"]["map"] == pytest.approx(signed["map"])
    assert found["dtw_frames"]["map"] == pytest.approx(signed["dtw"]["map"])
    for name in ("sta", "dtw", "sw", "signatures", "dtw_frames"):
        assert {*KEYS, "nn", "curve", "confusion"} == set(found[name])
        assert len(found[name]["curve"]["precision"]) == len(found[name]["curve"]["recall"])
        assert np.sum(found[name]["confusion"]["counts"]) == len(labels) * min(20, len(labels) - 1)
    folder = tmp_path / "figures"
    table = motionlake(
        "evaluate", "pesta", "--baseline", "none", "--label-column", "note", "--pictures", folder, "--lake", built_lake
    )
    drawn = {
        "precision-recall",
        "precision-recall-sta",
        *(f"confusion-{m}" for m in ("sta", "dtw", "sw", "signatures")),
    }
    assert {path.stem for path in folder.iterdir()} == drawn
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in folder.iterdir())
    assert "dtw_frames" not in table.out
    assert "sta" in table.out


def test_sub_queries_of_a_lake_are_measured(lake: Path, clips_folder: Path, scheduler: str) -> None:
    with (lake / "config.toml").open("a", encoding="utf-8") as config:
        config.write("[symbols]\nruns = false\nrepeats = false\n")  # strings long enough for sub-queries
    run = motionlake("run", "all", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    clips = query(
        lake,
        "SELECT path, frames FROM symbol_strings JOIN clips USING (clip) ORDER BY len(symbols) DESC, clip LIMIT 3",
    )
    taught_lake(lake, clips_folder, [(path, 0, frames, "move") for path, frames in clips])
    run = motionlake("evaluate", "pesta", "--baseline", "none", "--stride", "2", "--lake", lake, "--json")
    assert run.status == 0, run.err
    asked = run.json["sub_queries"]
    assert asked["pesta"]["n"] == asked["pesta_lq"]["n"] == asked["pesta"]["all_n"] > 0
    assert 0 < asked["pesta"]["p_at_2"] <= 1
    assert asked["share_of_time"] == pytest.approx(asked["pesta_lq"]["seconds"] / asked["pesta"]["seconds"])
    assert run.json["dtw_frames"] is None
    parts = motionlake(
        "evaluate", "pesta", "--protocol", "holistic", "--protocol", "several-labels", "--lake", lake, "--json",
    ).json  # fmt: skip
    assert list(parts) == ["holistic", "several_labels"]
    for method in ("sta", "dtw", "sw"):
        row = parts["holistic"][method]  # every frame of three clips shows one class
        answered = np.sum(row["confusion"]["counts"])
        assert row["confusion"]["classes"] == ["move"]
        assert row["n"] == row["all_n"] == 3
        assert row["p_at_10"] == pytest.approx(answered / 30)
        assert len(row["curve"]["recall"]) == len(row["curve"]["precision"])
    assert max(parts["holistic"][method]["map"] for method in ("sta", "dtw", "sw")) == 1
    for method in ("sta", "dtw", "sw"):
        assert parts["several_labels"][f"{method}_one_way"]["n"] == 3
        assert parts["several_labels"][method]["n_refused"] == 0
    unlabelled = motionlake("evaluate", "pesta", "--label-column", "split", "--lake", lake)  # segments are enough
    assert unlabelled.status == 0, unlabelled.err
    assert "pesta_lq" in unlabelled.out


def test_a_lake_with_strings_and_no_signatures_is_measured(
    tmp_path: Path, built_lake: Path, clips_folder: Path, scheduler: str
) -> None:
    """What is measured by strings is as in a lake that has signatures too; nothing is compared by those."""
    lake = tmp_path / "strings"
    quick_lake(lake)
    for words in (["ingest", clips_folder], ["run", "frames"], ["run", "postures"], ["run", "symbols"]):
        run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
    assert query(lake, "SELECT count(*) FROM signatures") == [(0,)]
    ask = ("evaluate", "pesta", "--protocol", "whole", "--baseline", "none", "--json")
    run = motionlake(*ask, "--lake", lake)
    assert run.status == 0, run.err
    assert "signatures: left out" in run.err
    both = motionlake(*ask, "--lake", built_lake).json
    assert run.json == both | {"signatures": None}
    clips = query(
        lake, "SELECT path, frames FROM symbol_strings JOIN clips USING (clip) WHERE len(symbols) > 3 LIMIT 2"
    )
    taught_lake(lake, clips_folder, [(path, 0, frames, "move") for path, frames in clips])
    parts = motionlake("evaluate", "pesta", "--protocol", "holistic", "--lake", lake, "--json")
    assert parts.status == 0, parts.err
    assert parts.json["holistic"]["sta"]["n"] == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--label-column", "shoes"], "no such column"),
        (["--label-column", "split"], "nothing to measure"),
        (["--only", "note"], "COLUMN=VALUE"),
        (["--baseline", "luck"], "auto, dtw, none"),
        (["--stride", "0"], "--stride"),
        (["--stride", "65"], "--stride: stride is 65"),
        (["--dataset", "no/name"], "no/name"),
        (["--protocol", "luck"], "there are whole, sub-queries, holistic"),
        (["--protocol", "holistic"], "no two clips have segments of one class"),
    ],
)
def test_what_pesta_cannot_measure_gets_a_clear_error(built_lake: Path, words: list[str], says: str) -> None:
    run = motionlake("evaluate", "pesta", *words, "--lake", built_lake)
    assert run.status == 2
    assert says in run.err


def test_replaced_pieces_of_a_lake_are_measured(built_lake: Path, tmp_path: Path) -> None:
    """Without replaced pieces the strings are the lake's own; with half of them alignment finds less."""
    folder = tmp_path / "figures"
    run = motionlake(
        "evaluate", "pesta", "--protocol", "robustness", "--protocol", "whole", "--baseline", "none",
        "--pictures", folder, "--lake", built_lake, "--json",
    )  # fmt: skip
    assert run.status == 0, run.err
    found = run.json["robustness"]
    for method in ("sta", "dtw", "sw"):
        assert found[method]["0"]["map"] == pytest.approx(run.json[method]["map"], abs=1e-6)
        assert list(found[method]) == ["0", "0.1", "0.2", "0.3", "0.4", "0.5"]
        assert found[method]["0.5"]["kept"] == pytest.approx(found[method]["0.5"]["map"] / found[method]["0"]["map"])
    assert found["sta"]["0.5"] != found["sta"]["0"]
    assert (folder / "robustness.png").read_bytes().startswith(b"\x89PNG")
    table = motionlake("evaluate", "pesta", "--protocol", "robustness", "--lake", built_lake).out
    assert "replaced" in table
    assert "confusion" not in table


def frames_of(count: int, fps: float, seed: int) -> Framed:
    random = np.random.default_rng(seed)
    body = random.normal(size=(1, 21, 3)) + np.cumsum(random.normal(scale=0.01, size=(count, 21, 3)), axis=0)
    return Framed(body, np.full((count, 21, 4), float(seed)), fps)


def test_a_replaced_piece_stands_where_the_one_before_stood() -> None:
    clips = [frames_of(200, 120.0, 1), frames_of(60, 30.0, 2), frames_of(90, 120.0, 3)]
    labels = ["a", "b", "a"]
    assert [piece_of(clip) for clip in clips] == [10, 2, 10]
    same = singular_clips(clips, labels, 0.0, 0)
    assert all(np.array_equal(one.positions, clip.positions) for one, clip in zip(same, clips, strict=True))
    every = singular_clips(clips, labels, 1.0, 0)
    assert (every[0].rotations == 2).all()  # by frames of the only clip of another class
    assert (every[1].rotations != 2).all()
    hips = INDEX["hips"]
    for start in range(0, 200, 10):
        place = every[0].positions[start, hips]
        np.testing.assert_allclose(place[[0, 2]], clips[0].positions[start, hips, [0, 2]], atol=1e-9)
        np.testing.assert_allclose(
            facing(every[0].positions[start][None]), facing(clips[0].positions[start][None]), atol=1e-6
        )


def test_drawn_ranges_are_of_every_class_and_follow_the_seed() -> None:
    ranges = [LabelledRange(f"c{i % 7}", i, i + 5, "few" if i < 3 else "many") for i in range(40)]
    drawn = drawn_ranges(ranges, 10, 0)
    assert [each.label for each in drawn] == ["few"] * 3 + ["many"] * 10
    assert set(drawn) <= set(ranges)
    assert drawn == drawn_ranges(ranges, 10, 0) != drawn_ranges(ranges, 10, 1)


def test_only_segments_of_one_posture_count_as_refused(lake: Path, clips_folder: Path) -> None:
    """A frame is one symbol, which `align` refuses; a lake that is damaged is told of."""
    clips = query(lake, "SELECT path, frames, clip FROM clips JOIN symbol_strings USING (clip) WHERE len(symbols) > 3")
    (one, long, _), (other, frames, _) = clips[:2]
    taught_lake(lake, clips_folder, [(one, 0, long, "move"), (other, 0, frames, "move"), (one, 3, 4, "move")])
    ask = ("evaluate", "pesta", "--protocol", "several-labels", "--lake", lake, "--json")
    found = motionlake(*ask).json["several_labels"]["sta"]
    assert (found["n"], found["n_refused"]) == (2, 1)
    assert found["all_map"] == pytest.approx(found["map"] * 2 / 3)
    for part in sorted(lake.glob("frames/**/*.parquet")):
        part.write_bytes(part.read_bytes()[:-40])
    damaged = motionlake(*ask)
    assert damaged.status == 2
    assert "parquet" in damaged.err


def test_dictionaries_of_several_sizes_are_measured(built_lake: Path, tmp_path: Path) -> None:
    """Each dictionary is one of the lake's own clips: that of the lake's size finds what a lake of such would."""
    words = ["evaluate", "pesta", "--protocol", "sizes", "--lake", built_lake]
    with mock.patch("motionlake.evaluation.pesta.sizes.SIZES", (20, 40, 100_000)):
        run = motionlake(*words, "--pictures", tmp_path, "--json")
        table = motionlake(*words).out
    assert run.status == 0, run.err
    assert "m = 100000: left out, as the lake holds" in run.err
    found = run.json["sizes"]
    assert list(found) == ["20", "40"]
    assert list(found["40"]) == ["map", "p_at_5", "nn", "n", "symbols", "milliseconds", "occupied"]
    lake = open_lake(built_lake)
    config = served_config(lake)
    with reading(lake) as con:
        postures = POSTURE_DICTIONARY.data(LakeReader(con, lake, config), Selection()) or []
    made = fit_dictionary(postures, replace(config.postures, m=20))
    text = "SELECT clip, label, fps, frames FROM symbol_strings JOIN clips USING (clip) WHERE label IS NOT NULL"
    rows = query(built_lake, f"{text} ORDER BY clip")
    strings = []
    for clip, _, fps, frames in rows:
        motion = query_motion(lake, Query(clip))
        codes = made.encode(word_features(*motion.cut(), fps, config.postures.frames))
        strings.append(symbolise(codes, codes_fps=30.0, fps=fps, n_frames=frames, config=config.symbols).symbols)
    costs = symmetric_costs(strings, made.distances, AlignmentConfig("sta", 3))
    assert found["20"]["map"] == pytest.approx(leave_one_out(costs, [label for _, label, *_ in rows]).map, abs=1e-6)
    assert found["20"]["symbols"] == sum(map(len, strings))
    assert found["20"]["occupied"] <= 20 < found["40"]["occupied"] <= 40
    assert {path.stem for path in tmp_path.iterdir()} == {"sizes", "sizes-cost"}
    assert "symbols of a dictionary" in table
    with mock.patch("motionlake.evaluation.pesta.sizes.SIZES", (100_000,)):
        small = motionlake(*words)
    assert (small.status, small.err.count("\n")) == (2, 1)
    assert "500000 are needed for 100000 symbols" in small.err
