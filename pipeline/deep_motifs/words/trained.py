"""A trained word network: embedding with it, keeping it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deep_motifs.words.network import WordNetwork, build
from motionlake.motion.features import WordConfig
from motionlake.threads import on_threads
from safetensors import safe_open
from safetensors.torch import save_file

METADATA_KEY: Final = "word_network"
# Words are embedded in batches of exactly this many, the last one padded, so that a word's vector does not
# depend on the words beside it.
EMBED_BATCH: Final = 64


@dataclass(frozen=True)
class TrainedNetwork:
    """A word network with what it needs to be used again.

    Attributes:
        network: in evaluation mode.
        architecture: its name.
        words: the words it was trained on.
        figures: of its training.
    """

    network: WordNetwork
    architecture: str
    words: WordConfig
    figures: Mapping[str, Any]

    def embed(self, words: Float32Array) -> Float32Array:
        """Embed `words` [n, length, D] as [n, d]; on one thread, each word independent of the others.

        Raises:
            ValueError: words of another shape than the network was trained on.
        """
        expected = (self.words.length, self.words.dimension)
        if words.shape[1:] != expected:
            raise ValueError(f"words of shape {words.shape[1:]}, but the network embeds {expected}")
        batches = []
        with on_threads(1), torch.inference_mode():
            for start in range(0, max(len(words), 1), EMBED_BATCH):
                batch = np.zeros((EMBED_BATCH, *expected), dtype=np.float32)
                count = len(words[start : start + EMBED_BATCH])
                batch[:count] = words[start : start + EMBED_BATCH]
                batches.append(self.network(torch.from_numpy(batch))[:count].numpy())
        return np.concatenate(batches)

    def save(self, path: Path) -> None:
        """Write weights and configuration as one safetensors file."""
        kept = {"architecture": self.architecture, "words": asdict(self.words), "figures": dict(self.figures)}
        tensors = {name: value.contiguous() for name, value in self.network.state_dict().items()}
        save_file(tensors, path, metadata={METADATA_KEY: json.dumps(kept, sort_keys=True)})


def load_network(path: Path) -> TrainedNetwork:
    """Read a network that `TrainedNetwork.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    with safe_open(path, framework="pt") as file:
        metadata = (file.metadata() or {}).get(METADATA_KEY)
        if metadata is None:
            raise ValueError(f"{path} holds no word network")
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    kept = json.loads(metadata)
    words = WordConfig(**kept["words"])
    network = build(kept["architecture"], words.length, words.dimension)
    network.load_state_dict(tensors)
    return TrainedNetwork(network.eval(), kept["architecture"], words, kept["figures"])
