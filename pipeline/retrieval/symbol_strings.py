"""Queries as symbols, and the strings of clips before their repeats are folded: what alignment on a lake looks for, and
where it finds it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from motionlake.arrays import BoolArray, Int32Array
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading, remembered
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.loaded import loaded
from motionlake.lake.settings import served_config
from motionlake.lake.strings import LakeStrings
from motionlake.motion.features import word_features
from motionlake.pesta.config import DICTIONARY_KEY, PosturesConfig, SymbolsConfig
from motionlake.pesta.cycles import repeated
from motionlake.pesta.symbols import UnfoldedString, unfolded
from motionlake.retrieval.encode import QueryMotion, query_motion
from motionlake.retrieval.protocol import Query, about
from motionlake.retrieval.string_queries import StringQuery, string_query
from motionlake.stages.postures import codes_of_clips
from motionlake.weights import read_tensors

if TYPE_CHECKING:
    from motionlake.pesta.dictionary import PostureDictionary

Codes: TypeAlias = Callable[[Sequence[str]], Mapping[str, Int32Array]]
KEPT: Final = 1000  # clips whose unfolded strings are remembered
EVERY: Final = [SymbolsConfig(runs, repeats) for runs in (True, False) for repeats in (True, False)]


def served_dictionary(lake: Lake, model: str) -> PostureDictionary:
    """The dictionary of that name. Raises `UserError` for one that an earlier version made."""
    from motionlake.pesta.dictionary import load_dictionary

    try:
        return loaded(load_dictionary, lake, model_file(lake, model))
    except ValueError as error:
        raise UserError(str(error)) from error


def model_file(lake: Lake, model: str) -> str:
    """The file of a model of that name, relative to the lake."""
    return str(
        remembered(lake, f"file of {model}", partial(fetch, name="model_file", parameters={"model": model}))[0]["file"]
    )


def encoded(lake: Lake, query: Query, dictionary: PostureDictionary, *, mirrored: bool = False) -> StringQuery:
    """The symbols of a clip file, of a clip mirrored, or of a range: those of a file that holds these frames alone.

    Raises:
        UserError: no such clip or file, it has no such frames, or these are one symbol.
    """
    used = dictionary.config.frames.reads_rotations
    motion = query_motion(lake, query, mirrored=mirrored, rotations=used)
    with about(query.name):
        string = _coded(lake, motion, dictionary)
    return string_query(query.name, string, motion.fps, query.clip)


def _coded(lake: Lake, motion: QueryMotion, dictionary: PostureDictionary) -> UnfoldedString:
    """The string of the frames that are asked for."""
    coding, (start, stop) = dictionary.config, motion.asked
    codes = dictionary.encode(word_features(*motion.cut(), motion.fps, coding.frames))
    found = unfolded(
        codes, codes_fps=coding.fps, fps=motion.fps, n_frames=stop - start, config=served_config(lake).symbols
    )
    return found.moved(start)


class ClipStrings:
    """The strings of a lake's clips with every cycle of their repeats, from the codes that stage "postures" keeps.

    Args:
        lake: the lake.
        strings: of its clips.
        codes: gives the codes of some clips; None: they are read from parts.
    """

    def __init__(self, lake: Lake, strings: LakeStrings, codes: Codes | None = None) -> None:
        self._lake, self._strings, self._codes = lake, strings, codes
        self._known: dict[str, UnfoldedString] = {}

    @cached_property
    def dictionary(self) -> PostureDictionary:
        """The dictionary that the strings are over."""
        return served_dictionary(self._lake, self._strings.model)

    def of(self, clip: str) -> UnfoldedString:
        """That of a clip. Raises `UserError` as `read`."""
        if clip not in self._known:
            self.read([clip])
        return self._known[clip]

    def of_query(self, query: StringQuery) -> UnfoldedString | None:
        """That of a query; None of symbols that have no frames. Raises `UserError` as `read`."""
        return self.of(query.clip) if query.unfolded is None and query.clip is not None else query.unfolded

    def read(self, clips: Sequence[str]) -> None:
        """Remember those of some clips, which are read together.

        Raises:
            UserError: the lake's string of one is not of its postures.
        """
        missing = [clip for clip in dict.fromkeys(clips) if clip not in self._known]
        if not missing:
            return
        if self._codes is not None:
            codes = self._codes(missing)
        else:
            with reading(self._lake) as con:
                codes = codes_of_clips(con, self._lake, self._strings.model, missing)
        if len(self._known) + len(missing) > KEPT:
            self._known.clear()
        for clip in missing:
            self._known[clip] = self._made(clip, codes.get(clip))

    def _made(self, clip: str, codes: Int32Array | None) -> UnfoldedString:
        """By the settings that the lake's string was made with, should config.toml have others by now."""
        index = self._strings.positions[clip]
        known, served = self._strings.clips[index], self._strings.string_of(index)
        if codes is None:  # they are being made anew
            motion, coding = query_motion(self._lake, Query(clip)), self.dictionary.config.frames
            codes = self.dictionary.encode(word_features(*motion.cut(), motion.fps, coding))
        for config in EVERY:
            with about(clip):
                found = unfolded(codes, codes_fps=self._fps, fps=known.fps, n_frames=known.frames, config=config)
            folded = found.folded
            if np.array_equal(folded.symbols, served.symbols) and np.array_equal(folded.starts, served.starts):
                return found
        raise UserError(f"{clip}: its symbol string is not of its postures; make it anew with `motionlake run all`")

    @cached_property
    def _fps(self) -> float:
        """Codes a second. Not by `dictionary`: no encoder is needed, nor torch."""
        _, kept = read_tensors(sound(self._lake, model_file(self._lake, self._strings.model)), DICTIONARY_KEY, "codes")
        return PosturesConfig(**kept["config"]).fps


def barred_symbols(strings: LakeStrings, query: StringQuery, clips: ClipStrings) -> BoolArray | None:
    """[Y] the symbols of the query's own frames in its own clip; None where it is not among the strings.

    Those that stand for several cycles are not barred: not all of these need be in the query.
    """
    index = strings.positions.get(query.clip) if query.clip else None
    if query.clip is None or index is None:
        return None
    string, own = clips.of(query.clip), strings.symbols_of(index)
    starts, stops = string.starts[string.kept], string.stops[string.kept]
    barred = np.zeros(len(strings.repository.symbols), dtype=np.bool_)
    barred[own] = (starts < query.stop) & (stops > query.start) & ~repeated(string)
    return barred
