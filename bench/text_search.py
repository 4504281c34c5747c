"""Search in words, and suggested labels: `python -m bench.text_search queries speed labels`.

queries: recall@10 of the forty written queries and of the dozen that the search was tuned by, beside substring search
and plain BM25. speed: a lake of 150,000 clips that say what the recordings say, under names of their own: seconds to
open it and answer first, and then. labels: the labels of half the clips of each set are hidden, and suggested by the
default search: how many are right, and how far confidence is from it (ten bins of confidence, mean of the distances
between what it says and how many are right, by their clips; Brier score).
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.jobs.run import run
from motionlake.jobs.session import session
from motionlake.lake.catalog import create_catalog, reading, writing
from motionlake.lake.layout import Lake
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.suggestions import REACH, TRIED, Confidence, Vote, vote
from motionlake.retrieval.text import LakeText
from motionlake.stages.registry import ALL

from bench.canonical_sets import SETS
from bench.lakes import make_lake
from bench.record import record, recordings
from tests.text_queries import expected, ours, plain_bm25, read_clips, read_queries, recall, substrings

CLIPS: Final = 150_000
SEEDS: Final = (0, 1, 2)
ASKED: Final = ("walks and turns left", "angry walking", "knoks on a door", "take 35")
LABELLED: Final = ("hdm05", "salsa", "bandai1", "utd_mhad")
INSERT: Final = """
INSERT INTO clips BY NAME
SELECT *, '' AS body, 'bvh' AS format, 'bench' AS rig, 100 AS frames, 30.0 AS fps, 3.3 AS seconds, 'y' AS up,
    1.0 AS metres_per_unit, 1.7 AS body_height, true AS twist, [] AS filled, 0 AS repaired, 0.0 AS fk_error,
    [] AS rest_offsets, '' AS layout, '' AS skeleton, [] AS notes, clip AS content_hash, '' AS part
