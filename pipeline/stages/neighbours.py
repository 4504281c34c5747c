"""Stage "neighbours": the nearest words of every word in other clips, under DTW.

The words to search are an index, a frozen version in `models` like the motifs: all words of the lake when it was made.
New clips are searched in it, and are found only once it is made anew (`motionlake run neighbours --refit`). So a new
clip costs one clip. What leaves the lake leaves the view `word_neighbours`, and a word may then have fewer neighbours.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.deep_motifs.config import NeighboursConfig
from motionlake.deep_motifs.words.neighbours import Neighbours, Searched, load_searched, prepare, save_searched, search
from motionlake.deep_motifs.words.windows import WordSet
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model, fitting_model
from motionlake.lake.parts import replacing, write_part
from motionlake.motion.dtw import Metric
from motionlake.motion.features import WordConfig
from motionlake.stages import words
from motionlake.stages.derived import PART_KEYS, Part, derive, due
from motionlake.stages.shard import Shard, ShardResult

NAME = "neighbours"
VERSION = 1
INDEX = "neighbours"
ELSEWHERE = -1  # group of a clip that the index does not hold
ROWS = pa.schema(
    [
        *PART_KEYS, ("word", pa.int32()), ("rank", pa.int32()), ("neighbour", pa.string()),
        ("neighbour_word", pa.int32()), ("neighbour_part", pa.string()), ("distance", pa.float32()),
    ]
)  # fmt: skip


def index_key(config: LakeConfig) -> str:
    """Covers all that shapes the index but the clips it holds: those it keeps."""
    return config_hash(INDEX, VERSION, config.words)


def fitting_index(con: Connection, config: LakeConfig) -> Model | None:
    """The current index if it was made for this configuration."""
    return fitting_model(con, INDEX, index_key(config))


def missing_words(con: Connection, config: LakeConfig) -> int:
    """How many parts lack the words that an index is made of."""
    done = {r["key"] for r in fetch(con, "shards", {"stage": words.NAME}) if r["state"] == "ok"}
    return sum(p.key not in done for p in words.keyed(con, config.words))


def fit(con: Connection, lake: Lake, config: LakeConfig, file: str) -> dict[str, object]:
    """Index every word of the lake, write `file`; returns its figures.

    Raises:
        UserError: fewer than two clips have words.
    """
    clips = fetch(con, "words_per_clip")
    if len(clips) < 2:
        raise UserError(f"{lake.root}: neighbours are sought in other clips, and {len(clips)} have words")
    live = {p.part: p.key for p in words.keyed(con, config.words)}
    features: dict[str, Float32Array] = {}
    for part in sorted({c["part"] for c in clips}):
        features.update(words.read_features(lake.path(words.features_file(live[part]))))
    corpus, groups = WordSet.of_clips([features[c["clip"]] for c in clips], config.words)
    names = {"clips": json.dumps([c["clip"] for c in clips]), "parts": json.dumps([c["part"] for c in clips])}
    with replacing(lake.path(file)) as temporary:
        save_searched(prepare(corpus, groups), temporary, names)
    return {"words": len(corpus), "clips": len(clips), "corpus": config_hash(sorted(live.values()))}


def keyed(con: Connection, config: LakeConfig, index: Model) -> list[Part]:
    """Every live part with the key its neighbours must have."""
    corpus = [index.model, index.figures["corpus"]]
    return derive(words.keyed(con, config.words), NAME, VERSION, corpus, config.neighbours)


def plan(con: Connection, config: LakeConfig, index: Model) -> list[Shard]:
    def spec(part: Part) -> dict[str, object]:
        return {
            "features": words.features_file(part.upstream),
            "index": index.file,
            "words": asdict(config.words),
            "neighbours": asdict(config.neighbours),
        }

    return due(con, NAME, words.NAME, keyed(con, config, index), spec)


def pending(con: Connection, config: LakeConfig) -> int:
    """How many parts lack their neighbours."""
    index = fitting_index(con, config)
    parts = keyed(con, config, index) if index else []
    done = {r["key"] for r in fetch(con, "shards", {"stage": NAME}) if r["state"] == "ok"}
    return sum(p.key not in done for p in parts) if index else len(words.keyed(con, config.words))


def neighbours_file(key: str) -> str:
    return f"neighbours/{key[:16]}.parquet"


def run(lake_root: Path, shard: Shard) -> ShardResult:
    """The nearest words of every word of one features part."""
    started = time.perf_counter()
    lake = Lake(lake_root)
    config, wanted = WordConfig(**shard.spec["words"]), NeighboursConfig(**shard.spec["neighbours"])
    corpus, names = load_searched(lake.path(shard.spec["index"]))
    clips = {clip: i for i, clip in enumerate(json.loads(names["clips"]))}
    parts = list(words.read_features(lake.path(shard.spec["features"])))
    queries, owners = WordSet.of_clips([features for _, features in parts], config)
    groups = np.array([clips.get(clip, ELSEWHERE) for clip, _ in parts])[owners]
    metric: Metric = "geodesic" if config.representation == "rotations" else "euclidean"
    found = search(corpus, queries, groups, wanted.k, method=wanted.chosen(len(corpus.words)), metric=metric)
    file = neighbours_file(shard.key)
    table = _rows(shard, [clip for clip, _ in parts], owners, found, corpus, names)
    size = write_part(lake.path(file), table, {"key": shard.key})
    return ShardResult(shard, table.num_rows, size, (file,), time.perf_counter() - started)


def _rows(
    shard: Shard, clips: list[str], owners: Int64Array, found: Neighbours, corpus: Searched, names: Mapping[str, str]
) -> pa.Table:
    queries, places = np.nonzero(found.indices >= 0)
    chosen = found.indices[queries, places]
    clip, neighbour = owners[queries], corpus.groups[chosen]
    columns = [
        pa.array(clips).take(pa.array(clip)),
        pa.repeat(shard.part, len(chosen)),
        pa.repeat(shard.key, len(chosen)),
        _within(owners)[queries],
        places + 1,
        pa.array(json.loads(names["clips"])).take(pa.array(neighbour)),
        _within(corpus.groups)[chosen],
        pa.array(json.loads(names["parts"])).take(pa.array(neighbour)),
        found.distances[queries, places],
    ]
    return pa.Table.from_arrays([pa.array(c, t) for c, t in zip(columns, ROWS.types, strict=True)], schema=ROWS)


def _within(owners: Int64Array) -> Int64Array:
    """[n] place of each word in its clip, for words clip by clip."""
    return np.arange(len(owners)) - np.searchsorted(owners, owners)


def load(_con: Connection, _root: Path, _results: Sequence[ShardResult]) -> None:
    """Neighbours are served from their parts: the manifest's row is all that is entered."""
