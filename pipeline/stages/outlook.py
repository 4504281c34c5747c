"""What a run will fit before it can go on, and about how long that takes."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.config import LakeConfig
from pipeline.lake.catalog import Connection, fetch
from pipeline.stages import embed, motifs
from pipeline.words.training import estimate_seconds


def outlook(con: Connection, config: LakeConfig, stages: Sequence[str], *, refit: bool) -> list[str]:
    """A line for each model that would be fitted."""
    lines = []
    network = embed.fitting_network(con, config)
    if "embed" in stages:
        if network is None or refit:
            words = min(_words(con, config), config.network.max_words)
            minutes = estimate_seconds(config.network, words) / 60
            lines.append(
                f"embed: will train a word network ({config.network.architecture}), about {minutes:.1f} minutes"
            )
        else:
            lines.append(f"embed: will not train; {network.model} embeds the words")
    if "motifs" in stages:
        fitted = motifs.fitting_motifs(con, config, network) if network else None
        if fitted is None or refit:
            lines.append(f"motifs: will fit {config.motifs.k} motifs")
        else:
            lines.append(f"motifs: will not fit; new words are assigned to {fitted.model}")
    return lines


def _words(con: Connection, config: LakeConfig) -> int:
    """Words of the lake; from its seconds where they are not cut yet."""
    seconds = fetch(con, "queries/total_seconds.sql")[0]["seconds"]
    return int(seconds * config.words.fps / config.words.stride) or config.network.max_words
