"""Strided temporal alignment on a lake (PESTA): a range of a clip, or a whole clip, looked for in every clip."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, Unpack

import numpy as np
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.config import load_config
from motionlake.lake.layout import Lake
from motionlake.motion.features import word_features
from motionlake.pesta.alignment.long_query import LongQuery
from motionlake.pesta.alignment.matches import best_matches, nearest_strings
from motionlake.pesta.alignment.scan import Both
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.symbols import symbolise
from motionlake.retrieval.aligned import (
    AlignedHit,
    StringQuery,
    WholeHit,
    aligned_hits,
    barred_symbols,
    query_of_symbols,
    string_query,
    whole_hits,
)
from motionlake.retrieval.encode import first_body
from motionlake.retrieval.lake_strings import LakeStrings, read_strings
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from motionlake.pesta.dictionary import PostureDictionary


class Wanted(TypedDict, total=False):
    """How a query is answered.

    Attributes:
        dataset: from its clips only.
        method, stride: others than those of config.toml.
        crossing: a match may begin in one clip and end in a later one.
        paths: give every match its path.
    """

    dataset: str | None
    method: str | None
    stride: int | None
    crossing: bool
    paths: bool


class Aligner:
    """Queries to the strings of a lake, read once; `strings` where they have been read already.

    Args:
        con: to the lake.
        lake: which holds the dictionary and the configuration.
        strings: of the lake.
        threads: which share a scan; answers do not depend on their number.
        real: synthetic clips are no answers.
    """

    def __init__(
        self,
        con: Connection,
        lake: Lake,
        strings: LakeStrings | None = None,
        *,
        threads: int = 1,
        real: bool = False,
    ) -> None:
        self._con, self._lake, self._threads, self._real = con, lake, threads, real
        self.strings = strings or read_strings(con)
        self._config = load_config(lake.config_file)

    def in_clip(
        self, clip: str, start: int | None, stop: int | None, k: int, **wanted: Unpack[Wanted]
    ) -> list[AlignedHit]:
        """The k best matches of frames [start, stop) of a clip of the lake that do not overlap these or one another.

        Args:
            clip: its full name.
            start, stop: at its own rate; None for its first and its last.
            k: how many at most.

        Raises:
            UserError: the clip has no string yet, there are no such frames, they are one symbol, or a setting is unfit.
        """
        return self._align(self._of_clip(clip, start, stop), k, wanted)

    def in_file(
        self, path: Path, start: int | None, stop: int | None, k: int, **wanted: Unpack[Wanted]
    ) -> list[AlignedHit]:
        """The same for frames of a clip file (its first body), which need not be in the lake.

        Raises:
            UserError: as `in_clip`; the file cannot be read.
        """
        return self._align(self._of_file(path, start, stop), k, wanted)

    def in_symbols(
        self, symbols: ArrayLike, k: int, *, model: str | None = None, **wanted: Unpack[Wanted]
    ) -> list[AlignedHit]:
        """The same for a string over the lake's dictionary (`model`, where its name is known).

        In paths, the query's frames are its symbols.

        Raises:
            UserError: an empty string, one symbol, a string over another dictionary, or a setting is unfit.
        """
        check_dictionary(model, self.strings.model)
        return self._align(query_of_symbols(np.asarray(symbols, dtype=np.int32)), k, wanted)

    def whole(
        self,
        query: str | Path,
        k: int,
        *,
        dataset: str | None = None,
        both: Both = "max",
        method: str | None = None,
        stride: int | None = None,
    ) -> list[WholeHit]:
        """The k clips nearest to a whole clip of the lake (its name), or to a clip file (a path).

        A clip's cost is that of its best match, for each symbol of the query. A short query is found in many clips, so
        the clip is sought in the query as well.

        Args:
            query: the clip, itself left out, or the file.
            k, dataset, method, stride: as in `in_clip`.
            both: the greater ("max") or the mean of both ways; "query" seeks the query in the clips alone.

        Raises:
            UserError: as in `in_clip` and `in_file`.
        """
        asked, strings = self._of(query), self._among(dataset)
        own = strings.positions.get(asked.clip) if asked.clip else None
        try:
            found = nearest_strings(
                asked.symbols, strings.repository, strings.distances, k, self._alignment(method, stride), both=both,
                without=own, threads=self._threads,
            )  # fmt: skip
        except ValueError as error:
            raise UserError(f"{asked.name}: {error}") from error
        return whole_hits(strings, found)

    def long_query(
        self, query: str | Path, *, dataset: str | None = None, method: str | None = None, stride: int | None = None
    ) -> LongAlignment:
        """A whole clip of the lake, or a clip file, whose ranges will be asked for (section 7).

        Raises:
            UserError: as in `in_clip` and `in_file`; Smith-Waterman.
        """
        asked, strings = self._of(query), self._among(dataset)
        try:
            kept = LongQuery(
                asked.symbols, strings.repository, strings.distances, self._alignment(method, stride)
            )  # fmt: skip
        except ValueError as error:
            raise UserError(f"{asked.name}: {error}") from error
        return LongAlignment(asked, strings, kept)

    def asked(self, query: str | Path, start: int | None = None, stop: int | None = None) -> StringQuery:
        """The symbols of frames [start, stop) of a clip of the lake (its name), or of a clip file (a path).

        Raises:
            UserError: as in `in_clip` and `in_file`.
        """
        return self._of_file(query, start, stop) if isinstance(query, Path) else self._of_clip(query, start, stop)

    @cached_property
    def _dictionary(self) -> PostureDictionary:
        from motionlake.pesta.dictionary import load_dictionary

        rows = fetch(self._con, "model_file", {"model": self.strings.model})
        return load_dictionary(self._lake.path(rows[0]["file"]))

    def _of(self, query: str | Path) -> StringQuery:
        return self._of_file(query, None, None) if isinstance(query, Path) else self._of_clip(query, None, None)

    def _of_clip(self, clip: str, start: int | None, stop: int | None) -> StringQuery:
        strings = self.strings
        if clip not in strings.positions:
            raise UserError(f"{clip}: has no symbol string yet; make it with `motionlake run all`")
        index = strings.positions[clip]
        return string_query(clip, strings.string_of(index), strings.clips[index].frames, start, stop, clip)

    def _of_file(self, path: Path, start: int | None, stop: int | None) -> StringQuery:
        body, motion = first_body(self._lake, path)
        coding, frames = self._dictionary.config, len(motion.positions)
        codes = self._dictionary.encode(word_features(motion.positions, motion.rotations, body.fps, coding.frames))
        reduced = self._config.symbols
        string = symbolise(codes, codes_fps=coding.fps, fps=body.fps, n_frames=frames, config=reduced)
        return string_query(str(path), string, frames, start, stop)

    def _among(self, dataset: str | None) -> LakeStrings:
        return self.strings.among(dataset, real=self._real)

    def _alignment(self, method: str | None, stride: int | None) -> AlignmentConfig:
        given = {name: value for name, value in (("method", method), ("stride", stride)) if value is not None}
        try:
            return replace(self._config.alignment, **given)  # type: ignore[arg-type]
        except ValueError as error:
            raise UserError(str(error)) from error

    def _align(self, query: StringQuery, k: int, wanted: Wanted) -> list[AlignedHit]:
        config = self._alignment(wanted.get("method"), wanted.get("stride"))
        strings, crossing = self._among(wanted.get("dataset")), wanted.get("crossing", False)
        try:
            matches = best_matches(
                query.symbols, strings.repository, strings.distances, k, config,
                boundaries="crossed" if crossing else "kept", barred=barred_symbols(strings, query),
                paths=wanted.get("paths", False), threads=self._threads,
            )  # fmt: skip
        except ValueError as error:
            raise UserError(f"{query.name}: {error}") from error
        return aligned_hits(strings, query, matches, path_from=query.first, crossing=crossing)


class LongAlignment:
    """A long query, of which every segment is aligned at most once: ask it for as many ranges as you like."""

    def __init__(self, query: StringQuery, strings: LakeStrings, kept: LongQuery) -> None:
        self._query, self._strings, self._kept = query, strings, kept

    def matches(self, start: int | None, stop: int | None, k: int, *, paths: bool = False) -> list[AlignedHit]:
        """The k best matches of frames [start, stop) of the long query, at its own rate.

        Raises:
            UserError: there are no such frames, or they are one symbol.
        """
        whole = self._query
        part = string_query(whole.name, whole.string, whole.stop, start, stop, whole.clip)
        barred = barred_symbols(self._strings, part)
        found = self._kept.best_matches(part.first, part.last, k, barred=barred, paths=paths)
        return aligned_hits(self._strings, part, found, path_from=0)


def check_dictionary(model: str | None, served: str) -> None:
    """Raises `UserError` where a string is over another dictionary: strings over two do not compare."""
    if model is not None and model != served:
        raise UserError(f"a string over {model} does not compare with strings over {served}; make it again")
