"""The answers of `motionlake align`: for each the matrix of figure 4, and a page of all as stick figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import Int64Array
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.matches import Match, best_matches
from motionlake.pesta.strings import Repository
from motionlake.pictures.alignment_matrix import AlignedPath, SymbolRow, alignment_matrix
from motionlake.pictures.hits_page import hits_page
from motionlake.pictures.html import Picture, picture, write_hits
from motionlake.pictures.symbol_material import SymbolMaterial
from motionlake.retrieval.protocol import Hit
from motionlake.retrieval.symbol_strings import LakeStrings, StringQuery

CONTEXT: Final = 3  # symbols before and after a match
MOST_WHOLE: Final = 30  # symbols of a clip that is shown whole
MOST_MATRICES: Final = 10


def save_alignments(
    material: SymbolMaterial,
    path: Path,
    query: StringQuery,
    fps: float,
    hits: Sequence[Hit],
    config: AlignmentConfig,
) -> None:
    """Draw the answers to a query: the best one as .png; a page of all of them, then one by one, as .html.

    Args:
        material: of the lake; its strings are those that were searched.
        path: the file.
        query: what was looked for.
        fps: of its frames.
        hits: ranges of frames have their paths. Where there are none, the query alone is drawn.
        config: how they were found.

    Raises:
        UserError: the file cannot be written.
    """
    chosen = hits[: MOST_MATRICES if path.suffix == ".html" else 1]
    pages = []
    if path.suffix == ".html" or not hits:
        pages.append(_overview(material, query, hits))
    for hit in chosen:
        if hit.start is None:
            pages.append(whole_picture(material, query, fps, hit, config))
        else:
            pages.append(hit_picture(material, query, fps, hit, hits))
    write_hits(path, pages)


def hit_picture(
    material: SymbolMaterial, query: StringQuery, fps: float, hit: Hit, others: Sequence[Hit] = ()
) -> Picture:
    """The matrix of one match, with what lies around it in its clip; other matches that lie there are dashed.

    Raises:
        ValueError: a hit without its path.
    """
    strings = material.strings
    pairs = path_indices(strings, query, hit)
    own = strings.symbols_of(strings.positions[hit.clip])
    first, last = _shown(int(pairs[0, 1]), int(pairs[-1, 1]) + 1, own)
    paths = [AlignedPath(f"hit {hit.rank}, cost {_cost(hit):.2f}", pairs - (0, first))]
    for other in others:
        if other.rank != hit.rank and other.clip == hit.clip and other.path:
            found = path_indices(strings, query, other)
            if first <= found[0, 1] and found[-1, 1] < last:
                paths.append(AlignedPath(f"hit {other.rank}, cost {_cost(other):.2f}", found - (0, first)))
    if hit.stop_clip in (None, hit.clip):
        begin = hit.start_seconds or 0.0
        said = f"frames {hit.start} to {hit.stop}, {begin:.2f}–{begin + hit.seconds:.2f} s"
        brief = said
    else:
        brief = f"from frame {hit.start} to frame {hit.stop} of a later clip, {hit.seconds:.2f} s"
        said = f"from frame {hit.start} to frame {hit.stop} of {_file(str(hit.stop_clip))}, {hit.seconds:.2f} s"
    figure = _matrix(
        material, query, fps, hit.clip, slice(first, last), paths,
        f"Hit {hit.rank}: {_file(hit.clip)}",
        f"{brief}; cost {_cost(hit):.3f}, {hit.distance:.3f} for each symbol of the query",
    )  # fmt: skip
    title = f"hit {hit.rank} for {query.name}: {hit.clip}, {said}"
    caption = (
        f"The query {query.name}, frames {query.start} to {query.stop}, aligned to {hit.clip}, {said}; cost "
        f"{_cost(hit):.3f} ({hit.distance:.3f} for each of {len(query.symbols)} symbols). {about_matrix(material)}"
    )
    return picture(f"alignment-{hit.rank}", title, caption, figure)


def whole_picture(
    material: SymbolMaterial,
    query: StringQuery,
    fps: float,
    hit: Hit,
    config: AlignmentConfig,
    title: str | None = None,
) -> Picture:
    """The matrix of a whole clip and one that is like it, with the best match of the first in the second."""
    strings = material.strings
    own = strings.symbols_of(strings.positions[hit.clip])
    match = best_match(strings, query, hit.clip, config)
    paths = [] if match is None else [AlignedPath(f"best match, cost {match.cost:.2f}", _pairs(match))]
    shared = f"cost {hit.distance:.3f} for each symbol, of both ways"
    figure = _matrix(
        material,
        query,
        fps,
        hit.clip,
        own,
        paths,
        title or f"Clip {hit.rank}: {_file(hit.clip)}, {hit.seconds:.2f} s",
        shared,
    )
    caption = (
        f"{query.name} aligned to {hit.clip}, {shared}; the path is that of the first in the second. "
        f"{about_matrix(material)}"
    )
    return picture(f"alignment-{hit.rank}", f"{hit.clip} aligned to {query.name}", caption, figure)


def best_match(strings: LakeStrings, query: StringQuery, clip: str, config: AlignmentConfig) -> Match | None:
    """The best match of a query in one clip, with its path; None where Smith-Waterman finds none."""
    string = strings.repository.string(strings.positions[clip])
    found = best_matches(query.symbols, Repository.of([string]), strings.distances, 1, config, paths=True)
    return found[0] if found else None


def _cost(hit: Hit) -> float:
    """A range's own cost; a whole clip has the distance alone."""
    return hit.distance if hit.cost is None else hit.cost


