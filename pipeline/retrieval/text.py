"""Search in words: what the clips of a lake say of themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from motionlake.arrays import BoolArray, Float64Array, Int64Array
from motionlake.deep_motifs.signatures import CorpusClip
from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, fetch_table, reading
from motionlake.lake.layout import Lake
from motionlake.lake.verdicts import good_clips
from motionlake.retrieval.hits import Hit, clip_hit, ranked
from motionlake.retrieval.protocol import EVERYTHING, ClipFilter, check_k
from motionlake.retrieval.text_index import Asked, TextIndex
from motionlake.retrieval.text_words import numbers, terms, words

Encoder: TypeAlias = Callable[[Sequence[str]], Any]  # n texts to [n, d] numbers, near where they mean the same
ENCODERS: Final = "motionlake.text_encoders"  # entry points of packages that bring one
LONGEST: Final = 100  # words of a query
_CLIP: Final = ("clip", "dataset", "label", "subject", "split", "fps", "frames", "synthetic")


@dataclass(frozen=True)
class Answers:
    """How the n clips of a lake answer a text.

    Attributes:
        near: [n] from 0, not at all, to 1, as the best does.
        asked: what was asked for.
    """

    near: Float64Array
    asked: Asked

    def best(self, k: int) -> list[int]:
        """The k clips that answer best, by their places; ties in their order."""
        order = np.argsort(-self.near, kind="stable")[:k]
        return [int(place) for place in order if self.near[place] > 0]


class LakeText:
    """What the clips of a lake say: in columns of labels.csv, segments, names of files and datasets.

    A clip is as near as its score by `TextIndex` over the greatest of any clip; its distance is one less that. A number
    counts for the clips whose name or subject has it. With an encoder, near is the mean of this and of the cosine of
    what was asked and what the clip says.

    Args:
        lake: which is read here, once.
        encoder: turns texts into vectors.
    """

    def __init__(self, lake: Lake, encoder: Encoder | None = None) -> None:
        self._lake, self._encoder = lake, encoder
        with reading(lake) as con:
            self._rows = fetch_table(con, "clip_texts").combine_chunks()
        said = self._rows["says"].combine_chunks().dictionary_encode()
        self._said: Int64Array = np.from_dlpack(said.indices).astype(np.int64)  # not `to_numpy`, which imports pandas
        self._texts: list[str] = said.dictionary.to_pylist()

    def search(self, text: str, k: int, scope: ClipFilter = EVERYTHING) -> list[Hit]:
        """The k clips that answer a text best, ties by name; fewer where fewer answer it.

        Raises:
            UserError: no words in the text, or too many.
        """
        check_k(k)
        answers = self.answers(text, scope)
        return ranked(self.hits(answers, answers.best(k)))

    def answers(self, text: str, scope: ClipFilter = EVERYTHING) -> Answers:
        """How every clip answers; those that may be no answers do not. Raises `UserError` as `search`."""
        asked_for, counted = words(text), dict.fromkeys(numbers(text))
        if not asked_for and not counted:
            raise UserError("the text to search for has no word that says what is looked for")
        if len(asked_for) + len(counted) > LONGEST:
            raise UserError(f"the text to search for has {len(asked_for) + len(counted)} words; the most is {LONGEST}")
        asked = self._index.asked(text)
        scores = self._index.scores(asked)[self._said]
        for number in counted:
            scores += self._numbered(number)
        near = scores / max(scores.max(initial=0.0), np.finfo(np.float64).tiny)
        if self._encoder is not None:
            meant = np.maximum(self._vectors @ _unit(self._encoder, [text])[0], 0.0)
            near = (near + meant[self._said]) / 2
        return Answers(np.where(self._admitted(scope), near, 0.0), asked)

    def hits(self, answers: Answers, places: Sequence[int]) -> list[Hit]:
        """Clips as answers, with what they say of what was asked for; not ranked yet."""
        rows = self._rows.select(_CLIP).take(np.array(places, dtype=np.int64)).to_pylist()
        clips = [CorpusClip(**row) for row in rows]
        with reading(self._lake) as con:
            says = {row["clip"]: row for row in fetch(con, "said_by_clips", {"clips": [clip.clip for clip in clips]})}
        wanted = {one for each in answers.asked for one in each}
        return [
            replace(clip_hit(clip, 1 - float(answers.near[place])), text=_met(wanted, says.get(clip.clip)))
            for clip, place in zip(clips, places, strict=True)
        ]

    @cached_property
    def places(self) -> dict[str, int]:
        """The place of every clip by its name."""
        return {clip: place for place, clip in enumerate(self._rows["clip"].to_pylist())}

    def _admitted(self, scope: ClipFilter) -> BoolArray:
        found = np.ones(len(self._rows), dtype=bool)
        for column in ("dataset", "split"):
            wanted = getattr(scope, column)
            if wanted is not None:
                found &= _true(pc.equal(self._rows[column], wanted))
        if scope.recorded_only:
            found &= ~_true(self._rows["synthetic"])
        if scope.min_quality is not None:
            with reading(self._lake) as con:
                good = good_clips(con, scope.min_quality)
            found &= np.array([clip in good for clip in self._rows["clip"].to_pylist()], dtype=bool)
        return found

    def _numbered(self, number: str) -> Float64Array:
        """[n] how much a number counts for each clip: the more, the fewer have it, as BM25 has it."""
        pattern = rf"(^|[^0-9])0*{number}([^0-9]|$)"
        named = [pc.match_substring_regex(self._rows[column], pattern) for column in ("clip", "subject")]
        has = np.logical_or(*map(_true, named)).astype(np.float64)
        return np.asarray(has * np.log1p((len(has) - has.sum() + 0.5) / (has.sum() + 0.5)))

    @cached_property
    def _index(self) -> TextIndex:
        return TextIndex([text.splitlines() for text in self._texts])

    @cached_property
    def _vectors(self) -> Float64Array:
        """[m, d] of what clips say, of length 1."""
        assert self._encoder is not None
        return _unit(self._encoder, [", ".join(text.splitlines()) for text in self._texts])


def encoder_named(name: str) -> Encoder:
    """An encoder that an installed package brings, by the name of its entry point.

    Raises:
        UserError: none has that name, or it cannot be loaded.
    """
    from importlib.metadata import entry_points

    found = entry_points(group=ENCODERS)
    if name not in found.names:
        there = ", ".join(sorted(found.names)) or "none; install a package that brings one"
        raise UserError(f"encoder {name}: no installed package has it; there are {there}")
    try:
        encoder: Encoder = found[name].load()
    except Exception as error:  # whatever a foreign package does
        raise UserError(f"encoder {name}: cannot be loaded ({error})") from error
    return encoder


def _true(column: pa.ChunkedArray) -> BoolArray:
    """[n] where a column of Arrow is true; not where it is NULL."""
    return np.from_dlpack(pc.fill_null(column, False).combine_chunks().cast(pa.int8())).astype(bool)


def _unit(encoder: Encoder, texts: Sequence[str]) -> Float64Array:
    """[n, d] vectors of texts, of length 1; those of length 0 as they are."""
    found = np.asarray(encoder(texts), dtype=np.float64)
    if found.ndim != 2 or len(found) != len(texts) or not np.isfinite(found).all():
        raise UserError(f"the encoder must give {len(texts)} texts a row of finite numbers each, not {found.shape}")
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), np.finfo(np.float64).tiny))


def _met(wanted: set[str], says: dict[str, Any] | None) -> str | None:
    """What of a clip's columns and segments was asked for; "name" where only its name was."""
    if says is None:
        return None
    parts = [(name, said) for name, said in sorted(says["columns"].items()) if said is not None]
    parts += [("segment", said) for said in says["segments"]]
    met = [f"{name}: {said}" for name, said in parts if wanted.intersection(terms(said))]
    name = wanted.intersection(terms(says["clip"]))
    return "; ".join(met) or ("name" if name else None)
