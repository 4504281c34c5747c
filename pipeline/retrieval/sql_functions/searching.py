"""Search in SQL, with the answers of the commands: whole clips like one, ranges of clips like a range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, cast

import pyarrow as pa
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import EVERYTHING, ClipFilter, Query, Scope, about
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
STEPS = pa.list_(pa.struct([(name, pa.list_(pa.int64())) for name in ("query", "clip")]))  # as `PathStep`
CROSSED = columns(Hit, "stop_clip") | {"path": STEPS}
CYCLES = COSTED | columns(Hit, "cycles") | CROSSED
ALIGNED = COSTED | columns(Hit, "cycles", "speed") | CROSSED
WINDOWS = {"query_start": int, "query_stop": int} | ALIGNED


@dataclass(frozen=True)
class Part:
    """Frames [start, stop) of a clip, and how many answers there are at most; NULL for k: all."""

    query: str
    start: int | None = None
    stop: int | None = None
    k: int | None = 10

    def of(self, served: Served) -> Query:
        return served.query(self.query, self.start, self.stop)

    @property
    def most(self) -> int:
        return _most(self.k)


@dataclass(frozen=True)
class Way:
    """How alignment compares; NULL: as config.toml says. `path`: say which frames match which."""

    stride: int | None = None
    method: str | None = None
    path: bool = False
    gaps: bool | None = None

    @property
    def options(self) -> dict[str, Any]:
        """For a searcher."""
        return {"paths" if name == "path" else name: value for name, value in asdict(self).items()}


@dataclass(frozen=True)
class RangeWay(Way):
    """How ranges are found by alignment; `boundaries` of clips: "kept" (NULL), "crossed" or "dropped"."""

    boundaries: str | None = None


@dataclass(frozen=True)
class ClipWay(Way):
    """How whole clips are ranked by alignment; `ways`: of both "max" (NULL), "mean" or "query", one way alone."""

    ways: str | None = None


@dataclass(frozen=True)
class Near(ClipFilter):
    """Which clips may be answers to what is not a clip, or to parts of one; `below`: the distance they are nearer than;
    `own`: parts of the clip itself may be answers to others."""

    own: bool = False
    below: float | None = None

    @property
    def scope(self) -> Scope:
        return Scope(**vars(self))


AS_CONFIGURED, WHOLE_AS_CONFIGURED = RangeWay(), ClipWay()
ANYWHERE = Near()


@sql_function(CLIP)
def similar_clips(
    served: Served, query: str, k: int | None = 10, method: str = "fused", scope: Scope = EVERYTHING
) -> list[Hit]:
    """The clips most like one, as `motionlake search`; NULL for k: all."""
    return served.searcher("clip", method).search([served.query(query)], _most(k), scope)[0]


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
        _most(k),
        Scope(**vars(clips)),
        mirrored=mirrored_signature,
        without=without,
        model=model,
    )


@sql_function(CLIP | {"path": STEPS})
def aligned_clips(
    served: Served,
    query: str,
    k: int | None = 10,
    way: ClipWay = WHOLE_AS_CONFIGURED,
    scope: Scope = EVERYTHING,
    start: int | None = None,
    stop: int | None = None,
) -> list[Hit]:
    """The clips most like one, or like frames [start, stop) of it, by alignment, as `motionlake align --whole`."""
    asked = served.query(query, start, stop)
    return served.searcher("clip", "alignment", **way.options).search([asked], _most(k), scope)[0]


@sql_function(RANGE)
def find_motion(served: Served, part: Part, scope: Scope = EVERYTHING) -> list[Hit]:
    """Where frames [start, stop) of a clip occur inside the clips, as `motionlake find`."""
    return served.searcher("range", "fused").search([part.of(served)], part.most, scope)[0]


@sql_function(COSTED)
def find_submotion(served: Served, part: Part, scope: Scope = EVERYTHING) -> list[Hit]:
    """The same by the sub-motion encoder, as `motionlake find --method submotion`."""
    return served.searcher("range", "submotion").search([part.of(served)], part.most, scope)[0]


@sql_function(ALIGNED)
def align_motion(served: Served, part: Part, way: RangeWay = AS_CONFIGURED, scope: Scope = EVERYTHING) -> list[Hit]:
    """The same by alignment, as `motionlake align`."""
    return _aligner(served, way).search([part.of(served)], part.most, scope)[0]


@sql_function(CYCLES)
def align_symbols(
    served: Served, query_symbols: list[int], k: int | None = 10, way: RangeWay = AS_CONFIGURED,
    model: str | None = None, near: Near = ANYWHERE,
) -> list[Hit]:  # fmt: skip
    """The same for a list of symbols; `model` names their dictionary: another than the lake's is an error."""
    return _aligner(served, way).in_symbols(query_symbols, _most(k), near.scope, model=model)


@sql_function(WINDOWS)
def align_windows(
    served: Served,
    query: str,
    window: int = 12,
    k: int | None = 10,
    way: RangeWay = AS_CONFIGURED,
    near: Near = ANYWHERE,
    start: int | None = None,
    stop: int | None = None,
) -> Sequence[Hit]:
    """The same for every window of some symbols, sliding over a clip or frames [start, stop) of it, as `motionlake
    align --window`."""
    asked = served.query(query, start, stop)
    return _aligner(served, way).long_query(asked, near.scope, window).windows(window, _most(k), paths=way.path)


def _aligner(served: Served, way: RangeWay) -> AlignmentRangeSearcher:
    return cast("AlignmentRangeSearcher", served.searcher("range", "alignment", **way.options))


def _most(k: int | None) -> int:
    return ALL if k is None else k


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
    return cast("SignatureSearcher", served.searcher("clip", "signature", exact=True))
