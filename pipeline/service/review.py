"""What a person should look at: clips whose label would teach most, pairs that are one recording, faulty ranges."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from motionlake.arrays import Float64Array
from motionlake.lake.annotations import Annotation
from motionlake.lake.catalog import fetch, reading
from motionlake.retrieval.hits import Hit
from motionlake.retrieval.protocol import EVERYTHING, Finds, Scope, Searcher
from motionlake.retrieval.protocol import Query as Asked
from motionlake.retrieval.suggestions import LabelSuggester
from motionlake.service.clips import plain
from motionlake.service.served import Served, annotations_of, serving_of

router = APIRouter(prefix="/api", tags=["review"])
ASKED: Final = 200  # clips without a label that are looked at together
ANEW: Final = 10  # labels that people give until the queue is made anew
Count = Annotated[int, Query(ge=1, le=500)]


class InTurn:
    """A searcher that takes its turn with every search, so that others come between."""

    def __init__(self, served: Served, finds: Finds, name: str) -> None:
        self._served, self.finds, self.name = served, finds, name

    def search(self, queries: Sequence[Asked], k: int, scope: Scope = EVERYTHING) -> list[list[Hit]]:
        """As `Searcher.search`."""
        with self._served.searching():
            return self._searcher().search(queries, k, scope)

    def distances(self, queries: Sequence[Asked], gallery: Sequence[Asked]) -> Float64Array:
        """As `Searcher.distances`."""
        with self._served.searching():
            return self._searcher().distances(queries, gallery)

    def _searcher(self) -> Searcher:
        return self._served.searcher(self.finds, self.name)


@dataclass(frozen=True)
class Learner(LabelSuggester):
    """Suggests labels for some of the clips that have none, and learns from what people said too.

    Attributes:
        own: labels that people gave, by clip.
    """

    own: Mapping[str, str] = field(default_factory=dict)

    def _rows(self) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        rows, teach = super()._rows()
        said = [{**row, "label": self.own[row["clip"]]} for row in rows if row["clip"] in self.own]
        unknown = [row for row in rows if row["label"] is None and row["clip"] not in self.own]
        unknown.sort(key=lambda row: hashlib.sha256(row["clip"].encode()).digest())
        kept = [row for row in teach if row["clip"] not in self.own]
        return unknown[:ASKED], [*kept, *said]


@router.get("/suggestions")
def suggestions(request: Request, k: Count = 20) -> dict[str, Any]:
    """Labels that clips may have, the least certain first: an answer to these teaches most."""
    served, decided = serving_of(request).now(), annotations_of(request).current()
    own = {each.clip: each.value for each in decided if each.kind in ("label", "accept") and each.start is None}
    found = served.later(("suggestions", len(own) // ANEW), lambda: _suggested(served, own))
    if found is None:
        return {"ready": False, "items": []}
    told = {each.clip for each in decided if each.kind in ("label", "accept")}
    told_of = {(each.clip, each.value) for each in decided if each.kind == "reject"}
    left = [item for item in found if item["clip"] not in told and (item["clip"], item["value"]) not in told_of]
    return {"ready": True, "items": left[:k]}


def _suggested(served: Served, own: Mapping[str, str]) -> list[dict[str, Any]]:
    learner = Learner(served.lake, InTurn(served, "clip", "fused"), own=own)
    found = [
        {"clip": each.clip, "column": "label", "value": each.label, "confidence": round(each.confidence, 4),
         "near": [each.like]}
        for each in learner.suggest()
    ]  # fmt: skip
    return sorted(found, key=lambda item: (item["confidence"], item["clip"]))


@router.get("/duplicates")
def duplicates(request: Request, k: Count = 50) -> dict[str, Any]:
    """Pairs of clips that are one recording, the nearest first, with what was decided of them."""
    served = serving_of(request).now()
    found = served.later("duplicates", lambda: _pairs(served))
    if found is None:
        return {"ready": False, "total": 0, "pairs": []}
    decided = _decided(annotations_of(request).current(kind="duplicate"))
    pairs = [{**pair, "decided": decided.get(_pair(pair["clip"], pair["other"]))} for pair in found]
    open_first = sorted(pairs, key=lambda pair: pair["decided"] is not None)
    return {"ready": True, "total": len(pairs), "pairs": open_first[:k]}


def _pairs(served: Served) -> list[dict[str, Any]]:
    from motionlake.retrieval.duplicates import near_duplicates

    with reading(served.lake) as con:
        return [plain(asdict(pair)) for pair in near_duplicates(con, served.lake)]


def _pair(clip: str, other: str) -> tuple[str, str]:
    return (clip, other) if clip <= other else (other, clip)


def _decided(annotations: Sequence[Annotation]) -> dict[tuple[str, str], str]:
    """What was decided of pairs: of value "same:OTHER" or "different:OTHER", the last one counts."""
    found = {}
    for each in annotations:
        how, _, other = each.value.partition(":")
        if other and how in ("same", "different"):
            found[_pair(each.clip, other)] = how
    return found


@router.get("/faults")
def faults(request: Request, k: Count = 50) -> dict[str, Any]:
    """The worst ranges that stage "quality" found, but for those that are usual in their dataset."""
    served = serving_of(request).now()
    with served.cursor() as con:
        if not fetch(con, "view_is_there", {"view": "quality_unusual"})[0]["there"]:
            return {"ready": False, "faults": []}
        rows = served.keep("faults", lambda: [plain(row) for row in fetch(con, "worst_faults", {"k": 500})])
    decided: dict[tuple[str, str], str] = {}
    for each in annotations_of(request).current(kind="fault"):
        how, _, fault = each.value.partition(":")
        decided[each.clip, fault] = how
    return {"ready": True, "faults": [{**row, "decided": decided.get((row["clip"], row["fault"]))} for row in rows[:k]]}
