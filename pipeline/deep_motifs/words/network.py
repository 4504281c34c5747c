"""Networks that embed motion words (Deep Motifs, section 3.3), by name.

"linear" is the embedding of `linear`. "moves" (the default) is the same of a word with its moves beside it. "conv" is a
small 1-D convolution over time beside a linear path that starts as that embedding: untrained it equals it.
"inception736" follows the paper: an Inception network on the word as an image of frames by features, pooled after its
first convolution as that of FaceNet is, with the 736 channels of its last module (256 + 384 + 96) averaged into a unit
vector.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array
from motionlake.motion.features import WordConfig
from motionlake.motion.moves import SILENT, ends
from motionlake.training import on_threads, read_network, save_network
from torch import Tensor, nn

EMBEDDING: Final = 48
MOVES_COUNT: Final = 1.0  # of the moves of a word beside the word itself


class WordNetwork(nn.Module):
    """Standardises words [n, length, D] and embeds them as [n, d]."""

    mean: Tensor
    scale: Tensor

    def __init__(self, dimension: int, body: nn.Module) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(dimension))
        self.register_buffer("scale", torch.ones(()))
        self.body = body

    def forward(self, words: Tensor) -> Tensor:
        embedded: Tensor = self.body((words - self.mean) / self.scale)
        return embedded


class LinearBody(nn.Module):
    """One matrix on the flattened word."""

    def __init__(self, words: WordConfig, beside: int = 0) -> None:
        super().__init__()
        self.linear = nn.Linear(words.length * (words.dimension + beside), EMBEDDING, bias=False)

    def seen(self, words: Tensor) -> Tensor:
        """[n, E] what the matrix reads of words [n, length, D]."""
        return words.flatten(1)

    def weights(self, seen: Tensor) -> Tensor:
        """[E] how much each number that is `seen` [n, E] counts where the matrix is learned."""
        return torch.ones(seen.shape[1])

    def forward(self, words: Tensor) -> Tensor:
        embedded: Tensor = self.linear(self.seen(words))
        return embedded

    @torch.no_grad()
    def start_from(self, matrix: Tensor) -> None:
        """Make the matrix `matrix` [d, E] (rows beyond are zero)."""
        self.linear.weight.zero_()
        count = min(len(matrix), len(self.linear.weight))
        self.linear.weight[:count] = matrix[:count]


def moves(words: Tensor, posture: int) -> Tensor:
    """[n, length, 2 P] the moves of words [n, length, D]: how far the first P numbers of a frame are from what they are
    where the word begins and ends, and how they change a frame, each over its root mean square in the word."""
    held = words[:, :, :posture]
    away = held - held[:, ends(words.shape[1])].mean(dim=1, keepdim=True)
    change = torch.gradient(held, dim=1)[0] if words.shape[1] > 1 else torch.zeros_like(held)
    parts = (away, change)
    return torch.cat([p / p.square().sum(2).mean(1).sqrt().clamp(min=SILENT)[:, None, None] for p in parts], dim=2)


class MovesBody(LinearBody):
    """One matrix on the flattened word with its moves beside it.

    The word tells how the body stands and how fast it moves; its moves tell what is done, be it largely or a little.
    """

    def __init__(self, words: WordConfig) -> None:
        super().__init__(words, beside=2 * words.posture)
        self._posture, self._plain = words.posture, words.length * words.dimension

    def seen(self, words: Tensor) -> Tensor:
        return torch.cat([words.flatten(1), moves(words, self._posture).flatten(1)], dim=1)

    def weights(self, seen: Tensor) -> Tensor:
        """Words and moves have as much variance, but for `MOVES_COUNT`."""
        parts = ((seen[:, : self._plain], 1.0), (seen[:, self._plain :], MOVES_COUNT))
        return torch.cat([
            torch.full((part.shape[1],), count / max(float(part.var(dim=0).sum()) ** 0.5, SILENT))
            for part, count in parts
        ])  # fmt: skip


class ConvBody(LinearBody):
    """Linear path plus convolutions over time, whose last layer starts at zero."""

    def __init__(self, words: WordConfig, *, width: int = 96) -> None:
        super().__init__(words)
        dimension, reduced = words.dimension, -(-words.length // 2)
        self.convolutions = nn.Sequential(
            nn.Conv1d(dimension, width, 5, stride=2, padding=2),
            nn.GELU(),
            nn.Conv1d(width, width, 3, padding=1),
            nn.GELU(),
            nn.Conv1d(width, width, 3, stride=2, padding=1),
            nn.GELU(),
            nn.Flatten(),
        )
        self.head = nn.Linear(width * -(-reduced // 2), EMBEDDING)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    def forward(self, words: Tensor) -> Tensor:
        learned: Tensor = self.head(self.convolutions(words.transpose(1, 2)))
        return super().forward(words) + learned


def _convolution(inputs: int, outputs: int, kernel: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
    )


class Inception(nn.Module):
    """Parallel 1x1, 3x3, 5x5 and pooled branches, joined along the channels."""

    def __init__(self, inputs: int, one: int, three: tuple[int, int], five: tuple[int, int], pooled: int) -> None:
        super().__init__()
        branches = [
            _convolution(inputs, one, 1),
            nn.Sequential(_convolution(inputs, three[0], 1), _convolution(three[0], three[1], 3)),
            nn.Sequential(nn.MaxPool2d(3, 1, padding=1), _convolution(inputs, pooled, 1)),
        ]
        if five[1]:
            branches.append(nn.Sequential(_convolution(inputs, five[0], 1), _convolution(five[0], five[1], 5)))
        self.branches = nn.ModuleList(branches)

    def forward(self, images: Tensor) -> Tensor:
        return torch.cat([branch(images) for branch in self.branches], dim=1)


class InceptionBody(nn.Module):
    """The word as a one-channel image of frames by features; a unit vector of 736 numbers."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            _convolution(1, 64, 7, stride=2),
            nn.MaxPool2d(3, 2, padding=1),
            Inception(64, 64, (96, 128), (16, 32), 32),
            nn.MaxPool2d(3, 2, padding=1),
            Inception(256, 128, (96, 192), (32, 64), 128),
            nn.MaxPool2d(3, 2, padding=1),
            Inception(512, 256, (96, 384), (0, 0), 96),
            nn.AdaptiveAvgPool2d(1),
            nn.Flatten(),
        )
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # 1.6 times as fast on a CPU

    def forward(self, words: Tensor) -> Tensor:
        return nn.functional.normalize(self.layers(words[:, None]), dim=1)


