"""A trained second network: from pieces of motion, and clips, to vectors of which the nearest belong together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from motionlake.arrays import Float32Array
from motionlake.deephums.submotions.config import SubmotionConfig
from motionlake.deephums.submotions.encoder import embed_pieces, network_of
from motionlake.network_file import read_network, save_network
from torch import nn

METADATA_KEY: Final = "submotion_network"


@dataclass(frozen=True)
class TrainedSubmotion:
    """A frozen network.

    Attributes:
        config: how it was trained.
        network: in evaluation mode, on the CPU.
        figures: of its training.
    """

    config: SubmotionConfig
    network: nn.Module
    figures: Mapping[str, Any]

    def embed(self, sequences: Sequence[Float32Array]) -> Float32Array:
        """[n, 512] vectors, of length one, of n pieces or windows (`clip_sequence`), each independent of the others."""
        return embed_pieces(self.network, sequences)

    def save(self, path: Path) -> None:
        """Write it as one safetensors file."""
        kept = {"config": asdict(self.config), "figures": dict(self.figures)}
        save_network(path, self.network, METADATA_KEY, kept)


def load_submotion(path: Path) -> TrainedSubmotion:
    """Read what `TrainedSubmotion.save` wrote.

    Raises:
        ValueError: the file holds something else.
    """
    tensors, kept = read_network(path, METADATA_KEY)
    config = SubmotionConfig(**kept["config"])
    network = network_of(config)
    network.load_state_dict(tensors)
    return TrainedSubmotion(config, network.eval(), kept["figures"])
