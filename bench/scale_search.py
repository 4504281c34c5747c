"""The default search of a large lake: how long one query takes, and whether its answers are the right ones.

A lake of many clips is made (`bench.large_lakes`), and its shortlist by the stage. Then, for queries of the lake drawn
by seed: the time of one query after the first few, the time of a whole command in a new process, with the lake's files
in the page cache and without them, the most memory that the queries take, and how many of the ten first answers are
among the ten first of the exact ranking: every clip compared by every method, weighed in the same way.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.motion.moves_index import floored
from motionlake.motion.stacks import Stack, aligned
from motionlake.retrieval.alignment import AlignmentSearcher
from motionlake.retrieval.fused import REACH, FusedSearcher
from motionlake.retrieval.hits import Hit, clip_hit
from motionlake.retrieval.protocol import Finds, LakeSearcher, Query, Scope
from motionlake.retrieval.signature import SignatureSearcher
from motionlake.stages.moves import MOVES, tracks_in
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_files import MOST
from threadpoolctl import threadpool_limits

from bench.large_lakes import large_lake
from bench.record import record, recordings

CHECKOUT: Final = Path(__file__).parents[1]
CLIPS: Final = 150_000
QUERIES: Final = 60
WARMING: Final = 5  # queries before the clock runs
COMMANDS: Final = 5
THREADS: Final = 2
BARS: Final = {"warm_ms": 100.0, "cold_seconds": 1.5, "recall": 0.97}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=CLIPS)
    parser.add_argument("--queries", type=int, default=QUERIES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2, help="that make the lake")
    parser.add_argument("--folder", type=Path, help="keeps the lake, and takes the one that lies there (default: none)")
    parser.add_argument("--warm", type=Path, help=argparse.SUPPRESS)  # what a child process does
    given = parser.parse_args()
    if given.warm:
        print(json.dumps(warm(Lake(given.warm), drawn(Lake(given.warm), given.queries, given.seed))))
        return
    with kept_folder(given.folder) as folder:
        lake, figures = Lake(folder / "lake"), {"queries": given.queries, "bars": BARS}
        if not lake.catalog.is_file():
            started = time.perf_counter()
            large_lake(folder, recordings(), given.clips, given.seed, given.processes)
            figures["lake_seconds"] = time.perf_counter() - started
        figures |= {"clips": clips_in(lake)} | measure(lake, given.queries, given.seed)
    for name, value in figures.items():
        print(f"{name}: {value}")
    print(record("scale-search", figures))


@contextmanager
def kept_folder(kept: Path | None) -> Iterator[Path]:
    """A folder for a lake: one that stays, or none that was named, which goes at the end of the block."""
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
        yield kept
        return
    with tempfile.TemporaryDirectory(prefix="bench-scale-") as name:
        yield Path(name)


def measure(lake: Lake, queries: int, seed: int) -> dict[str, Any]:
    """All figures."""
    figures: dict[str, Any] = {"shortlist_seconds": shortlist(lake)}
    files = list(lake.root.glob("shortlist/*"))
    figures["shortlist_bytes"] = sum(len(path.read_bytes()) for path in files)  # which lie in the page cache from now
    figures |= _child(lake, queries, seed)
    asked = drawn(lake, queries, seed)
    answers = figures.pop("answers")
    kept = lake.root.parent / f"exact-{queries}-{seed}.json"  # of the lake that lies beside it
    if not kept.is_file():
        kept.write_text(json.dumps(exact_answers(lake, asked)), encoding="utf-8")
    exact = json.loads(kept.read_text(encoding="utf-8"))
    found = [len(set(ours) & set(right)) / max(1, len(right)) for ours, right in zip(answers, exact, strict=True)]
    figures["recall"], figures["recall_worst"] = float(np.mean(found)), min(found)
    command = [sys.executable, "-m", "motionlake.cli.main", "search", asked[0], "--lake", str(lake.root), "--json"]
    for name, dropped in (("cold_seconds", False), ("cold_seconds_dropped", True)):
        figures[name] = [timed_command(command, lake if dropped else None) for _ in range(COMMANDS)]
    return figures


def clips_in(lake: Lake) -> int:
    """How many clips a lake holds, which need not be what was asked for."""
    with reading(lake) as con:
        return int(fetch(con, "count_clips")[0]["clips"])


def drawn(lake: Lake, count: int, seed: int) -> list[str]:
    """Clips of a lake."""
    with reading(lake) as con:
        names = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
    chosen = np.random.default_rng(seed).choice(len(names), min(count, len(names)), replace=False)
    return [names[at] for at in chosen.tolist()]


def shortlist(lake: Lake) -> float:
    """Make the shortlist where it is due; seconds."""
    started = time.perf_counter()
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, ["shortlist"])
    return time.perf_counter() - started


def _child(lake: Lake, queries: int, seed: int) -> dict[str, Any]:
    """What `warm` says, in a process of its own."""
    return in_child("bench.scale_search", ["--warm", str(lake.root), "--queries", str(queries), "--seed", str(seed)])


def in_child(module: str, words: Sequence[str]) -> dict[str, Any]:
    """What a module prints as JSON in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", module, *words], stdout=subprocess.PIPE, text=True, check=True,
        cwd=CHECKOUT, env=os.environ | {"PYTHONPATH": os.pathsep.join([str(CHECKOUT), *_given_paths()])},
    )  # fmt: skip
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _given_paths() -> list[str]:
    """Where this process looks for modules first: a child that looked elsewhere would measure other code."""
    return [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]


