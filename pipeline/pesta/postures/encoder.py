"""The encoder of a trained autoencoder: all of it that coding postures needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from motionlake.motion.features import Float32Array
from motionlake.pesta.postures.network import PostureAutoencoder
from motionlake.pesta.postures.recipe import HeadForm
from motionlake.threads import on_threads
from numpy.typing import NDArray

# Batches of exactly this many, the last one padded, so that a symbol does not depend on the postures beside it.
BATCH: Final = 512
_LEFT_OUT: Final = ("decoder.", "class_critic.", "style_critic.")


@dataclass(frozen=True)
class AutoencoderEncoder:
    """Codes postures with a `PostureAutoencoder` in evaluation mode."""

    network: PostureAutoencoder

    def symbols(self, features: Float32Array) -> NDArray[np.int32]:
        """[T] symbols of postures [T, D], on one thread."""
        coded = np.empty(len(features), dtype=np.int32)
        batch = np.zeros((BATCH, features.shape[1]), dtype=np.float32)
        with on_threads(1), torch.inference_mode():
            for start in range(0, len(features), BATCH):
                rows = features[start : start + BATCH]
                batch[: len(rows)] = rows
                coded[start : start + len(rows)] = self.network.symbols(torch.from_numpy(batch))[: len(rows)].numpy()
        return coded

    def tensors(self) -> dict[str, Float32Array]:
        state = self.network.state_dict()
        return {name: value.numpy() for name, value in state.items() if not name.startswith(_LEFT_OUT)}


def load_encoder(tensors: dict[str, Float32Array]) -> AutoencoderEncoder:
    """The encoder that `AutoencoderEncoder.tensors` kept; its decoder and critics are untrained."""
    n, dimension = tensors["start"].shape
    form: HeadForm = "linear" if "to_class.weight" in tensors else "nearest"
    network = PostureAutoencoder(dimension, len(tensors["heads"]), n, len(tensors["encoder.0.bias"]), form)
    network.load_state_dict({name: torch.from_numpy(value) for name, value in tensors.items()}, strict=False)
    return AutoencoderEncoder(network.eval())
