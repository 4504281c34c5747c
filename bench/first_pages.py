"""First pages of answers for a person to look at: `python -m bench.first_pages OUT [--seed N] [--lake LAKE]`.

A lake of all recordings, each set a dataset of its own, and clips drawn by seed, as many of each set as `DRAWN` says.
Each is searched for by the default search, as the command does it, and its five nearest clips are drawn beside it. What
a person would call wrong, a person has to say; the classes of the answers are written beside the pages.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.stages.registry import ALL

from bench.lakes import make_lake
from bench.record import recordings

DRAWN: Final = {"hdm05": 6, "bandai1": 6, "utd_mhad": 6, "cmu_bvh": 6, "cmu_dance": 4, "cmu_exercises": 2}
HITS: Final = 5
COMMAND: Final = Path(sys.executable).with_name("motionlake")


def made(folder: Path) -> Lake:
    """A lake of all sets with every stage."""
    lake = make_lake(folder, [recordings() / name for name in DRAWN])
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, ALL)
    return lake


def drawn(lake: Lake, seed: int) -> list[str]:
    """Clips of every set."""
    with reading(lake) as con:
        clips = [row[0] for row in con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
    rng = np.random.default_rng(seed)
    found: list[str] = []
    for name, count in DRAWN.items():
        of_set = [clip for clip in clips if clip.startswith(f"{name}/")]
        chosen = rng.permutation(len(of_set))[:count]
        found += [of_set[i] for i in sorted(chosen.tolist())]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--lake", type=Path, help="that holds all sets (default: one is made, and deleted)")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="bench-first-pages-") as folder:
        lake = open_lake(given.lake) if given.lake else made(Path(folder) / "lake")
        rows = []
        for page, clip in enumerate(drawn(lake, given.seed), start=1):
            file = given.out / f"{page:02}.png"
            asked = [COMMAND, "search", clip, "-k", str(HITS), "--json", "--picture", file, "--lake", lake.root]
            done = subprocess.run(asked, capture_output=True, text=True, check=True)
            hits = json.loads(done.stdout)
            rows += [[page, clip, hit["rank"], hit["clip"], hit["label"], round(hit["distance"], 3)] for hit in hits]
            print(f"{file}: {clip}", flush=True)
    with (given.out / "answers.csv").open("w", newline="", encoding="utf-8") as handle:
        csv.writer(handle).writerows([["page", "query", "rank", "clip", "label", "distance"], *rows])


if __name__ == "__main__":
    main()
