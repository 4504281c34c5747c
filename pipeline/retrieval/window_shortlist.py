"""Which clips of a very large lake hold a piece: the shortlist's numbers of its windows choose some, compared exactly.

Along some directions windows keep most of how far they are apart; of the ten clips nearest by vectors, the 120 nearest
by these numbers hold nearly all (docs/scale.md). The shortlist holds their vectors, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
from motionlake.arrays import Float32Array, Int64Array
from motionlake.columns import column_of, texts
from motionlake.kernels import njit
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.known_clips import KnownClips
from motionlake.retrieval.lake_shortlist import LakeShortlist
from motionlake.retrieval.protocol import Scope
from motionlake.retrieval.window_vectors import nearest_among
from motionlake.stages.mapped_part import lists_of
from motionlake.stages.shortlist_files import CLIPS
from motionlake.stages.shortlist_windows import PIECES, ShortlistWindows, kind_of
from motionlake.threads import in_threads
from numpy.typing import NDArray

NEAR: Final = 120  # clips whose vectors are compared
SPARE: Final = 10  # clips beyond those that are asked for whose windows SQL compares
_THREADS: Final = 2


class WindowShortlist:
    """The windows of a lake's shortlist; as `WindowScan`.

    Args:
        clips: of a shortlist.
        windows: of its files.
    """

    def __init__(self, clips: LakeShortlist, windows: ShortlistWindows) -> None:
        self._clips, self._windows = clips, windows

    @property
    def known(self) -> KnownClips:
        """What the catalog says of the clips."""
        return self._clips.known

    @staticmethod
    def open(lake: Lake, files: Sequence[str], clips: LakeShortlist | None = None) -> WindowShortlist | None:
        """None where the shortlist has no windows of the encoder that the lake serves.

        Args:
            lake: the lake.
            files: of its shortlist.
            clips: of these files; read where they are not given, whatever motifs, postures or moves they are of.

        Raises:
            UserError, DamagedError: as `LakeShortlist`.
        """
        with reading(lake) as con:
            kind = kind_of(con)
        windows = ShortlistWindows.open(lake, files, kind)
        if windows is None:
            return None
        return WindowShortlist(clips or LakeShortlist(lake, [file for file in files if file.endswith(CLIPS)]), windows)

    def holding(
        self, con: Connection, descriptor: Float32Array, k: int, scope: Scope, without: Mapping[str, Any]
    ) -> list[dict[str, Any]]:
        """As `WindowScan.holding`, but for clips that are nearer than their numbers tell."""
        near = self.rows_near(descriptor, max(NEAR, k + SPARE), scope)
        held = self._windows.rows.of(near)
        exact = np.array([_nearest(windows["vector"], descriptor) for windows in held], dtype=np.float32)
        return nearest_among(con, self.known, self._rows(near[_least(exact, k + SPARE)]), descriptor, k, without)

    def rows_near(self, descriptor: Float32Array, count: int, scope: Scope) -> Int64Array:
        """The rows, in order, of so many clips whose windows are nearest to a descriptor [512] by their numbers."""
        return _least(self._apart(descriptor) - self._clips.admits(scope.clips), count)

    def _rows(self, clips: Int64Array) -> pa.Table:
        """The windows of some clips, by row, with vectors in single precision."""
        held, names = self._windows.rows.of(clips), self._windows.clips["clip"]
        windows = np.concatenate([np.zeros(0, dtype=PIECES.row), *held])
        named = [names[row].as_py() for row in clips.tolist()]
        columns = [
            texts([name for name, own in zip(named, held, strict=True) for _ in own]),
            *(column_of(windows[bound].astype(np.int64)) for bound in ("start", "stop")),
            lists_of(windows["vector"].astype(np.float32)),
        ]
        return pa.Table.from_arrays(columns, names=["clip", "start", "stop", "descriptor"])

    def _apart(self, descriptor: Float32Array) -> Float32Array:
        """[n] squared distance of the nearest window of each clip, by its numbers; infinite for a clip without."""
        windows = self._windows
        found = np.full(len(windows.starts) - 1, np.inf, dtype=np.float32)
        query = windows.directions.project(descriptor)
        cuts = np.searchsorted(windows.starts, np.linspace(0, windows.starts[-1], _THREADS + 1)).tolist()
        cuts[-1] = len(found)

        def scan(share: int) -> None:
            nearest_of_clips(windows.numbers, windows.starts, query, windows.steps, cuts[share], cuts[share + 1], found)

        in_threads(scan, range(_THREADS), _THREADS)
        return found


def _least(values: Float32Array, count: int) -> Int64Array:
    """The places of the least of some values, so many, in order of places; none that is infinite."""
    count = min(count, int(np.isfinite(values).sum()))
    return np.sort(np.argpartition(values, count - 1)[:count]) if count else np.zeros(0, dtype=np.int64)


def _nearest(vectors: NDArray[np.float16], descriptor: Float32Array) -> float:
    """Squared distance of a descriptor from the nearest of some vectors [w, 512]."""
    apart = vectors.astype(np.float32) - descriptor
    return float(np.einsum("wd,wd->w", apart, apart).min(initial=np.inf))


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def nearest_of_clips(
    places: NDArray[np.int8], starts: Int64Array, query: Float32Array, steps: Float32Array, first: int, last: int,
    found: Float32Array,
) -> None:  # fmt: skip
    """Write of clips [first, last) the squared distance of a query [d] from the nearest row of places [N, d], both in
    steps [d]."""
    for clip in range(first, last):
        least = np.float32(np.inf)
        for row in range(starts[clip], starts[clip + 1]):
            total = np.float32(0.0)
            for i in range(len(query)):
                apart = (np.float32(places[row, i]) - query[i]) * steps[i]
                total += apart * apart
            least = min(least, total)
        found[clip] = least
