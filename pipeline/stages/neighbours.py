"""Stage "neighbours": the nearest words of every word in other clips, under DTW, and the index they are searched in.

The index holds all words of a lake as it was when the index was made: new clips are searched in it, and are found only
once it is made anew (`motionlake run neighbours --refit`). What leaves the lake leaves the view `word_neighbours`, and
a word may then have fewer neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array, Progress
from motionlake.deep_motifs.config import NeighboursConfig
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import PART_KEYS, Part, PartStage, Shard
from motionlake.stages.words import WORDS, read_features

if TYPE_CHECKING:
    from motionlake.deep_motifs.words.neighbours import Neighbours
    from motionlake.deep_motifs.words.word_index import WordIndex
    from motionlake.motion.dtw import Metric

ELSEWHERE = -1  # group of a clip that the index does not hold
ROWS = pa.schema(
    [
        *PART_KEYS, ("word", pa.int32()), ("rank", pa.int32()), ("neighbour", pa.string()),
        ("neighbour_word", pa.int32()), ("neighbour_part", pa.string()), ("distance", pa.float32()),
    ]
)  # fmt: skip


@dataclass(frozen=True)
class IndexedClips:
    """Names, parts and features [T, D] of clips, and a hash of the parts these are in."""

    clips: list[str]
    parts: list[str]
    features: list[Float32Array]
    corpus: str


@dataclass(frozen=True)
class SearchedWords:
    """The index as a file of the lake has it, with the names and parts of its clips and a hash of these parts."""

    searched: WordIndex
    clips: list[str]
    parts: list[str]
    corpus: str

    @property
    def metrics(self) -> Mapping[str, Any]:
        return {"words": len(self.searched.words), "clips": len(self.clips), "corpus": self.corpus}

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        from motionlake.deep_motifs.words.neighbours import save_index

        notes = {"clips": self.clips, "parts": self.parts, "corpus": self.corpus}
        save_index(self.searched, path, notes)


class NeighbourIndex(ModelKind[IndexedClips]):
    """Words to search the nearest among."""

    name = "neighbours"
    version = 2
    config = WordConfig
    title = "index of words"
    use = "is searched"
    lacks = "words of some clips yet; `motionlake run words` makes them"

    def settings(self, config: LakeConfig) -> Mapping[str, Any]:
        return {"words": asdict(config.words)}

    def announce(self, at: LakeReader) -> str:
        return "will index all words of the lake"

    def data(self, at: LakeReader, where: Selection) -> IndexedClips | None:
        live = WORDS.parts(at) or []
        if any(p.key not in at.done(WORDS.name) for p in live):
            return None
        rows = fetch(at.con, "words_per_clip")
        if len(rows) < 2:
            raise UserError(f"{at.lake.root}: neighbours are sought in other clips, and {len(rows)} have words")
        features: dict[str, Float32Array] = {}
        for part in sorted({row["part"] for row in rows}):
            features.update(read_features(sound(at.lake, WORDS.files(at)[part])))
        clips = [row["clip"] for row in rows]
        keys = sorted({p.part: p.key for p in live}.values())
        return IndexedClips(clips, [row["part"] for row in rows], [features[c] for c in clips], config_hash(keys))

    def fit(
        self, lake: Lake, config: LakeConfig, data: IndexedClips, checkpoint: Path, progress: Progress
    ) -> SearchedWords:
        from motionlake.deep_motifs.words.word_index import WordSet, fit_index

        corpus, groups = WordSet.of_clips(data.features, config.words)
        return SearchedWords(fit_index(corpus, groups), data.clips, data.parts, data.corpus)

    def load(self, path: Path) -> SearchedWords:
        from motionlake.deep_motifs.words.neighbours import load_index

        searched, notes = load_index(path)
        return SearchedWords(searched, **notes)


NEIGHBOUR_INDEX: Final = NeighbourIndex()


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

        index = NEIGHBOUR_INDEX.load(sound(lake, shard.spec["index"]))
        clips = {clip: i for i, clip in enumerate(index.clips)}
        parts = list(read_features(sound(lake, shard.spec["features"])))
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
