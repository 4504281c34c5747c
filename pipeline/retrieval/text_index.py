"""An index over what clips say of themselves, ranked by BM25."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.retrieval.text_words import Spelling, concepts, terms_of, thesaurus, words

if TYPE_CHECKING:
    import bm25s

Asked: TypeAlias = Sequence[Mapping[str, float]]  # terms that stand for one thing each, and what each counts


class TextIndex:
    """BM25 (Robertson and Zaragoza, 2009) of texts, by words without endings, synonyms and pieces of words.

    Every term of a text counts once, however often the text says it: a label that also names folder and file says no
    more than one that does not. For each thing that a query asks for (`concepts`) a text gets the best of the terms
    that stand for it, and the sum over all of them.

    Args:
        texts: the parts of each, such as a label and a name; words of two parts make no pair. Texts that are the same
            should come once, since how rare a word is follows from them.
    """

    def __init__(self, texts: Sequence[Sequence[str]]) -> None:
        known: dict[str, int] = {}
        parts: dict[str, list[int]] = {}  # many texts have folders in common
        said: set[str] = set()
        ids = []
        for text in texts:
            for part in text:
                if part not in parts:
                    found = words(part)
                    said.update(found)
                    parts[part] = [known.setdefault(one, len(known)) for one in terms_of(found)]
            ids.append(list(dict.fromkeys(one for part in text for one in parts[part])))
        self._ids, self._known, self._said = ids, known, said

    def asked(self, query: str) -> Asked:
        """What a query asks for, in terms of this index."""
        return concepts(query, self._known, self._spelling)

    def scores(self, asked: Asked) -> Float64Array:
        """[n] how well each text answers; 0 where it does not at all."""
        found = np.zeros(len(self._ids))
        for each in asked:
            found += self._answered(each)
        return found

    def _answered(self, each: Mapping[str, float]) -> Float64Array:
        """[n] how well each text answers one thing that is asked for.

        A rare word would count more than the common one that was asked for and that it only stands for: it does not.
        """
        scores = {one: self._bm25(one) for one in each}
        most = min((scores[one].max() for one, counts in each.items() if counts == 1), default=np.inf)
        return np.asarray(
            np.max([scores[one] * counts * min(1, most / scores[one].max()) for one, counts in each.items()], axis=0)
        )

    def _bm25(self, term: str) -> Float64Array:
        return np.asarray(self._index.get_scores_from_ids([self._known[term]]), dtype=np.float64)

    @cached_property
    def _index(self) -> bm25s.BM25:
        import bm25s
        from bm25s.tokenization import Tokenized

        made = bm25s.BM25(b=0.1)
        made.index(Tokenized(self._ids, dict(self._known)), create_empty_token=False, show_progress=False)
        return made

    @cached_property
    def _spelling(self) -> Spelling:
        return Spelling(self._said | thesaurus().spelled)
