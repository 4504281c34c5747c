"""Measures on a lake: the DTW baseline against loops, scores by hand, the commands."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.deep_motifs.emd import emd_matrix, ground_distances
from motionlake.evaluation.dtw import baseline_features
from motionlake.evaluation.ranking import leave_one_out
from motionlake.evaluation.segmentation import mean_scores, score_words, word_truth
from motionlake.evaluation.signatures import folded_accuracy
from motionlake.motion.dtw import clip_dtw, dtw_matrix, frame_pairs

from tests.lakes import motionlake, query

KEYS = ("nn", "top5", "first_tier", "second_tier", "map", "cross_subject_nn", "n")


def naive_dtw(a: np.ndarray, b: np.ndarray) -> float:
    cost = np.full((len(a) + 1, len(b) + 1), np.inf)
    cost[0, 0] = 0
    for i in range(len(a)):
        for j in range(len(b)):
            step = min(cost[i, j], cost[i, j + 1], cost[i + 1, j])
            cost[i + 1, j + 1] = step + np.linalg.norm(a[i] - b[j])
    return float(cost[-1, -1] / (len(a) + len(b)))


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(1, 4), st.integers(0, 1000))
def test_dtw_is_the_cheapest_path(n: int, m: int, width: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b = (random.standard_normal((length, width)).astype(np.float32) for length in (n, m))
    assert clip_dtw(a, b) == pytest.approx(naive_dtw(a, b), abs=1e-4)
    assert clip_dtw(a, a) == pytest.approx(0, abs=2e-3)


def test_dtw_of_all_pairs() -> None:
    random = np.random.default_rng(0)
    clips = [random.standard_normal((n, 6)).astype(np.float32) for n in (5, 12, 8, 1)]
    matrix = dtw_matrix(clips)
    np.testing.assert_array_equal(matrix, matrix.T)
    assert matrix[1, 2] == pytest.approx(naive_dtw(clips[1], clips[2]), abs=1e-4)
    assert frame_pairs([5, 12, 8, 1]) == 5 * 12 + 5 * 8 + 5 + 12 * 8 + 12 + 8
    with pytest.raises(ValueError, match="without frames"):
        dtw_matrix([clips[0], clips[1][:0]])


def test_what_dtw_compares_is_seen_from_the_body() -> None:
    """Neither place, direction nor size of the body counts; 24 frames a second."""
    random = np.random.default_rng(1)
    body = random.standard_normal((1, 21, 3)) + np.cumsum(0.01 * random.standard_normal((61, 21, 3)), axis=0)
    turn = np.array([[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]])
    plain = baseline_features(body, 60.0)
    assert plain.shape == (25, 42)
    np.testing.assert_allclose(baseline_features(2.5 * body @ turn.T + [3, 1, -2], 60.0), plain, atol=1e-4)


def test_words_are_scored_by_hand() -> None:
    truth = word_truth(np.array([0.5, 1, 2, 3, 9]), [(0, 2, "a"), (1, 3, "b"), (3, 4, "new")])
    assert truth == [{"a"}, {"a", "b"}, {"b"}, {"new"}, set()]
    found = score_words(truth, ["a", "b", "unknown", "unknown", "a"], ["a", "b", "a", "b", "a"], {"a", "b"})
    assert (found.n, found.n_known) == (4, 3)
    assert found.accuracy == 3 / 4
    assert found.accuracy_known == pytest.approx(2 / 3)
    assert found.accuracy_known_or_unknown == pytest.approx(2 / 3)
    never = score_words([{"new"}], ["unknown"], ["a"], {"a"})
    assert (never.accuracy, never.accuracy_known) == (1, None)
    assert mean_scores([found, never]).accuracy == pytest.approx(7 / 8)
    assert mean_scores([found, never]).accuracy_known == pytest.approx(2 / 3)


def test_a_clip_does_not_classify_itself() -> None:
    distances = np.abs(np.subtract.outer([0.0, 1, 5, 5.5], [0, 1, 5, 5.5]))
    labels = ["a", "b", "a", "b"]

    def nearest(queries: np.ndarray, known: np.ndarray, names: list[str]) -> list[str]:
        assert known.shape == (len(names), len(names))
        return [names[i] for i in queries.argmin(axis=1)]

    assert folded_accuracy(distances, labels, 4, nearest) == 0
    assert folded_accuracy(distances, ["a", "a", "b", "b"], 2, nearest) == 1
    with pytest.raises(ValueError, match="nothing to learn"):
        folded_accuracy(distances, list("abcd"), 4, nearest)


def test_signatures_are_measured(built_lake: Path) -> None:
    run = motionlake("evaluate", "signatures", "--lake", built_lake, "--json")
    assert run.status == 0, run.err
    rows = query(built_lake, "SELECT signature, label, subject FROM signatures JOIN clips USING (clip) ORDER BY clip")
    centroids = query(built_lake, "SELECT centroid FROM motifs ORDER BY motif")
    ground = ground_distances(np.array([r[0] for r in centroids], dtype=np.float32))
    kept = [r for r in rows if r[1] is not None]
    distances = emd_matrix(np.array([r[0] for r in kept], dtype=np.float32), ground)
    expected = leave_one_out(distances, [r[1] for r in kept], [r[2] or "" for r in kept])
    found = run.json
    assert found["map"] == pytest.approx(expected.map)
    assert found["cross_subject_nn"] == expected.cross_subject_nn
    assert found["n"] == expected.n
    assert set(KEYS) <= set(found)
    assert set(KEYS) <= set(found["dtw"])
    assert 0 <= found["classification"]["accuracy"] <= 1
    alone = motionlake("evaluate", "signatures", "--baseline", "none", "--lake", built_lake, "--json").json
    assert alone == {**found, "dtw": None}
    table = motionlake("evaluate", "signatures", "--label-column", "note", "--lake", built_lake)
    assert "whole-clip DTW" in table.out
    assert "\nmap: mean average precision" in table.out
    assert "pr_area" not in table.out


def taught_lake(lake: Path, clips_folder: Path, rows: list[tuple[str, int, int, str]]) -> None:
    """Give clips of a lake segments, from a file of its own: other tests read the folder of the clips meanwhile."""
    file = lake.with_name("segments.csv")
    with file.open("w", newline="", encoding="utf-8") as handle:
        placed = [(clips_folder / path, *rest) for path, *rest in rows]
        csv.writer(handle).writerows([("file", "start", "stop", "label"), *placed])
    run = motionlake("ingest", clips_folder, "--segments", file, "--lake", lake)
    assert run.status == 0, run.err


def test_segmentation_is_measured_and_asked_for_in_every_way(lake: Path, clips_folder: Path) -> None:
    clips = query(lake, "SELECT clip, path, frames FROM clips ORDER BY frames DESC, clip LIMIT 3")
    rows = [(path, 0, frames // 2, "begin") for _, path, frames in clips]
    rows += [(path, frames // 2, frames, "end") for _, path, frames in clips[:2]]
    taught_lake(lake, clips_folder, rows)
    run = motionlake("evaluate", "segmentation", "--lake", lake, "--json")
    assert run.status == 0, run.err
    assert set(run.json["per_clip"]) == {clip for clip, _, _ in clips}
    assert 0 <= run.json["accuracy_known"] <= 1
    assert run.json["n"] == sum(each["n"] for each in run.json["per_clip"].values())
    clip, _, frames = clips[2]
    found = motionlake("segment", clip, "--lake", lake, "--json").json
    assert found[0]["start"] == 0
    assert found[-1]["stop"] == frames
    assert all(a["stop"] == b["start"] and a["label"] != b["label"] for a, b in pairwise(found))
    assert {b["label"] for b in found} <= {"begin", "end", "unknown"}
    sql = motionlake("sql", f"FROM segment_clip('{clip}')", "--lake", lake, "--json").json
    assert sql == found
    named = motionlake("segment", clip, "--labelled-clip", clips[0][0], "--no-mirrored", "--lake", lake, "--json")
    assert {b["label"] for b in named.json} <= {"begin", "end", "unknown"}
    by_file = motionlake("segment", clips_folder / clips[0][1], "--no-unknown", "--lake", lake, "--json").json
    assert by_file[-1]["stop"] == clips[0][2]
    assert {b["label"] for b in by_file} <= {"begin", "end"}
    whole = motionlake("segment", clip, "--dataset", "clips", "--label-column", "note", "--lake", lake)
    assert whole.status == 0, whole.err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["evaluate", "signatures", "--label-column", "shoes"], "no such column"),
        (["evaluate", "signatures", "--only", "note"], "COLUMN=VALUE"),
        (["evaluate", "signatures", "--only", "note=absent"], "with note = absent"),
        (["evaluate", "signatures", "--baseline", "luck"], "auto, dtw, none"),
        (["evaluate", "signatures", "--label-column", "split"], "nothing to measure"),
        (["evaluate", "segmentation"], "leaving one out needs two"),
        (["evaluate", "segmentation", "--dataset", "elsewhere"], "has no clip"),
    ],
)
def test_what_cannot_be_measured_gets_one_clear_line(built_lake: Path, words: list[str], says: str) -> None:
    run = motionlake(*words, "--lake", built_lake)
    assert run.status == 2
    assert says in run.err
    assert run.err.count("\n") == 1
