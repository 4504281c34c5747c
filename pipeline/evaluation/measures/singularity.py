"""Clips with pieces of other motions in them (PESTA, section 8.4 and Fig. 8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Int64Array

PIECE: Final = 10  # frames


def singular_pieces(
    lengths: Sequence[int], labels: Sequence[str], rate: float, seed: int, piece: int = PIECE
) -> list[Int64Array]:
    """Which pieces of clips are replaced, and by what.

    A clip is cut into pieces from its first frame on (what is left over at its end stays); the given share of them,
    drawn at random, is replaced by pieces drawn at random from clips of other labels. With one seed, what a rate
    replaces a higher rate replaces alike.

    Args:
        lengths: [n] frames of each clip.
        labels: [n].
        rate: share of the pieces, from 0 to 1.
        seed: of the draw.
        piece: frames of a piece.

    Returns:
        Of each clip [r, 3]: first frame of a replaced piece, clip and first frame that it is replaced by; in order.

    Raises:
        ValueError: a rate that is no share, or a clip for which no clip of another label is long enough.
    """
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate of replaced pieces is {rate}, not from 0 to 1")
    sizes, names = np.asarray(lengths), np.asarray(labels)
    found = []
    for clip, length in enumerate(lengths):
        rng = np.random.default_rng([seed, clip])
        count = length // piece
        sources = np.flatnonzero((names != names[clip]) & (sizes >= piece))
        if count and not len(sources):
            raise ValueError(f"no clip of another label than {labels[clip]!r} has {piece} frames to take a piece of")
        places = rng.permutation(count) * piece
        taken = rng.choice(sources, count) if count else np.zeros(0, dtype=np.int64)
        starts = rng.integers(0, sizes[taken] - piece + 1) if count else taken
        rows = np.column_stack([places, taken, starts])[: round(rate * count)]
        found.append(rows[np.argsort(rows[:, 0])].astype(np.int64))
    return found
