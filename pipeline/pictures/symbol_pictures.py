"""Pictures of symbol strings: those of a report (strips, the dictionary's map, two clips aligned), and the answers of
`motionlake align`, for each the matrix of figure 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array, IntArray
from motionlake.deep_motifs.clip_map import LEAST, tsne
from motionlake.lake.catalog import fetch
from motionlake.lake.frames import read_clips
from motionlake.lake.integrity import sound
from motionlake.lake.settings import served_config
from motionlake.motion.features import word_features
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.matches import best_matches
from motionlake.pesta.nearest import symmetric_costs
from motionlake.pesta.strings import Repository
from motionlake.pesta.tandem import reduce_runs
from motionlake.pictures.hits_page import hits_page
from motionlake.pictures.html import Picture, picture, write_hits
from motionlake.pictures.maps import posture_map
from motionlake.pictures.material import sampled
from motionlake.pictures.symbol_columns import Columns, of_string, path_indices, shown
from motionlake.pictures.symbol_figures import (
    MOMENTS,
    AlignedPath,
    StripOfSymbols,
    SymbolRow,
    alignment_matrix,
    folds,
    symbol_strip,
)
from motionlake.pictures.symbol_material import SymbolMaterial
from motionlake.retrieval.hits import Hit, clip_hit, ranked
from motionlake.retrieval.string_queries import StringQuery, clip_query
from motionlake.retrieval.symbol_strings import ClipStrings

MOST_MATRICES: Final = 10
STRIPS: Final = 3
MOST_PAIRED: Final = 80  # clips among which the nearest two are looked for
ENOUGH: Final = 6  # symbols of a string worth aligning
MOST_IN_STRIP: Final = 36
SAMPLED_CLIPS: Final = 60
SAMPLED: Final = 1000  # postures on the map
PERPLEXITY: Final = 30.0


def string_pictures(material: SymbolMaterial, clips: Sequence[int]) -> list[Picture | None]:
    """Strips of some of the clips (indices of the strings), the dictionary's map, the two nearest clips aligned."""
    strips = [_strip(material, clip) for clip in _strip_clips(material, clips)]
    return [*strips, _dictionary_map(material, clips), _nearest_two(material, clips)]


def _strip_clips(material: SymbolMaterial, clips: Sequence[int]) -> list[int]:
    """Clips worth a strip: those of which most was folded, one of a label (a dataset, where there are none)."""
    strings = material.strings

    def saved(clip: int) -> float:
        """Seconds a symbol of the string stands for, of strings that fit on the page and hold a few symbols."""
        known, length = strings.clips[clip], int(strings.repository.lengths[clip])
        return known.frames / known.fps / length if ENOUGH <= length <= MOST_IN_STRIP else 0.0

    chosen: dict[str, int] = {}
    for clip in sorted(clips, key=lambda i: (-saved(i), strings.clips[i].clip)):
        chosen.setdefault(strings.clips[clip].label or strings.clips[clip].dataset, clip)
    return list(chosen.values())[:STRIPS]


def _strip(material: SymbolMaterial, clip: int) -> Picture | None:
    """A clip and its string (figure 3); None while its postures are being coded anew."""
    known = material.strings.clips[clip]
    drawn = strip_of(material, clip)
    if drawn is None:
        return None
    found = folds(drawn, 1 / material.config.fps)
    name = _file(known.clip)
    title = f"{name}: {known.frames} frames become {len(drawn.symbols)} symbols"
    note = f"{drawn.seconds:.1f} s; {len(drawn.runs)} runs of one symbol, "
    note += f"{sum(fold.symbols for fold in found) or 'none'} of them folded as repeats; {material.about_dictionary}"
    caption = (
        "A clip and its string (PESTA, figure 3). (a) Moments of the clip, the symbol of each, and all of its symbols "
        "in time: runs of one symbol, and below them the string, where grey stands for repeats that were folded "
        f"into the instance before. (b) The string as {material.about_bodies}. Like colours are like postures."
    )
    return picture(f"strip-{name}", title, caption, symbol_strip(drawn, found, material.colours, title, note))