def warm(lake: Lake, asked: Sequence[str]) -> dict[str, Any]:
    """Times of single queries in a process that is ready for many, as `motionlake browse` is, their first ten answers,
    and the most memory that the process held."""
    started = time.perf_counter()
    search = FusedSearcher(lake)
    search.warm_up()
    ready = time.perf_counter() - started
    answers, spent = [], []
    with threadpool_limits(limits=THREADS):
        for clip in [*asked[:WARMING], *asked]:
            before = time.perf_counter(), time.process_time()
            (hits,) = search.search([Query(clip)], 10)
            spent.append((time.perf_counter() - before[0], time.process_time() - before[1]))
            answers.append([hit.clip for hit in hits])
    clock, processor = 1e3 * np.array(spent[WARMING:]).T if len(spent) > WARMING else np.zeros((2, 1))
    return {
        "ready_seconds": ready,
        "warm_ms": {
            "median": float(np.median(clock)),
            "95": float(np.quantile(clock, 0.95)),
            "least": float(min(clock)),
        },
        "warm_processor_ms": {"median": float(np.median(processor)), "95": float(np.quantile(processor, 0.95))},
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "answers": answers[len(answers) - len(asked) :],
    }


def timed_command(words: Sequence[str], dropped: Lake | None) -> dict[str, float]:
    """Seconds of a command, by the clock and of the processor; the files of a lake may leave the page cache before."""
    if dropped is not None:
        for path in dropped.root.rglob("*"):
            if path.is_file():
                handle = os.open(path, os.O_RDONLY)
                os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
                os.close(handle)
    # As where motionlake is installed: Python keeps what it has compiled.
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, cwd=CHECKOUT, env=kept)
    seconds, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    return {"clock": seconds, "processor": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime}


class _Exhaustive(LakeSearcher):
    """The nearest clips of some queries, worked out before."""

    finds: Finds = "clip"

    def __init__(self, lake: Lake, name: str, hits: dict[str, list[Hit]]) -> None:
        super().__init__(lake)
        self.name, self._hits = name, hits

    def nearest(self, queries: Sequence[Query], k: int, scope: Scope, *, mirrored: bool) -> list[list[Hit]]:
        return [self._hits[query.name][:k] for query in queries]

    def distances(self, queries: Sequence[Query], gallery: Sequence[Query]) -> Float64Array:
        raise ValueError("answers were worked out before; distances were not kept")


def exact_answers(lake: Lake, asked: Sequence[str]) -> list[list[str]]:
    """The ten first clips of each query by the distances of all clips by every method, along the graph where one is."""
    k, scope = REACH + 1, Scope(own=True)
    queries = [Query(clip) for clip in asked]
    if clips_in(lake) <= MOST:
        every = FusedSearcher(lake, exact=True)
        return [[hit.clip for hit in every.search([query], 10)[0]] for query in queries]
    searchers: dict[str, LakeSearcher] = {}
    signature = SignatureSearcher(lake)
    clips = {clip.clip: clip for clip in signature.clips}
    searchers["signature"] = _Exhaustive(
        lake, "signature", dict(zip(asked, signature.search(queries, k, scope), strict=True))
    )
    del signature
    alignment = AlignmentSearcher(lake)
    long = {clip for clip in asked if len(alignment.strings.string_of(alignment.strings.positions[clip])) > 1}
    hits = {clip: alignment.search([Query(clip)], k, scope)[0] if clip in long else [] for clip in asked}
    searchers["alignment"] = _Exhaustive(lake, "alignment", hits)
    del alignment
    hits = {clip: [clip_hit(clips[other], far) for other, far in near]
            for clip, near in _moves(lake, asked, k).items()}  # fmt: skip
    searchers["moves"] = _Exhaustive(lake, "moves", hits)
    exact = FusedSearcher(lake, searchers=searchers, graph=False)
    return [[hit.clip for hit in exact.search([query], 10)[0]] for query in queries]


def _moves(lake: Lake, asked: Sequence[str], k: int) -> dict[str, list[tuple[str, float]]]:
    """The k nearest clips of each query by their moves, part by part: memory holds one."""
    with reading(lake) as con:
        files = [MOVES.file(part.key) for part in MOVES.made(LakeReader(con, lake, served_config(lake)))]
    wanted = {clip: track.moves() for file in files for clip, track in tracks_in(lake, file) if clip in set(asked)}
    near: dict[str, list[tuple[str, float]]] = {clip: [] for clip in asked}
    for file in files:
        known = [(clip, track.moves()) for clip, track in tracks_in(lake, file)]
        stack = Stack.of([moves for _, moves in known])
        for clip in asked:
            far = floored(stack.spread(aligned(wanted[clip], stack))).tolist()
            found = [*near[clip], *zip([name for name, _ in known], far, strict=True)]
            near[clip] = sorted(found, key=lambda pair: (pair[1], pair[0]))[:k]
    return near


if __name__ == "__main__":
    main()
