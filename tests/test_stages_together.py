"""Stages that need the frames alone run together on a part, which is read once; what they make is the same."""

from __future__ import annotations

import asyncio
import gc
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from distributed import Client, wait
from distributed.client import AllExit
from motionlake.errors import UserError
from motionlake.jobs.cluster import cluster
from motionlake.jobs.run import ingest, run
from motionlake.jobs.session import Session, session
from motionlake.jobs.shards import OnCluster, bundled, with_inputs
from motionlake.lake import frames
from motionlake.lake.config import load_config
from motionlake.lake.layout import open_lake
from motionlake.stages.moves import MOVES
from motionlake.stages.part_clips import read_together, shared
from motionlake.stages.reader import lake_reader
from motionlake.stages.sources import IngestOptions, Root
from motionlake.stages.stage import Shard, ShardResult, ShardStage
from motionlake.stages.words import WORDS

from tests.lakes import QUICK, Changed, quick_lake

READERS = ("words", "postures", "moves", "descriptors", "submotions")
FOLDERS = ("features", "postures", "moves", "submotions")


def opened(lake: Path) -> Any:
    return session(open_lake(lake), "test", lambda *_: None, lambda _: None)


@pytest.fixture
def undone(lake: Path) -> Path:
    """A copy of the lake in which none of these stages has run; its models are there."""
    with Changed(lake) as con:
        con.execute("DELETE FROM manifest WHERE stage IN $stages", {"stages": list(READERS)})
        con.execute("DELETE FROM files WHERE split_part(file, '/', 1) IN $folders", {"folders": list(FOLDERS)})
    for folder in FOLDERS:
        for path in (lake / folder).iterdir():
            path.unlink()
    return lake


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each frames part was read."""
    found: Counter[str] = Counter()
    read: Callable[..., Iterator[frames.Frames]] = frames.read_part

    def counted(path: Path, *given: Any, **named: Any) -> Iterator[frames.Frames]:
        found[path.name] += 1
        return read(path, *given, **named)

    monkeypatch.setattr(frames, "read_part", counted)
    return found


def written(lake: Path) -> dict[str, bytes]:
    return {f"{folder}/{path.name}": path.read_bytes() for folder in FOLDERS for path in (lake / folder).iterdir()}


def test_a_part_is_read_once_and_the_same_is_made(undone: Path, built_lake: Path, reads: Counter[str]) -> None:
    with opened(undone) as job:
        run(job, READERS)
        assert {name: (o.ok, o.failed) for name, o in job.outcomes.items()} == dict.fromkeys(READERS, (1, 0))
    assert set(reads.values()) == {1}, "each part once for all stages"
    assert written(undone) == written(built_lake)


def test_alone_each_stage_reads_it(undone: Path, built_lake: Path, reads: Counter[str]) -> None:
    with opened(undone) as job:
        for name in READERS:
            run(job, [name])
    assert set(reads.values()) == {len(READERS)}
    assert written(undone) == written(built_lake)


def test_a_shard_that_fails_leaves_the_others_and_is_tried_once(undone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def fails(_lake: Any, shard: Shard) -> Iterator[Any]:
        tried.append(shard.key)
        raise ValueError("no moves today")
        yield

    monkeypatch.setattr(type(MOVES), "rows", lambda _self, lake, shard: fails(lake, shard))
    with opened(undone) as job:
        run(job, READERS)
        assert {name: (o.ok, o.failed) for name, o in job.outcomes.items()} == {
            name: (0, 1) if name == "moves" else (1, 0) for name in READERS
        }
        assert job.outcomes["moves"].reason == "ValueError: no moves today"
    assert len(tried) == 1


def test_a_model_that_cannot_be_trained_stops_no_stage_before_it(clips_folder: Path, tmp_path: Path) -> None:
    lake = quick_lake(tmp_path / "lake", QUICK.replace("m = 40", 'm = 20000\nweights = "own"'))
    with opened(lake) as job:
        ingest(job, [Root("clips", str(clips_folder), IngestOptions())])
    with opened(lake) as job, pytest.raises(UserError, match="postures to train on"):
        run(job, READERS)
    with opened(lake) as job:
        assert run(job, ["words", "moves"]) is None
        assert {name: o.ok for name, o in job.outcomes.items()} == {"words": 0, "moves": 0}, "they were made"


def test_stages_of_one_part_are_one_bundle_in_their_order() -> None:
    def shard(stage: str, part: str) -> Shard:
        return Shard(stage, f"{stage}-{part}", part, "d", {}, 1)

    both = [(WORDS, [shard("words", "p"), shard("words", "q")]), (MOVES, [shard("moves", "q"), shard("moves", "r")])]
    found = [[one.key for _, one in bundle] for bundle in bundled(both)]
    assert found == [["words-p"], ["words-q", "moves-q"], ["moves-r"]]
    assert [len(bundle) for bundle in bundled(both[:1])] == [1, 1]


def test_nothing_is_shared_outside_the_block() -> None:
    made: list[int] = []

    def make() -> int:
        made.append(1)
        return len(made)

    assert [shared("a", make), shared("a", make)] == [1, 2]
    with read_together():
        assert [shared("a", make), shared("a", make), shared("b", make)] == [3, 3, 4]
    with read_together():
        assert shared("a", make) == 5


def test_progress_names_the_stages_that_run_together(undone: Path) -> None:
    told: list[tuple[str, int, int]] = []
    with session(open_lake(undone), "test", lambda *given: told.append(given), lambda _: None) as job:
        assert isinstance(job, Session)
        run(job, READERS)
    assert told[0] == (", ".join(READERS), 0, 15)
    assert [done for name, done, _ in told if name == told[0][0]][-1] == 15


def test_what_has_ended_is_given_to_who_stops(undone: Path, scheduler: str) -> None:
    lake = open_lake(undone)
    with lake_reader(lake, load_config(lake.config_file)) as at:
        planned = [(stage, with_inputs(lake, stage.plan(at))) for stage in (WORDS, MOVES)]
    bundles = [[(stage, shard)] for stage, shards in planned for shard in shards]
    with Client(scheduler) as client:
        work = OnCluster(lake.root, bundles, client)
        [((first, _), found)] = next(iter(work))
        assert isinstance(found, ShardResult)
        wait(list(work._running), timeout=60)
        [[((second, _), other)]] = work.finished()
    assert {first.name, second.name} == {"words", "moves"}
    assert isinstance(other, ShardResult)


def test_who_stops_leaves_no_shard_running_on_the_cluster_of_another(tmp_path: Path, scheduler: str) -> None:
    def slow(root: Path, shard: Shard) -> ShardResult:
        (root / f"{shard.key}-began").touch()
        time.sleep(1.0)
        (root / f"{shard.key}-ended").touch()
        return ShardResult(shard)

    stage = cast("ShardStage", SimpleNamespace(name="slow", run=slow))
    bundles = [[(stage, Shard("slow", f"s{k}", f"p{k}", "d", {}, 1))] for k in range(2)]
    with Client(scheduler) as client:
        work = OnCluster(tmp_path, bundles, client)
        work._submitted()
        while not (tmp_path / "s0-began").exists():
            time.sleep(0.01)
        work.give_up()
        assert sorted(file.name for file in tmp_path.iterdir()) == ["s0-began", "s0-ended"]
        time.sleep(1.0)
    assert len(list(tmp_path.iterdir())) == 2, "the second one ran"


def test_how_dask_leaves_off_waiting_is_not_shown(lake: Path, scheduler: str, caplog: pytest.LogCaptureFixture) -> None:
    """A command that was stopped may make that an error which nobody asks for; others are shown as before."""
    with cluster(open_lake(lake), 1, scheduler):
        pass

    async def left(error: type[BaseException]) -> None:
        async def wait() -> None:
            raise error

        task = asyncio.get_running_loop().create_task(wait())
        await asyncio.sleep(0)
        del task
        gc.collect()

    for error, shown in ((AllExit, 0), (ValueError, 1)):
        caplog.clear()
        asyncio.run(left(error))
        assert [record.name for record in caplog.records] == ["asyncio"] * shown
