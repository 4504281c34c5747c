"""The bundle that is committed: what its sources build, with licences, without another host in it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

SERVICE = Path(__file__).parents[2] / "pipeline" / "service"
WEB, BUNDLE = SERVICE / "web", SERVICE / "bundle"


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_bundle_is_what_the_sources_build(tmp_path: Path) -> None:
    """Byte for byte, with the packages that the lock file pins."""
    npm, npx = shutil.which("npm"), shutil.which("npx")
    if npm is None or npx is None:
        pytest.skip("no npm here: apt-get install npm")
    web = shutil.copytree(WEB, tmp_path / "web", ignore=shutil.ignore_patterns("node_modules"))
    installed = subprocess.run(
        [npm, "ci", "--no-audit", "--no-fund"], cwd=web, capture_output=True, text=True, timeout=600, check=False
    )
    if installed.returncode:
        pytest.skip(f"npm cannot install the packages here: {installed.stderr[-300:]}")
    built = subprocess.run([npm, "run", "build"], cwd=web, capture_output=True, text=True, timeout=600, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    made, kept = contents(tmp_path / "bundle"), contents(BUNDLE)
    assert sorted(made) == sorted(kept), "run `make web` and commit what it builds"
    assert [name for name in made if made[name] != kept[name]] == []


def test_every_package_is_pinned_and_no_registry_is_named() -> None:
    about = json.loads((WEB / "package.json").read_text(encoding="utf-8"))
    for version in (about["dependencies"] | about["devDependencies"]).values():
        assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    lock = json.loads((WEB / "package-lock.json").read_text(encoding="utf-8"))
    for name, package in lock["packages"].items():
        assert "resolved" not in package, name
        assert not name or package["integrity"].startswith("sha512-"), name


def test_licences_are_listed() -> None:
    text = (BUNDLE / "LICENSES.txt").read_text(encoding="utf-8")
    heads = re.findall(r"^(\S+) (\d+\.\d+\.\d+): (\S+)$", text, re.MULTILINE)
    names = {name for name, _, _ in heads}
    assert {"react", "react-dom", "three", "@mantine/core", "@tanstack/react-virtual"} <= names
    assert {licence for _, _, licence in heads} <= {"MIT", "ISC", "0BSD", "BSD-3-Clause", "Apache-2.0"}
    assert "no text of its own" not in text


def test_the_page_keeps_a_strict_policy() -> None:
    """No script or style in the page itself, and no code made of text."""
    page = (BUNDLE / "index.html").read_text(encoding="utf-8")
    assert re.findall(r"<script(?![^>]*\ssrc=)", page) == []
    assert "<style" not in page
    assert re.search(r"\son\w+=", page) is None
    for path in BUNDLE.rglob("*.js"):
        text = path.read_text(encoding="utf-8")
        assert re.search(r"\beval\(|new Function\(", text) is None, path.name
    for path in BUNDLE.rglob("*.css"):
        assert "url(http" not in path.read_text(encoding="utf-8")
