"""What `pip install motionlake` puts where: one package, complete, beside packages that have names of their own."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.lakes import made_clips, motionlake, quick_lake

ROOT = Path(__file__).parents[1]
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
SBOM = runpy.run_path(str(ROOT / ".ci" / "sbom.py"))
WEB = ROOT / "pipeline" / "service" / "web"  # sources of the bundle, which alone is installed
BESIDE = ("jupysql==0.11.1", "ipython")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    shutil.rmtree(ROOT / "build", ignore_errors=True)  # setuptools would take files from there that are gone
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
        for module in (path for path in (ROOT / top).rglob("__init__.py") if WEB not in path.parents):
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
            if path.is_file() and "__pycache__" not in path.parts and WEB not in path.parents:
                below = path.relative_to(ROOT if top != "pipeline" else ROOT / top)
                expected.add(f"motionlake/{below.as_posix()}")
    assert expected == {name for name in names if ".dist-info" not in name}


def test_what_is_pinned_is_known_by_its_hash() -> None:
    """But torch: which of its builds fits is the machine's to say."""
    torch = (ROOT / "requirements-torch.lock").read_text(encoding="utf-8")
    assert re.fullmatch(r"torch==\S+\n", torch)
    for name in ("requirements.lock", "requirements-bench.lock"):
        text = (ROOT / name).read_text(encoding="utf-8").replace("\\\n", "")
        for line in text.splitlines():
            assert re.fullmatch(r"[a-z0-9.-]+==\S+( +--hash=sha256:[0-9a-f]{64})+", line.strip()), line
        assert "torch==" not in text


def test_a_release_has_a_bill_of_materials(wheel: Path) -> None:
    first, again = SBOM["bill"](wheel), SBOM["bill"](wheel)
    assert first == json.loads(json.dumps(again))
    assert (first["bomFormat"], first["specVersion"]) == ("CycloneDX", "1.6")
    libraries = {c["name"]: c for c in first["components"] if c["type"] == "library"}
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    direct = {re.split(r"[\[<>=]", line)[0] for line in asked}
    assert direct | {"distributed", "llvmlite"} <= set(libraries)
    assert not {"pytest", "mypy", "librosa"} & set(libraries)
    for name, (version, hashes) in SBOM["pinned"]().items():
        if name in libraries:
            found = libraries[name]
            assert found["version"] == version
            assert found["licenses"], name
            told = [entry["content"] for files in found.get("externalReferences", []) for entry in files["hashes"]]
            assert told == hashes
            assert bool(told) == (name != "torch")
    models = [c for c in first["components"] if c["type"] == "machine-learning-model"]
    assert len(models) == len([p for p in (ROOT / "pipeline").glob("*/weights/*") if p.is_file()])
    known = {c["bom-ref"] for c in first["components"]} | {first["metadata"]["component"]["bom-ref"]}
    assert {entry["ref"] for entry in first["dependencies"]} <= known
    assert all(set(entry["dependsOn"]) <= known for entry in first["dependencies"])


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
