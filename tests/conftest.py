"""Fixtures shared by all tests, and the count of the tests that ran without real recordings."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster

from tests.lakes import made_clips, motionlake, quick_lake, real_clips


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; a test that needs it is skipped, by name, where there is none."""
    folder = os.environ.get("MOTIONLAKE_DATA")
    if not folder:
        pytest.skip("MOTIONLAKE_DATA is not set: no real recordings here")
    return Path(folder)


@pytest.fixture(scope="session")
def clips_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of small clips of three rigs with labels: real ones where they are at hand, else made ones."""
    folder = tmp_path_factory.mktemp("source") / "clips"
    data = os.environ.get("MOTIONLAKE_DATA")
    if data:
        real_clips(Path(data), folder, 5)
    else:
        made_clips(folder, 5)
    return folder


@pytest.fixture(scope="session")
def scheduler() -> Iterator[str]:
    """The address of a Dask cluster that all tests share."""
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="session")
def built_lake(tmp_path_factory: pytest.TempPathFactory, clips_folder: Path, scheduler: str) -> Path:
    """A lake of `clips_folder` with every stage made; tests read it, and copy it to change it (`lake`)."""
    lake = quick_lake(tmp_path_factory.mktemp("lakes") / "built")
    for words in (["ingest", clips_folder], ["run", "all"]):
        run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
        assert run.status == 0, run.err
    return lake


@pytest.fixture
def lake(tmp_path: Path, built_lake: Path) -> Path:
    """A copy of `built_lake` for one test."""
    return Path(shutil.copytree(built_lake, tmp_path / "lake"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name what was skipped, and say how many tests ran without real recordings."""
    if os.environ.get("MOTIONLAKE_DATA"):
        return
    ran = len(terminalreporter.stats.get("passed", [])) + len(terminalreporter.stats.get("failed", []))
    skipped = len(terminalreporter.stats.get("skipped", []))
    if not ran + skipped:
        return
    terminalreporter.write_line(
        f"without real recordings: {ran} tests ran (made clips stand in where they can), {skipped} need MOTIONLAKE_DATA"
    )
