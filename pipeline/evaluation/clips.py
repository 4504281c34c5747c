"""What every evaluation on a lake shares: frames of its clips as whole-clip DTW compares them, and the DTW baseline."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final, Protocol

import numpy as np
from motionlake.evaluation.measures.dtw import baseline_features
from motionlake.lake import frames
from motionlake.lake.layout import Lake
from motionlake.motion.clip_dtw import CELLS_PER_SECOND, dtw_matrix, frame_pairs
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Notice = Callable[[str], None]

# Whole-clip DTW is left out by default where it would take longer.
PATIENCE: Final = 300.0


class FramedClip(Protocol):
    """A clip of a lake; `part` holds its frames."""

    @property
    def clip(self) -> str: ...
    @property
    def dataset(self) -> str: ...
    @property
    def part(self) -> str: ...


def clip_features(lake: Lake, clips: Sequence[FramedClip]) -> list[Float32Array]:
    """What DTW compares, of every clip (`baseline_features`)."""
    found = {name: baseline_features(positions, fps) for name, fps, positions in read_positions(lake, clips)}
    return [found[clip.clip] for clip in clips]


def read_positions(lake: Lake, clips: Sequence[FramedClip]) -> Iterator[tuple[str, float, Float64Array]]:
    """Name, rate and canonical joint positions [F, 21, 3] (metres) of clips; each frames part is read once."""
    names = {clip.clip for clip in clips}
    for dataset, part in sorted({(clip.dataset, clip.part) for clip in clips}):
        for clip in frames.read_part(lake.path(lake.frames_part(dataset, part)), names):
            yield clip.clip, clip.fps, clip.positions.astype(np.float64)


def dtw_distances(lake: Lake, clips: Sequence[FramedClip]) -> Float64Array:
    """[n, n] whole-clip DTW between clips of a lake."""
    return dtw_matrix(clip_features(lake, clips))


def dtw_baseline(lake: Lake, clips: Sequence[FramedClip], wanted: bool | None, notice: Notice) -> Float64Array | None:
    """[n, n] the same; None where it is not wanted, or takes longer than `PATIENCE` seconds and is not asked for."""
    if wanted is False:
        return None
    features = clip_features(lake, clips)
    return dtw_matrix(features) if worth_waiting(frame_pairs([len(f) for f in features]), wanted, notice) else None


def worth_waiting(pairs: int, wanted: bool | None, notice: Notice) -> bool:
    """Whether so many frame distances are computed: where asked for, or in at most `PATIENCE` seconds."""
    seconds = pairs / CELLS_PER_SECOND
    if wanted is None and seconds > PATIENCE:
        notice(
            f"whole-clip DTW is left out: it would take about {seconds / 60:.0f} minutes; --baseline dtw computes it"
        )
        return False
    notice(f"whole-clip DTW: about {seconds:.0f} s")
    return True
