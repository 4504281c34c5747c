"""Stages "motifs" and "signatures": each word's nearest motif; tf-idf histograms of these, made in SQL, for clips."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
from motionlake.deep_motifs.motifs import assign
from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.stages.embed import EMBED, read_embeddings
from motionlake.stages.motif_model import MOTIF_MODEL, read_motifs
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Part, PartStage, Shard, ShardResult


class MotifsOfWords(PartStage):
    """The motif of every word; it enters the catalog together with the signatures, so that the two always agree."""

    name = "motifs"
    about = "cluster the words if there are no motifs, assign every word"
    source = EMBED
    model = MOTIF_MODEL
    folder = "assigned"

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        return {"embeddings": EMBED.file(part.upstream), "motifs": MOTIF_MODEL.serving(at).file}

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        rows, vectors = read_embeddings(sound(lake, shard.spec["embeddings"]))
        found = assign(vectors, loaded(read_motifs, lake, shard.spec["motifs"]))
        yield rows.append_column("motif", pa.array(found, pa.int32()))


MOTIFS: Final = MotifsOfWords()


class Signatures(PartStage):
    """A histogram of motifs a clip. All its work is done when it is loaded."""

    name = "signatures"
    about = "tf-idf signatures of clips, ready for search"
    source = MOTIFS
    tables = ("word_motifs", "motifs", "signatures")

    def shaping(self, at: LakeReader) -> Sequence[Any] | None:
        # The name of the motifs: refitted ones may be the same, and yet all signatures must then follow.
        motifs = MOTIF_MODEL.fitting(at)
        return None if motifs is None else (motifs.model,)

    def spec(self, at: LakeReader, part: Part) -> Mapping[str, Any]:
        motifs = MOTIF_MODEL.serving(at)
        return {"assigned": MOTIFS.file(part.upstream), "motifs": motifs.file, "model": motifs.model}

    def at_once(self, at: LakeReader) -> bool:
        return True

    def rows(self, lake: Lake, shard: Shard) -> Iterator[pa.Table]:
        yield from ()

    def run(self, root: Path, shard: Shard, /) -> ShardResult:
        return ShardResult(shard)

    def load(self, con: Connection, root: Path, results: Sequence[ShardResult], /) -> None:
        """Enter assigned words; new motifs replace the old with their idf, which then stays frozen.

        When the motifs are new, `results` must hold every part of the lake: signatures of two sets of motifs do
        not compare.
        """
        spec = results[0].shard.spec
        served = fetch(con, "served_motifs")
        parameters = {
            "parts": [r.shard.part for r in results],
            "files": [str(root / r.shard.spec["assigned"]) for r in results],
            "motifs": str(root / spec["motifs"]),
            "model": spec["model"],
        }
        new_motifs = not served or served[0]["model"] != spec["model"]
        if new_motifs:
            run_sql(con, "clear_motifs")
        run_sql(con, "load_word_motifs", parameters)
        if new_motifs:
            run_sql(con, "load_motifs", parameters)
        run_sql(con, "make_signatures", parameters)


SIGNATURES: Final = Signatures()
