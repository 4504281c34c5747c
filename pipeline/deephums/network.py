"""The networks that turn clips into descriptors (DeepHuMS, section 3.2), and a trained one with its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.deephums.batches import NO_AUGMENTATION, Augmentation, padded, resampled, windows
from motionlake.deephums.config import DIMENSION, DescriptorsConfig
from motionlake.motion.skeleton import COMMON
from motionlake.training import on_threads, read_network, save_network
from torch import Tensor, nn
from torch.nn.functional import normalize

CHANNELS: Final = 2 * 3 * len(COMMON)
NOISE: Final = 0.02  # of a joint that is there, body lengths
METADATA_KEY: Final = "descriptor_network"
# Batches of exactly this many, the last one filled up, so that a descriptor does not depend on the clips beside it.
BATCH: Final = 32


class DescriptorNetwork(nn.Module):
    """Descriptors of clips, and how likely each class is where it was trained with classes.

    Attributes:
        encoders: each gives a part of the descriptor, of length one; they learn apart from one another.
        heads: of each encoder a linear classifier on its part; none without classes.
        fill: puts something in for joints that are missing; the thesis leaves them out.
    """

    def __init__(self, recipe: DescriptorRecipe, classes: int = 0) -> None:
        super().__init__()
        if recipe.encoder == "lstm":
            encoders: list[nn.Module] = [Lstm(recipe.hidden, DIMENSION)]
        else:
            width = DIMENSION // len(READINGS)
            encoders = [ConvolutionalGru(reading, recipe.hidden, recipe.dropout, width) for reading in READINGS]
        self.encoders = nn.ModuleList(encoders)
        width = DIMENSION // len(encoders)
        self.heads = nn.ModuleList(nn.Linear(width, classes) for _ in encoders) if classes else None
        self.fill = nn.Identity() if recipe.encoder == "lstm" else MissingJoints()

    def forward(self, clips: Tensor, lengths: Tensor | None = None) -> Tensor:
        """[B, 512] descriptors of clips [B, T, 15, 3]; of clip i the first lengths[i] frames count."""
        parts = self.parts(clips, lengths)
        return torch.cat([normalize(part, dim=1) for part in parts], dim=1) if len(parts) > 1 else parts[0]

    def parts(self, clips: Tensor, lengths: Tensor | None = None) -> list[Tensor]:
        """The parts of `forward`, before they are brought to length one."""
        filled = self.fill(clips)
        return [encoder(filled, lengths) for encoder in self.encoders]

    def logits(self, parts: list[Tensor]) -> list[Tensor]:
        """[B, C] of each part."""
        assert self.heads is not None
        return [head(part) for head, part in zip(self.heads, parts, strict=True)]


class MissingJoints(nn.Module):
    """Joints that are zero in all frames, by linear regression on those that are not (the mean of a Gaussian)."""

    mean: Tensor
    covariance: Tensor

    def __init__(self) -> None:
        super().__init__()
        size = 3 * (len(COMMON) - 1)  # the root's place holds its path
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("covariance", torch.eye(size))

    def learn(self, frames: Tensor) -> None:
        """From postures [n, 15, 3] of which no joint is missing."""
        rows = frames[:, 1:].flatten(1)
        self.mean.copy_(rows.mean(dim=0))
        self.covariance.copy_(torch.cov(rows.T) + NOISE**2 * torch.eye(rows.shape[1]))

    def forward(self, clips: Tensor) -> Tensor:
        """[B, T, 15, 3] clips without missing joints."""
        gone = (clips[:, :, 1:] == 0).all(dim=3).all(dim=1)
        some = gone.any(dim=1) & ~gone.all(dim=1)
        if not bool(some.any()):
            return clips
        there = (~gone[some]).repeat_interleave(3, dim=1).to(clips.dtype)
        both = there[:, :, None] * there[:, None]
        known = self.covariance * both + torch.diag_embed(1 - there)
        apart = (clips[some, :, 1:].flatten(2) - self.mean) * there[:, None]
        weights = torch.linalg.solve(known, apart.transpose(1, 2))
        guessed = (self.covariance @ (weights * there[..., None])).transpose(1, 2) + self.mean
        body = torch.where(there[:, None] > 0, clips[some, :, 1:].flatten(2), guessed)
        filled = clips.clone()
        filled[some, :, 1:] = body.reshape(*body.shape[:2], -1, 3)
        return filled


class ConvolutionalGru(nn.Module):
    """Strided convolutions over time, a GRU both ways, mean and maximum over time. Clips of equal length.

    Args:
        reading: of `READINGS`, what enters.
        hidden: channels, and units of the GRU each way.
        dropout: share of numbers dropped while training.
        width: of what comes out.
    """

    def __init__(self, reading: str, hidden: int, dropout: float, width: int) -> None:
        super().__init__()
        self.reading = READINGS[reading]
        self.standardise = nn.BatchNorm1d(CHANNELS)
        self.convolutions = nn.Sequential(
            _convolution(CHANNELS, hidden, 5, 1, dropout),
            _convolution(hidden, hidden, 5, 2, dropout),
            _convolution(hidden, hidden, 3, 2, dropout),
        )
        self.recurrent = nn.GRU(hidden, hidden, batch_first=True, bidirectional=True)
        self.dropout = nn.Dropout(dropout)
        self.project = nn.Linear(4 * hidden, width)

    def forward(self, clips: Tensor, _lengths: Tensor | None = None) -> Tensor:
        """[B, width] of clips [B, T, 15, 3]; `lengths` is not used."""
        seen = self.convolutions(self.standardise(self.reading(clips).transpose(1, 2)))
        states, _ = self.recurrent(seen.transpose(1, 2))
        pooled = torch.cat([states.mean(dim=1), states.amax(dim=1)], dim=1)
        return self.project(self.dropout(pooled))  # type: ignore[no-any-return]


class Lstm(nn.Module):
    """The thesis's: an LSTM over the frames as they are; its last state gives the descriptor."""

    def __init__(self, hidden: int, width: int) -> None:
        super().__init__()
        self.recurrent = nn.LSTM(CHANNELS, hidden, batch_first=True)
        self.project = nn.Linear(hidden, width)

    def forward(self, clips: Tensor, lengths: Tensor | None = None) -> Tensor:
        """[B, width] of clips [B, T, 15, 3], of which the first `lengths` [B] frames count."""
        states, _ = self.recurrent(positions_and_motion(clips))
        last = torch.full((len(clips),), clips.shape[1]) if lengths is None else lengths
        return self.project(states[torch.arange(len(clips)), last - 1])  # type: ignore[no-any-return]


