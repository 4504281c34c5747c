"""Fixtures shared by all tests, the order of test files, and what was skipped for want of real recordings."""

from __future__ import annotations

import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import dask
import pytest
from distributed import LocalCluster
from hypothesis import settings

from tests.lakes import made_clips, made_once, motionlake, quick_lake, real_clips
from tests.processes import serve_forks

# Tests assert what is right, not how fast it comes. In CI examples are the same every time, so that a failure is of the
# change; anywhere else new ones are drawn.
settings.register_profile("motionlake", deadline=None, derandomize="MOTIONLAKE_SAME_EXAMPLES" in os.environ)
settings.load_profile("motionlake")

# The longest files first: where processes share the files out, no long one is left for the end.
LONGEST = ("test_readme", "test_lake_faults", "test_many_at_once", "test_extending", "test_lake_cluster",
           "test_lake_updates", "test_synthesize", "test_command_line", "test_pictures", "test_searcher_protocol",
           "test_evaluate_synthesis", "test_synthesize_faults", "test_lake_versions", "test_submotion_search",
           "test_packaging", "test_hostile_lake", "test_pesta_pictures", "test_glogen", "test_training")  # fmt: skip
# The processes of pytest-xdist keep all cores busy: threads of their own would only wait for one another.
for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# Modules are compiled once for all processes of the tests; numba keeps its own files beside them in any case.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; a test that needs it is skipped, by name, where there is none."""
    folder = os.environ.get("MOTIONLAKE_DATA")
    if not folder:
        pytest.skip("MOTIONLAKE_DATA is not set: no real recordings here")
    return Path(folder)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of this run, which the processes of pytest-xdist have in common: for what `made_once` makes."""
    folder = tmp_path_factory.getbasetemp()
    return (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "shared"


@pytest.fixture(scope="session")
def clips_folder(shared: Path) -> Path:
    """A folder of small clips of three rigs with labels: real ones where they are at hand, else made ones."""
    data = os.environ.get("MOTIONLAKE_DATA")
    return made_once(
        shared / "clips", lambda folder: real_clips(Path(data), folder, 5) if data else made_clips(folder, 5)
    )


@pytest.fixture(scope="session")
def scheduler() -> Iterator[str]:
    """The address of a Dask cluster that all tests of a process share."""
    serve_forks()
    with (
        dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
    ):
        yield cluster.scheduler_address


@pytest.fixture(scope="session")
def built_lake(shared: Path, clips_folder: Path, request: pytest.FixtureRequest) -> Path:
    """A lake of `clips_folder` with every stage made; tests read it, and copy it to change it (`lake`)."""

    def build(lake: Path) -> None:
        quick_lake(lake)
        for words in (["ingest", clips_folder], ["run", "all"]):
            run = motionlake(*words, "--lake", lake, "--scheduler", request.getfixturevalue("scheduler"))
            assert run.status == 0, run.err

    return made_once(shared / "lakes" / "built", build)


@pytest.fixture
def lake(tmp_path: Path, built_lake: Path) -> Path:
    """A copy of `built_lake` for one test."""
    return Path(shutil.copytree(built_lake, tmp_path / "lake"))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path.stem, len(LONGEST)))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say in one line how many tests ran without real recordings, and which were skipped for want of them."""
    if os.environ.get("MOTIONLAKE_DATA"):
        return
    ran = len(terminalreporter.stats.get("passed", [])) + len(terminalreporter.stats.get("failed", []))
    reports = terminalreporter.stats.get("skipped", [])
    files = Counter(Path(report.fspath).stem for report in reports if "MOTIONLAKE_DATA" in str(report.longrepr))
    if not ran + len(reports):
        return
    skipped = ", ".join(f"{name} {count}" for name, count in sorted(files.items()))
    terminalreporter.write_line(
        f"without real recordings: {ran} tests ran (made clips stand in where they can), "
        f"{files.total()} need MOTIONLAKE_DATA{': ' * bool(skipped)}{skipped}"
    )
