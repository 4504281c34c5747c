"""Joint positions of clips of a lake."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
import pyarrow.parquet as pq
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.frames import POSITION_CHANNELS, ROOT_CHANNELS, runs_of
from motionlake.lake.layout import Lake
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
CACHED: Final = 64
_CHANNELS: Final = (*ROOT_CHANNELS, *POSITION_CHANNELS)


class Poses:
    """Reads the canonical positions of clips; the last few stay in memory.

    Attributes:
        positions: of a clip by its name, [F, 21, 3] metres.
    """

    def __init__(self, con: Connection, lake: Lake) -> None:
        self._con, self._lake = con, lake
        self.positions = lru_cache(maxsize=CACHED)(lambda clip: self.many([clip])[clip])

    def many(self, clips: Sequence[str]) -> dict[str, Float32Array]:
        """Positions of several clips, each part of the lake read once."""
        parts: dict[tuple[str, str], list[str]] = defaultdict(list)
        for row in fetch(self._con, "parts_of", {"clips": list(clips)}):
            parts[row["dataset"], row["part"]].append(row["clip"])
        found: dict[str, Float32Array] = {}
        for (dataset, part), members in parts.items():
            path = self._lake.path(self._lake.frames_part(dataset, part))
            table = pq.read_table(path, columns=["clip", *_CHANNELS], filters=[("clip", "in", members)])
            matrix = np.column_stack([table.column(name).to_numpy() for name in _CHANNELS])
            start = 0
            for clip, stop in runs_of(table.column("clip")):
                found[clip] = matrix[start:stop].reshape(stop - start, -1, 3)
                start = stop
        return found

    def sample(self, clip: str, start: int, stop: int, count: int) -> Float32Array:
        """[count, 21, 3] frames evenly spread over the half-open range of a clip's frames, its ends included."""
        return spread(self.positions(clip)[start:stop], count)

    def whole(self, clip: str, count: int) -> Float32Array:
        """[count, 21, 3] frames evenly spread over a clip."""
        return spread(self.positions(clip), count)


def spread(positions: Float32Array, count: int) -> Float32Array:
    """[count, 21, 3] of [F, 21, 3], from the first frame to the last; frames repeat where there are too few."""
    return np.asarray(positions[np.linspace(0, len(positions) - 1, count).round().astype(int)])
