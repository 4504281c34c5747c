"""What programs that watch a lake are told: what each stage has done and how fast, and a log of events."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from motionlake.cli._open_metrics import open_metrics

from tests.lakes import Changed, motionlake, query, quick_lake

SAMPLE = re.compile(r'^([a-z_]+)(?:\{((?:[a-z]+="(?:[^"\\\n]|\\["\\n])*",?)*)\})? (\S+)$')


def samples(text: str) -> dict[tuple[str, str], float]:
    """Every sample by its name and labels; each family stands together, below its type."""
    *lines, end, last = text.split("\n")
    assert (end, last) == ("# EOF", "")
    found: dict[tuple[str, str], float] = {}
    family = ""
    for line in lines:
        if line.startswith("# TYPE "):
            family = line.split()[2]
        elif not line.startswith("#"):
            match = SAMPLE.match(line)
            assert match, line
            assert match[1] == family
            key = (match[1], match[2] or "")
            assert key not in found
            found[key] = float(match[3])
    return found


def test_a_stage_has_done_what_the_manifest_says(built_lake: Path) -> None:
    rows = query(built_lake, "SELECT stage, batches, failed, clips, frames, bytes, work_seconds FROM stage_metrics()")
    clips, frames = query(built_lake, "SELECT count(*), sum(frames) FROM clips")[0]
    by_stage = {row[0]: row[1:] for row in rows}
    for stage in ("frames", "words", "postures", "descriptors"):
        _, failed, done, of, size, seconds = by_stage[stage]
        assert (failed, done, of) == (0, clips, frames)
        assert size > 0
        assert seconds > 0
    ((rate,),) = query(built_lake, "SELECT frames_per_second FROM stage_metrics() WHERE stage = 'frames'")
    assert rate == pytest.approx(frames / by_stage["frames"][-1])


def test_status_as_open_metrics(built_lake: Path) -> None:
    found = samples(motionlake("status", "--open-metrics", "--lake", built_lake).out)
    clips, frames = query(built_lake, "SELECT count(*), sum(frames) FROM clips")[0]
    assert found["motionlake_dataset_clips", 'dataset="clips"'] == clips
    assert found["motionlake_stage_frames", 'stage="frames"'] == frames
    assert found["motionlake_stage_batches", 'stage="words",state="done"'] >= 1
    assert found["motionlake_stage_batches", 'stage="words",state="due"'] == 0
    assert ("motionlake_stage_batches", 'stage="quality",state="due"') not in found
    assert found["motionlake_damaged_files", ""] == 0
    run = motionlake("status", "--open-metrics", "--json", "--lake", built_lake)
    assert (run.status, "name one" in run.err) == (2, True)


def test_names_cannot_break_out_of_a_label() -> None:
    name = 'x",y="\n# EOF\\'
    found = samples(open_metrics([{"dataset": name, "clips": 1, "frames": 2, "rejects": 0}], [], {}, 0))
    ((label,),) = ({labels for (_, labels) in found if labels},)
    assert label == 'dataset="x\\",y=\\"\\n# EOF\\\\"'


def test_a_lake_of_an_earlier_program_gets_the_macro_by_its_next_run(built_lake: Path, tmp_path: Path) -> None:
    lake = Path(shutil.copytree(built_lake, tmp_path / "lake"))
    with Changed(lake) as con:
        con.execute("DROP MACRO TABLE stage_metrics")
    run = motionlake("status", "--open-metrics", "--lake", lake)
    assert (run.status, "an earlier motionlake wrote it; `motionlake run all`" in run.err) == (2, True)
    assert motionlake("run", "words", "--lake", lake).status == 0
    assert motionlake("status", "--open-metrics", "--lake", lake).status == 0


def events(file: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def test_a_log_of_events(tmp_path: Path, clips_folder: Path, scheduler: str) -> None:
    log, lake = tmp_path / "log.jsonl", quick_lake(tmp_path / "lake")
    words = ("ingest", clips_folder, "--lake", lake, "--scheduler", scheduler)
    assert motionlake("--log-json", log, *words).status == 0
    begins, *between, ends = events(log)
    assert begins["event"] == "begins"
    assert (ends["event"], ends["status"]) == ("ends", 0)
    assert all("time" in one for one in between)
    counts = [(one["done"], one["total"]) for one in between if one.get("stage") == "frames"]
    ((clips,),) = query(lake, "SELECT count(*) FROM clips")
    assert (counts[0], counts[-1]) == ((0, clips), (clips, clips))
    assert counts == sorted(counts)

    assert motionlake("--log-json", log, "run", "nothing", "--lake", lake).status == 2
    assert [one["event"] for one in events(log)[-3:]] == ["begins", "fails", "ends"]
    assert "no such stage" in str(events(log)[-2]["reason"])
    assert motionlake("status", "--lake", lake).status == 0
    assert events(log)[-1]["status"] == 2, "the next command keeps no log"


def test_a_log_that_cannot_be_written(tmp_path: Path, built_lake: Path) -> None:
    run = motionlake("--log-json", tmp_path / "nowhere" / "log", "status", "--lake", built_lake)
    assert (run.status, "No such file or directory; name a file that can be written" in run.err) == (2, True)
    run = motionlake("--log-json", "/dev/full", "status", "--lake", built_lake)
    assert (run.status, run.err.count("no more is logged")) == (0, 1)
