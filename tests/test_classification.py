"""Classes of whole clips: votes by hand, one-vs-all, real recordings, one answer however it is asked for."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.classification import classify_knn, classify_one_vs_all
from motionlake.errors import UserError
from motionlake.retrieval.sql_functions import connect

from tests.lakes import motionlake, query


def on_a_line(places: list[float]) -> np.ndarray:
    x = np.array(places)
    apart: Float64Array = np.abs(x[:, None] - x[None])
    return apart


def test_votes_by_hand() -> None:
    labels = ["a", "b", "b", "a", "c"]
    found = classify_knn(np.array([[1.0, 2, 3, 4, 0.5], [1, 2, 9, 9, 9]]), labels, 4)
    assert [(v.label, v.confidence, v.distance) for v in found] == [("b", 0.5, 0.5), ("a", 0.5, 1)]
    # Of those that tie, the class that holds the nearest; equal distances rank by index.
    assert classify_knn(np.zeros((1, 2)), ["z", "a"], 2)[0].label == "z"
    assert classify_knn(np.array([[3.0, 1]]), ["z", "a"], 9)[0].label == "a"


def test_one_classifier_a_class_finds_the_classes_of_a_line() -> None:
    places = [0, 1, 2, 10, 11, 12, 20, 21, 22.5]
    labels = list("aaabbbccc")
    queries = np.abs(np.array([0.5, 11.4, 30])[:, None] - np.array(places)[None])
    found = classify_one_vs_all(queries, on_a_line(places), labels)
    assert [v.label for v in found] == ["a", "b", "c"]
    assert all(v.confidence > 0 for v in found[:2])
    with pytest.raises(UserError, match="nothing to tell apart"):
        classify_one_vs_all(np.zeros((1, 2)), np.zeros((2, 2)), ["a", "a"])


@pytest.mark.parametrize("k", [0, -1])
def test_a_vote_of_nobody_is_refused(k: int) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        classify_knn(np.zeros((1, 2)), ["a", "b"], k)
    with pytest.raises(ValueError, match="do not fit"):
        classify_knn(np.zeros((1, 3)), ["a", "b"], 1)


def test_every_way_to_ask_gives_the_same_class(built_lake: Path, clips_folder: Path, tmp_path: Path) -> None:
    clips = [row[0] for row in query(built_lake, "SELECT clip FROM clips ORDER BY clip")]
    con = connect(built_lake)
    try:
        by_sql = [con.execute("FROM classify_clip($clip, 3)", {"clip": clip}).fetchone() for clip in clips]
    finally:
        con.close()
    written = tmp_path / "found.csv"
    run = motionlake("classify", *clips, "-k", 3, "--write-labels", written, "--lake", built_lake, "--json")
    assert run.status == 0, run.err
    assert [r["clip"] for r in run.json] == clips
    for row, found in zip(run.json, by_sql, strict=True):
        assert found is not None
        assert (row["label"], row["confidence"]) == (found[0], pytest.approx(found[1]))
        assert row["distance"] == pytest.approx(found[2], abs=1e-6)
    rows = list(csv.DictReader(written.open(encoding="utf-8")))
    assert [r["label"] for r in rows] == [r["label"] for r in run.json]
    assert all((clips_folder / r["file"]).is_file() for r in rows)


def test_a_file_gets_the_class_of_the_clip_it_is(built_lake: Path, clips_folder: Path) -> None:
    clip, path, label = query(built_lake, "SELECT clip, path, label FROM clips ORDER BY clip LIMIT 1")[0]
    row = motionlake("classify", clips_folder / path, "-k", 1, "--lake", built_lake, "--json").json[0]
    assert row["label"] == label
    assert row["distance"] == pytest.approx(0, abs=1e-6)
    one = motionlake("classify", clip, "--method", "one-vs-all", "--lake", built_lake, "--json").json[0]
    assert one["label"] in {r[0] for r in query(built_lake, "SELECT DISTINCT label FROM clips")}


def test_the_first_labelled_answers_of_search_vote(built_lake: Path) -> None:
    rows = query(built_lake, "SELECT clip, label FROM clips ORDER BY clip")
    labels = {clip: label for clip, label in rows if label is not None}
    for clip in list(labels)[:2]:
        hits = motionlake("search", clip, "-k", len(rows), "--lake", built_lake, "--json").json
        voters = [hit for hit in hits if hit["clip"] in labels][:3]
        (found,) = motionlake("classify", clip, "-k", 3, "--lake", built_lake, "--json").json
        votes = Counter(labels[hit["clip"]] for hit in voters)
        assert votes[found["label"]] == max(votes.values())
        assert found["confidence"] == pytest.approx(votes[found["label"]] / len(voters))
        assert found["distance"] == pytest.approx(voters[0]["distance"])
        by_signatures = motionlake("classify", clip, "-k", 3, "--method", "knn", "--lake", built_lake, "--json").json
        assert by_signatures[0]["label"] in labels.values()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "name a clip"),
        (["nothing_like_it"], "no such clip"),
        (["--unlabelled", "--label-column", "shoes"], "no such column"),
        (["--unlabelled", "--dataset", "elsewhere"], "no clip of dataset elsewhere"),
        (["--unlabelled", "--method", "guess"], "search, knn, one-vs-all"),
    ],
)
def test_what_cannot_be_answered_gets_one_clear_line(built_lake: Path, words: list[str], says: str) -> None:
    run = motionlake("classify", *words, "--lake", built_lake)
    assert run.status == 2
    assert says in run.err
    assert run.err.count("\n") == 1


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "chosen", "classes", "least"), [("hdm05", "hkls", 5, 0.97), ("bandai1", "", 16, 0.65)]
)
def test_recordings_get_their_classes(recordings: Path, name: str, chosen: str, classes: int, least: float) -> None:
    """Sets that the pretrained words never saw: clips get their own class from all others.

    With the columns of the weights shuffled one-vs-all reaches .47 on bandai1.
    """
    from motionlake.evaluation.signatures import folded_accuracy

    from bench.canonical_sets import load
    from tests.pretrained_words import signature_distances

    clips = [clip for clip in load(name) if clip.label[0] in chosen or not chosen][:: 2 if chosen else 1]
    distances = signature_distances(clips, 60)
    labels = [clip.label for clip in clips]

    def one_vs_all(queries: np.ndarray, known: np.ndarray, names: list[str]) -> list[str]:
        return [v.label for v in classify_one_vs_all(queries, known, names)]

    def knn(queries: np.ndarray, known: np.ndarray, names: list[str]) -> list[str]:
        return [v.label for v in classify_knn(queries, names, 5)]

    assert len(set(labels)) == classes
    assert folded_accuracy(distances, labels, 5, one_vs_all) > least
    assert folded_accuracy(distances, labels, 5, knn) > least
