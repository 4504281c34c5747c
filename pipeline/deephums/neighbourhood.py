"""Where a clip lies in the neighbour graph of the clips that were trained on, guessed from its sketch.

Two clips of one kind may look unlike, while a chain of clips lies between them, each near the next: along the graph
they are near (`way_between`). For clips trained on, this is worked out from alignments of their moves. For any other,
kernel ridge regression from the sketches to the rows of that table says how near it would be to each of them; nothing
is learned by gradients.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array
from motionlake.deephums.sketch import Sketch, principal
from torch import Tensor, nn
from torch.nn.functional import normalize

BREADTH: Final = 0.025  # of the kernel exp((cosine - 1) / BREADTH)
RIDGE: Final = 0.3
MOST_EXAMPLES: Final = 5_000  # clips or windows of them; of more, so many are drawn
KEPT: Final = 32  # nearest clips of a clip among which those that are joined to it are found


class Neighbourhood(nn.Module):
    """How near clips are along the graph to those trained on, in the directions in which this differs most.

    Args:
        width: numbers that come out, and of the sketches that go in.

    Attributes:
        sketch: its directions are learned too.
        examples: [n, width] sketches, of length one, of the n clips trained on.
        ways: [n, width] what each contributes.
    """

    examples: Tensor
    ways: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.sketch = Sketch(width)
        self._hold(torch.zeros(0, width), torch.zeros(0, width))

    def learn(self, clips: Tensor, near: Tensor) -> None:
        """From clips [n, 48, 15, 3], and [n, n] how near they are to one another."""
        self.sketch.learn(clips)
        examples = self._examples(clips)
        kernel = _kernel(examples.double(), examples.double())
        weights = torch.linalg.solve(kernel + RIDGE * torch.eye(len(kernel)), near.double())
        directions = principal(normalize(kernel @ weights, dim=1), self.examples.shape[1])
        self._hold(examples, (weights @ directions.T).float())

    def forward(self, clips: Tensor, _lengths: Tensor | None = None) -> Tensor:
        """[B, width] of clips [B, 48, 15, 3]; `lengths` is not used."""
        found = self._examples(clips)
        # The length of what comes out does not count, so that a row of the kernel may be divided by its sum: a clip
        # that is like none of the examples is taken for one like the nearest.
        return torch.softmax(found @ self.examples.T / BREADTH, dim=1) @ self.ways

    def _examples(self, clips: Tensor) -> Tensor:
        return normalize(self.sketch(clips), dim=1)

    def _hold(self, examples: Tensor, ways: Tensor) -> None:
        self.register_buffer("examples", examples)
        self.register_buffer("ways", ways)

    def _load_from_state_dict(self, state: dict[str, Any], prefix: str, *given: Any) -> None:
        """How many clips were trained on, the file says."""
        kept = [state.get(f"{prefix}{name}") for name in ("examples", "ways")]
        if all(isinstance(one, Tensor) and one.ndim == 2 for one in kept):
            self._hold(*(torch.zeros(one.shape) for one in kept if one is not None))
        super()._load_from_state_dict(state, prefix, *given)


def _kernel(one: Tensor, other: Tensor) -> Tensor:
    """[n, m] of sketches [n, d] and [m, d] of length one."""
    return torch.exp((one @ other.T - 1) / BREADTH)


def neighbourhoods(
    clips: Sequence[Float32Array], joined: int, progress: Callable[[int, int], None] | None = None
) -> Float32Array:
    """[n, n] how near clips [T, 15, 3] are along the graph in which each is joined to so many (`way_between`).

    Args:
        clips: two at least, as `clip_sequence` has them.
        joined: neighbours that a clip is joined to, at most.
        progress: called with (clips done, clips) whose neighbours are found.
    """
    from motionlake.motion.diffusion import way_between
    from motionlake.motion.moves import Track, at_12
    from motionlake.motion.moves_index import MovesIndex

    moves = [Track.of(at_12(clip)).moves() for clip in clips]
    index = MovesIndex(moves)
    apart: Float64Array = np.full((len(moves), len(moves)), np.inf)
    for row, clip in enumerate(moves):
        found = index.nearest(clip, KEPT + 1)
        apart[row, found.indices] = found.distances
        if progress:
            progress(row + 1, len(moves))
    apart = np.minimum(apart, apart.T)
    np.fill_diagonal(apart, 0)
    return way_between(apart, joined).astype(np.float32)
