"""Posture dictionaries: they code each frame as the symbol of the nearest posture (PESTA, section 5.2)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import torch
from motionlake.arrays import Float32Array, Int32Array
from motionlake.pesta.config import PosturesConfig
from motionlake.pesta.posture_network import HeadForm, PostureAutoencoder
from motionlake.training import on_threads
from safetensors import safe_open
from safetensors.numpy import save_file

# Batches of exactly this many, the last one padded, so that a symbol does not depend on the postures beside it.
BATCH: Final = 512
_LEFT_OUT: Final = ("decoder.", "class_critic.", "style_critic.")


@dataclass(frozen=True)
class AutoencoderEncoder:
    """Codes postures with a `PostureAutoencoder` in evaluation mode."""

    network: PostureAutoencoder

    def symbols(self, features: Float32Array) -> Int32Array:
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


METADATA_KEY: Final = "posture_dictionary"
ROWS: Final = 4096


class Encoder(Protocol):
    """Gives postures their symbols; what kinds of dictionary differ in."""

    def symbols(self, features: Float32Array) -> Int32Array:
        """[T] symbols of postures [T, D]."""

    def tensors(self) -> dict[str, Float32Array]:
        """What the encoder is kept as."""


@dataclass(frozen=True)
class PostureDictionary:
    """A frozen dictionary of m symbols.

    Attributes:
        config: what it was trained for.
        encoder: from postures to symbols.
        codes: [m, d] cluster heads; Euclidean distances between them are the distances of symbols.
        postures: [m, D] a typical posture of each symbol, in features as `word_features` gives them.
        metrics: of its training.
    """

    config: PosturesConfig
    encoder: Encoder
    codes: Float32Array
    postures: Float32Array
    metrics: Mapping[str, Any]

    @property
    def m(self) -> int:
        return len(self.codes)

    @cached_property
    def distances(self) -> Float32Array:
        """[m, m] posture distance matrix D (section 5.2)."""
        from scipy.spatial.distance import cdist

        points = self.codes.astype(np.float64)
        return np.asarray(cdist(points, points), dtype=np.float32)

    def encode(self, features: Float32Array) -> Int32Array:
        """[T] symbols of postures [T, D], each independent of the others.

        Raises:
            ValueError: postures of another width than the dictionary was trained on.
        """
        if features.ndim != 2 or features.shape[1] != self.postures.shape[1]:
            raise ValueError(
                f"postures of shape {features.shape}, but the dictionary codes [T, {self.postures.shape[1]}]"
            )
        return self.encoder.symbols(features)

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {"config": asdict(self.config), "figures": dict(self.metrics)}
        tensors = {"codes": self.codes, "postures": self.postures}
        tensors |= {f"encoder.{name}": np.ascontiguousarray(value) for name, value in self.encoder.tensors().items()}
        save_file(tensors, path, metadata={METADATA_KEY: json.dumps(kept, sort_keys=True)})


@dataclass(frozen=True)
class NearestCode:
    """The code nearest to the posture itself (L2), the first where two tie: k-means and self-organising maps.

    Attributes:
        codes: [m, D] in the space of the postures.
    """

    codes: Float32Array

    def symbols(self, features: Float32Array) -> Int32Array:
        codes = self.codes.astype(np.float64)
        half = np.einsum("md,md->m", codes, codes) / 2
        batches = [
            np.argmin(half - features[start : start + ROWS].astype(np.float64) @ codes.T, axis=1)
            for start in range(0, max(len(features), 1), ROWS)
        ]
        return np.concatenate(batches).astype(np.int32)

    def tensors(self) -> dict[str, Float32Array]:
        return {"codes": self.codes}


def load_dictionary(path: Path) -> PostureDictionary:
    """Read what `PostureDictionary.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    with safe_open(path, framework="numpy") as file:
        metadata = (file.metadata() or {}).get(METADATA_KEY)
        if metadata is None:
            raise ValueError(f"{path} holds no posture dictionary")
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    kept = json.loads(metadata)
    config = PosturesConfig(**kept["config"])
    own = {name.removeprefix("encoder."): value for name, value in tensors.items() if name.startswith("encoder.")}
    return PostureDictionary(config, _encoder(config, own), tensors["codes"], tensors["postures"], kept["figures"])


def _encoder(config: PosturesConfig, tensors: dict[str, Float32Array]) -> Encoder:
    if config.dictionary != "aae":
        return NearestCode(tensors["codes"])

    return load_encoder(tensors)