FROM rows
"""


def queries() -> dict[str, Any]:
    """Recall@10 by file of queries and by method, and by query of ours."""
    clips = read_clips(recordings())
    ways = {"ours": ours(clips), "substrings": substrings(clips), "bm25": plain_bm25(clips)}
    found: dict[str, Any] = {"clips": len(clips)}
    for name in ("text_queries", "text_development_queries"):
        asked = [(each["text"], expected(each, clips)) for each in read_queries(f"{name}.toml")]
        rows = {
            text: {way: recall(scores(text), wanted) for way, scores in ways.items()}
            for text, wanted in asked
            if any(wanted)
        }
        means = {way: fmean(row[way] for row in rows.values()) for way in ways}
        found[name] = {"mean": means, "queries": rows}
        print(f"{name} ({len(rows)}): " + ", ".join(f"{way} {value:.3f}" for way, value in means.items()))
    return found


def speed() -> dict[str, Any]:
    """Seconds by the clock, and of the processor, to open a large lake and answer, and then a query."""
    with tempfile.TemporaryDirectory(prefix="bench-text-") as folder:
        lake = Lake(Path(folder) / "lake")
        create_catalog(lake)
        _fill(lake)
        times: dict[str, Any] = {"clips": CLIPS}
        start, spent = time.perf_counter(), time.process_time()
        says = LakeText(lake)
        says.search(ASKED[0], 10)
        times["first"] = {"seconds": time.perf_counter() - start, "processor": time.process_time() - spent}
        for text in ASKED:
            start, spent = time.perf_counter(), time.process_time()
            says.search(text, 10)
            times[text] = {"seconds": time.perf_counter() - start, "processor": time.process_time() - spent}
    for name, row in times.items():
        print(f"{name}: {row}")
    return times


def _fill(lake: Lake) -> None:
    clips = read_clips(recordings())
    rows, segments = [], []
    for place in range(CLIPS):
        clip = clips[place % len(clips)]
        base, _, suffix = clip.name.rpartition(".")
        name = f"{base}_cut{place // len(clips):03d}.{suffix}"
        own = {column: clip.columns.get(column) for column in ("dataset", "label", "subject", "split")}
        rest = [(key, value) for key, value in clip.columns.items() if key not in {*own, "file"}]
        rows.append({"clip": name, "path": name.split("/", 1)[1], **own, "attributes": rest})
        segments += [{"clip": name, "start": 0, "stop": 10, "label": label} for label in clip.segments]
    text = pa.string()
    types = {**dict.fromkeys(rows[0], text), "attributes": pa.map_(text, text)}
    with writing(lake) as con:
        con.register("rows", pa.Table.from_pylist(rows, pa.schema(types)))
        con.execute(INSERT)
        con.register("cut", pa.Table.from_pylist(segments))
        con.execute("INSERT INTO segments FROM cut")


def labels(ready: Path | None) -> dict[str, Any]:
    """By set: how many suggested labels are right, and how near confidence is to that, mean over seeds."""
    found = {}
    for name in LABELLED:
        with tempfile.TemporaryDirectory(prefix="bench-text-") as folder:
            lake = Lake(ready / f"lake-{SETS[name].folder}") if ready else _made(Path(folder), name)
            hits, truth = _neighbours(lake, "AND label = 'salsa'" if name == "salsa" else "", SETS[name].label)
        runs = [_half(hits, truth, seed) for seed in SEEDS]
        found[name] = {key: _mean([one[key] for one in runs]) for key in runs[0]}
        print(
            name, {key: value if value is None else round(value, 3) for key, value in found[name].items()}, flush=True
        )
    return found


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fmean(known) if known else None


def _made(folder: Path, name: str) -> Lake:
    lake = make_lake(folder, [recordings() / SETS[name].folder])
    with session(lake, "bench", lambda stage, done, total: None, lambda line: None) as job:
        run(job, tuple(stage for stage in ALL if stage != "submotions"))
    return lake


def _neighbours(lake: Lake, only: str, label: str) -> tuple[dict[str, list[Hit]], dict[str, str]]:
    """The nearest clips of every clip that has a label, and its label."""
    with reading(lake) as con:
        rows = con.execute(f"SELECT clip, {label} FROM clips WHERE {label} IS NOT NULL {only} ORDER BY clip").fetchall()
    by = FusedSearcher(lake)
    return {clip: by.search([Query(clip)], REACH, Scope(recorded_only=True))[0] for clip, _ in rows}, dict(rows)


def _half(hits: Mapping[str, Sequence[Hit]], truth: Mapping[str, str], seed: int) -> dict[str, float | None]:
    random = np.random.default_rng(seed)
    hidden = {str(clip) for clip in random.permutation(sorted(truth))[: len(truth) // 2]}
    kept = {clip: label for clip, label in truth.items() if clip not in hidden}
    votes: dict[str, Vote] = {clip: of for clip in truth if (of := vote(hits[clip], kept)) is not None}
    tried = [str(clip) for clip in random.permutation(sorted(kept)) if clip in votes][:TRIED]
    confidence = Confidence([votes[c].agreed for c in tried], [votes[c].label == kept[c] for c in tried])
    asked = sorted(hidden & votes.keys())
    right = np.array([votes[clip].label == truth[clip] for clip in asked], dtype=np.float64)
    sure = np.array([confidence.of(votes[clip].agreed) for clip in asked])
    bins = np.minimum((sure * 10).astype(int), 9)
    apart = sum(abs(sure[bins == b].sum() - right[bins == b].sum()) for b in range(10)) / len(asked)
    most = sure >= 0.9
    return {
        "right": float(right.mean()),
        "confidence": float(sure.mean()),
        "apart": float(apart),
        "brier": float(np.mean((sure - right) ** 2)),
        "share of .9 and more": float(most.mean()),
        "right of these": float(right[most].mean()) if most.any() else None,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", choices=("queries", "speed", "labels"))
    parser.add_argument("--lakes", type=Path, help="labels: a folder of lakes that are made, named lake-<set>")
    given = parser.parse_args()
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "queries": queries,
        "speed": speed,
        "labels": lambda: labels(given.lakes),
    }
    print(record("text", {part: parts[part]() for part in given.parts}, packages=("bm25s", "pystemmer")))


if __name__ == "__main__":
    main()
