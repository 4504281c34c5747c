"""The index of nearest words: all words of a lake as it was when the index was made.

New clips are searched in it, and are found only once it is made anew (`motionlake run neighbours --refit`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from motionlake.arrays import Float32Array, Progress
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import LakeReader
from motionlake.stages.words import WORDS, read_features

if TYPE_CHECKING:
    from motionlake.deep_motifs.words.word_index import WordIndex


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

        notes = {"clips": json.dumps(self.clips), "parts": json.dumps(self.parts), "corpus": self.corpus}
        save_index(self.searched, path, notes)


class NeighbourIndex(ModelKind[IndexedClips]):
    """Words to search the nearest among."""

    name = "neighbours"
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
            features.update(read_features(at.lake.path(WORDS.files(at)[part])))
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
        return SearchedWords(searched, json.loads(notes["clips"]), json.loads(notes["parts"]), notes["corpus"])


NEIGHBOUR_INDEX: Final = NeighbourIndex()