def strip_of(material: SymbolMaterial, clip: int) -> StripOfSymbols | None:
    """What the strip of a clip shows."""
    known, string = material.strings.clips[clip], material.strings.string_of(clip)
    codes = material.codes_of([known.clip]).get(known.clip)
    if codes is None:
        return None
    runs, seconds = reduce_runs(codes), known.frames / known.fps
    moments = (np.arange(MOMENTS) + 0.5) / MOMENTS * seconds
    frames = np.minimum((moments * known.fps).astype(np.int64), known.frames - 1)
    return StripOfSymbols(
        seconds, material.poses.positions(known.clip)[frames], moments,
        codes[runs], np.maximum(0.0, (runs - 0.5) / material.config.fps),
        string.symbols, string.starts / known.fps, material.bodies(string.symbols),
    )  # fmt: skip


def _dictionary_map(material: SymbolMaterial, clips: Sequence[int]) -> Picture | None:
    """The dictionary's heads and a sample of the clips' postures (figure 2b); None where there are hardly any."""
    features, symbols = posture_sample(material, clips)
    if min(len(material.codes), len(features)) < LEAST:
        return None
    title = f"The posture dictionary {material.strings.model}: {len(material.codes)} symbols"
    used = int(np.count_nonzero(material.share))
    note = f"{material.config.dictionary}; {used} symbols in use; t-SNE (seed 0) of the codes, and of the postures"
    caption = (
        "A map of the dictionary (PESTA, figure 2b). Above the heads of its clusters by the distance of their codes, "
        "below postures of clips by their features, in the colour of the symbol they are coded as: near heads have "
        f"like colours. Stick figures are {material.about_bodies}. Neighbours on the page are neighbours; distances "
        "between groups mean little, and the two maps have nothing to do with each other's places."
    )
    figure = posture_map(
        tsne(material.codes, PERPLEXITY), material.share, material.bodies(np.arange(len(material.codes))),
        tsne(features, PERPLEXITY), symbols, material.colours, title, note,
    )  # fmt: skip
    return picture("dictionary", title, caption, figure)


def posture_sample(material: SymbolMaterial, clips: Sequence[int]) -> tuple[Float32Array, Int32Array]:
    """[n, D] postures spread over some clips, the same ones every time, and the [n] symbols they are coded as."""
    names = [material.strings.clips[i].clip for i in clips]
    chosen = [names[i] for i in sampled(names, SAMPLED_CLIPS)]
    coded = material.codes_of(chosen)
    parts: dict[tuple[str, str], list[str]] = {}
    for row in fetch(material.con, "parts_of", {"clips": chosen}):
        if row["clip"] in coded:
            parts.setdefault((row["dataset"], row["part"]), []).append(row["clip"])
    features = [np.zeros((0, material.postures.shape[1]), dtype=np.float32)]
    symbols = [np.zeros(0, dtype=np.int32)]
    for (dataset, part), members in sorted(parts.items()):
        for stored in read_clips(sound(material.lake, material.lake.frames_part(dataset, part)), members):
            found = stored.recorded()
            positions, rotations = found.positions.astype(float), found.rotations.astype(float)
            features.append(word_features(positions, rotations, found.fps, material.config.frames))
            symbols.append(coded[found.clip])
    every = np.concatenate(features)
    kept = np.unique(np.linspace(0, len(every) - 1, min(SAMPLED, len(every))).round().astype(np.int64))
    return every[kept], np.concatenate(symbols)[kept]


