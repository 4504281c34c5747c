"""Search in SQL, with the answers of the commands: whole clips like one, ranges of clips like a range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, cast

from motionlake.retrieval.protocol import EVERYTHING, ClipFilter, Hit, Query, Scope, about
from motionlake.retrieval.sql_functions import Served, columns, sql_function

if TYPE_CHECKING:
    from motionlake.retrieval.alignment import AlignmentRangeSearcher
    from motionlake.retrieval.signature import SignatureSearcher

ALL = 2**62  # answers, where k is NULL
CLIP = columns(Hit, "rank", "clip", "distance", "mirrored", "label", "dataset", "seconds")
RANGE = columns(
    Hit, "rank", "clip", "start", "stop", "distance", "mirrored", "label", "dataset", "start_seconds", "seconds"
)
COSTED = columns(
    Hit, "rank", "clip", "start", "stop", "distance", "cost", "mirrored", "label", "dataset", "start_seconds", "seconds"
)
CYCLES = COSTED | columns(Hit, "cycles")
ALIGNED = CYCLES | columns(Hit, "speed")
WINDOWS = {"query_start": int, "query_stop": int} | ALIGNED


@dataclass(frozen=True)
class Part:
    """Frames [start, stop) of a clip, and how many answers there are at most."""

    query: str
    start: int | None = None
    stop: int | None = None
    k: int = 10

    def of(self, served: Served) -> Query:
        return served.query(self.query, self.start, self.stop)


@dataclass(frozen=True)
class Way:
    """How alignment compares; NULL: as config.toml says."""

    stride: int | None = None
    method: str | None = None


AS_CONFIGURED = Way()


@sql_function(CLIP)
def similar_clips(
    served: Served, query: str, k: int | None = 10, method: str = "fused", scope: Scope = EVERYTHING
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
    clips: ClipFilter = EVERYTHING,
) -> list[Hit]:
    """The same for any signature; `without`: a clip that is no answer, `model`: the motifs that it was made with."""
    return _signatures(served).like(
        query_signature,
        ALL if k is None else k,
        Scope(**vars(clips)),
        mirrored=mirrored_signature,
        without=without,
        model=model,
    )


@sql_function(CLIP)
def aligned_clips(
    served: Served, query: str, k: int = 10, way: Way = AS_CONFIGURED, scope: Scope = EVERYTHING
) -> list[Hit]:
    """The clips most like one by alignment, as `motionlake align --whole`."""
    return served.searcher("clip", "alignment", **asdict(way)).search([served.query(query)], k, scope)[0]


@sql_function(RANGE)
def find_motion(served: Served, part: Part, scope: Scope = EVERYTHING) -> list[Hit]:
    """Where frames [start, stop) of a clip occur inside the clips, as `motionlake find`."""
    return served.searcher("range", "fused").search([part.of(served)], part.k, scope)[0]


@sql_function(COSTED)
def find_submotion(served: Served, part: Part, scope: Scope = EVERYTHING) -> list[Hit]:
    """The same by the sub-motion encoder, as `motionlake find --method submotion`."""
    return served.searcher("range", "submotion").search([part.of(served)], part.k, scope)[0]


@sql_function(ALIGNED)
def align_motion(served: Served, part: Part, way: Way = AS_CONFIGURED, scope: Scope = EVERYTHING) -> list[Hit]:
    """The same by alignment, as `motionlake align`."""
    return _aligner(served, way).search([part.of(served)], part.k, scope)[0]


@sql_function(CYCLES)
def align_symbols(
    served: Served, query_symbols: list[int], k: int = 10, way: Way = AS_CONFIGURED, model: str | None = None,
    clips: ClipFilter = EVERYTHING,
) -> list[Hit]:  # fmt: skip
    """The same for a list of symbols; `model` names their dictionary: another than the lake's is an error."""
    return _aligner(served, way).in_symbols(query_symbols, k, Scope(**vars(clips)), model=model)


@sql_function(WINDOWS)
def align_windows(
    served: Served, query: str, window: int = 12, k: int = 10, way: Way = AS_CONFIGURED, clips: ClipFilter = EVERYTHING
) -> Sequence[Hit]:
    """The same for every window of some symbols, sliding over a clip, as `motionlake align --window`."""
    scope = Scope(**vars(clips))
    return _aligner(served, way).long_query(served.query(query), scope, window).windows(window, k)


def _aligner(served: Served, way: Way) -> AlignmentRangeSearcher:
    return cast("AlignmentRangeSearcher", served.searcher("range", "alignment", **asdict(way)))


@sql_function()
def emd(served: Served, p: list[float], q: list[float]) -> float:
    """The earth mover's distance of two signatures."""
    from motionlake.deep_motifs.emd import emd

    with about("emd"):
        return emd(p, q, _signatures(served).ground)


@sql_function()
def emd_deep_motifs(served: Served, p: list[float], q: list[float]) -> float:
    """The paper's variant of it; see `motionlake.deep_motifs.emd.exact`."""
    from motionlake.deep_motifs.emd import emd_deep_motifs

    searcher = _signatures(served)
    with about("emd_deep_motifs"):
        return emd_deep_motifs(p, q, searcher.strength, searcher.ground)


def _signatures(served: Served) -> SignatureSearcher:
    return cast("SignatureSearcher", served.searcher("clip", "signature"))
