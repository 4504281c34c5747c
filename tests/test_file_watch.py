"""A file that takes too long, or that ends the process of the worker that reads it, is rejected by name."""

from __future__ import annotations

import json
import os
import shutil
import signal
from pathlib import Path

import dask
import pytest
from motionlake.formats.limits_config import LimitError, Limits, raised
from motionlake.jobs import cluster
from motionlake.lake.layout import Lake
from motionlake.stages.file_watch import MOST_ENDS, at_fault, journal_of
from motionlake.stages.stage import Shard

from tests.lakes import elsewhere, motionlake, query
from tests.samples import deepmimic_frames, deepmimic_text

ROOT = Path(__file__).parents[1]
# A format whose files do as they say; compiled code sleeps with the interpreter's lock held.
READER = """
import ctypes, os, signal
from motionlake.formats.deepmimic import DeepMimicReader

class Bad:
    name = "bad"
    suffixes = (".bad",)

    def read(self, data, path, fps=None):
        if data.startswith(b"slow"):
            ctypes.PyDLL(None).sleep(3600)
        if data.startswith(b"fatal"):
            os.kill(os.getpid(), signal.SIGKILL)
        return DeepMimicReader().read(data, path, fps)

READER = Bad()
"""


def program(folder: Path) -> Path:
    """A copy of the program, its files linked, that reads `.bad` files too."""
    package = folder / "site" / "motionlake"
    for top in ("pipeline", "jobs", "sql"):
        target = package if top == "pipeline" else package / top
        shutil.copytree(ROOT / top, target, copy_function=os.symlink, dirs_exist_ok=True)
    (package / "formats" / "bad.py").write_text(READER, encoding="utf-8")
    return folder / "site"


def test_files_that_end_their_worker_are_rejected_and_the_others_taken_in(tmp_path: Path) -> None:
    clips = tmp_path / "clips"
    clips.mkdir()
    good = deepmimic_text(deepmimic_frames(40))
    (clips / "b1.bad").write_text("slow")
    (clips / "e1.bad").write_text("fatal")
    for name in ("a", "c", "e2", "z"):
        (clips / f"{name}.bad").write_text(good)
    motionlake("init", tmp_path / "lake")
    (tmp_path / "lake" / "config.toml").write_text("[limits]\nseconds = 15\n")
    site = program(tmp_path)
    words = ("ingest", "clips", "--lake", "lake", "--json")
    run, again = elsewhere(site, tmp_path, words, words)
    assert (run.status, run.json["clips"], run.json["rejected"], run.json["failed"]) == (1, 4, 2, 0), run.err
    reasons = dict(query(tmp_path / "lake", "SELECT path, reason FROM rejects"))
    assert reasons["b1.bad"] == "takes more than 15 s to read; [limits] seconds = 15 in config.toml"
    assert f"ended the process that reads it {MOST_ENDS} times" in reasons["e1.bad"]
    assert {clip for (clip,) in query(tmp_path / "lake", "SELECT path FROM clips")} == {
        "a.bad", "c.bad", "e2.bad", "z.bad",
    }  # fmt: skip
    assert not list((tmp_path / "lake" / "staging").glob("*"))
    assert (again.json["clips"], again.json["unchanged"]) == (0, 6)


def shard() -> Shard:
    return Shard("frames", "0123456789abcdef0123", "p", "d", {}, 1)


def test_a_journal_tells_who_was_at_fault(tmp_path: Path) -> None:
    path = journal_of(tmp_path, shard())
    path.parent.mkdir()
    assert at_fault(tmp_path, shard()) == set()
    run, reads = json.dumps({"run": "x"}), [json.dumps({"reads": name, "seconds": 9}) for name in ("é", "b")]
    path.write_text("\n".join([run, *reads, run, *reads, run, reads[0], "Timeout (0:00:09)!", "Thread 0x1:", ""]))
    assert at_fault(tmp_path, shard()) == {"é"}
    path.write_text("\n".join([run, *reads] * MOST_ENDS) + "\n")
    assert at_fault(tmp_path, shard()) == {"b"}
    path.write_text("\n".join([run, *reads] * (MOST_ENDS - 1)) + "\n")
    assert at_fault(tmp_path, shard()) == set()


def test_a_reason_tells_whether_its_limit_was_raised() -> None:
    assert not raised("is empty", Limits())
    reason = str(LimitError("seconds", 600, "takes more than 600 s to read"))
    assert [raised(reason, Limits(seconds=seconds)) for seconds in (1, 600, 601, 0)] == [False, False, True, True]
    reason = LimitError("frames", 10, "has 11 frames", 7).reason
    assert [raised(reason, Limits(frames=frames)) for frames in (9, 10, 11)] == [False, False, True]


def test_a_worker_that_dask_gives_up_is_started_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one is that takes too long to be back; a run without workers waited for ever."""
    monkeypatch.setattr(cluster, "_LOOK_AGAIN", 0.5)
    lost = dask.config.set({"distributed.deploy.lost-worker-timeout": "1ms"})
    with lost, cluster.cluster(Lake(tmp_path), 1) as client:
        first = client.submit(os.getpid).result()
        os.kill(first, signal.SIGKILL)
        assert client.submit(os.getpid, pure=False).result(timeout=250) != first