def _pairs(match: Match) -> Int64Array:
    assert match.path is not None
    return match.path


def path_indices(strings: LakeStrings, query: StringQuery, hit: Hit) -> Int64Array:
    """[L, 2] (symbol of the query, symbol of all strings) of a hit's path, which is in frames.

    Raises:
        ValueError: a hit without its path.
    """
    if not hit.path:
        raise ValueError(f"{hit.clip}: the hit has no path; ask for it")
    asked = np.array([query.frames_of(i) for i in range(query.first, query.last)])
    begin = strings.symbols_of(strings.positions[hit.clip]).start
    stored = np.stack([strings.starts[begin:], strings.stops[begin:]], axis=1)
    rows = _places(asked, [step.query for step in hit.path])
    columns = _places(stored, [step.clip for step in hit.path])
    return np.stack([rows, columns + begin], axis=1)


def _places(ranges: Int64Array, wanted: Sequence[tuple[int, int]]) -> Int64Array:
    """Where ranges of frames stand, each not before the last: a path never goes back."""
    found, place = [], 0
    for pair in wanted:
        while tuple(ranges[place]) != pair:
            place += 1
        found.append(place)
    return np.array(found, dtype=np.int64)


def _shown(first: int, last: int, own: slice) -> tuple[int, int]:
    """Symbols to show around a match [first, last) of a clip at `own`: the clip, or some before and after."""
    if last <= own.stop and own.stop - own.start <= MOST_WHOLE:
        return own.start, own.stop
    return max(own.start, first - CONTEXT), max(last, min(own.stop, last + CONTEXT))


def _matrix(
    material: SymbolMaterial, query: StringQuery, fps: float, clip: str, columns: slice, paths: Sequence[AlignedPath],
    title: str, note: str,
) -> Figure:  # fmt: skip
    strings = material.strings
    known = strings.clips[strings.positions[clip]]
    symbols = strings.repository.symbols[columns]
    asked = SymbolRow(query.name, _when(query.start, query.stop, fps), query.symbols, material.bodies(query.symbols))
    start, stop = int(strings.starts[columns.start]), int(strings.stops[columns.stop - 1])
    cuts = [int(cut) for cut in strings.repository.offsets if columns.start < cut < columns.stop]
    when = f"from frame {start} on, and on in the next clip" if cuts else _when(start, stop, known.fps)
    found = SymbolRow(clip, when, symbols, material.bodies(symbols), [cut - columns.start for cut in cuts])
    distances = strings.distances.matrix[np.ix_(query.symbols, symbols)]
    return alignment_matrix(
        asked, found, distances, paths, material.colours, title, f"{note}; {about_dictionary(material)}"
    )


def _when(start: int, stop: int, fps: float) -> str:
    return f"frames {start} to {stop}, {start / fps:.2f}–{stop / fps:.2f} s"


def _file(clip: str) -> str:
    return clip.rpartition("/")[2] or clip


def about_dictionary(material: SymbolMaterial) -> str:
    return f"{material.strings.model}, {len(material.codes)} symbols"


def about_matrix(material: SymbolMaterial) -> str:
    """What one sees in a matrix."""
    return (
        "The matrix has the distances of their postures (PESTA, figure 4): the lighter, the nearer. The line is what "
        "is aligned to what; symbols that it strides over are boxed. Stick figures are "
        f"{material.about_bodies}, numbers their symbols."
    )


def _overview(material: SymbolMaterial, query: StringQuery, hits: Sequence[Hit]) -> Picture:
    rows: list[dict[str, Any]] = [hit.as_row() | {"cost": _cost(hit)} for hit in hits]
    asked: str | Path = query.clip if query.clip else Path(query.name)
    figure = hits_page(
        material.con, material.lake, asked, rows, query.start, query.stop,
        "cost", f"costs of alignment; {about_dictionary(material)}",
    )  # fmt: skip
    return picture("hits", f"hits for {query.name}", "The query, shaded, and the answers, cheapest first.", figure)
