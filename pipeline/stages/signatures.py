"""Stage "signatures": tf-idf histograms of motifs, made in SQL, served together with their motifs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from motionlake.lake.catalog import Connection, fetch, run_sql
from motionlake.lake.config import LakeConfig
from motionlake.lake.layout import Lake
from motionlake.lake.models import Model
from motionlake.stages import motifs
from motionlake.stages.derived import Part, derive, due
from motionlake.stages.shard import Shard, ShardResult

NAME = "signatures"
VERSION = 1


def keyed(assigned: list[Part], model: Model) -> list[Part]:
    """Parts of the stage "motifs" with the key their signatures must have.

    It covers the name of the motifs: refitted ones may be the same, and yet all signatures must then follow.
    """
    return derive(assigned, NAME, VERSION, model.model)


def plan(con: Connection, lake: Lake, config: LakeConfig, network: Model, model: Model) -> list[Shard]:
    """One shard a part; its work is done when it is loaded."""

    def spec(part: Part) -> dict[str, object]:
        return {"assigned": motifs.assigned_file(part.upstream), "motifs": model.file, "model": model.model}

    parts = keyed(motifs.keyed(con, lake, config, network, model), model)
    return due(con, NAME, motifs.NAME, parts, spec)


def run(_lake_root: Path, shard: Shard) -> ShardResult:
    """Nothing is left for a worker to do."""
    return ShardResult(shard, 0, 0, (), 0.0)


def load(con: Connection, root: Path, results: Sequence[ShardResult]) -> None:
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
