"""The word network (Deep Motifs, section 3.3), trained on the words of a lake or taken pretrained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Progress
from motionlake.deep_motifs.config import CLOSED, ENOUGH, PAPER, PRETRAINED_WORDS, NetworkConfig
from motionlake.lake.catalog import fetch
from motionlake.lake.config import LakeConfig, config_hash
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.reader import LakeReader
from motionlake.stages.words import WORDS, read_features

if TYPE_CHECKING:
    from motionlake.deep_motifs.words.network import TrainedNetwork

TRUNK: Final = 2  # version of the layers of "inception736"; those of an earlier one cannot be read


@dataclass(frozen=True)
class WordSample:
    """Features [T, D] of whole clips, and the name and file of the network to go on from, if any."""

    features: list[Float32Array]
    start: tuple[str, str] | None = None


class WordNetwork(ModelKind[WordSample]):
    """What embeds motion words."""

    name = "network"
    config = NetworkConfig
    title = "word network"
    use = "embeds the words"
    lacks = "words to train on yet; make them with `motionlake run words`"
    command = "words"
    help = """Train the word network that config.toml names; `motionlake run all` then embeds with it.

    Interrupted, the same command goes on where it stopped. [network] in config.toml says which architecture
    ("moves", "linear", "conv", "inception736"), how many steps, and from which seed; recipe = "deep_motifs" trains the
    paper's network until its loss on held-out words stops falling.

    Example: motionlake train words --lake mylake

    Example: motionlake train words --fine-tune --lake mylake
    """
    said = "trained on {words} words; embed with it: motionlake run all --lake {lake}"
    options = ("fine_tune",)
    pretrained = PRETRAINED_WORDS
    kept = ("words",)

    def key(self, at: LakeReader) -> str:
        shaping, default = asdict(at.config.network), NetworkConfig()
        for name in ("recipe", "negatives"):  # added later: networks made before keep their key
            if shaping[name] == getattr(default, name):
                del shaping[name]
        made = [] if at.config.network.built != PAPER else [TRUNK]
        return config_hash(self.name, self.version, at.config.words, shaping, *made)

    def settings(self, config: LakeConfig) -> Mapping[str, Any]:
        return {"words": asdict(config.words), "network": asdict(config.network)}

    def fits(self, config: LakeConfig) -> bool:
        return PRETRAINED_WORDS.fits(config.words, config.network)

    def takes_pretrained(self, at: LakeReader) -> bool:
        return self.fits(at.config) and (at.config.network.weights == "pretrained" or _count(at) < ENOUGH)

    def announce(self, at: LakeReader) -> str:
        network = at.config.network
        if network.built in CLOSED:
            return f"will train a word network ({network.built})"
        steps = f"at most {network.steps}" if network.recipe == "deep_motifs" else f"{network.steps}"
        return f"will train a word network ({network.built}, {steps} steps; says how long after the first)"

    def data(self, at: LakeReader, where: Selection) -> WordSample | None:
        features = training_sample(at)
        if not features:
            return None
        before = self.fitting(at) if where.fine_tune else None
        return WordSample(features, (before.model, before.file) if before else None)

    def fit(
        self, lake: Lake, config: LakeConfig, data: WordSample, checkpoint: Path, progress: Progress
    ) -> TrainedNetwork:
        from motionlake.deep_motifs.words.training import train_words

        before = self.load(sound(lake, data.start[1])) if data.start else None
        trained = train_words(
            data.features, config.words, config.network, start=before, checkpoint=checkpoint, progress=progress
        )
        named = {"fine_tuned_from": data.start[0]} if data.start else {}
        return replace(trained, metrics={**trained.metrics, **named})

    def load(self, path: Path) -> TrainedNetwork:
        from motionlake.deep_motifs.words.network import load_network

        return load_network(path)

    def take(self, lake: Lake, config: LakeConfig, weights: Path, file: str) -> Mapping[str, Any]:
        network = self.load(weights)
        if (network.words, network.architecture) != (config.words, config.network.built):
            raise ValueError(f"{weights} embeds other words than config.toml says")
        return super().take(lake, config, weights, file)


WORD_NETWORK: Final = WordNetwork()


def _count(at: LakeReader) -> int:
    return sum(row["words"] for row in fetch(at.con, "recorded_words"))


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
        for clip, features in read_features(sound(at.lake, files[part])):
            if clip in chosen:
                found[clip] = features
    return [found[clip] for clip in sorted(found)]
