"""The documentation: its site is built with every link checked, and the examples on its pages are no fiction."""

from __future__ import annotations

import ast
import importlib
import os
import re
import shlex
import subprocess
from pathlib import Path

import duckdb
import motionlake
import pytest
import typer
from motionlake.cli.main import app
from typer.core import TyperGroup

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMAND = re.compile(r"^(?:    )?motionlake +([a-z][^\n]*)$", re.MULTILINE)
ADDED = ("longest_clips", "speeds", "metres_each_second", "novelty")  # by the guide to extending
MADE_ON_REQUEST = ("similar_words", "FROM quality")  # of stages that `run all` leaves out


def commands(page: Path) -> list[str]:
    """Lines of code blocks that run motionlake."""
    text = page.read_text(encoding="utf-8")
    fenced = re.findall(r"^```(\w*)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    indented = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    blocks = [block for language, block in fenced if language in ("", "sh")]
    blocks += re.findall(r"(?:^    .*\n)+", indented, re.MULTILINE)
    return [line for block in blocks for line in COMMAND.findall(block)]


ALL = [(page.name, line) for page in PAGES for line in commands(page) if not line.startswith("train novelty")]


def test_there_are_examples_to_check() -> None:
    assert len(ALL) > 60


@pytest.mark.parametrize(("page", "line"), ALL)
def test_commands_have_these_options(page: str, line: str) -> None:
    """What a page says to type is understood; README's commands are also run (test_readme)."""
    command, words = typer.main.get_command(app), shlex.split(line)
    while isinstance(command, TyperGroup):
        found = command.get_command(typer.Context(command), words[0])
        assert found is not None, f"{page}: no command {words[0]}"
        command, words = found, words[1:]
    command.make_context(command.name, words)


def test_queries_fit_the_tables(built_lake: Path) -> None:
    """SQL on the pages names tables, columns and functions that a lake has."""
    queries = [
        words[1]
        for _, line in ALL
        if (words := shlex.split(line))[0] == "sql" and not any(name in line for name in MADE_ON_REQUEST)
    ]
    for page in PAGES:
        queries += re.findall(r"^```sql\n((?!--|CREATE).*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    assert len(queries) > 10
    con = motionlake.connect(built_lake, trusted=True)  # some read parts by their names
    try:
        for query in queries:
            if any(name in query for name in ADDED):
                continue
            try:
                con.execute(f"EXPLAIN {query}")
            except duckdb.Error as error:
                raise AssertionError(f"{query}: {error}") from error
    finally:
        con.close()


def test_python_imports_what_there_is() -> None:
    for page in PAGES:
        if page.name == "extending.md":
            continue  # test_extending runs it
        for block in re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL):
            for node in ast.walk(ast.parse(block)):
                if isinstance(node, ast.ImportFrom) and node.module and node.module != "__future__":
                    module = importlib.import_module(node.module)
                    for alias in node.names:
                        assert hasattr(module, alias.name), f"{page.name}: {node.module} has no {alias.name}"


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    built = subprocess.run(
        ["make", "docs", f"SITE={tmp_path / 'site'}"], cwd=ROOT, capture_output=True, text=True, check=False,
        timeout=300, env=os.environ | {"NO_COLOR": "1"},
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    reference = (tmp_path / "site" / "reference.html").read_text(encoding="utf-8")
    for name in ("open_lake", "synthesize", "ClipDataset", "positions"):
        assert name in reference
