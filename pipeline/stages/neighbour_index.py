"""The index of nearest words: all words of a lake as it was when the index was made.

New clips are searched in it, and are found only once it is made anew (`motionlake run neighbours --refit`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

from motionlake.arrays import Float32Array
from motionlake.deep_motifs.words.windows import WordSet
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.stages.model_kind import ModelKind, Selection, Steps
from motionlake.stages.reader import LakeReader
from motionlake.stages.words import WORDS, read_features


@dataclass(frozen=True)
class IndexedClips:
    """Names, parts and features [T, D] of clips, and a hash of the parts these are in."""

    clips: list[str]
    parts: list[str]
    features: list[Float32Array]
    corpus: str


class NeighbourIndex(ModelKind[IndexedClips]):
    """Words to search the nearest among."""

    name = "neighbours"
    table = "words"
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
            features.update(read_features(at.lake.path(WORDS.files(at)[part])))
        clips = [row["clip"] for row in rows]
        keys = sorted({p.part: p.key for p in live}.values())
        return IndexedClips(clips, [row["part"] for row in rows], [features[c] for c in clips], config_hash(keys))

    def train(
        self, lake: Lake, config: LakeConfig, data: IndexedClips, file: str, progress: Steps
    ) -> Mapping[str, Any]:
        from motionlake.deep_motifs.words.neighbours import prepare, save_searched

        corpus, groups = WordSet.of_clips(data.features, config.words)
        names = {"clips": json.dumps(data.clips), "parts": json.dumps(data.parts)}
        with replacing(lake.path(file)) as temporary:
            save_searched(prepare(corpus, groups), temporary, names)
        return {"words": len(corpus), "clips": len(data.clips), "corpus": data.corpus}


NEIGHBOUR_INDEX: Final = NeighbourIndex()
