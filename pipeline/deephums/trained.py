"""A trained descriptor network: from clips to descriptors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deephums.batches import Augmentation, padded, resampled, windows
from motionlake.deephums.config import DIMENSION, DescriptorsConfig
from motionlake.deephums.network import DescriptorNetwork, DescriptorRecipe
from motionlake.training import on_threads, read_network, save_network
from torch.nn.functional import normalize

METADATA_KEY: Final = "descriptor_network"
# Batches of exactly this many, the last one filled up, so that a descriptor does not depend on the clips beside it.
BATCH: Final = 32


@dataclass(frozen=True)
class TrainedDescriptor:
    """A frozen network.

    Attributes:
        config: what it was trained for.
        recipe: how it was trained.
        network: in evaluation mode, on the CPU.
        classes: [C] it was trained with; empty without labels.
        metrics: of its training.
    """

    config: DescriptorsConfig
    recipe: DescriptorRecipe
    network: DescriptorNetwork
    classes: list[str]
    metrics: Mapping[str, Any]

    def embed(self, sequences: Sequence[Float32Array]) -> Float32Array:
        """[n, 512] descriptors, of length one, of n clips (`clip_sequence`), each independent of the others.

        That of a clip longer than `batches.LONGEST` frames is the mean over its windows.
        """
        if not len(sequences):
            return np.empty((0, DIMENSION), dtype=np.float32)
        parts = [windows(sequence) if self.recipe.frames else [sequence] for sequence in sequences]
        with on_threads(1), torch.inference_mode():
            found = self._embed([part for several in parts for part in several])
        stops = np.cumsum([len(several) for several in parts])
        means = np.add.reduceat(found, np.concatenate([[0], stops[:-1]]), axis=0)
        return np.asarray(means / np.maximum(np.linalg.norm(means, axis=1, keepdims=True), 1e-12), dtype=np.float32)

    def _embed(self, clips: Sequence[Float32Array]) -> Float32Array:
        if not self.recipe.frames:
            rows = [self.network(*padded([clip])) for clip in clips]
            return normalize(torch.cat(rows), dim=1).numpy()
        found = np.empty((len(clips), DIMENSION), dtype=np.float32)
        for start in range(0, len(clips), BATCH):
            some = [resampled(clip, self.recipe.frames) for clip in clips[start : start + BATCH]]
            batch, _ = padded([*some, *[some[0]] * (BATCH - len(some))])
            found[start : start + len(some)] = normalize(self.network(batch), dim=1)[: len(some)].numpy()
        return found

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {
            "config": asdict(self.config), "recipe": asdict(self.recipe), "classes": self.classes,
            "figures": dict(self.metrics),
        }  # fmt: skip
        save_network(path, self.network, METADATA_KEY, kept)


def load_descriptor(path: Path) -> TrainedDescriptor:
    """Read what `TrainedDescriptor.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    tensors, kept = read_network(path, METADATA_KEY)
    recipe = DescriptorRecipe(**{**kept["recipe"], "augmentation": Augmentation(**kept["recipe"]["augmentation"])})
    network = DescriptorNetwork(recipe, len(kept["classes"]))
    network.load_state_dict(tensors)
    return TrainedDescriptor(
        DescriptorsConfig(**kept["config"]), recipe, network.eval(), kept["classes"], kept["figures"]
    )
