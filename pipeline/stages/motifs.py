"""Stage "motifs": every embedded word is assigned to the nearest motif."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import pyarrow as pa
from motionlake.deep_motifs.motifs import assign
from motionlake.lake.layout import Lake
from motionlake.stages.embed import EMBED, read_embeddings
from motionlake.stages.motif_model import MOTIF_MODEL, read_motifs
from motionlake.stages.reader import LakeReader
from motionlake.stages.shard import Shard
from motionlake.stages.stage import Part, PartStage


class MotifsOfWords(PartStage):
    """The motif of every word; it enters the catalog together with the signatures, so that the two always agree."""

    name = "motifs"
    about = "cluster the words if there are no motifs, assign every word"
    source = EMBED
    model = MOTIF_MODEL
    folder = "assigned"

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        motifs = MOTIF_MODEL.fitting(at)
        return None if motifs is None else (at.file_hash(motifs.file),)

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        motifs = MOTIF_MODEL.serving(at)
        return {"embeddings": EMBED.file(part.upstream), "motifs": motifs.file}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        rows, vectors = read_embeddings(lake.path(shard.spec["embeddings"]))
        found = assign(vectors, read_motifs(lake.path(shard.spec["motifs"])))
        yield rows.append_column("motif", pa.array(found, pa.int32()))


MOTIFS: Final = MotifsOfWords()
