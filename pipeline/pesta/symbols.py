"""The symbol string of a clip: runs and tandem repeats reduced to one instance (PESTA, section 5).

Sample k of a clip stands at k / codes_fps seconds. Each source frame belongs to the sample nearest to it in time (of
two equally near to the later), and thereby to a symbol: the first sample is nearest from frame 0 on, the last one to
the clip's end. The frames of samples that a reduction removes belong to the last symbol kept before them: those of a
run to its symbol, those of the further instances of a tandem repeat to the last symbol of the first instance. Before
the repeats are folded every instance has frames of its own (`UnfoldedString`).

Tandem repeats are those of `motionlake.pesta.tandem`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from motionlake.arrays import Int32Array, Int64Array
from motionlake.motion.resampling import TOLERANCE, sample_count
from motionlake.pesta.config import SymbolsConfig
from motionlake.pesta.tandem import reduce_repeats, reduce_runs


@dataclass(frozen=True)
class SymbolString:
    """The string of a clip or of a range of one; symbol i covers the source frames [starts[i], stops[i]).

    The ranges follow each other without gaps from the first frame to the last. At a clip rate below that of the codes
    a symbol may cover no frame (starts[i] == stops[i]).

    Attributes:
        symbols: int32 [n], n >= 1.
        starts: int64 [n], at the clip's own rate.
        stops: int64 [n].
    """

    symbols: Int32Array
    starts: Int64Array
    stops: Int64Array

    def __len__(self) -> int:
        return len(self.symbols)


@dataclass(frozen=True)
class UnfoldedString:
    """A string before its repeats are folded: r symbols, which a clip's frames follow without leaving one out.

    Attributes:
        symbols: int32 [r], one of each run (of each sample, where runs are kept).
        starts: int64 [r], frames as of `SymbolString`.
        stops: int64 [r].
        kept: int64 [n] places of the symbols that stay, ascending; the first is 0.
    """

    symbols: Int32Array
    starts: Int64Array
    stops: Int64Array
    kept: Int64Array

    @property
    def folded(self) -> SymbolString:
        """The string with each repeat reduced to one instance, which has the frames of all."""
        starts = self.starts[self.kept]
        return SymbolString(self.symbols[self.kept], starts, np.append(starts[1:], self.stops[-1]))

    def part(self, start: int, stop: int, config: SymbolsConfig) -> UnfoldedString:
        """The string of frames [start, stop) of it, reduced for itself."""
        covered = np.flatnonzero((self.starts < stop) & (self.stops > start))
        within = slice(int(covered[0]), int(covered[-1]) + 1)
        starts, stops = np.maximum(self.starts[within], start), np.minimum(self.stops[within], stop)
        return UnfoldedString(self.symbols[within], starts, stops, _kept(self.symbols[within], config))

    def moved(self, frames: int) -> UnfoldedString:
        """The same string of frames so many later."""
        return replace(self, starts=self.starts + frames, stops=self.stops + frames)


def symbolise(codes: Int32Array, *, codes_fps: float, fps: float, n_frames: int, config: SymbolsConfig) -> SymbolString:
    """The symbol string of a clip from the codes of its samples: `unfolded` and then folded."""
    return unfolded(codes, codes_fps=codes_fps, fps=fps, n_frames=n_frames, config=config).folded


def unfolded(
    codes: Int32Array, *, codes_fps: float, fps: float, n_frames: int, config: SymbolsConfig
) -> UnfoldedString:
    """The string of a clip from the codes of its samples, with every instance of its repeats.

    Args:
        codes: int32 [T] dictionary symbols at `codes_fps`, T = floor((n_frames - 1) / fps * codes_fps) + 1.
        codes_fps: samples a second.
        fps: the clip's own rate.
        n_frames: F, the clip's frames at its own rate.
        config: which redundancy is taken out.

    Returns:
        The string, with the correspondence to the clip's frames.

    Raises:
        ValueError: no codes, negative codes, a rate that is not positive, or codes that do not fit the clip's length.
    """
    if codes.ndim != 1 or not np.issubdtype(codes.dtype, np.integer):
        raise ValueError(f"codes are whole numbers in a row, not {codes.dtype} {list(codes.shape)}")
    if len(codes) == 0:
        raise ValueError("a clip without codes has no symbol string")
    if codes.min() < 0:
        raise ValueError(f"symbol {int(codes.min())} is negative")
    if not (fps > 0 and codes_fps > 0):
        raise ValueError(f"the rates are {fps} and {codes_fps} a second, not positive")
    expected = sample_count(n_frames, fps, codes_fps)
    if n_frames < 1 or len(codes) != expected:
        raise ValueError(f"{len(codes)} codes for {n_frames} frames at {fps} a second, not {max(expected, 0)}")
    kept = _kept(codes, config)
    places: Int64Array = reduce_runs(codes) if config.runs else np.arange(len(codes))
    starts = np.ceil((places - 0.5) * (fps / codes_fps) - TOLERANCE).astype(np.int64)
    starts[0] = 0
    stops = np.append(starts[1:], n_frames)
    return UnfoldedString(codes[places].astype(np.int32), starts, stops, np.searchsorted(places, kept))


def _kept(codes: Int32Array, config: SymbolsConfig) -> Int64Array:
    """[k] places of the samples that stay, the first of them 0."""
    runs: Int64Array = reduce_runs(codes)
    if config.runs:
        return runs[reduce_repeats(codes[runs])] if config.repeats else runs
    if not config.repeats:
        return np.arange(len(codes))
    lengths = np.diff(runs, append=len(codes))
    stays = np.zeros(len(runs), dtype=np.bool_)
    stays[reduce_repeats(codes[runs] * (lengths.max() + 1) + lengths)] = True
    return np.flatnonzero(np.repeat(stays, lengths))
