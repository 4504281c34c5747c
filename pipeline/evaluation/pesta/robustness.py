"""Clips with pieces of other motions in them (section 8.4, Fig. 8): MAP by the share of replaced pieces.

Pieces of a twelfth of a second (the paper's ten frames at 120 a second) are replaced in canonical frames, before
anything is computed; each is moved and turned about the vertical so that its first frame stands and faces as the one
that it replaces: what is singular is the posture and how it moves, not the place. Every clip is replaced, queries and
repository alike. The dictionary is that of the lake.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array, Int64Array
from motionlake.evaluation.pesta.framed import Framed, coded, read_framed
from motionlake.evaluation.pesta.measuring import SEED, WHOLE_STRIDE, Measuring
from motionlake.evaluation.ranking import others, ranked_relevance, relatives, score_rankings
from motionlake.lake.settings import served_config
from motionlake.motion.rotations import turn_on_ground
from motionlake.motion.skeleton import INDEX, facing
from motionlake.pesta.config import METHODS, Method
from motionlake.pesta.nearest import symmetric_costs
from motionlake.retrieval.protocol import about
from motionlake.retrieval.symbol_strings import served_dictionary

PIECE: Final = 10  # frames
SECONDS: Final = 1 / 12  # of a piece
RATES: Final = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)


def measure_robustness(measuring: Measuring) -> dict[str, Any] | None:
    """By method and share of replaced pieces ("0", "0.1", …): map, nn, p_at_5, and kept, its MAP as a share of that
    without replaced pieces. None where no two clips share a label, or all do.

    Raises:
        UserError: no clip of another class is as long as a piece.
    """
    chosen, strings, lake = measuring.chosen.labelled(), measuring.strings, measuring.lake
    labels = chosen.labels
    if len(set(labels)) in (1, len(labels)):
        return None
    known = read_framed(lake, chosen.clips)
    dictionary, reduced = served_dictionary(lake, strings.model), served_config(lake).symbols
    found: dict[Method, dict[str, Any]] = {method: {} for method in METHODS}
    for rate in RATES:
        measuring.options.notice(f"{rate:.0%} of the pieces of {len(known)} clips replaced")
        with about(f"{rate:.0%} replaced"):
            replaced = singular_clips(known, labels, rate, SEED)
        own = coded(dictionary, replaced, [clip.postures(dictionary.config.frames) for clip in replaced], reduced)
        for method, rows in found.items():
            costs = symmetric_costs(own, strings.distances, measuring.alignment(method, WHOLE_STRIDE))
            scores = score_rankings(ranked_relevance(costs, relatives(labels), others(len(labels))))
            row = {"map": scores.map, "nn": scores.nn, "p_at_5": scores.p_at_5, "n": scores.n}
            rows[f"{rate:g}"] = row | {"kept": scores.map / rows["0"]["map"] if rate else 1.0}
    return {str(method): rows for method, rows in found.items()}


def piece_of(clip: Framed) -> int:
    """Frames of a piece."""
    return max(1, round(SECONDS * clip.fps))


def singular_clips(clips: Sequence[Framed], labels: Sequence[str], rate: float, seed: int) -> list[Framed]:
    """Clips with a share of their pieces replaced by pieces of clips of other labels."""
    sizes = [piece_of(clip) for clip in clips]
    pieces = singular_pieces([len(clip.positions) for clip in clips], labels, rate, seed, sizes)
    found = []
    for clip, rows in zip(clips, pieces, strict=True):
        positions, rotations = clip.positions.copy(), clip.rotations.copy()
        for at, source, start in rows.tolist():
            other = clips[source]
            taken = np.linspace(start, start + piece_of(other) - 1, piece_of(clip)).round().astype(np.int64)
            own = slice(at, at + piece_of(clip))
            positions[own] = placed(other.positions[taken], clip.positions[at])
            rotations[own] = other.rotations[taken]
        found.append(replace(clip, positions=positions, rotations=rotations))
    return found


def singular_pieces(
    lengths: Sequence[int], labels: Sequence[str], rate: float, seed: int, pieces: Sequence[int] | int = PIECE
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
        pieces: [n] frames of a piece of each clip, or one number for all.

    Returns:
        Of each clip [r, 3]: first frame of a replaced piece, clip and first frame that it is replaced by; in order.

    Raises:
        ValueError: a rate that is no share, or a clip for which no clip of another label is long enough.
    """
    if not 0 <= rate <= 1:
        raise ValueError(f"the rate of replaced pieces is {rate}, not from 0 to 1")
    sizes, names = np.asarray(lengths), np.asarray(labels)
    of_each = np.broadcast_to(np.asarray(pieces), sizes.shape)
    found = []
    for clip, piece in enumerate(of_each.tolist()):
        rng = np.random.default_rng([seed, clip])
        count = lengths[clip] // piece
        sources = np.flatnonzero((names != names[clip]) & (sizes >= of_each))
        if count and not len(sources):
            raise ValueError(f"no clip of another label than {labels[clip]!r} has {piece} frames to take a piece of")
        places = rng.permutation(count) * piece
        taken = rng.choice(sources, count) if count else np.zeros(0, dtype=np.int64)
        starts = rng.integers(0, sizes[taken] - of_each[taken] + 1) if count else taken
        rows = np.column_stack([places, taken, starts])[: round(rate * count)]
        found.append(rows[np.argsort(rows[:, 0])].astype(np.int64))
    return found


def placed(piece: Float64Array, frame: Float64Array) -> Float64Array:
    """A piece [n, 21, 3] whose first frame has its hips above those of a `frame` [21, 3] and faces as it does."""
    turn = float(facing(frame[None])[0] - facing(piece[:1])[0])
    hips = piece[0, INDEX["hips"]]
    x, z = turn_on_ground(piece[..., 0] - hips[0], piece[..., 2] - hips[2], turn)
    at = frame[INDEX["hips"]]
    return np.stack([x + at[0], piece[..., 1], z + at[2]], axis=-1)