def _nearest_two(material: SymbolMaterial, clips: Sequence[int]) -> Picture | None:
    """The two nearest clips that are called differently and not the same, aligned (figure 4); None without such."""
    strings, config = material.strings, served_config(material.lake).alignment
    long = [i for i in clips if strings.repository.lengths[i] >= ENOUGH]
    chosen = [long[i] for i in sampled([strings.clips[i].clip for i in long], MOST_PAIRED)]
    if len(chosen) < 2:
        return None
    one = Repository.of([strings.repository.string(i) for i in chosen])
    costs = symmetric_costs(one, strings.distances, config).astype(np.float64)
    files = np.array([_file(strings.clips[i].clip) for i in chosen])
    costs[(files[:, None] == files) | (costs <= 0)] = np.inf
    costs[np.tril_indices(len(chosen))] = np.inf
    first, second = np.unravel_index(int(np.argmin(costs)), costs.shape)
    if not np.isfinite(costs[first, second]):
        return None
    query, known = strings.clips[chosen[first]], strings.clips[chosen[second]]
    asked = clip_query(query.clip, strings.string_of(chosen[first]), query.fps)
    whole = ClipStrings(material.lake, strings)
    (hit,) = ranked([clip_hit(known, float(costs[first, second]))])
    made = AlignmentPictures(material, asked, query.fps, config, whole).whole(hit, "The nearest two clips, aligned")
    caption = (
        f"{files[first]} aligned to {files[second]}, the nearest two among {len(chosen)} clips that are not called "
        f"alike and whose strings differ. {material.about_matrix} `motionlake align CLIP --picture hits.html` draws it "
        "for any query."
    )
    return replace(made, name="alignment", caption=caption)


