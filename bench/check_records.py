"""Records that docs name are there and were made from a clean tree of this repository: `python -m bench.check_records`.

A figure in docs names the record that it is from (`bench/results`). What is wrong is printed, a line each, and the exit
status is then 1. `--history` asks too whether the commit that a record was made at belongs to the repository, which a
copy without its history cannot tell.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from bench.record import RESULTS

ROOT: Final = Path(__file__).parents[1]
NAME: Final = re.compile(r"\b[a-z][a-z0-9_-]*-20\d{6}T\d{6}Z\b")


def named(pages: Iterable[Path]) -> dict[str, set[str]]:
    """The records that pages name, and the names of these pages."""
    found: dict[str, set[str]] = {}
    for page in pages:
        for name in NAME.findall(page.read_text(encoding="utf-8")):
            found.setdefault(name, set()).add(page.name)
    return found


def faults(records: dict[str, set[str]], results: Path, history: frozenset[str] | None) -> Iterator[str]:
    """What is wrong with records that pages name.

    Args:
        records: as `named` gives them.
        results: the folder that holds them.
        history: every commit of the repository, its first twelve digits; None where it is not known.
    """
    for name, pages in sorted(records.items()):
        where = ", ".join(sorted(pages))
        path = results / f"{name}.json"
        if not path.is_file():
            yield f"{where}: names {name}, and there is no such record in {results.name}"
            continue
        revision = json.loads(path.read_text(encoding="utf-8")).get("revision") or ""
        if not revision or revision.endswith("+"):
            yield f"{where}: names {name}, which was not made from a clean tree (revision {revision!r}); make it again"
        elif history is not None and revision not in history:
            yield f"{where}: names {name}, whose commit {revision} the repository does not hold; make it again"


def commits() -> frozenset[str] | None:
    """The repository's commits, twelve digits each; None in a copy without its history."""

    def git(*words: str) -> str | None:
        run = subprocess.run(["git", "-C", ROOT, *words], capture_output=True, text=True, check=False)
        return run.stdout if run.returncode == 0 else None

    if git("rev-parse", "--is-shallow-repository") != "false\n":
        return None
    listed = git("rev-list", "HEAD")
    return None if listed is None else frozenset(line[:12] for line in listed.splitlines())


def main() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    found = list(faults(named(pages), RESULTS, commits() if "--history" in sys.argv[1:] else None))
    print("\n".join(found) or "every record that docs name was made from a clean tree")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
