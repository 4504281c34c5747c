"""The networks that turn clips into descriptors (DeepHuMS, section 3.2), and a trained one with its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deephums.batches import padded, resampled, windows
from motionlake.deephums.config import DIMENSION, DescriptorsConfig
from motionlake.deephums.encoders import ConvolutionalGru, Lstm, MissingJoints
from motionlake.deephums.neighbourhood import Neighbourhood
from motionlake.deephums.recipes import DescriptorRecipe, read_recipe
from motionlake.deephums.sketch import Sketch
from motionlake.training import on_threads, read_network, save_network
from torch import Tensor, nn
from torch.nn.functional import normalize

METADATA_KEY: Final = "descriptor_network"
# Batches of exactly this many, the last one filled up, so that a descriptor does not depend on the clips beside it.
BATCH: Final = 32


WITHOUT_GRADIENTS: Final = (Sketch, Neighbourhood)


class DescriptorNetwork(nn.Module):
    """Descriptors of clips, and how likely each class is where it was trained with classes.

    Attributes:
        encoders: each gives a part of the descriptor, of length one; they learn apart from one another.
        heads: of each encoder a linear classifier on its part; none without classes.
        fill: puts something in for joints that are missing; the thesis leaves them out.
    """

    def __init__(self, recipe: DescriptorRecipe, classes: int = 0) -> None:
        super().__init__()
        width = DIMENSION // len(recipe.encoders)
        self.encoders = nn.ModuleList(_encoder(name, recipe, width) for name in recipe.encoders)
        encoders = self.encoders
        self.heads = nn.ModuleList(nn.Linear(width, classes) for _ in encoders) if classes else None
        self.fill = nn.Identity() if recipe.encoders == ("lstm",) else MissingJoints()

    def learn(self, frames: Tensor, clips: Tensor | None, near: Tensor | None = None) -> None:
        """What is learned without gradients.

        Args:
            frames: [n, 15, 3] postures.
            clips: [m, 48, 15, 3], for a sketch.
            near: [m, m] how near these clips are to one another, for a neighbourhood.
        """
        if isinstance(self.fill, MissingJoints):
            self.fill.learn(frames)
        for encoder in self.encoders:
            if isinstance(encoder, Sketch):
                assert clips is not None
                encoder.learn(self.fill(clips))
            elif isinstance(encoder, Neighbourhood):
                assert clips is not None
                assert near is not None
                encoder.learn(self.fill(clips), near)

    def forward(self, clips: Tensor, lengths: Tensor | None = None) -> Tensor:
        """[B, 512] descriptors of clips [B, T, 15, 3]; of clip i the first lengths[i] frames count."""
        parts = self.parts(clips, lengths)
        return torch.cat([normalize(part, dim=1) for part in parts], dim=1) if len(parts) > 1 else parts[0]

    def parts(self, clips: Tensor, lengths: Tensor | None = None) -> list[Tensor]:
        """The parts of `forward`, before they are brought to length one."""
        filled = self.fill(clips)
        return [encoder(filled, lengths) for encoder in self.encoders]

    def learning_parts(self, clips: Tensor, lengths: Tensor | None = None) -> list[Tensor]:
        """Those of `parts` that learn by gradients."""
        filled = self.fill(clips)
        return [encoder(filled, lengths) for encoder in self.encoders if not isinstance(encoder, WITHOUT_GRADIENTS)]

    def logits(self, parts: list[Tensor]) -> list[Tensor]:
        """[B, C] of each part."""
        assert self.heads is not None
        return [head(part) for head, part in zip(self.heads, parts, strict=True)]


def _encoder(name: str, recipe: DescriptorRecipe, width: int) -> nn.Module:
    if name == "lstm":
        return Lstm(recipe.hidden, width)
    if name == "sketch":
        return Sketch(width)
    if name == "neighbourhood":
        return Neighbourhood(width)
    return ConvolutionalGru(name, recipe.convolutions, recipe.hidden, recipe.dropout, width)


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
            some = [resampled(clip, self.recipe.frames, self.recipe.paced) for clip in clips[start : start + BATCH]]
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
    recipe = read_recipe(kept["recipe"])
    network = DescriptorNetwork(recipe, len(kept["classes"]))
    network.load_state_dict(tensors)
    return TrainedDescriptor(
        DescriptorsConfig(**kept["config"]), recipe, network.eval(), kept["classes"], kept["figures"]
    )