def build(architecture: str, words: WordConfig) -> WordNetwork:
    """A network by name, with random weights from torch's generator; `ValueError` for an unknown name."""
    bodies: dict[str, Callable[[], nn.Module]] = {
        "moves": lambda: MovesBody(words),
        "linear": lambda: LinearBody(words),
        "conv": lambda: ConvBody(words),
        "inception736": InceptionBody,
    }
    if architecture not in bodies:
        raise ValueError(f"unknown word network {architecture!r}; known are {', '.join(bodies)}")
    return WordNetwork(words.dimension, bodies[architecture]())


METADATA_KEY: Final = "word_network"
# Words are embedded in batches of exactly this many, the last one padded, so that a word's vector does not
# depend on the words beside it.
EMBED_BATCH: Final = 64
TOGETHER: Final = 16 * EMBED_BATCH  # words of clips that are embedded one after the other


@dataclass(frozen=True)
class TrainedNetwork:
    """A word network with what it needs to be used again.

    Attributes:
        network: in evaluation mode.
        architecture: its name.
        words: the words it was trained on.
        metrics: of its training.
    """

    network: WordNetwork
    architecture: str
    words: WordConfig
    metrics: Mapping[str, Any]

    def embed(self, words: Float32Array) -> Float32Array:
        """Embed `words` [n, length, D] as [n, d]; on one thread, each word independent of the others.

        Raises `ValueError` for words of another shape than the network was trained on.
        """
        expected = (self.words.length, self.words.dimension)
        if words.shape[1:] != expected:
            raise ValueError(f"words of shape {words.shape[1:]}, but the network embeds {expected}")
        batches = []
        with on_threads(1), torch.inference_mode():
            for start in range(0, max(len(words), 1), EMBED_BATCH):
                some = words[start : start + EMBED_BATCH]
                batch = np.zeros((EMBED_BATCH, *expected), dtype=np.float32)
                batch[: len(some)] = some
                batches.append(self.network(torch.from_numpy(batch))[: len(some)].numpy())
        return np.concatenate(batches)

    def embed_clips(self, clips: Iterable[tuple[str, Float32Array]]) -> Iterator[tuple[str, Float32Array]]:
        """(clip, [n, d]) for (clip, words [n, length, D]), one after the other; batches hold words of several clips."""
        for names, words in _together(clips):
            vectors = self.embed(words[0] if len(words) == 1 else np.concatenate(words))
            yield from zip(names, np.split(vectors, np.cumsum([len(some) for some in words[:-1]])), strict=True)

    def save(self, path: Path) -> None:
        """Write weights and configuration as one safetensors file."""
        kept = {"architecture": self.architecture, "words": asdict(self.words), "figures": dict(self.metrics)}
        save_network(path, self.network, METADATA_KEY, kept)


def _together(clips: Iterable[tuple[str, Float32Array]]) -> Iterator[tuple[list[str], list[Float32Array]]]:
    """The names of clips and their words, so many clips at a time that their words fill whole batches but for a few."""
    names, words = list[str](), list[Float32Array]()
    for name, some in clips:
        names.append(name)
        words.append(some)
        if sum(map(len, words)) >= TOGETHER:
            yield names, words
            names, words = [], []
    if names:
        yield names, words


def load_network(path: Path) -> TrainedNetwork:
    """Read a network that `TrainedNetwork.save` wrote; `ValueError` where the file holds something else."""
    tensors, kept = read_network(path, METADATA_KEY)
    words = WordConfig(**kept["words"])
    network = build(kept["architecture"], words)
    network.load_state_dict(tensors)
    return TrainedNetwork(network.eval(), kept["architecture"], words, kept["figures"])
