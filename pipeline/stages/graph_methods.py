"""What the methods of the default search compare for the neighbour graph: all clips of a lake with one another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final, Protocol

import numpy as np
from motionlake.arrays import Float32Array, Float64Array, Int64Array
from motionlake.deephums.exact import ExactScan
from motionlake.deephums.scans import scan_of
from motionlake.lake.catalog import fetch
from motionlake.lake.corpus import read_descriptors, read_signatures
from motionlake.motion.sketches import instants
from motionlake.pesta.config import AlignmentConfig
from motionlake.stages.moves import tracks_in
from motionlake.stages.reader import LakeReader
from motionlake.stages.shortlist_files import INSTANTS, string_sketch
from motionlake.stages.stage import Shard
from numpy.typing import ArrayLike

Found = tuple[ArrayLike, ArrayLike]


class Search(Protocol):
    """Finds the k nearest of some clips to the clip at a place, itself among them or not."""

    def __call__(self, place: int, k: int) -> Found:
        """Which of those clips, counted among them, nearest first and ties by place; and their distances."""
        ...


@dataclass(frozen=True)
class Compared:
    """Clips that a method compares.

    Attributes:
        clips: by name, in order.
        among: the search among the clips at some places [m], ascending, for many searches.
        few: the k nearest to the clip at a place among those at some others [m], ascending, as `among` finds them.
        vectors: makes [n, D], whose distances follow those of the method, all of them finite.
    """

    clips: Sequence[str]
    among: Callable[[Int64Array], Search]
    few: Callable[[int, Int64Array, int], Found]
    vectors: Callable[[], Float32Array]

    def nearest(self, rows: Int64Array) -> Callable[[int, int], tuple[Int64Array, Float64Array]]:
        """Of a place and k: the places of the k nearest among those at `rows`, without itself, and their distances."""
        search = self.among(rows) if len(rows) else None
        return lambda place, k: _others(place, k, rows, search(place, k + 1) if search else ((), ()))

    def nearest_of(self, place: int, rows: Int64Array, k: int) -> tuple[Int64Array, Float64Array]:
        """The same for one search."""
        return _others(place, k, rows, self.few(place, rows, k + 1) if len(rows) else ((), ()))


def _others(place: int, k: int, rows: Int64Array, found: Found) -> tuple[Int64Array, Float64Array]:
    near, apart = rows[np.array(found[0], dtype=np.int64)], np.array(found[1], dtype=np.float64)
    others = np.flatnonzero(near != place)[:k]
    return near[others], apart[others]


def _by_signature(at: LakeReader, _: Shard) -> Compared:
    from motionlake.deep_motifs.emd import ground_distances
    from motionlake.deep_motifs.emd_search import SignatureIndex

    motifs, clips, signatures = read_signatures(at.con)
    index = SignatureIndex.build(signatures, ground_distances(np.array([m["centroid"] for m in motifs], np.float32)))

    def few(place: int, rows: Int64Array, k: int) -> Found:
        found = index.nearest(signatures[place], k, rows)
        return np.searchsorted(rows, found.indices), found.distances

    def among(rows: Int64Array) -> Search:
        return lambda place, k: few(place, rows, k)

    return Compared([clip.clip for clip in clips], among, few, lambda: index.projected)


def _by_alignment(at: LakeReader, shard: Shard) -> Compared:
    from motionlake.lake.strings import read_strings
    from motionlake.pesta.nearest import nearest_strings
    from motionlake.pesta.strings import Repository

    strings, config = read_strings(at.con), AlignmentConfig(**shard.spec["alignment"])
    every = strings.repository

    def among(rows: Int64Array) -> Search:
        repository = every if len(rows) == len(every) else Repository.of([every.string(row) for row in rows.tolist()])
        own = {row: at for at, row in enumerate(rows.tolist())}

        def nearest(place: int, k: int) -> Found:
            symbols = every.string(place)
            if len(symbols) < 2:  # a posture that is held is found anywhere
                return (), ()
            found = nearest_strings(
                symbols, repository, strings.distances, k, config, without=own.get(place), threads=1
            )
            return [other for other, _ in found], [cost for _, cost in found]

        return nearest

    def vectors() -> Float32Array:
        codes = np.array([row["code"] for row in fetch(at.con, "posture_codes")], dtype=np.float64)
        return np.stack([string_sketch(every.string(row), codes) for row in range(len(every))])

    return Compared([clip.clip for clip in strings.clips], among, lambda place, rows, k: among(rows)(place, k), vectors)


def _by_moves(at: LakeReader, shard: Shard) -> Compared:
    from motionlake.motion.moves_index import MovesIndex

    live = {row["clip"] for row in fetch(at.con, "clips_with_parts")}
    tracks = dict(pair for file in shard.spec["moves"] for pair in tracks_in(at.lake, file) if pair[0] in live)
    clips = sorted(tracks)
    moves = [tracks[clip].moves() for clip in clips]

    def among(rows: Int64Array) -> Search:
        index = MovesIndex([moves[row] for row in rows.tolist()])
        return lambda place, k: index.nearest(moves[place], k)

    every = cache(lambda: MovesIndex(moves))

    def few(place: int, rows: Int64Array, k: int) -> Found:
        found = every().nearest(moves[place], k, rows)
        return np.searchsorted(rows, found.indices), found.distances

    return Compared(clips, among, few, lambda: np.stack([instants(each, INSTANTS).ravel() for each in moves]))


def _by_descriptor(at: LakeReader, _: Shard) -> Compared:
    clips, descriptors = read_descriptors(at.con)

    def among(rows: Int64Array) -> Search:
        scan = scan_of(descriptors[rows])

        def nearest(place: int, k: int) -> Found:
            found = scan.nearest(descriptors[place], k)
            return found.indices[0], found.distances[0]

        return nearest

    def few(place: int, rows: Int64Array, k: int) -> Found:
        found = ExactScan(descriptors[rows]).nearest(descriptors[place], k)
        return found.indices[0], found.distances[0]

    return Compared([clip.clip for clip in clips], among, few, lambda: descriptors)


COMPARE: Final[Mapping[str, Callable[[LakeReader, Shard], Compared]]] = {
    "signature": _by_signature,
    "alignment": _by_alignment,
    "moves": _by_moves,
    "descriptor": _by_descriptor,
}
