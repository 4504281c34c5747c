"""The word network (Deep Motifs, section 3.3), trained on the words of a lake or taken pretrained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.config import PRETRAINED_WORDS
from motionlake.lake.catalog import fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.layout import Lake
from motionlake.lake.models import checkpoint_file, save_model
from motionlake.stages.model_kind import ModelKind, Selection, Steps
from motionlake.stages.reader import LakeReader
from motionlake.stages.words import WORDS, read_features


@dataclass(frozen=True)
class WordSample:
    """Features [T, D] of whole clips, and the name and file of the network to go on from, if any."""

    features: list[Float32Array]
    start: tuple[str, str] | None = None


class WordNetwork(ModelKind[WordSample]):
    """What embeds motion words."""

    name = "network"
    table = "network"
    title = "word network"
    command = "words"
    use = "embeds the words"
    lacks = "words yet; `motionlake run all` makes every stage"
    pretrained = PRETRAINED_WORDS
    kept = ("words",)

    def key(self, at: LakeReader) -> str:
        return config_hash(self.name, self.version, at.config.words, at.config.network)

    def settings(self, config: LakeConfig) -> Mapping[str, Any]:
        return {"words": asdict(config.words), "network": asdict(config.network)}

    def fits(self, config: LakeConfig) -> bool:
        return PRETRAINED_WORDS.fits(config.words, config.network)

    def announce(self, at: LakeReader) -> str:
        network = at.config.network
        steps = "" if network.architecture == "linear" else f", {network.steps} steps; says how long after the first"
        return f"will train a word network ({network.architecture}{steps})"

    def data(self, at: LakeReader, where: Selection) -> WordSample | None:
        features = training_sample(at)
        if not features:
            return None
        before = self.fitting(at) if where.fine_tune else None
        return WordSample(features, (before.model, before.file) if before else None)

    def train(self, lake: Lake, config: LakeConfig, data: WordSample, file: str, progress: Steps) -> Mapping[str, Any]:
        from motionlake.deep_motifs.words.network import load_network
        from motionlake.deep_motifs.words.training import train_words

        checkpoint = checkpoint_file(lake, "words")
        before = load_network(lake.path(data.start[1])) if data.start else None
        trained = train_words(
            data.features, config.words, config.network, start=before, checkpoint=checkpoint, progress=progress
        )
        save_model(lake, file, trained.save)
        return {**trained.metrics, **({"fine_tuned_from": data.start[0]} if data.start else {})}

    def metrics_of(self, weights: Path) -> Mapping[str, Any]:
        from motionlake.deep_motifs.words.network import load_network

        return load_network(weights).metrics

    def take(self, lake: Lake, config: LakeConfig, weights: Path, file: str) -> Mapping[str, Any]:
        from motionlake.deep_motifs.words.network import load_network

        network = load_network(weights)
        if (network.words, network.architecture) != (config.words, config.network.architecture):
            raise ValueError(f"{weights} embeds other words than config.toml says")
        return super().take(lake, config, weights, file)


WORD_NETWORK: Final = WordNetwork()


def training_sample(at: LakeReader) -> list[Float32Array]:
    """Features of whole clips, drawn at random until they hold `max_words` words; in order of the clips."""
    config = at.config.network
    rows = fetch(at.con, "recorded_words")
    order = np.random.default_rng(config.seed).permutation(len(rows))
    total, chosen = 0, set()
    for i in order.tolist():
        if total >= config.max_words:
            break
        total += rows[i]["words"]
        chosen.add(rows[i]["clip"])
    files = WORDS.files(at)
    found: dict[str, Float32Array] = {}
    for part in sorted({r["part"] for r in rows if r["clip"] in chosen}):
        for clip, features in read_features(at.lake.path(files[part])):
            if clip in chosen:
                found[clip] = features
    return [found[clip] for clip in sorted(found)]
