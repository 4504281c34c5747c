"""Texts as words: cut apart, without endings, beside the words that mean the same or are spelled nearly alike."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import pairwise
from typing import Any, Final

# Where words that are written together end: walkLeft, BVHFile, a letter beside a number.
_HUMPS: Final = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_WORDS: Final = re.compile(r"[^\W\d_]+")
_NUMBERS: Final = re.compile(r"[0-9]+")
SAME, KIND = 0.8, 0.6  # what a word that means the same counts, and one that is a kind of it; the word itself 1
PART = 0.5  # a word of which the one that was asked for is a part
_ALIKE: Final = 0.5  # of the pieces of two words, below which they are not taken for one
_LEAST: Final = 4  # letters of a word that may be misspelled, or a part of another


def words(text: str) -> list[str]:
    """The words of a text or a name, in their order, in small letters, without those that say nothing."""
    plain = text if text.isascii() else unicodedata.normalize("NFKC", text)
    apart, stop = _HUMPS.sub(" ", plain).casefold(), _stop()
    return [word for word in _WORDS.findall(apart) if word not in stop]


def numbers(text: str) -> list[str]:
    """The numbers in a text, without leading zeros."""
    return [found.lstrip("0") or "0" for found in _NUMBERS.findall(unicodedata.normalize("NFKC", text))]


@cache
def stem(word: str) -> str:
    """A word without its ending, as Porter's English stemmer has it."""
    return str(_stemmer().stemWord(word))


def terms(text: str) -> list[str]:
    """What a text is found by: its words without endings, and each with the one that follows it, as "walk left"."""
    return terms_of(words(text))


def terms_of(said: Iterable[str]) -> list[str]:
    """The same of words in their order."""
    found = [stem(word) for word in said]
    return [*found, *map(" ".join, pairwise(found))]


@cache
def _stemmer() -> Any:
    import Stemmer

    return Stemmer.Stemmer("english")


@dataclass(frozen=True)
class Thesaurus:
    """Terms that stand for others, with what each counts.

    Attributes:
        near: the others by term.
        spelled: words of the table, to which misspelled ones may be led.
    """

    near: Mapping[str, Mapping[str, float]]
    spelled: frozenset[str]


@cache
def _table() -> dict[str, Any]:
    return tomllib.loads(files(__package__).joinpath("synonyms.toml").read_text(encoding="utf-8"))


@cache
def _stop() -> frozenset[str]:
    return frozenset(" ".join(_table()["stop"]).split())


@cache
def thesaurus() -> Thesaurus:
    """The table that comes with the program."""
    table = _table()
    near: defaultdict[str, dict[str, float]] = defaultdict(dict)
    groups = [[term(entry) for entry in line.split(",")] for line in table["same"]]
    for group in groups:
        for one in group:
            near[one].update((other, SAME) for other in group if other != one)
    for head, line in table["kinds"].items():
        for entry in line.split(","):
            near[term(head)].setdefault(term(entry), KIND)
    lines = [*table["same"], *table["kinds"], *table["kinds"].values()]
    return Thesaurus(near, frozenset(word for line in lines for word in words(line)))


def term(entry: str) -> str:
    """A word or a pair of words as the term that it is in an index."""
    return " ".join(stem(word) for word in words(entry))


class Spelling:
    """Finds words that are spelled nearly alike, by the pieces of two and three letters that they share.

    Args:
        known: the words that may be meant.
    """

    def __init__(self, known: Iterable[str]) -> None:
        self._words = sorted(set(known))
        self._pieces = [_pieces(word) for word in self._words]
        self._with: defaultdict[str, list[int]] = defaultdict(list)
        for place, pieces in enumerate(self._pieces):
            for piece in pieces:
                self._with[piece].append(place)

    def alike(self, word: str) -> dict[str, float]:
        """The words most like one, with how much of the pieces of both they share (Dice), up to 1."""
        if len(word) < _LEAST:
            return {}
        pieces = _pieces(word)
        shared = Counter(place for piece in pieces for place in self._with.get(piece, ()))
        found = {
            self._words[place]: 2 * count / (len(pieces) + len(self._pieces[place])) for place, count in shared.items()
        }
        best = max(found.values(), default=0.0)
        return {other: value for other, value in found.items() if value >= max(_ALIKE, best - 0.05)}

    def parts(self, word: str) -> list[str]:
        """The words of which one is a part, such as "swordplay" of "sword"."""
        if len(word) < _LEAST:
            return []
        pieces = _pieces(word, edges=False)
        places = set.intersection(*(set(self._with.get(piece, ())) for piece in pieces))
        return [self._words[place] for place in sorted(places) if word in self._words[place] != word]


def _pieces(word: str, *, edges: bool = True) -> set[str]:
    whole = f"^{word}$" if edges else word
    return {whole[i : i + n] for n in (2, 3) for i in range(len(whole) - n + 1)}


def concepts(query: str, known: Mapping[str, int], spelling: Spelling) -> list[dict[str, float]]:
    """What a query asks for: terms of an index that stand for one thing each, with what each of them counts.

    A word stands for itself, for what means the same, and for longer words of which it is a part; a word that neither
    the index nor the table has stands for those that are spelled nearly alike. Two words that follow one another stand
    for the pair, at half of what a word counts, for the word that both make together, and for what means the same.

    Args:
        query: as it was typed.
        known: the terms of the index.
        spelling: of the words of the index and of the table.
    """
    table, asked = thesaurus(), words(query)
    found = [_of_word(word, known, table, spelling) for word in asked]
    for left, right in pairwise(asked):
        pair = f"{stem(left)} {stem(right)}"
        found.append({pair: 0.5, stem(left + right): 1.0, **table.near.get(pair, {})})
    kept = [{one: value for one, value in each.items() if one in known} for each in found]
    return [each for each in kept if each]


def _of_word(word: str, known: Mapping[str, int], table: Thesaurus, spelling: Spelling) -> dict[str, float]:
    meant = {stem(word): 1.0}
    if stem(word) not in known and stem(word) not in table.near:
        for other, value in (spelling.alike(word) | spelling.alike(stem(word))).items():
            meant[stem(other)] = max(value, meant.get(stem(other), 0.0))
    found = dict(meant)
    for one, value in meant.items():
        for other, near in table.near.get(one, {}).items():
            found[other] = max(found.get(other, 0.0), value * near)
    for longer in spelling.parts(word):
        found.setdefault(stem(longer), PART)
    return found
