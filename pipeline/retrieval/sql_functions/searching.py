"""Search in SQL, with the answers of the commands: whole clips like one, ranges of clips like a range."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from motionlake.retrieval.protocol import EVERYTHING, Hit, Scope
from motionlake.retrieval.sql_functions import Served, columns, sql_function

if TYPE_CHECKING:
    from motionlake.retrieval.alignment import AlignmentRangeSearcher
    from motionlake.retrieval.signature import SignatureSearcher

ALL = 2**62  # answers, where k is NULL
CLIP = columns(Hit, "rank", "clip", "distance", "mirrored", "label", "dataset", "seconds")
RANGE = columns(
    Hit, "rank", "clip", "start", "stop", "distance", "mirrored", "label", "dataset", "start_seconds", "seconds"
)
ALIGNED = columns(
    Hit, "rank", "clip", "start", "stop", "distance", "cost", "mirrored", "label", "dataset", "start_seconds", "seconds"
)


@sql_function(CLIP)
def similar_clips(
    served: Served, query: str, k: int | None = 10, method: str = "signature", scope: Scope = EVERYTHING
) -> list[Hit]:
    """The clips most like one, as `motionlake search`; NULL for k: all."""
    return served.searcher("clip", method).search([served.query(query)], ALL if k is None else k, scope)[0]


@sql_function(CLIP)
def clips_like(
    served: Served,
    query_signature: list[float],
    k: int | None = 10,
    mirrored_signature: list[float] | None = None,
    without: str | None = None,
    model: str | None = None,
    dataset: str | None = None,
    split: str | None = None,
    recorded_only: bool = False,
) -> list[Hit]:
    """The same for any signature; `without`: a clip that is no answer, `model`: the motifs that it was made with."""
    return _signatures(served).like(
        query_signature, ALL if k is None else k, Scope(dataset, split, recorded_only), mirrored=mirrored_signature,
        without=without, model=model,
    )  # fmt: skip


@sql_function(CLIP)
def aligned_clips(
    served: Served,
    query: str,
    k: int = 10,
    stride: int | None = None,
    method: str | None = None,
    scope: Scope = EVERYTHING,
) -> list[Hit]:
    """The clips most like one by alignment, as `motionlake align --whole`."""
    return served.searcher("clip", "alignment", stride=stride, method=method).search([served.query(query)], k, scope)[0]


@sql_function(RANGE)
def find_motion(
    served: Served,
    query: str,
    start: int | None = None,
    stop: int | None = None,
    k: int = 10,
    scope: Scope = EVERYTHING,
) -> list[Hit]:
    """Where frames [start, stop) of a clip occur inside the clips, as `motionlake find`."""
    return served.searcher("range", "words").search([served.query(query, start, stop)], k, scope)[0]


@sql_function(ALIGNED)
def find_submotion(
    served: Served,
    query: str,
    start: int | None = None,
    stop: int | None = None,
    k: int = 10,
    scope: Scope = EVERYTHING,
) -> list[Hit]:
    """The same by the sub-motion encoder, as `motionlake find --method submotion`."""
    return served.searcher("range", "submotion").search([served.query(query, start, stop)], k, scope)[0]


@sql_function(ALIGNED)
def align_motion(
    served: Served,
    query: str,
    start: int | None = None,
    stop: int | None = None,
    k: int = 10,
    stride: int | None = None,
    method: str | None = None,
    scope: Scope = EVERYTHING,
) -> list[Hit]:
    """The same by alignment, as `motionlake align`."""
    asked = [served.query(query, start, stop)]
    return served.searcher("range", "alignment", stride=stride, method=method).search(asked, k, scope)[0]


@sql_function(ALIGNED)
def align_symbols(
    served: Served,
    query_symbols: list[int],
    k: int = 10,
    stride: int | None = None,
    method: str | None = None,
    model: str | None = None,
    dataset: str | None = None,
    split: str | None = None,
    recorded_only: bool = False,
) -> list[Hit]:
    """The same for a list of symbols; `model` names their dictionary: another than the lake's is an error."""
    searcher = cast("AlignmentRangeSearcher", served.searcher("range", "alignment", stride=stride, method=method))
    return searcher.in_symbols(query_symbols, k, Scope(dataset, split, recorded_only), model=model)


@sql_function()
def emd(served: Served, p: list[float], q: list[float]) -> float:
    """The earth mover's distance of two signatures."""
    from motionlake.deep_motifs.emd import emd

    return emd(p, q, _signatures(served).ground)


@sql_function()
def emd_deep_motifs(served: Served, p: list[float], q: list[float]) -> float:
    """The paper's variant of it; see `motionlake.deep_motifs.emd.exact`."""
    from motionlake.deep_motifs.emd import emd_deep_motifs

    searcher = _signatures(served)
    return emd_deep_motifs(p, q, searcher.strength, searcher.ground)


def _signatures(served: Served) -> SignatureSearcher:
    return cast("SignatureSearcher", served.searcher("clip", "signature"))
