"""Every way to search a lake, by what it finds and its name. A new one is a module and a line here."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final

from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import Lake
from motionlake.retrieval.protocol import Finds, Searcher

# The first of each kind is what commands take by default. Named, not imported: each needs other libraries.
SEARCHERS: Final[dict[Finds, dict[str, str]]] = {
    "clip": {
        "fused": "fused:FusedSearcher",
        "signature": "signature:SignatureSearcher",
        "alignment": "alignment:AlignmentSearcher",
        "descriptor": "descriptor:DescriptorSearcher",
        "moves": "moves:MovesSearcher",
    },
    "range": {
        "fused": "fused_ranges:FusedRangeSearcher",
        "words": "query_by_example:WordsSearcher",
        "alignment": "alignment:AlignmentRangeSearcher",
        "submotion": "submotion_search:SubmotionSearcher",
        "moves": "moves:MovesRangeSearcher",
    },
}


# Those that compare some clips by a shortlist: chosen by vectors or windows, or by the words of a piece.
CHOSEN: Final[dict[Finds, tuple[str, ...]]] = {
    "clip": ("signature", "alignment", "moves"), "range": ("alignment", "submotion", "moves"),
}  # fmt: skip
# Those that can compare every clip instead; the first by an option of its own.
EXACT: Final[dict[Finds, tuple[str, ...]]] = {"clip": ("fused", *CHOSEN["clip"]), "range": CHOSEN["range"]}


def methods(finds: Finds) -> tuple[str, ...]:
    """The names of all ways to find clips, or ranges."""
    return tuple(SEARCHERS[finds])


def check_method(finds: Finds, name: str) -> str:
    """Raises `UserError` for an unknown method."""
    if name not in SEARCHERS[finds]:
        raise UserError(f"--method {name}: not one of {', '.join(SEARCHERS[finds])}")
    return name


def check_exact(finds: Finds, method: str, option: str, *, exact: bool) -> None:
    """Raises `UserError`, naming the option, where a method compares every clip in any case, or none alone."""
    if exact and method not in EXACT[finds]:
        raise UserError(f"{option}: is for --method {', '.join(EXACT[finds])}")


def searcher(finds: Finds, name: str, lake: Lake, /, *, exact: bool = False, **options: Any) -> Searcher:
    """A way to search a lake.

    Args:
        finds: whole clips, or ranges of frames inside them.
        name: of `methods(finds)`; "fused" takes those that the lake is ready for.
        lake: what is searched.
        exact: compare every clip, where the method would choose some by the lake's shortlist.
        options: of the method itself, such as the stride of "alignment"; with any, every clip is compared.

    Raises:
        UserError: an unknown method, or one that the lake is not ready for.
    """
    if name in CHOSEN[finds] and not (exact or options):
        if files := _shortlist(lake, finds):
            return _of_some_clips(finds, name, lake, files)
        if (finds, name) == ("range", "moves") and "submotion" in ready(lake, finds):
            from motionlake.retrieval.near_moves import NearMovesSearcher

            return NearMovesSearcher(lake)
    if exact and (finds, name) == ("clip", "fused"):
        options["exact"] = True
    module, _, maker = SEARCHERS[finds][check_method(finds, name)].partition(":")
    found: Searcher = getattr(import_module(f"motionlake.retrieval.{module}"), maker)(lake, **options)
    return found


def _of_some_clips(finds: Finds, name: str, lake: Lake, files: list[str]) -> Searcher:
    def every() -> Searcher:
        return searcher(finds, name, lake, exact=True)

    if finds == "clip":
        from motionlake.retrieval.chosen import ChosenSearcher

        return ChosenSearcher(lake, name, files, every)
    if name == "submotion":
        from motionlake.retrieval.submotion_search import SubmotionSearcher

        return SubmotionSearcher(lake, files)
    from motionlake.retrieval.narrowed import NarrowedSearcher

    by_windows = name == "moves" and "submotion" in ready(lake, finds)
    return NarrowedSearcher(lake, name, files, every, by_windows=by_windows)


def _shortlist(lake: Lake, finds: Finds) -> list[str]:
    from motionlake.retrieval.lake_shortlist import shortlist_of

    return shortlist_of(lake, finds)


def ready(lake: Lake, finds: Finds) -> list[str]:
    """The methods whose tables the lake has, without reading them."""
    with reading(lake) as con:
        (there,) = fetch(con, "searchable")
    return [name for name in SEARCHERS[finds] if there.get(name, any(there.values()))]