@dataclass(frozen=True)
class AlignmentPictures:
    """Draws the answers to one query.

    Attributes:
        material: of the lake; its strings are those that were searched.
        query: what was looked for.
        fps: of its frames.
        config: how the answers were found.
        clips: the strings with every cycle of their repeats.
    """

    material: SymbolMaterial
    query: StringQuery
    fps: float
    config: AlignmentConfig
    clips: ClipStrings

    def save(self, path: Path, hits: Sequence[Hit]) -> None:
        """Draw the best answer as .png; a page of all of them, then one by one, as .html.

        Hits that are ranges of frames have their paths. Where there are no hits, the query alone is drawn.

        Raises:
            UserError: the file cannot be written.
        """
        page = path.suffix == ".html"
        pages = [self._overview(hits)] if page or not hits else []
        for hit in hits[: MOST_MATRICES if page else 1]:
            pages.append(self.whole(hit) if hit.start is None else self._match(hit, hits))
        write_hits(path, pages)

    def whole(self, hit: Hit, title: str | None = None) -> Picture:
        """The matrix of a whole clip and one that is like it, with the best match of the first in the second."""
        strings, query = self.material.strings, self.query
        clip = strings.positions[hit.clip]
        string = Repository.of([strings.repository.string(clip)])
        matches = best_matches(query.symbols, string, strings.distances, 1, self.config, paths=True)
        paths = [AlignedPath(f"best match, cost {m.cost:.2f}", m.path) for m in matches if m.path is not None]
        paths += self.compared(string.symbols, 0)
        said = f"cost {hit.distance:.3f} for each symbol, of both ways"
        title = title or f"Clip {hit.rank}: {_file(hit.clip)}, {hit.seconds:.2f} s"
        caption = f"{query.name} aligned to {hit.clip}, {said}; the path is that of the first in the second."
        alternative = f"{hit.clip} aligned to {query.name}"
        columns = of_string(strings, strings.symbols_of(clip))
        return self._picture(hit, columns, paths, title, said, alternative, caption)

    def _match(self, hit: Hit, others: Sequence[Hit]) -> Picture:
        """The matrix of one match, with what lies around it in its clip; other matches that lie there are dashed.

        Of a clip every cycle of its repeats is shown; of several the strings, with repeats folded.
        """
        query, columns = self.query, self.around(hit)
        pairs = path_indices(columns, query, hit)
        first, last = shown(int(pairs[0, 1]), int(pairs[-1, 1]) + 1, columns)
        paths = [AlignedPath(f"hit {hit.rank}, cost {_cost(hit):.2f}", pairs - (0, first))]
        paths += self.compared(columns.symbols[int(pairs[0, 1]) : int(pairs[-1, 1]) + 1], int(pairs[0, 1]) - first)
        for other in others:
            if other.rank != hit.rank and other.clip == hit.clip and other.stop_clip == hit.stop_clip and other.path:
                found = path_indices(columns, query, other)
                if first <= found[0, 1] and found[-1, 1] < last:
                    paths.append(AlignedPath(f"hit {other.rank}, cost {_cost(other):.2f}", found - (0, first)))
        if hit.stop_clip in (None, hit.clip):
            begin = hit.start_seconds or 0.0
            said = brief = f"frames {hit.start} to {hit.stop}, {begin:.2f}–{begin + hit.seconds:.2f} s"
        else:
            brief = f"from frame {hit.start} to frame {hit.stop} of a later clip, {hit.seconds:.2f} s"
            said = f"from frame {hit.start} to frame {hit.stop} of {_file(str(hit.stop_clip))}, {hit.seconds:.2f} s"
        caption = (
            f"The query {query.name}, frames {query.start} to {query.stop}, aligned to {hit.clip}, {said}; cost "
            f"{_cost(hit):.3f} ({hit.distance:.3f} for each of {len(query.symbols)} symbols)."
        )
        return self._picture(
            hit, columns.part(first, last), paths, f"Hit {hit.rank}: {_file(hit.clip)}",
            f"{brief}; cost {_cost(hit):.3f}, {hit.distance:.3f} for each symbol of the query",
            f"hit {hit.rank} for {query.name}: {hit.clip}, {said}", caption,
        )  # fmt: skip

    def compared(self, symbols: IntArray, first: int) -> list[AlignedPath]:
        """The path that dynamic time warping takes through a match of strided alignment, as figure 4 has it.

        Args:
            symbols: of the match.
            first: column of the first of them.
        """
        if self.config.method != "sta" or (self.config.stride == 1 and not self.config.gaps):
            return []
        stretch, warping = Repository.of([symbols]), self.config.by("dtw")
        distances = self.material.strings.distances
        matches = best_matches(self.query.symbols, stretch, distances, 1, warping, paths=True)
        return [
            AlignedPath(f"dynamic time warping there, cost {m.cost:.2f}", m.path + np.array([0, first]), compared=True)
            for m in matches if m.path is not None
        ]  # fmt: skip

    def around(self, hit: Hit) -> Columns:
        """What a hit's path may lead through."""
        strings = self.material.strings
        own = strings.symbols_of(strings.positions[hit.clip])
        if hit.stop_clip not in (None, hit.clip):
            return of_string(strings, slice(own.start, len(strings.repository.symbols)))
        string = self.clips.of(hit.clip)
        return Columns(string.symbols, string.starts, string.stops, [])

    def _picture(
        self, hit: Hit, columns: Columns, paths: Sequence[AlignedPath], title: str, note: str, alternative: str,
        caption: str,
    ) -> Picture:  # fmt: skip
        """The matrix of the query and of symbols of the lake; `alternative` is for those who cannot see it."""
        material, query = self.material, self.query
        strings = material.strings
        fps = strings.clips[strings.positions[hit.clip]].fps
        symbols, cuts = columns.symbols, columns.cuts
        start, stop = int(columns.starts[0]), int(columns.stops[-1])
        when = f"from frame {start} on, and on in the next clip" if cuts else _when(start, stop, fps)
        asked = _when(query.start, query.stop, self.fps)
        figure = alignment_matrix(
            SymbolRow(query.name, asked, query.symbols, material.bodies(query.symbols)),
            SymbolRow(hit.clip, when, symbols, material.bodies(symbols), cuts),
            strings.distances.matrix[np.ix_(query.symbols, symbols)],
            paths, material.colours, title, f"{note}; {material.about_dictionary}",
        )  # fmt: skip
        return picture(f"alignment-{hit.rank}", alternative, f"{caption} {material.about_matrix}", figure)

    def _overview(self, hits: Sequence[Hit]) -> Picture:
        material, query = self.material, self.query
        rows: list[dict[str, Any]] = [hit.as_row() | {"cost": _cost(hit)} for hit in hits]
        figure = hits_page(
            material.con, material.lake, query.clip or Path(query.name), rows, query.start, query.stop,
            "cost", f"costs of alignment; {material.about_dictionary}",
        )  # fmt: skip
        caption = "The query, shaded, and the answers, cheapest first."
        return picture("hits", f"hits for {query.name}", caption, figure)


def _cost(hit: Hit) -> float:
    """A range's own cost; a whole clip has the distance alone."""
    return hit.distance if hit.cost is None else hit.cost


def _when(start: int, stop: int, fps: float) -> str:
    return f"frames {start} to {stop}, {start / fps:.2f}–{stop / fps:.2f} s"


def _file(clip: str) -> str:
    return clip.rpartition("/")[2] or clip
