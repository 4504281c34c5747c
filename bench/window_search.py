"""Pieces in a large lake, by codes and by every vector: `python -m bench.window_search [--clips N] [--queries N]`.

A lake of clips as long as those of BONES-SEED (`bench.long_clips`) goes through the stages `frames`, `words`,
`submotions` and `windows`. Pieces of two seconds out of some of its clips are looked for in the others, by the codes of
windows and by DuckDB's scan of all their vectors, one after the other in this process. Told are the share of the ten
clips by the scan that are among those by the codes, whether all distances are the same, and the seconds of either, with
their ratio: of the whole search, and of the choice of the ten clips, without the alignment of the piece with each.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.jobs import run as jobs
from motionlake.jobs.session import session
from motionlake.lake.catalog import create_catalog, fetch, reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.submotion_search import SubmotionSearcher
from motionlake.stages import windows
from motionlake.stages.sources import IngestOptions, Root

from bench.long_clips import MEAN, read_recordings, write_long_clips
from bench.record import record, recordings, rounds_of

K: Final = 10
PIECE: Final = 2.0  # seconds
STAGES: Final = ("words", "submotions", "windows")
Row = dict[str, Any]


def made_lake(folder: Path, clips: int, seconds: float) -> Lake:
    """A lake of so many clips, `seconds` long in the mean, with their windows and codes."""
    lake = Lake(folder / "lake")
    write_long_clips(read_recordings(recordings()), 0, clips, folder / "clips", seconds)
    create_catalog(lake)
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        jobs.ingest(job, [Root("long", str(folder / "clips"), IngestOptions())])
        jobs.run(job, STAGES)
    return lake


def pieces(lake: Lake, count: int) -> list[Query]:
    """Ranges of two seconds in the midst of clips, all over the lake."""
    text = "SELECT clip, frames, fps FROM clips WHERE frames > fps * $seconds ORDER BY md5(clip) LIMIT $count"
    with reading(lake) as con:
        rows = con.execute(text, {"seconds": PIECE, "count": count}).fetchall()
    middle = ((clip, int(frames - PIECE * fps) // 2, int(PIECE * fps)) for clip, frames, fps in rows)
    return [Query(clip, start=first, stop=first + length) for clip, first, length in middle]


def measure(lake: Lake, queries: int, rounds: int) -> Row:
    """Recall, whether distances agree, and the median seconds of both over queries."""
    searcher, exactly = SubmotionSearcher(lake), SubmotionSearcher(lake)
    assert searcher._scan is not None
    exactly._scan = None
    asked, scope = pieces(lake, queries), Scope()
    recalls, same = [], True
    ways = {"codes": searcher, "vectors": exactly}
    taken: dict[str, list[float]] = {f"{part}{name}": [] for part in ("", "choosing ") for name in ways}
    for query in asked:
        whole = {name: partial(each.nearest, [query], K, scope, mirrored=False) for name, each in ways.items()}
        found = {name: {hit.clip: hit.distance for hit in call()[0]} for name, call in whole.items()}
        wanted = found["vectors"]
        recalls.append(len(found["codes"].keys() & wanted.keys()) / max(1, len(wanted)))
        same &= all(wanted.get(clip, distance) == distance for clip, distance in found["codes"].items())
        piece = searcher._piece(query, own=False)
        without = dict(zip(("clip", "first", "last"), piece.own or (None, 0, 0), strict=True))
        descriptor = searcher._network.embed([piece.sequence])[0]
        with reading(lake) as con:
            calls: dict[str, Callable[[], object]] = {**whole}
            calls |= {f"choosing {name}": partial(each.holding, con, descriptor, K, scope, without)
                      for name, each in ways.items()}  # fmt: skip
            for name, rows in rounds_of(calls, rounds).items():
                taken[name].append(statistics.median(rows))
    with reading(lake) as con:
        (held,) = con.execute("SELECT count(*) FROM submotions").fetchall()
        (clips,) = fetch(con, "count_clips")
    ratios = {part: float(np.median(np.divide(taken[f"{part}vectors"], taken[f"{part}codes"])))
              for part in ("", "choosing ")}  # fmt: skip
    return {
        "clips": clips["clips"], "windows": held[0], "queries": len(asked), "recall_at_10": float(np.mean(recalls)),
        "least_recall": float(min(recalls)), "same_distances": same,
        "seconds": {name: statistics.median(each) for name, each in taken.items()},
        "vectors_over_codes": ratios[""], "choosing_vectors_over_codes": ratios["choosing "],
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=4000)
    parser.add_argument("--seconds", type=float, default=MEAN, help="that a clip lasts in the mean")
    parser.add_argument("--queries", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="bench-windows-") as name:
        lake = made_lake(Path(name), given.clips, given.seconds)
        figures = measure(lake, given.queries, given.rounds)
    print(
        f"{figures['windows']} windows of {figures['clips']} clips: recall at 10 {figures['recall_at_10']:.3f}, codes "
        f"{1e3 * figures['seconds']['codes']:.0f} ms, vectors {1e3 * figures['seconds']['vectors']:.0f} ms, ratio "
        f"{figures['vectors_over_codes']:.1f}, of the choice of clips {figures['choosing_vectors_over_codes']:.1f}"
    )
    print(record("window-search", figures | {"most": windows.MOST}))


if __name__ == "__main__":
    main()
