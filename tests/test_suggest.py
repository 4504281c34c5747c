"""Suggested labels: how the nearest vote, how sure that is, and the labels.csv that a person may take in."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import motionlake as library
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.suggestions import Confidence, vote

from tests.lakes import Changed, motionlake, query


def hit(clip: str, distance: float) -> Hit:
    return Hit(rank=1, clip=clip, distance=distance, label=None, dataset="d", seconds=1.0)


LABELS = {"a": "walk", "b": "walk", "c": "run", "d": "run"}


@pytest.mark.parametrize(
    ("near", "label", "agreed"),
    [
        ("ab", "walk", 1.0),
        ("xacyb", "walk", (1 + 1 / 3) / (1 + 1 / 2 + 1 / 3)),
        ("abcd", "walk", (1 + 1 / 2) / (1 + 1 / 2 + 1 / 3)),
        ("acd", "walk", 1 / (1 + 1 / 2 + 1 / 3)),
        ("xc", "run", 1.0),
    ],
)
def test_the_nearest_labelled_clip_says_the_label(near: str, label: str, agreed: float) -> None:
    found = vote([hit(clip, place / 10) for place, clip in enumerate(near)], LABELS)
    assert found is not None
    first = next(clip for clip in near if clip in LABELS)
    assert (found.label, found.like, found.distance) == (label, first, near.index(first) / 10)
    assert found.agreed == pytest.approx(agreed)


def test_without_a_labelled_clip_there_is_no_vote() -> None:
    assert vote([hit("x", 0.1)], LABELS) is None


@given(st.lists(st.tuples(st.sampled_from([1.0, 0.8, 0.5]), st.booleans())), st.sampled_from([1.0, 0.8, 0.5]))
def test_confidence_is_how_often_such_votes_were_right(votes: list[tuple[float, bool]], agreed: float) -> None:
    found = Confidence([one for one, _ in votes], [was for _, was in votes]).of(agreed)
    such = [was for one, was in votes if one == agreed]
    assert found == pytest.approx(min((sum(such) + 2 * agreed) / (len(such) + 2), (len(such) + 1) / (len(such) + 2)))
    assert 0 < found < 1


@pytest.fixture
def half(lake: Path) -> tuple[Path, dict[str, str]]:
    """A lake in which every second clip has lost its label, and the labels that these had."""
    labels = dict(query(lake, "SELECT clip, label FROM clips ORDER BY clip"))
    hidden = dict(list(labels.items())[::2])
    with Changed(lake) as con:
        con.execute("UPDATE clips SET label = NULL WHERE clip IN (SELECT unnest($1::VARCHAR[]))", [list(hidden)])
    return lake, hidden


def said_of(lake: Path) -> dict[str, Any]:
    """All that label files say of clips."""
    return {row[0]: row[1:] for row in query(lake, "SELECT clip, label, subject, split, attributes FROM clips")}


def test_every_unlabelled_clip_gets_a_label_of_the_clip_most_like_it(half: tuple[Path, dict[str, str]]) -> None:
    lake, hidden = half
    before = (lake / "catalog.duckdb").read_bytes()
    run = motionlake("suggest", "labels", "--json", "--lake", lake)
    assert run.status == 0, run.err
    assert {row["clip"] for row in run.json} == hidden.keys()
    labels = dict(query(lake, "SELECT clip, label FROM clips"))
    for row in run.json:
        nearest = motionlake("search", row["clip"], "-k", 50, "--json", "--lake", lake).json
        like = next(one for one in nearest if labels[one["clip"]] is not None)
        assert (row["label"], row["like"]) == (labels[like["clip"]], like["clip"])
        assert row["distance"] == pytest.approx(like["distance"])
        assert 0 < row["confidence"] < 1
    sure = [row["confidence"] for row in run.json]
    assert sure == sorted(sure, reverse=True)
    fewer = motionlake("suggest", "labels", "--at-least", sure[0], "--json", "--lake", lake).json
    assert fewer == [row for row in run.json if row["confidence"] >= sure[0]]
    assert (lake / "catalog.duckdb").read_bytes() == before  # nothing is written unless it is asked for


def test_the_file_that_is_written_can_be_taken_in(half: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    lake, hidden = half
    (folder,) = (row[0] for row in query(lake, "SELECT DISTINCT root FROM sources"))
    before, frames = said_of(lake), query(lake, "SELECT part, key FROM manifest WHERE stage = 'frames' ORDER BY part")
    out = tmp_path / "elsewhere" / "found.csv"
    out.parent.mkdir()
    found = motionlake("suggest", "labels", "--out", out, "--json", "--lake", lake)
    assert found.status == 0, found.err
    assert f"motionlake ingest {folder} --labels {out}" in found.err
    assert said_of(lake) == before
    run = motionlake("ingest", folder, "--labels", out, "--lake", lake)
    assert run.status == 0, run.err
    suggested = {row["clip"]: row for row in found.json}
    for clip, (label, subject, split, attributes) in said_of(lake).items():
        was = before[clip]
        assert (subject, split) == was[1:3]
        assert {name: value for name, value in attributes.items() if name != "confidence"} == was[3]
        if clip in hidden:
            assert label == suggested[clip]["label"]
            assert float(attributes["confidence"]) == pytest.approx(suggested[clip]["confidence"], abs=5e-4)
        else:
            assert label == was[0]
            assert "confidence" not in attributes
    assert query(lake, "SELECT part, key FROM manifest WHERE stage = 'frames' ORDER BY part") == frames
    again = motionlake("suggest", "labels", "--json", "--lake", lake)
    assert (again.status, again.json) == (0, [])


def test_files_below_the_folder_are_named_from_there(half: tuple[Path, dict[str, str]]) -> None:
    lake, _ = half
    folder = Path(query(lake, "SELECT DISTINCT root FROM sources")[0][0])
    out = folder / "suggested-labels.csv"
    try:
        assert motionlake("suggest", "labels", "--out", out, "--lake", lake).status == 0
        with out.open(encoding="utf-8") as stream:
            named = {row["file"] for row in csv.DictReader(stream)}
    finally:
        out.unlink()
    assert named == {row[0] for row in query(lake, "SELECT path FROM clips")}


def test_python_gives_the_same(half: tuple[Path, dict[str, str]]) -> None:
    lake, _ = half
    told = motionlake("suggest", "labels", "--json", "--lake", lake).json
    with library.open_lake(lake) as opened:
        assert [dict(row) for row in opened.suggest_labels()] == told
        assert len(opened.suggest_labels(dataset="nothing")) == 0


def test_mistakes_are_said_in_one_line(lake: Path, tmp_path: Path) -> None:
    def refused(*words: object) -> str:
        run = motionlake("suggest", "labels", *words, "--lake", lake)
        assert (run.status, run.err.count("\n")) == (2, 1)
        return run.err

    assert "no such folder" in refused("--out", tmp_path / "nowhere" / "found.csv")
    assert "no such column" in refused("--label-column", "nothing")
    with Changed(lake) as con:
        con.execute("UPDATE clips SET label = NULL")
    assert "0 clips have a label to learn from" in refused()


def test_a_labels_file_is_for_one_folder(half: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    lake, _ = half
    with Changed(lake) as con:
        con.execute("UPDATE sources SET root = '/other' WHERE path = (SELECT min(path) FROM sources)")
    run = motionlake("suggest", "labels", "--out", tmp_path / "found.csv", "--lake", lake)
    assert run.status == 2
    assert "come from 2 folders" in run.err
    assert not (tmp_path / "found.csv").exists()
