"""What is usual in a dataset: the views of stage "quality" and `check`, on a dataset that grows, against numpy."""

from __future__ import annotations

import shutil
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.motion.quality import Recording, check, in_dataset
from motionlake.motion.quality.levels import levels, sustained
from motionlake.motion.quality_config import QualityConfig
from motionlake.motion.runs import runs

from tests.lakes import motionlake, query, quick_lake

CONFIG = QualityConfig()
FEW, ENOUGH = 12, 24  # clips of a dataset, of which too little and enough is known


@given(
    values=st.lists(st.integers(0, 9), min_size=1, max_size=40), threshold=st.integers(0, 9), gap=st.integers(0, 5),
    least=st.integers(1, 6),
)  # fmt: skip
def test_sustained_values_give_the_runs_of_every_threshold(
    values: list[int], threshold: int, gap: int, least: int
) -> None:
    array = np.array(values, dtype=np.float64)
    assert runs(sustained(array, gap, least) > threshold) == runs(array > threshold, gap, least)


def test_levels_are_those_of_the_check_at_every_rung() -> None:
    values = np.array([[0.0, 1, 2, 2, 1, 5, 5, 5, 1, 0, 2, 2], [0.0] * 12]).T
    found = levels("jitter", values, [1.0, 1.0], ["a", "b"], 0, 2)
    assert {(each.joint, each.rung, each.start, each.stop, each.level) for each in found} == {
        ("a", 0, 2, 4, 2.0), ("a", 0, 5, 8, 5.0), ("a", 0, 10, 12, 2.0), ("a", 1, 2, 4, 2.0), ("a", 1, 5, 8, 5.0),
        ("a", 1, 10, 12, 2.0), ("a", 2, 5, 8, 5.0), ("a", 3, 5, 8, 5.0), ("a", 4, 5, 8, 5.0),
    }  # fmt: skip


def make(lake: Path, folder: Path, scheduler: str) -> None:
    """Ingest all that lies in a folder, and check it."""
    run = motionlake("ingest", folder, "--dataset", "kinect", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    run = motionlake("run", "quality", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err


def naive(rows: list[dict[str, Any]], found: dict[str, list[Any]]) -> dict[tuple[str, str], float]:
    """The limits, in numpy: of each fault that half of the clips have, by joint."""
    limits: dict[tuple[str, str], float] = {}
    for kind in ("slide", "penetration", "jitter", "spike", "limb_drift"):
        peaks: dict[str, dict[str, float]] = defaultdict(dict)
        for clip, each in found.items():
            for level in (level for level in each if level.kind == kind):
                peaks[level.joint][clip] = max(peaks[level.joint].get(clip, 0.0), level.level)
        faulty = {clip for by_clip in peaks.values() for clip in by_clip}
        if 2 * len(faulty) < len(rows):
            continue
        usual = {j: max(1.0, np.quantile([of.get(c, 0.0) for c in found], 0.75)) for j, of in peaks.items()}
        scores = [max((of.get(clip, 0.0) / usual[j] for j, of in peaks.items()), default=0.0) for clip in found]
        middle = np.median(scores)
        ratio = middle + 0.5 * 1.4826 * np.median(np.abs(scores - middle))
        limits |= {(kind, joint): max(1.0, value * ratio) for joint, value in usual.items()}
    return limits


@pytest.mark.recordings
def test_a_dataset_that_grows_says_what_is_usual_in_it(recordings: Path, tmp_path: Path, scheduler: str) -> None:
    files = sorted((recordings / "utd_mhad" / "clips").glob("*.npz"))[::35][:ENOUGH]
    assert len(files) == ENOUGH
    folder, lake = tmp_path / "kinect", quick_lake(tmp_path / "lake")
    folder.mkdir()
    for file in files[:FEW]:
        shutil.copy(file, folder)
    make(lake, folder, scheduler)
    assert query(lake, "FROM quality_usual") == []
    ranges = "SELECT clip, fault, joint, start, stop FROM {} ORDER BY ALL"
    assert query(lake, ranges.format("quality_unusual")) == query(lake, ranges.format("quality_ranges"))
    assert query(lake, "SELECT count(*) FROM quality WHERE verdict = verdict_in_dataset") == [(FEW,)]
    first = query(lake, "SELECT clip, verdict, jitter FROM quality ORDER BY clip")

    for file in files[FEW:]:
        shutil.copy(file, folder)
    make(lake, folder, scheduler)
    assert set(first) <= set(query(lake, "SELECT clip, verdict, jitter FROM quality"))
    told = motionlake("check", "--lake", lake, "--json")
    usual = {(kind, joint): highest for kind, joint, highest in query(
        lake, "SELECT fault, joint, highest FROM quality_usual WHERE dataset = 'kinect'"
    )}  # fmt: skip
    assert {"jitter", "limb_drift"} <= {kind for kind, _ in usual}
    assert told.err.count("is usual here") == len({kind for kind, _ in usual})
    assert f"kinect: limb drift is usual here, in {ENOUGH} of {ENOUGH} clips" in told.err

    checked = {row["clip"]: checked_again(lake, row["clip"]) for row in told.json}
    expected = naive(told.json, {clip: quality.levels for clip, quality in checked.items()})
    assert usual == pytest.approx(expected)
    by_kind: dict[str, dict[str, float]] = defaultdict(dict)
    for (kind, joint), highest in usual.items():
        by_kind[kind][joint] = highest
    verdicts = {clip: in_dataset(quality, by_kind, CONFIG) for clip, quality in checked.items()}
    assert dict(query(lake, "SELECT clip, verdict_in_dataset FROM quality")) == {
        clip: quality.verdict for clip, quality in verdicts.items()
    }
    assert query(lake, ranges.format("quality_unusual")) == sorted(
        (row["clip"], f["kind"], f["joint"], f["start"], f["stop"]) for row in told.json for f in row["outstanding"]
    )
    drifting = {row["clip"] for row in told.json if any(f["kind"] == "limb_drift" for f in row["outstanding"])}
    assert 0 < len(drifting) < ENOUGH / 2, "all have it, and few stand out"
    assert all(any(f["kind"] == "limb_drift" for f in row["faults"]) for row in told.json), "nothing is hidden"
    assert told.status == any(row["verdict_in_dataset"] == "bad" for row in told.json)


def checked_again(lake: Path, clip: str) -> Any:
    from motionlake.lake.catalog import fetch, reading
    from motionlake.lake.frames import canonical_motion
    from motionlake.lake.layout import open_lake

    at = open_lake(lake)
    with reading(at) as con:
        motion = canonical_motion(con, at, clip)
        repaired = fetch(con, "clip", {"clip": clip})[0]["repaired"]
    recording = Recording.of(
        motion.positions, motion.rotations, motion.fps, twist=motion.twist, filled=motion.filled, repaired=repaired
    )
    return check(recording, CONFIG)
