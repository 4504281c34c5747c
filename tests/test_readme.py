"""README's commands and the Makefile's targets are run, so that they cannot rot."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.lakes import QUICK, Run, elsewhere, on_cluster, query, quick_lake
from tests.samples import deepmimic_frames, deepmimic_text

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.findall(r"^([a-z-]+):.*##", MAKEFILE, re.MULTILINE)


def shell(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env={**os.environ, "PATH": path, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture(scope="module")
def motions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that README speaks of: the fetched motions where `make demo` was run, else made ones."""
    folder = tmp_path_factory.mktemp("readme") / "demo" / "deepmimic"
    if (ROOT / "demo" / "deepmimic").is_dir():
        return Path(shutil.copytree(ROOT / "demo" / "deepmimic", folder))
    folder.mkdir(parents=True)
    for i, name in enumerate(("walk", "kick", "run", "dance_a", "jump", "spin")):
        (folder / f"humanoid3d_{name}.txt").write_text(deepmimic_text(deepmimic_frames(60 + 10 * i)))
    shutil.copy(ROOT / "docs" / "demo" / "labels.csv", folder / "labels.csv")
    return folder


def run_line(line: str, scheduler: str) -> Run:
    """Run a line of shell that calls motionlake, within this process and on the cluster that tests share."""
    name, *words = shlex.split(line)
    assert Path(name).name == "motionlake", line
    return on_cluster(words, scheduler)


def test_readme_s_commands_run(motions: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    base = motions.parents[1]
    monkeypatch.chdir(base)
    commands = [
        line for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL) for line in block.strip().splitlines()
    ]
    assert len(commands) > 10
    quick_lake(base / "mylake", QUICK + "[descriptors]\nepochs = 3\n")
    for command in commands:
        run = run_line(command, scheduler)
        # 1: the robot dog among the fetched motions is rejected
        assert run.status in (0, 1), f"{command}: {run.err}"
        assert run.out.strip() or "rejects" in command, command
    assert (base / "walk.bvh").is_file()


def test_readme_names_targets_that_are_there() -> None:
    assert set(re.findall(r"`make ([a-z-]+)", README)) <= set(TARGETS)


def test_every_target_has_its_line_of_help() -> None:
    phony = re.search(r"^\.PHONY:(.*)$", MAKEFILE, re.MULTILINE)
    stages = re.search(r"^STAGES := (.*)$", MAKEFILE, re.MULTILINE)
    assert phony
    assert stages
    assert set(phony[1].replace("$(STAGES)", stages[1]).split()) == set(TARGETS)


def test_the_demo_with_a_folder_of_one_s_own(motions: Path, tmp_path: Path) -> None:
    run = shell(f"make demo DATA={motions} DEMO_LAKE={tmp_path / 'lake'}", ROOT)
    assert run.returncode == 0, run.stderr
    assert "rank" in run.stdout
    assert query(tmp_path / "lake", "SELECT count(*) > 5 FROM signatures") == [(True,)]


def test_stages_are_targets(motions: Path, tmp_path: Path, scheduler: str) -> None:
    lake = quick_lake(tmp_path / "lake")
    source = tmp_path / "clips"
    source.mkdir()
    for path in sorted(motions.glob("humanoid3d_*.txt"))[:5]:
        shutil.copyfile(path, source / path.name)
    targets = "ingest frames words embed motifs signatures status"
    printed = shell(f"make --dry-run {targets} SRC={source} LAKE={lake}", ROOT)
    assert printed.returncode == 0, printed.stderr
    lines = [line for line in printed.stdout.splitlines() if "bin/motionlake" in line]
    assert len(lines) == len(targets.split())
    for line in lines:
        run = run_line(line, scheduler)
        assert run.status == 0, f"{line}: {run.err}"
        assert run.out.strip(), line
    assert query(lake, "SELECT count(*) FROM signatures") == [(5,)]


def take_over_kernels(package: Path) -> None:
    """Give modules that are those of the checkout the kernels that numba has compiled of these: it takes a minute."""
    for file in package.rglob("*.py"):
        twin = ROOT / "pipeline" / file.relative_to(package)
        if twin.is_file() and twin.read_bytes() == file.read_bytes():
            shutil.copystat(twin, file)
            for kernel in (twin.parent / "__pycache__").glob(f"{twin.stem}.*.nb[ic]"):
                (file.parent / "__pycache__").mkdir(exist_ok=True)
                shutil.copy(kernel, file.parent / "__pycache__")


def test_a_built_wheel_works_as_the_checkout_does(motions: Path, tmp_path: Path) -> None:
    built = shell(f"make wheel DIST={tmp_path}", ROOT)
    assert built.returncode == 0, built.stderr
    site = tmp_path / "site"
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        wheel.extractall(site)
    take_over_kernels(site / "motionlake")
    lake = tmp_path / "lake"
    assert not elsewhere(site, tmp_path, ("init", str(lake)))[0].status
    (lake / "config.toml").write_text(QUICK, encoding="utf-8")
    lines = (("ingest", str(motions)), ("run", "all"), ("status",), ("search", "humanoid3d_walk"))
    for run in elsewhere(site, tmp_path, *((*words, "--lake", str(lake)) for words in lines)):
        assert run.status in (0, 1), run.err
