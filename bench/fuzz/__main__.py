"""Damage on purpose, at any size: `python -m bench.fuzz [PART ...]`.

files: damaged files of all formats (10,000) through `motionlake ingest`; counts, words and memory.
readers, config, labels, sql: what hypothesis finds in readers, configurations, label files and functions in SQL
(`--examples` each). A find is printed with what makes it again; the exit status is 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from motionlake.retrieval.sql_functions import connect

from bench.fuzz.files import ingest_damaged, show
from bench.memory import watch
from bench.record import record
from tests import fuzz
from tests.lakes import QUICK, made_clips
from tests.samples import readable

PARTS: Final = ("files", "readers", "config", "labels", "sql")
CHECKOUT: Final = Path(__file__).parents[2]


def outcome(check: Callable[[], None]) -> list[str]:
    """What a property found."""
    try:
        check()
    except AssertionError as error:
        return [_told(error)]
    except ExceptionGroup as group:
        return [_told(error) for error in group.exceptions]
    except Exception as error:
        return [_told(error)]
    return []


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {str(error)[:1000]}\n" + "\n".join(getattr(error, "__notes__", []))[:2000]


def _motionlake(*words: object) -> None:
    used = watch([sys.executable, "-m", "motionlake.cli.main", *map(str, words)], CHECKOUT)
    if used.status:
        sys.exit(f"motionlake {words[0]}: exit status {used.status}")


def made_lake(folder: Path) -> tuple[Path, Path]:
    """A small lake with every stage made, and the folder of its clips."""
    clips, lake = folder / "clips", folder / "lake"
    made_clips(clips, 4)
    (clips / "labels.csv").unlink()
    _motionlake("init", lake)
    (lake / "config.toml").write_text(QUICK, encoding="utf-8")
    _motionlake("ingest", clips, "--lake", lake, "--workers", 1)
    _motionlake("run", "all", "--lake", lake, "--workers", 1)
    return lake, clips


def campaigns(parts: list[str], folder: Path, examples: int, seed: int) -> dict[str, list[str]]:
    """What hypothesis finds, by campaign."""
    found: dict[str, list[str]] = {}

    def campaign(name: str, check: Callable[[], None]) -> None:
        started = time.perf_counter()
        found[name] = outcome(check)
        print(f"{name}: {len(found[name])} found in {time.perf_counter() - started:.0f} s", flush=True)
        print(*found[name], sep="\n", end="")

    if "readers" in parts:
        for suffix in readable():
            (folder / suffix[1:]).mkdir()
            campaign(f"reader {suffix}", lambda s=suffix: fuzz.check_reader(s, folder / s[1:], examples, seed))  # type: ignore[misc]
    if "config" in parts:
        campaign("config.toml", lambda: fuzz.check_config(folder, examples, seed))
    if {"labels", "sql"} & set(parts):
        lake, clips = made_lake(folder)
    if "labels" in parts:
        campaign("label files", lambda: fuzz.check_label_files(lake, clips, max(examples // 10, 2), seed))
    if "sql" in parts:
        with connect(lake) as con:
            campaign(
                "functions in SQL", lambda: fuzz.check_sql_functions(con.own, examples, seed, left_out=["synthesize"])
            )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="these alone")
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--examples", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    parts = given.parts or list(PARTS)
    figures: dict[str, Any] = {"seed": given.seed, "examples": given.examples}
    faults = 0
    if "files" in parts:
        figures["files"] = ingest_damaged(given.files, given.seed, given.workers)
        show(figures["files"])
        faults += len(figures["files"]["faults"])
    with tempfile.TemporaryDirectory(prefix="bench-fuzz-") as folder:
        figures["found"] = campaigns(parts, Path(folder), given.examples, given.seed)
    faults += sum(map(len, figures["found"].values()))
    print(record("fuzz", figures, packages=["hypothesis"]))
    if faults:
        sys.exit(f"{faults} found")


if __name__ == "__main__":
    main()
