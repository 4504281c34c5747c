"""Stage "neighbours": the nearest words of every word in other clips, under DTW.

A new clip costs one clip. What leaves the lake leaves the view `word_neighbours`, and a word may then have fewer
neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Int64Array
from motionlake.deep_motifs.config import NeighboursConfig
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig
from motionlake.stages.neighbour_index import NEIGHBOUR_INDEX, SearchedWords
from motionlake.stages.reader import LakeReader
from motionlake.stages.shard import Shard
from motionlake.stages.stage import PART_KEYS, Part, PartStage
from motionlake.stages.words import WORDS, read_features

if TYPE_CHECKING:
    from motionlake.deep_motifs.words.neighbours import Neighbours
    from motionlake.motion.dtw import Metric

ELSEWHERE = -1  # group of a clip that the index does not hold
ROWS = pa.schema(
    [
        *PART_KEYS, ("word", pa.int32()), ("rank", pa.int32()), ("neighbour", pa.string()),
        ("neighbour_word", pa.int32()), ("neighbour_part", pa.string()), ("distance", pa.float32()),
    ]
)  # fmt: skip


class NearestWords(PartStage):
    """Served from its Parquet parts."""

    name = "neighbours"
    about = "the nearest words of every word in other clips"
    source = WORDS
    model = NEIGHBOUR_INDEX
    folder = "neighbours"
    by_name = True

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        index = NEIGHBOUR_INDEX.fitting(at)
        return None if index is None else ([index.model, index.metrics["corpus"]], at.config.neighbours)

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {
            "features": WORDS.file(part.upstream),
            "index": NEIGHBOUR_INDEX.serving(at).file,
            "words": asdict(at.config.words),
            "neighbours": asdict(at.config.neighbours),
        }

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        config, wanted = WordConfig(**shard.spec["words"]), NeighboursConfig(**shard.spec["neighbours"])
        from motionlake.deep_motifs.words.neighbours import SearchConfig, search
        from motionlake.deep_motifs.words.word_index import WordSet

        index = NEIGHBOUR_INDEX.load(lake.path(shard.spec["index"]))
        clips = {clip: i for i, clip in enumerate(index.clips)}
        parts = list(read_features(lake.path(shard.spec["features"])))
        queries, owners = WordSet.of_clips([features for _, features in parts], config)
        groups = np.array([clips.get(clip, ELSEWHERE) for clip, _ in parts])[owners]
        metric: Metric = "geodesic" if config.representation == "rotations" else "euclidean"
        how = SearchConfig(wanted.chosen(len(index.searched.words)), metric)
        found = search(index.searched, queries, groups, wanted.k, how)
        yield _rows(shard, [clip for clip, _ in parts], owners, found, index)


NEIGHBOURS: Final = NearestWords()


def _rows(shard: Shard, clips: list[str], owners: Int64Array, found: Neighbours, index: SearchedWords) -> pa.Table:
    queries, places = np.nonzero(found.indices >= 0)
    chosen = found.indices[queries, places]
    clip, neighbour = owners[queries], index.searched.groups[chosen]
    columns = [
        pa.array(clips).take(pa.array(clip)),
        pa.repeat(shard.part, len(chosen)),
        pa.repeat(shard.key, len(chosen)),
        _within(owners)[queries],
        places + 1,
        pa.array(index.clips).take(pa.array(neighbour)),
        _within(index.searched.groups)[chosen],
        pa.array(index.parts).take(pa.array(neighbour)),
        found.distances[queries, places],
    ]
    return pa.Table.from_arrays([pa.array(c, t) for c, t in zip(columns, ROWS.types, strict=True)], schema=ROWS)


def _within(owners: Int64Array) -> Int64Array:
    """[n] place of each word in its clip, for words clip by clip."""
    return np.arange(len(owners)) - np.searchsorted(owners, owners)
