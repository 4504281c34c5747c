"""A copy of the repository in which faults are planted and tests run, with the compiled kernels that still hold."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Final

from bench.record import hash_files

ROOT: Final = Path(__file__).parents[2]
PACKAGE: Final = {"pipeline": "motionlake", "jobs": "motionlake.jobs", "sql": "motionlake.sql"}


class Tree:
    """A copy of the files that git knows, and a process that runs tests in it.

    Numba does not see that a kernel of another module, compiled into a kept one, has changed: kernels of every module
    that imports the changed one are compiled anew.

    Args:
        folder: to make it in.
    """

    def __init__(self, folder: Path) -> None:
        self.root, self._cache = folder / "tree", folder / "kernels-of-run"
        shutil.rmtree(self.root, ignore_errors=True)
        listed = subprocess.run(
            ["git", "ls-files", "-zco", "--exclude-standard"], cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout
        for name in filter(None, listed.split("\0")):
            if (ROOT / name).is_file():
                target = self.root / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, target)
        self._warm = folder / f"kernels-{_sources(self.root)[:12]}"
        self._warm.mkdir(exist_ok=True)
        source = self.root / ".source"
        (source / "motionlake").mkdir(parents=True)
        for entry in [*(self.root / "pipeline").iterdir(), self.root / "jobs", self.root / "sql"]:
            (source / "motionlake" / entry.name).symlink_to(entry)
        self._users = _users(self.root)
        self._clock = 0
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(source), str(self.root)]),
            **dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
        }
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", str(Path(__file__).with_name("fork_tests.py"))],
            cwd=self.root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run(self, tests: Sequence[str], log: Path, seconds: float, path: str = "", text: str = "") -> tuple[str, float]:
        """How tests end, "passed", "failed" or "timed out", and the seconds of the processor that they took.

        Args:
            tests: files, in their order.
            log: where what they say goes.
            seconds: of the processor that they may take.
            path: of a module, relative to the repository, that has another `text` meanwhile; "": none has, and the
                kernels that are compiled are kept.
        """
        if not path:
            return self._asked(tests, self._warm, log, seconds)
        shutil.rmtree(self._cache, ignore_errors=True)
        _link(self._warm, self._cache, self._users[path])
        file = self.root / path
        kept, times = file.read_bytes(), file.stat()
        try:
            self._write(file, text)
            return self._asked(tests, self._cache, log, seconds)
        finally:
            file.write_bytes(kept)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))

    def close(self) -> None:
        """End the process."""
        stream: IO[str] | None = self._process.stdin
        assert stream is not None
        stream.close()
        self._process.wait()

    def _asked(self, tests: Sequence[str], cache: Path, log: Path, seconds: float) -> tuple[str, float]:
        given, answers = self._process.stdin, self._process.stdout
        assert given is not None
        assert answers is not None
        print(
            json.dumps({"tests": [*tests], "cache": str(cache), "log": str(log), "seconds": int(seconds)}), file=given
        )
        given.flush()
        how, spent = json.loads(answers.readline())
        return how, spent

    def _write(self, file: Path, text: str) -> None:
        """Write a module at a time of its own: Python takes what it compiled of a file by its second and size."""
        file.write_text(text, encoding="utf-8")
        self._clock += 1
        seconds = 1_000_000_000 + 2 * self._clock
        os.utime(file, (seconds, seconds))


def _sources(root: Path) -> str:
    """sha256 of all modules, of which kept kernels were compiled."""
    return hash_files((file for top in PACKAGE for file in (root / top).rglob("*.py")), root)


def _users(root: Path) -> dict[str, set[str]]:
    """Of each module, by its path relative to `root`, the names of all that import it, directly or not, and its own."""
    names = {}
    for top, package in PACKAGE.items():
        for file in (root / top).rglob("*.py"):
            parts = [package, *file.relative_to(root / top).with_suffix("").parts]
            names[".".join(part for part in parts if part != "__init__")] = file
    users: dict[str, set[str]] = defaultdict(set)
    for name, file in names.items():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            found = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                found = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            for other in found:
                users[other].add(name)
    closed = {}
    for name, file in names.items():
        reached, left = {name}, [name]
        while left:
            new = users[left.pop()] - reached
            reached |= new
            left += new
        closed[str(file.relative_to(root))] = reached
    return closed


def _link(kept: Path, target: Path, without: set[str]) -> None:
    """Link numba's files of a folder into another, but for those of some modules."""
    left_out = {tuple(name.split(".")[-2:]) for name in without}
    for folder in kept.iterdir():
        (target / folder.name).mkdir(parents=True)
        for file in folder.iterdir():
            if (folder.name.rpartition("_")[0], file.name.partition(".")[0]) not in left_out:
                os.link(file, target / folder.name / file.name)
