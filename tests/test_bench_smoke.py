"""The register of small benches: every bench is in it, and what it changes is there to be changed."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

from bench.smoke import ELSEWHERE, SMOKES, Smoke

BENCH = Path(__file__).parents[1] / "bench"
MAKEFILE = (BENCH.parent / "Makefile").read_text(encoding="utf-8")


def has_main(file: Path) -> bool:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body)


def test_every_bench_has_a_small_size() -> None:
    files = [file for file in BENCH.rglob("*.py") if has_main(file) and file != BENCH / "smoke.py"]
    modules = {".".join(file.relative_to(BENCH).with_suffix("").parts) for file in files}
    names = {module.removesuffix(".__main__") for module in modules}
    assert len(names) > 20
    assert names == {smoke.module.removeprefix("bench.") for smoke in SMOKES} | set(ELSEWHERE)
    assert all((BENCH.parent / file).is_file() for file in ELSEWHERE.values())


@pytest.mark.parametrize("name", ["pesta", "deephums", "glogen", "comparators"])
def test_every_part_of_a_bench_has_a_small_size(name: str) -> None:
    parts = importlib.import_module(f"bench.{name}.__main__").PARTS
    assert set(parts) == {smoke.words[0] for smoke in SMOKES if smoke.module == f"bench.{name}"}


@pytest.mark.parametrize("smoke", SMOKES, ids=str)
def test_what_is_made_smaller_is_a_constant_of_a_bench(smoke: Smoke) -> None:
    for name in smoke.smaller:
        module, _, constant = name.rpartition(".")
        assert hasattr(importlib.import_module(module), constant), name


def test_make_runs_them() -> None:
    assert "-m bench.smoke" in MAKEFILE
