"""What `pip install motionlake` puts where: one package, complete, beside packages that have names of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.lakes import made_clips, motionlake, quick_lake

ROOT = Path(__file__).parents[1]
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
BESIDE = ("jupysql==0.11.1", "ipython")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    made = python("-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT))
    assert made.returncode == 0, made.stderr
    return next(folder.glob("*.whl"))


def python(*words: str, folder: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip


def folders() -> set[str]:
    """Every package by its folder: `pipeline/` is motionlake, `jobs/` and `sql/` lie below it."""
    found = set()
    for top in ("pipeline", "jobs", "sql"):
        for module in (ROOT / top).rglob("__init__.py"):
            below = module.parent.relative_to(ROOT if top != "pipeline" else ROOT / top)
            found.add(".".join(("motionlake", *below.parts)))
    return found


def test_every_package_folder_is_listed() -> None:
    assert set(SETUPTOOLS["packages"]) == folders()
    assert SETUPTOOLS["packages"] == sorted(SETUPTOOLS["packages"])


def test_the_wheel_holds_every_file_and_one_package(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {name.split("/")[0] for name in names if ".dist-info" not in name} == {"motionlake"}
    expected = {"motionlake/py.typed"}
    for top in ("pipeline", "jobs", "sql"):
        for path in (ROOT / top).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                below = path.relative_to(ROOT if top != "pipeline" else ROOT / top)
                expected.add(f"motionlake/{below.as_posix()}")
    assert expected == {name for name in names if ".dist-info" not in name}


def test_it_lives_beside_jupysql(wheel: Path, tmp_path: Path) -> None:
    """jupysql, which many use with DuckDB, is a top-level package `sql`; its magic asks a lake."""
    site = tmp_path / "site"
    to_site = ("-m", "pip", "install", "--quiet", "--no-compile", "--target", str(site))
    installed = python(*to_site, "--no-deps", str(wheel))
    assert installed.returncode == 0, installed.stderr
    fetched = python(*to_site, *BESIDE)
    if fetched.returncode and "No matching distribution" in fetched.stderr:
        pytest.skip("jupysql cannot be fetched: no network, or an index without it")
    assert fetched.returncode == 0, fetched.stderr
    lake = quick_lake(tmp_path / "lake")
    made_clips(tmp_path / "clips", 1)
    assert motionlake("ingest", tmp_path / "clips", "--lake", lake, "--workers", 1).status == 0
    program = f"""
import sql, motionlake
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
sql.load_ipython_extension(shell)
shell.user_ns["lake"] = motionlake.connect({str(lake)!r})
shell.run_line_magic("sql", "lake --alias lake")
shell.run_line_magic("sql", "asked << SELECT count(*) AS clips FROM clips")
clips = motionlake.open_lake({str(lake)!r}).clips()
print(sql.__file__, motionlake.__file__, shell.user_ns["asked"].dict(), len(clips))
"""
    quiet = {"PLOOMBER_STATS_ENABLED": "false", "IPYTHONDIR": str(tmp_path / "ipython"), "HOME": str(tmp_path)}
    run = python("-c", program, folder=tmp_path, PYTHONPATH=str(site), **quiet)
    assert run.returncode == 0, run.stderr
    told = run.stdout.splitlines()[-1]
    assert told == f"{site}/sql/__init__.py {site}/motionlake/__init__.py {{'clips': (3,)}} 3", run.stdout
