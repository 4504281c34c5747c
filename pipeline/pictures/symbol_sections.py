"""The pictures of a report that show symbol strings: strips of clips, the dictionary's map, two clips aligned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.arrays import Float32Array, Int32Array
from motionlake.lake.catalog import fetch
from motionlake.lake.config import load_config
from motionlake.lake.frames import read_clips
from motionlake.motion.features import word_features
from motionlake.pesta.config import AlignmentConfig
from motionlake.pesta.scan import symmetric_costs
from motionlake.pesta.strings import Repository
from motionlake.pesta.symbols import reduce_runs
from motionlake.pictures.alignment_page import about_dictionary, about_matrix, whole_picture
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.maps import LEAST, plane, posture_map
from motionlake.pictures.material import display_names, sampled
from motionlake.pictures.symbol_material import SymbolMaterial
from motionlake.pictures.symbol_strip import MOMENTS, StripOfSymbols, folds, symbol_strip
from motionlake.retrieval.protocol import clip_hit, ranked
from motionlake.retrieval.symbol_strings import string_query

STRIPS: Final = 3
MOST_PAIRED: Final = 80  # clips among which the nearest two are looked for
ENOUGH: Final = 6  # symbols of a string worth aligning
SAMPLED_CLIPS: Final = 60
SAMPLED: Final = 1000  # postures on the map


def string_pictures(material: SymbolMaterial, clips: Sequence[int]) -> list[Picture]:
    """Strips of some of the clips (indices of the strings), the dictionary's map, the two nearest clips aligned."""
    made = [strip(material, clip) for clip in strip_clips(material, clips)]
    made += [dictionary_map(material, clips), nearest_two(material, clips)]
    return [one for one in made if one is not None]


def strip_clips(material: SymbolMaterial, clips: Sequence[int]) -> list[int]:
    """Clips worth a strip: those of which most was folded, one of a label (a dataset, where there are none)."""
    strings = material.strings
    chosen: dict[str, int] = {}
    for clip in sorted(clips, key=lambda i: (-_saved(material, i), strings.clips[i].clip)):
        known = strings.clips[clip]
        chosen.setdefault(known.label or known.dataset, clip)
    return list(chosen.values())[:STRIPS]


def _saved(material: SymbolMaterial, clip: int) -> float:
    """Seconds a symbol of the string stands for, of strings that fit on the page and hold a few symbols."""
    known, length = material.strings.clips[clip], int(material.strings.repository.lengths[clip])
    return known.frames / known.fps / length if ENOUGH <= length <= 36 else 0.0


def strip(material: SymbolMaterial, clip: int) -> Picture | None:
    """A clip and its string (figure 3); None while its postures are being coded anew."""
    known = material.strings.clips[clip]
    drawn = strip_of(material, clip)
    if drawn is None:
        return None
    found = folds(drawn, 1 / material.config.fps)
    name = display_names([known.clip])[0]
    title = f"{name}: {known.frames} frames become {len(drawn.symbols)} symbols"
    note = f"{drawn.seconds:.1f} s; {len(drawn.runs)} runs of one symbol, "
    note += f"{sum(fold.symbols for fold in found) or 'none'} of them folded as repeats; {about_dictionary(material)}"
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
        known.frames, seconds, material.poses.positions(known.clip)[frames], moments,
        codes[runs], np.maximum(0.0, (runs - 0.5) / material.config.fps),
        string.symbols, string.starts / known.fps, material.bodies(string.symbols),
    )  # fmt: skip


def dictionary_map(material: SymbolMaterial, clips: Sequence[int]) -> Picture | None:
    """The dictionary's heads and a sample of the clips' postures (figure 2b); None where there are hardly any."""
    features, symbols = posture_sample(material, clips)
    if min(len(material.codes), len(features)) < LEAST:
        return None
    kinds = np.arange(len(material.codes))
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
        plane(material.codes), material.share, material.bodies(kinds), plane(features), symbols, material.colours,
        title, note,
    )  # fmt: skip
    return picture("dictionary", title, caption, figure)


def posture_sample(material: SymbolMaterial, clips: Sequence[int]) -> tuple[Float32Array, Int32Array]:
    """[n, D] postures spread over some clips, the same ones every time, and the [n] symbols they are coded as."""
    strings = material.strings
    names = [strings.clips[i].clip for i in clips]
    chosen = [names[i] for i in sampled(names, SAMPLED_CLIPS)]
    parts: dict[tuple[str, str], list[str]] = {}
    for row in fetch(material.con, "parts_of", {"clips": chosen}):
        parts.setdefault((row["dataset"], row["part"]), []).append(row["clip"])
    coded = material.codes_of(chosen)
    features, symbols = [], []
    for dataset, part in sorted(parts):
        path = material.lake.path(material.lake.frames_part(dataset, part))
        for found in read_clips(path, [clip for clip in parts[dataset, part] if clip in coded]):
            config = material.config.frames
            positions, rotations = found.positions.astype(float), found.rotations.astype(float)
            features.append(word_features(positions, rotations, found.fps, config))
            symbols.append(coded[found.clip])
    every = np.concatenate(features) if features else np.zeros((0, material.postures.shape[1]), dtype=np.float32)
    all_symbols = np.concatenate(symbols) if symbols else np.zeros(0, dtype=np.int32)
    kept = np.unique(np.linspace(0, len(every) - 1, min(SAMPLED, len(every))).round().astype(np.int64))
    return every[kept], all_symbols[kept]


def nearest_two(material: SymbolMaterial, clips: Sequence[int]) -> Picture | None:
    """The two nearest clips that are called differently and not the same, aligned (figure 4); None without such."""
    strings, config = material.strings, load_config(material.lake.config_file).alignment
    long = [i for i in clips if strings.repository.lengths[i] >= ENOUGH]
    chosen = [long[i] for i in sampled([strings.clips[i].clip for i in long], MOST_PAIRED)]
    pair = _nearest(material, chosen, config)
    if pair is None:
        return None
    one, other, cost = pair
    query = strings.clips[one]
    asked = string_query(query.clip, strings.string_of(one), query.frames, None, None, query.clip)
    known = strings.clips[other]
    (hit,) = ranked([clip_hit(known, cost)])
    names = [clip.rpartition("/")[2] for clip in (query.clip, known.clip)]
    made = whole_picture(material, asked, query.fps, hit, config, "The nearest two clips, aligned")
    caption = (
        f"{names[0]} aligned to {names[1]}, the nearest two among {len(chosen)} clips that are not called alike and "
        f"whose strings differ. {about_matrix(material)} `motionlake align CLIP --picture hits.html` draws it for any "
        "query."
    )
    return Picture("alignment", made.title, caption, made.png, made.width)


def _nearest(material: SymbolMaterial, clips: Sequence[int], config: AlignmentConfig) -> tuple[int, int, float] | None:
    """The clips of least cost above nothing whose files have different names, and the cost."""
    strings = material.strings
    if len(clips) < 2:
        return None
    costs = symmetric_costs(
        Repository.of([strings.repository.string(i) for i in clips]), strings.distances, config
    ).astype(np.float64)
    files = np.array([strings.clips[i].clip.rpartition("/")[2] for i in clips])
    costs[(files[:, None] == files) | (costs <= 0)] = np.inf
    costs[np.tril_indices(len(clips))] = np.inf
    first, second = np.unravel_index(int(np.argmin(costs)), costs.shape)
    if not np.isfinite(costs[first, second]):
        return None
    return clips[int(first)], clips[int(second)], float(costs[first, second])
