"""Every way to search a large lake: one query of a process that is ready, one of a new process, and memory.

`python -m bench.scale_methods FOLDER` takes the lake in FOLDER/lake that `bench.whole_lake` or `bench.scale_search`
left. For each way to find clips, and pieces of two seconds inside clips, a process of its own asks for drawn clips one
after the other; then commands in new processes ask once each, with the lake's files in the page cache and without them.
The answers of methods that choose clips are also set beside those of comparing every clip, for some queries.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Finds, Query, Searcher
from motionlake.retrieval.registry import SEARCHERS, searcher
from threadpoolctl import threadpool_limits

from bench.record import record
from bench.scale_search import THREADS, WARMING, clips_in, in_child, timed_command
from bench.window_search import PIECE

QUERIES: Final = 40
COMMANDS: Final = 3
K: Final = 10
READ: Final = 1 << 22  # bytes
LONGER: Final = 1.0  # seconds that a clip lasts more than a piece
BARS: Final = {"warm_ms": 100.0, "cold_seconds": 3.0}
RECALLED: Final[dict[Finds, tuple[str, ...]]] = {  # methods that choose clips
    "clip": ("signature", "alignment", "moves"), "range": ("alignment", "submotion", "moves"),
}  # fmt: skip
FEWER: Final[dict[tuple[Finds, str], int]] = {("range", "moves"): 8}  # queries: to compare every clip takes long
AS_NEAR: Final = 1e-6  # of a distance: what rounding may make of it
COMMAND_OF: Final[dict[Finds, str]] = {"clip": "search", "range": "find"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where bench.whole_lake or bench.scale_search left a lake")
    parser.add_argument("--queries", type=int, default=QUERIES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", type=int, default=COMMANDS)
    parser.add_argument("--warm", nargs=2, help=argparse.SUPPRESS)  # what a child process measures
    given = parser.parse_args()
    lake = Lake(given.folder / "lake")
    asked = pieces(lake, given.queries, given.seed)
    if given.warm:
        finds, name = given.warm
        print(json.dumps(warm(lake, finds, name, asked)))
        return
    figures: dict[str, Any] = {"clips": clips_in(lake), "queries": given.queries, "bars": BARS}
    for path in lake.root.glob("shortlist/*"):  # which lies in the page cache from now
        with path.open("rb", buffering=0) as file:
            while file.read(READ):  # in pieces: a child counts as its own the most memory that this process had
                pass
    every = [(finds, name) for finds, names in SEARCHERS.items() for name in names]
    ready = [_child(given, finds, name) for finds, name in every]  # before files are dropped from there
    for (finds, name), found in zip(every, ready, strict=True):
        told = f"{COMMAND_OF[finds]} {name}"
        figures[told] = found | cold(lake, finds, name, asked[0], given.commands)
        print(f"{told}: {figures[told]}", flush=True)
    print(record("scale-methods", figures))


def pieces(lake: Lake, count: int, seed: int) -> list[Query]:
    """Drawn clips that are long enough, each with the two seconds in its midst."""
    with reading(lake) as con:
        text = "SELECT clip, frames, fps FROM clips WHERE frames > fps * $seconds ORDER BY clip"
        rows = con.execute(text, {"seconds": PIECE + LONGER}).fetchall()
    drawn = np.random.default_rng(seed).choice(len(rows), min(count, len(rows)), replace=False)
    middle = (
        (clip, int(frames - PIECE * fps) // 2, int(PIECE * fps)) for clip, frames, fps in (rows[at] for at in drawn)
    )
    return [Query(clip, first, first + length) for clip, first, length in middle]


def warm(lake: Lake, finds: Finds, name: str, asked: Sequence[Query]) -> dict[str, Any]:
    """Times of single queries in a process that is ready for many, and the most memory that it held."""
    started = time.perf_counter()
    search = searcher(finds, name, lake)
    if hasattr(search, "warm_up"):
        search.warm_up()
    ready = time.perf_counter() - started
    queries = [Query(query.source) for query in asked] if finds == "clip" else list(asked)
    spent, refused, answered = [], 0, {}
    with threadpool_limits(limits=THREADS):
        for number, query in enumerate([*queries[:WARMING], *queries]):
            before = time.perf_counter()
            try:
                (answered[query],) = search.search([query], K)
            except UserError:  # a posture that is held is no string
                refused += number >= WARMING
                continue
            if number >= WARMING:
                spent.append(1e3 * (time.perf_counter() - before))
    return {
        "ready_seconds": ready,
        "warm_ms": {"median": float(np.median(spent)), "95": float(np.quantile(spent, 0.95)), "least": min(spent)},
        "refused": refused,
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    } | (_recalled(lake, finds, name, answered) if name in RECALLED[finds] else {})


def _recalled(lake: Lake, finds: Finds, name: str, answered: Mapping[Query, Sequence[Hit]]) -> dict[str, Any]:
    asked = [*answered][: FEWER.get((finds, name), len(answered))]
    share = recall_of_ranges if (finds, name) == ("range", "alignment") else recall
    exact = searcher(finds, name, lake, exact=True)
    return {"recalled": len(asked), "recall": share(exact, {query: answered[query] for query in asked})}


def recall(exact: Searcher, answered: Mapping[Query, Sequence[Hit]]) -> float:
    """The mean share of the clips that an exact search answers with which were answers."""
    shares = []
    for query, hits in answered.items():
        (wanted,) = exact.search([query], K)
        clips = {hit.clip for hit in wanted}
        if clips:
            shares.append(len(clips & {hit.clip for hit in hits}) / len(clips))
    return float(np.mean(shares))


def recall_of_ranges(exact: Searcher, answered: Mapping[Query, Sequence[Hit]]) -> float:
    """The mean share of the ranges that an exact search answers with for which there are answers as near as the last of
    them: strings have many ranges that are equally near, of which one is as good as another."""
    shares = []
    for query, hits in answered.items():
        (wanted,) = exact.search([query], K)
        if wanted:
            limit = wanted[-1].distance * (1 + AS_NEAR) + AS_NEAR
            shares.append(sum(hit.distance <= limit for hit in hits) / len(wanted))
    return float(np.mean(shares))


def cold(lake: Lake, finds: Finds, name: str, asked: Query, count: int) -> dict[str, list[float]]:
    """Seconds of commands in new processes, with the files of the lake in the page cache and without them."""
    words = [sys.executable, "-m", "motionlake.cli.main", COMMAND_OF[finds], asked.name, "--method", name]
    if finds == "range":
        words += ["--from", str(asked.start), "--to", str(asked.stop)]
    words += ["--lake", str(lake.root), "--json", "--no-service"]
    timed_command(words, None)
    return {
        told: [timed_command(words, lake if dropped else None)["clock"] for _ in range(count)]
        for told, dropped in (("cold_seconds", False), ("cold_seconds_dropped", True))
    }


def _child(given: argparse.Namespace, finds: Finds, name: str) -> dict[str, Any]:
    """What `warm` says, in a process of its own."""
    words = [str(given.folder), "--warm", finds, name, "--queries", str(given.queries), "--seed", str(given.seed)]
    return in_child("bench.scale_methods", words)


if __name__ == "__main__":
    main()
