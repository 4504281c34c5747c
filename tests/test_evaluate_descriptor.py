"""Descriptors measured on a lake: by loops over its tables, across a split and without one, drawn, and refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motionlake.deep_motifs.clip_map import tsne
from motionlake.evaluation.dtw import baseline_features, joint_error
from motionlake.evaluation.ranking import leave_one_out
from motionlake.lake.frames import read_part
from motionlake.motion.dtw import clip_dtw
from motionlake.motion.features import body_length
from motionlake.pictures.evaluation import loss_figure

from tests.lakes import Changed, motionlake, query
from tests.test_pictures import NASTY, assert_readable

MEASURES = ("top1", "top10", "map", "n", "pr_area", "dtw_error_mm", "retrieval_ms", "curve")


def change(lake: Path, statement: str, **parameters: Any) -> None:
    with Changed(lake) as con:
        con.execute(statement, parameters)


def with_splits(lake: Path) -> None:
    """Every other clip of each label to train, the rest to test."""
    change(
        lake,
        """UPDATE clips SET split = if(place % 2 = 1, 'train', 'test') FROM (
            SELECT clip AS named, row_number() OVER (PARTITION BY label ORDER BY clip) AS place
            FROM clips WHERE label IS NOT NULL
        ) WHERE clip = named""",
    )


def evaluate(lake: Path, *words: str | Path) -> dict[str, Any]:
    run = motionlake("evaluate", "descriptor", *words, "--lake", lake, "--json")
    assert run.status == 0, run.err
    found: dict[str, Any] = run.json
    return found


def features(lake: Path) -> tuple[dict[str, np.ndarray], float]:
    rates = dict(query(lake, "SELECT clip, fps FROM clips"))
    labelled = {name for (name,) in query(lake, "SELECT clip FROM clips WHERE label IS NOT NULL")}
    clips = [clip for path in sorted(lake.glob("frames/**/*.parquet")) for clip in read_part(path)]
    kept = [clip for clip in clips if clip.clip in labelled]
    found = {clip.clip: baseline_features(clip.positions.astype(float), rates[clip.clip]) for clip in kept}
    return found, float(np.mean([body_length(clip.positions.astype(float)) for clip in kept]))


def test_test_clips_query_training_clips(lake: Path, tmp_path: Path) -> None:
    with_splits(lake)
    found = evaluate(lake)
    rows = query(
        lake, "SELECT clip, label, split, descriptor FROM clips JOIN descriptors USING (clip) WHERE label IS NOT NULL"
    )
    asked, known = ([row for row in rows if row[2] == split] for split in ("test", "train"))
    known.sort()
    first, right, precise, errors = [], [], [], []
    shown, body = features(lake)
    for name, label, _, descriptor in asked:
        near = sorted(known, key=lambda row: (np.linalg.norm(np.subtract(row[3], descriptor)), row[0]))
        hits = [row[1] == label for row in near]
        if any(hits):
            first.append(hits[0])
            right.append(np.mean(hits[:10]))
            precise.append(np.mean([np.mean(hits[: i + 1]) for i, hit in enumerate(hits) if hit]))
            errors.append(joint_error(shown[name], shown[near[0][0]]))
    assert found["n"] == len(first) > 0
    assert (found["queries"], found["repository"]) == (len(asked), len(known))
    assert found["protocol"] == "test clips query train clips"
    assert found["top1"] == pytest.approx(np.mean(first))
    assert found["top10"] == pytest.approx(np.mean(right))
    assert found["map"] == pytest.approx(np.mean(precise))
    assert found["body_mm"] == pytest.approx(1000 * body)
    assert found["dtw_error_mm"] == pytest.approx(1000 * body * np.mean(errors))
    assert list(found)[:4] == ["top1", "top10", "map", "n"]
    methods = found["methods"]
    assert set(methods) == {"signature", "alignment", "dtw", "fused"}
    for row in (found, *methods.values()):
        assert set(MEASURES) <= set(row)
        assert row["n"] == found["n"]
    by_frames = [
        known[int(np.argmin([clip_dtw(shown[name], shown[row[0]]) for row in known]))][1] == label
        for name, label, *_ in asked
        if any(row[1] == label for row in known)
    ]
    assert methods["dtw"]["top1"] == pytest.approx(np.mean(by_frames))
    swapped = evaluate(lake, "--split", "train", "--train-split", "test", "--baseline", "none")
    assert (swapped["queries"], swapped["methods"]["dtw"]) == (len(known), None)


def test_without_splits_each_clip_queries_all_others(built_lake: Path, tmp_path: Path) -> None:
    found = evaluate(built_lake)
    rows = query(
        built_lake,
        "SELECT label, descriptor FROM descriptors JOIN clips USING (clip) WHERE label IS NOT NULL ORDER BY clip",
    )
    points = np.array([row[1] for row in rows], dtype=np.float64)
    expected = leave_one_out(np.linalg.norm(points[:, None] - points, axis=2), [row[0] for row in rows])
    assert found["protocol"] == "leave one out"
    assert (found["top1"], found["map"], found["n"]) == pytest.approx((expected.nn, expected.map, expected.n))
    signed = motionlake("evaluate", "signatures", "--lake", built_lake, "--json").json
    assert found["methods"]["signature"]["map"] == pytest.approx(signed["map"])
    assert found["methods"]["dtw"]["map"] == pytest.approx(signed["dtw"]["map"])
    drawn = motionlake(
        "evaluate", "descriptor", "--label-column", "note", "--pictures", tmp_path / "figures", "--lake", built_lake
    )
    assert drawn.status == 0, drawn.err
    assert {"precision-recall", "descriptors-tsne"} <= {path.stem for path in (tmp_path / "figures").iterdir()}
    assert "leave one out" in drawn.err
    assert "fused" in drawn.out


@pytest.mark.parametrize(
    ("metrics", "warns"),
    [
        ({"split": "train", "dataset": None}, False),
        ({"split": "train", "dataset": "clips"}, False),
        ({"split": None, "dataset": None}, True),
        ({"split": "test", "dataset": "clips"}, True),
        ({"split": None, "dataset": "elsewhere"}, False),
        ({"pretrained": True, "sets": ["clips"]}, True),
        ({"pretrained": True, "sets": ["elsewhere"]}, False),
    ],
)
def test_queries_that_training_has_seen_are_told(lake: Path, metrics: dict[str, Any], warns: bool) -> None:
    with_splits(lake)
    change(lake, "UPDATE models SET metrics = $metrics WHERE kind = 'descriptors'", metrics=json.dumps(metrics))
    run = motionlake("evaluate", "descriptor", "--baseline", "none", "--lake", lake, "--json")
    assert ("training has seen" in (run.json["warning"] or "")) == warns
    assert ("warning: " in run.err) == warns
    assert run.json["model"].items() >= metrics.items()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--label-column", "shoes"], "no such column"),
        (["--split", "validation"], "no labelled clip has split validation; there are no splits"),
        (["--label-column", "split"], "has a descriptor"),
        (["--dataset", "elsewhere"], "no clip of dataset elsewhere"),
        (["--baseline", "luck"], "auto, dtw, none"),
    ],
)
def test_what_descriptors_cannot_be_measured_by(built_lake: Path, words: list[str], says: str) -> None:
    run = motionlake("evaluate", "descriptor", *words, "--lake", built_lake)
    assert run.status == 2
    assert says in run.err
    assert run.err.count("\n") == 1


def test_a_lake_without_descriptors_is_told_so(lake: Path) -> None:
    change(lake, "DELETE FROM descriptors")
    run = motionlake("evaluate", "descriptor", "--lake", lake)
    assert run.status == 2
    assert "has no descriptors yet" in run.err


@pytest.mark.parametrize("name", ["plain", "".join(NASTY)])
def test_losses_can_be_read(name: str) -> None:
    figure = loss_figure([3.0, 1.0, 0.0, 0.5], name, name, name)
    assert_readable(figure)
    (loss,) = figure.axes[0].lines
    np.testing.assert_allclose(np.asarray(loss.get_ydata()), [1, 1 / 3, np.nan, 1 / 6])
    assert {"1", "0.5", "0.2"} <= {label.get_text() for label in figure.axes[0].get_yticklabels()}
    assert_readable(loss_figure([1.0], name, name, name))
    with pytest.raises(ValueError, match="no losses"):
        loss_figure([], name, name)


def test_a_map_of_descriptors_is_the_same_every_time() -> None:
    random = np.random.default_rng(0)
    groups = np.repeat(random.standard_normal((3, 512)), 12, axis=0)
    points = (groups + 0.05 * random.standard_normal(groups.shape)).astype(np.float32)
    found = tsne(points)
    np.testing.assert_array_equal(found, tsne(points))
    apart = np.linalg.norm(found[:, None] - found, axis=2) + 1e9 * np.eye(len(found))
    assert np.all(apart.argmin(axis=1) // 12 == np.arange(len(found)) // 12)
    with pytest.raises(ValueError, match="at least 4"):
        tsne(points[:3])
