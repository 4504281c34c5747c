"""What every measurement shares: interleaved timing, and a dated record of figures, machine and data."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"
MACHINES = "machines.json"
PACKAGES = ("motionlake", "numpy", "numba", "scipy", "duckdb", "torch")


def recordings() -> Path:
    """The folder of real recordings that MOTIONLAKE_DATA names; leaves with a message where it is unset."""
    folder = os.environ.get("MOTIONLAKE_DATA")
    if not folder:
        sys.exit("MOTIONLAKE_DATA is not set: set it to the folder of the recordings")
    return Path(folder)


def installed(packages: Iterable[str]) -> list[str]:
    """Those of some packages, by the names they are imported by, that are there; of others it is said that not."""
    found = {package: importlib.util.find_spec(package) is not None for package in packages}
    if missing := [package for package, there in found.items() if not there]:
        print(f"not installed, so left out: {', '.join(missing)}")
    return [package for package, there in found.items() if there]


def interleave(functions: Mapping[str, Callable[[], object]], rounds: int = 7) -> dict[str, float]:
    """Median seconds of each function over `rounds`, one call of each in turn after one call to warm up."""
    return {name: statistics.median(values) for name, values in rounds_of(functions, rounds).items()}


def rounds_of(
    functions: Mapping[str, Callable[[], object]], rounds: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, list[float]]:
    """As `interleave`, the seconds of every round: the nth of one function beside the nth of the others."""
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        function()
    for _ in range(rounds):
        for name, function in functions.items():
            start = clock()
            function()
            seconds[name].append(clock() - start)
    return seconds


def hash_files(paths: Iterable[Path], base: Path) -> str:
    """SHA-256 over the names relative to `base`, sizes and contents of files."""
    digest = hashlib.sha256()
    for path in sorted(paths):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(base).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def machine() -> dict[str, Any]:
    """Processor model, cores and system."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    model = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return {
        "processor": model[1] if model else platform.processor(),
        "cores": os.cpu_count(),
        "system": platform.system(),
    }


def versions(packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Versions of Python and of those packages that are installed."""
    found = {"python": platform.python_version()}
    for package in packages:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def _here() -> dict[str, Any]:
    return {"machine": machine(), "versions": versions()}


def enter_machine(folder: Path) -> None:
    """Say in a folder that keeps what is measured that this machine, with these versions, measured some of it."""
    here, known = _here(), machines(folder)
    if here not in known:
        (folder / MACHINES).write_text(json.dumps([*known, here], indent=2) + "\n", encoding="utf-8")


def machines(folder: Path | None) -> list[dict[str, Any]]:
    """The machines that are entered in a folder, and their versions."""
    path = folder and folder / MACHINES
    return json.loads(path.read_text(encoding="utf-8")) if path and path.exists() else []


def revision() -> str:
    """The working tree's git revision, with "+" where files differ from it, or "" outside a repository."""

    def git(*words: str) -> str:
        run = subprocess.run(["git", *words], cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
        return run.stdout.strip() if run.returncode == 0 else ""

    head = git("rev-parse", "--short=12", "HEAD")
    return head + ("+" if head and git("status", "--porcelain", "--untracked-files=no") else "")


def record(
    name: str,
    figures: Mapping[str, Any],
    data: str = "",
    packages: Iterable[str] = (),
    folder: Path | None = None,
    kept: Path | None = None,
) -> Path:
    """Write figures as `<folder>/<name>-<UTC time>.json` with what is needed to judge them.

    Args:
        name: the measurement's name.
        figures: what was measured; JSON values.
        data: `hash_files` of the data.
        packages: peers whose versions matter, besides `PACKAGES`.
        folder: where to; `RESULTS` if not given.
        kept: a folder that kept what was measured, perhaps on other machines: then all that measured are named.

    Returns:
        The file written.
    """
    now, folder = datetime.now(UTC), folder or RESULTS
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}-{now:%Y%m%dT%H%M%SZ}.json"
    content = {
        "name": name,
        "date": now.isoformat(timespec="seconds"),
        "revision": revision(),
        "machine": machine(),
        "versions": versions([*PACKAGES, *packages]),
        **({"machines": others} if (others := machines(kept)) not in ([], [_here()]) else {}),
        "data_sha256": data,
        "figures": dict(figures),
    }
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    return path