def positions_and_motion(clips: Tensor) -> Tensor:
    """[B, T, 90] joints and their motion to the next frame (the thesis's input), of clips [B, T, 15, 3]."""
    return torch.cat([clips.flatten(2), motion_of(clips).flatten(2)], dim=2)


def displacement_and_motion(clips: Tensor) -> Tensor:
    """[B, T, 90] displacement of the joints from the posture that a clip starts and ends in, and their motion to the
    next frame, each divided by its root mean square over the clip: how a body moves, not how far nor how it stands.
    """
    ends = torch.cat([clips[:, :2], clips[:, -2:]], dim=1).mean(dim=1, keepdim=True)
    return torch.cat([_unit(clips - ends).flatten(2), _unit(motion_of(clips)).flatten(2)], dim=2)


def positions_and_speed(clips: Tensor) -> Tensor:
    """[B, T, 90] joints and their velocity, in body lengths a quarter of the clip."""
    return torch.cat([clips.flatten(2), motion_of(clips).flatten(2) * (clips.shape[1] / 4)], dim=2)


def motion_of(clips: Tensor) -> Tensor:
    """[B, T, J, 3] from each frame of clips [B, T, J, 3] to the next; zero in the last."""
    motion = torch.zeros_like(clips)
    motion[:, :-1] = clips[:, 1:] - clips[:, :-1]
    return motion


def _unit(values: Tensor) -> Tensor:
    squares = values.square().sum(dim=(2, 3), keepdim=True).mean(dim=1, keepdim=True)
    return values / (squares + 1e-8).sqrt()


# What the encoders of the default recipe read: how a body moves, and where its joints are.
READINGS: Final[dict[str, Callable[[Tensor], Tensor]]] = {
    "moves": displacement_and_motion,
    "joints": positions_and_speed,
}


def _convolution(inputs: int, outputs: int, width: int, stride: int, dropout: float) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(inputs, outputs, width, stride, width // 2),
        nn.BatchNorm1d(outputs),
        nn.GELU(),
        nn.Dropout(dropout),
    )


EncoderKind = Literal["conv_gru", "lstm"]
Objective = Literal["contrast", "pairs"]


@dataclass(frozen=True)
class DescriptorRecipe:
    """Sizes, training and objective of a descriptor network.

    Attributes:
        encoder: "conv_gru", or "lstm" (the thesis's).
        frames: every clip is brought to so many; 0 leaves clips as they are, at 30 frames a second.
        hidden: width of the encoder.
        objective: "contrast": near clips (by class, else by alignment) should be the nearest of a batch; "pairs":
            equation 3.1 over pairs that are similar by motion field and motion distance.
        contrast: weight of "contrast" beside cross entropy.
        temperature: of the softmax over cosines ("contrast").
        neighbours, sharpness: which clips are near without labels (`similarity.neighbourhoods`).
        margin, similar: m of equation 3.1, and the share of pairs that either test passes (`similar_by_motion`).
        smoothing: of the labels in cross entropy.
        speeds: adds a copy of every clip at twice the speed and one at half of it (section 3.3.2).
        augmentation: variants of clips made anew in each epoch.
    """

    encoder: EncoderKind = "conv_gru"
    frames: int = 48
    hidden: int = 192
    dropout: float = 0.3
    epochs: int = 120
    batch: int = 64
    learning_rate: float = 2e-3
    weight_decay: float = 0.01
    warm_up: bool = True
    objective: Objective = "contrast"
    contrast: float = 1.0
    temperature: float = 0.1
    neighbours: int = 8
    sharpness: float = 2.0
    margin: float = 1.0
    similar: float = 0.2
    smoothing: float = 0.1
    speeds: bool = False
    augmentation: Augmentation = field(default_factory=Augmentation)


_RECIPES: Final = {
    "default": DescriptorRecipe(),
    # Section 3.3.2: Adam at 1e-3, batches of 128 (NTU) or 8 (HDM05), faster and slower copies. Widths, epochs, margin
    # and thresholds are not given there.
    "deephums": DescriptorRecipe(
        encoder="lstm", frames=0, hidden=256, dropout=0.0, epochs=40, batch=32, learning_rate=1e-3, weight_decay=0.0,
        warm_up=False, objective="pairs", smoothing=0.0, speeds=True, augmentation=NO_AUGMENTATION,
    ),
}  # fmt: skip


def recipe_of(config: DescriptorsConfig) -> DescriptorRecipe:
    """The recipe that a configuration names."""
    recipe = _RECIPES[config.recipe]
    return replace(recipe, epochs=config.epochs) if config.epochs else recipe


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
