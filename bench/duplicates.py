"""Copies among real clips: `python -m bench.duplicates`.

All recordings in one lake with the default configuration. So many clips, drawn at random with a seed, are copied
(one kind of copy each, in turn: 30 frames a second, 10 % cut, canonical rig, mirrored, all of these) and taken in
as a second dataset. `motionlake duplicates --mirrored` is asked for pairs of the whole lake. Whatever is not a
clip and its copy counts as false, among them all takes of one action by one performer; the number of pairs of
takes with one label tells how many chances there were.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.deep_motifs.duplicates import MAX_DISTANCE
from motionlake.jobs.run import ingest
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.duplicates import near_duplicates
from motionlake.retrieval.protocol import Scope
from motionlake.stages.sources import IngestOptions, Root

from bench.copies import COPIES, write_copies
from bench.lakes import make_lake, run_all
from bench.record import record, recordings

SETS: Final = ("hdm05", "cmu_dance", "cmu_bvh", "cmu_exercises", "cmu_86", "utd_mhad", "bandai1")
COPIED: Final = 200
SEED: Final = 1
TAKES: Final = """
SELECT sum(n * (n - 1) / 2)::BIGINT FROM (
    SELECT count(*) AS n FROM clips WHERE dataset <> 'copies' AND label IS NOT NULL GROUP BY dataset, label
)
"""


def copy_some(lake: Lake, folder: Path) -> dict[tuple[str, str], str]:
    """Take copies of some clips in; returns the kind of each pair (clip, copy), by name."""
    with reading(lake) as con:
        clips = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
        chosen = np.random.default_rng(SEED).choice(len(clips), COPIED, replace=False)
        made = write_copies(con, lake, [clips[i] for i in chosen], folder / "copies", list(COPIES))
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        ingest(job, [Root("copies", str(folder / "copies"), IngestOptions())])
    run_all(lake, 0)
    pairs = {name: tuple(sorted((source, f"copies/{name}"))) for name, source in made.items()}
    return {(a, b): name.partition("_")[0] for name, (a, b) in pairs.items()}


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="bench-duplicates-") as name:
        folder = Path(name)
        lake = make_lake(folder, [recordings() / set_name for set_name in SETS])
        run_all(lake, 0)
        kinds = copy_some(lake, folder)
        started = time.perf_counter()
        with reading(lake) as con:
            found = near_duplicates(con, lake, Scope(mirrored=True))
            seconds = time.perf_counter() - started
            clips = con.execute("SELECT count(*) FROM clips").fetchall()[0][0]
            takes = con.execute(TAKES).fetchall()[0][0]
    right = [pair for pair in found if (pair.clip, pair.other) in kinds]
    of_kind, all_of_kind = Counter(kinds[pair.clip, pair.other] for pair in right), Counter(kinds.values())
    recall = {kind: of_kind[kind] / count for kind, count in all_of_kind.items()}
    figures = {
        "clips": clips,
        "copies": len(kinds),
        "pairs_of_takes_of_one_label": takes,
        "max_distance": MAX_DISTANCE,
        "precision": len(right) / max(1, len(found)),
        "recall": len(right) / len(kinds),
        "recall_by_kind": recall,
        "false_pairs": [
            [pair.clip, pair.other, pair.distance] for pair in found if (pair.clip, pair.other) not in kinds
        ],
        "largest_distance_found": max((pair.distance for pair in right), default=None),
        "seconds": seconds,
        "seed": SEED,
    }
    for key, value in figures.items():
        print(f"{key:28} {value}")
    print(record("duplicates", figures))


if __name__ == "__main__":
    main()
