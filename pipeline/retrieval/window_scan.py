"""Which clips of a lake hold a piece: their windows' codes are scanned, and the nearest clips compared exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from motionlake.arrays import BoolArray, Float32Array, Int64Array
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.integrity import sound_files
from motionlake.lake.layout import Lake
from motionlake.retrieval.known_clips import KnownClips
from motionlake.retrieval.protocol import Scope
from motionlake.retrieval.window_codes import CodedPiece, codes_of_files, overlapping
from motionlake.retrieval.window_vectors import holding_among
from motionlake.stages.windows import WindowFile
from motionlake.threads import in_threads

SPARE: Final = 16  # clips that are compared exactly beyond those that are asked for
_THREADS: Final = 2


@dataclass(frozen=True)
class WindowScan:
    """The codes of all windows of a lake.

    Attributes:
        parts: codes by frames part.
        vectors: by frames part, the file of the vectors themselves, relative to the lake.
        clips: the clips of the lake, by frames part.
        known: what the catalog says of them.
    """

    lake: Lake
    parts: Mapping[str, WindowFile]
    vectors: Mapping[str, str]
    clips: Mapping[str, frozenset[str]]
    known: KnownClips

    @staticmethod
    def open(lake: Lake, con: Connection) -> WindowScan | None:
        """None where there are windows of which the stage has made no codes yet, or none at all.

        Raises:
            DamagedError: a file is not as it was written.
        """
        rows = fetch(con, "window_files")
        if not rows or len(codes_of_files(rows)) < len(rows):
            return None
        paths = sound_files(lake, [row["codes"] for row in rows])
        held: dict[str, set[str]] = {row["part"]: set() for row in rows}
        known = KnownClips.read(con)
        clips = known.table
        for clip, part in zip(clips["clip"].to_pylist(), clips["part"].to_pylist(), strict=True):
            if part in held:
                held[part].add(clip)
        return WindowScan(
            lake,
            {row["part"]: WindowFile.open(path) for row, path in zip(rows, paths, strict=True)},
            {row["part"]: row["vectors"] for row in rows},
            {part: frozenset(own) for part, own in held.items()},
            known,
        )

    def holding(
        self, con: Connection, descriptor: Float32Array, k: int, scope: Scope, without: Mapping[str, Any]
    ) -> list[dict[str, Any]]:
        """The k clips nearest to a descriptor [512], as the macro `clips_holding` gives them.

        Args:
            con: to the catalog.
            without: `clip`, `first`, `last`: windows of this clip that overlap these frames are no answer.
        """
        near = self.near(con, descriptor, k + SPARE, scope, without)
        return holding_among(self.lake, con, self.known, self.vectors, descriptor, k, without, near)

    def near(
        self, con: Connection, descriptor: Float32Array, count: int, scope: Scope, without: Mapping[str, Any]
    ) -> dict[str, str]:
        """So many clips, nearest first, with the part of each, as codes tell how near they are to a descriptor [512].

        Args:
            con, without: as of `holding`.
        """
        admitted = None
        if scope.as_parameters(con) != Scope().as_parameters(con):
            admitted = {row["clip"] for row in fetch(con, "clips_admitted", scope.as_parameters(con))}
        return self._nearest(descriptor, count, admitted, without)

    def _nearest(
        self, descriptor: Float32Array, count: int, admitted: set[str] | None, without: Mapping[str, Any]
    ) -> dict[str, str]:
        """The clips nearest by codes, with the part of each."""
        piece = CodedPiece.of(descriptor)
        runs = self._runs
        distances = np.empty(runs.offsets[-1])

        def scan(parts: range) -> None:
            for part in parts:
                file = runs.files[part]
                squares = piece.apart(file)
                if (own := file.runs.get(without["clip"])) is not None:
                    squares[own][overlapping(file, own, without)] = np.inf
                np.minimum.reduceat(squares, runs.starts[part], out=distances[slice(*runs.offsets[part : part + 2])])

        middle = len(runs.files) // 2
        in_threads(scan, (range(middle), range(middle, len(runs.files))), _THREADS)
        distances[~runs.live] = np.inf
        chosen: dict[str, str] = {}
        for at in np.argsort(distances, kind="stable").tolist():
            if len(chosen) == count or not np.isfinite(distances[at]):
                break
            part, clip = runs.names[at]
            if admitted is None or clip in admitted:
                chosen[clip] = part
        return chosen

    @cached_property
    def _runs(self) -> _Runs:
        names = [(part, clip) for part, file in self.parts.items() for clip in file.runs]
        files = [file for file in self.parts.values() if file.runs]
        return _Runs(
            files,
            [np.array([run.start for run in file.runs.values()], dtype=np.int64) for file in files],
            np.cumsum([0, *(len(file.runs) for file in files)]),
            names,
            np.array([clip in self.clips[part] for part, clip in names], dtype=np.bool_),
        )


@dataclass(frozen=True)
class _Runs:
    """The clips of all parts, one after another, c in all.

    Attributes:
        files: parts that hold windows.
        starts: of each, the rows at which those of its clips begin.
        offsets: the clips of part i are `offsets[i]:offsets[i + 1]` of all.
        names: [c] part and clip.
        live: [c] which the lake holds.
    """

    files: Sequence[WindowFile]
    starts: Sequence[Int64Array]
    offsets: Int64Array
    names: Sequence[tuple[str, str]]
    live: BoolArray
