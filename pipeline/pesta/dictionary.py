"""Posture dictionaries: they code each frame as a symbol (PESTA, section 5.2).

Four kinds, see `PosturesConfig.dictionary`. Of all of them a symbol has a head, and the Euclidean distances between
heads are the distances of symbols.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int32Array
from motionlake.pesta.config import DICTIONARY_KEY, KINDS, PosturesConfig
from motionlake.weights import read_tensors, save_tensors

ROWS: Final = 4096  # postures that are compared with the codes at a time


class Encoder(Protocol):
    """What turns postures into symbols."""

    def symbols(self, features: Float32Array) -> Int32Array:
        """[T] symbols of postures [T, D], each independent of the others."""

    def tensors(self) -> dict[str, Float32Array]:
        """Arrays by name, from which it is made again."""


@dataclass(frozen=True)
class NearestCode:
    """The nearest code (L2), the first where two tie: k-means and self-organising maps.

    Attributes:
        codes: [m, d] in the space of the postures, or where `start` takes them.
        start: [d, D] a linear map of postures; None: they stay as they are.
    """

    codes: Float32Array
    start: Float32Array | None = None

    def symbols(self, features: Float32Array) -> Int32Array:
        half, from_postures = self._compared
        batches = [
            np.argmin(half - features[start : start + ROWS].astype(np.float64) @ from_postures, axis=1)
            for start in range(0, max(len(features), 1), ROWS)
        ]
        return np.concatenate(batches).astype(np.int32)

    @cached_property
    def _compared(self) -> tuple[Float64Array, Float64Array]:
        """Half the squared lengths of the codes [m], and the map [D, m] of postures to their products with these."""
        codes = self.codes.astype(np.float64)
        from_postures = codes.T if self.start is None else self.start.T.astype(np.float64) @ codes.T
        return np.einsum("md,md->m", codes, codes) / 2, from_postures

    def tensors(self) -> dict[str, Float32Array]:
        return {"codes": self.codes} | ({} if self.start is None else {"start": self.start})


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
        tensors |= {f"encoder.{name}": value for name, value in self.encoder.tensors().items()}
        save_tensors(path, tensors, DICTIONARY_KEY, kept)


def load_dictionary(path: Path) -> PostureDictionary:
    """Read what `PostureDictionary.save` wrote.

    Raises:
        ValueError: the file holds something else, or a dictionary of a kind that is no longer made.
    """
    tensors, kept = read_tensors(path, DICTIONARY_KEY)
    kind = kept["config"]["dictionary"]
    if kind not in KINDS:
        raise ValueError(
            f"{path} holds a dictionary of kind {kind!r}, as earlier versions made them; `motionlake run all` makes "
            "another"
        )
    config = PosturesConfig(**{name: value for name, value in kept["config"].items() if name != "recipe"})
    own = {name.removeprefix("encoder."): value for name, value in tensors.items() if name.startswith("encoder.")}
    encoder = NearestCode(own["codes"], own.get("start")) if "codes" in own else _autoencoder(own)
    return PostureDictionary(config, encoder, tensors["codes"], tensors["postures"], kept["figures"])


def _autoencoder(tensors: Mapping[str, Float32Array]) -> Encoder:
    import torch  # a second, which k-means need not pay
    from motionlake.pesta.autoencoder import AutoencoderEncoder, read_autoencoder

    return AutoencoderEncoder(read_autoencoder({name: torch.from_numpy(value) for name, value in tensors.items()}))
