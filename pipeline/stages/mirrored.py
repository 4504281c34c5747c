"""Stage "mirrored": the signature that each clip would have if it were mirrored left to right.

Words of the mirrored features go through the network and the motifs that the lake serves, and are weighed
with the frozen idf, as the clip's own words are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any, Final

import pyarrow as pa
from motionlake.deep_motifs.motifs import assign
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.motion.features import WordConfig, mirrored_features, word_windows
from motionlake.stages.motif_model import MOTIF_MODEL, read_motifs
from motionlake.stages.reader import LakeReader
from motionlake.stages.signatures import SIGNATURES
from motionlake.stages.stage import Part, PartStage, Shard, part_keys
from motionlake.stages.word_network import WORD_NETWORK
from motionlake.stages.words import WORDS, read_features

ROWS = pa.schema([("clip", pa.string()), ("part", pa.string()), ("motif", pa.int32())])


class Mirrored(PartStage):
    """Mirrored signatures of the parts whose signatures are served: they must be of the same motifs."""

    name = "mirrored"
    about = "the signature of every clip mirrored left to right"
    source = SIGNATURES
    tables = ("mirrored_signatures",)
    schema = ROWS
    statement = "load_mirrored"

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {
            "features": WORDS.files(at)[part.part],
            "network": WORD_NETWORK.serving(at).file,
            "motifs": MOTIF_MODEL.serving(at).file,
            "words": asdict(at.config.words),
        }

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        from motionlake.deep_motifs.words.network import load_network

        config = WordConfig(**shard.spec["words"])
        network = loaded(load_network, lake, shard.spec["network"])
        vocabulary = loaded(read_motifs, lake, shard.spec["motifs"])
        read = read_features(sound(lake, shard.spec["features"]))
        turned = ((clip, word_windows(mirrored_features(features, config), config)) for clip, features in read)
        for clip, vectors in network.embed_clips(turned):
            found = assign(vectors, vocabulary)
            clips, parts, _ = part_keys(clip, shard, len(found))
            yield pa.Table.from_arrays([clips, parts, pa.array(found, pa.int32())], schema=ROWS)


MIRRORED: Final = Mirrored()
