"""Search in words in SQL."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motionlake.lake.layout import Lake
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import EVERYTHING, Scope
from motionlake.retrieval.sql_functions import Served, columns, sql_function
from motionlake.retrieval.sql_functions.searching import ALL

if TYPE_CHECKING:
    from motionlake.retrieval.text import LakeText


@sql_function(columns(Hit, "rank", "clip", "distance", "mirrored", "text", "label", "dataset", "seconds"))
def clips_saying(
    served: Served,
    words: str,
    k: int | None = 10,
    query: str | None = None,
    method: str = "fused",
    scope: Scope = EVERYTHING,
) -> list[Hit]:
    """The clips that say what is asked for, as `motionlake search --text`; `query`: and that are like this one."""
    says: LakeText = served.once(_says)
    most = ALL if k is None else k
    if query is None:
        return says.search(words, most, scope)
    from motionlake.retrieval.text_example import ExampleAndText

    both = ExampleAndText(served.searcher("clip", method), says, words)
    return both.search([served.query(query)], most, scope)[0]


def _says(lake: Lake) -> LakeText:
    from motionlake.retrieval.text import LakeText

    return LakeText(lake)
