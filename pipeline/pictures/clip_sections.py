"""The pictures of a report that show clips: signature bars, maps, motif bands, motifs as stick figures, a search."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from itertools import combinations
from typing import Final, TypeVar

import numpy as np
from matplotlib.figure import Figure
from motionlake.arrays import Float64Array
from motionlake.deep_motifs.emd import emd_many, emd_matrix
from motionlake.evaluation.dtw import BASELINE, baseline_features
from motionlake.lake.layout import Lake
from motionlake.motion.dtw import dtw_matrix, frame_pairs
from motionlake.pictures.bands import motif_bands
from motionlake.pictures.hits_page import hits_page
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.maps import clip_map, plane_of
from motionlake.pictures.material import ALL, Material, View, count_of, discriminative, shares
from motionlake.pictures.motif_figures import MotifRow, WordStrip, contact_sheet, signature_bars
from motionlake.pictures.stick_figures import spread
from motionlake.pictures.style import UNLABELLED
from motionlake.threads import limited

T = TypeVar("T", bound=Hashable)

MOST_CLASSES: Final = 30
PER_CLASS: Final = 4
HITS: Final = 6
SUBJECTS: Final = range(2, 10)
A_SUBJECT: Final = 3
BY_SUBJECT: Final = 60
LEAST_ON_MAP: Final = 3
MOST_PAIRS: Final = 400_000_000  # of frames, some seconds of DTW
LONGEST: Final = 40
ENOUGH_MOTIFS: Final = 4


def bars(material: Material, view: View) -> Picture:
    """Signature bars, four clips a class (figures 1 and 6)."""
    by_class = view.by_class()
    shown = {name: material.some(clips, PER_CLASS) for name, clips in _largest(by_class, MOST_CLASSES).items()}
    groups = {
        name: dict(zip(material.short_names(clips), material.signatures[clips], strict=True))
        for name, clips in shown.items()
    }
    of_each = f"the clips of each {view.kind}" if len(by_class) > 1 else "the clips"
    title = f"{view.name}: which motifs {of_each} are made of"
    chosen = count_of(sum(map(len, groups.values())), view.total)
    note = f"{chosen}, at most {PER_CLASS} a {view.kind}; {material.about_model}"
    fewer = len(shown) < len(by_class)
    left_out = f" The {len(shown)} largest of {len(by_class)} {view.plural} are shown." if fewer else ""
    caption = (
        "Signatures (Deep Motifs, figures 1 and 6). A row is a clip, a column a motif; the hotter and darker, the "
        f"larger the motif's tf-idf share, grey is none. Clips of one {view.kind} light up in the same columns. "
        f"Similar motifs stand side by side; the order is not that of time.{left_out}{view.about_clusters}"
    )
    return picture(f"{view.name}-signatures", title, caption, signature_bars(groups, material.order, title, note))


def _largest(groups: dict[T, list[int]], most: int) -> dict[T, list[int]]:
    """The groups with most members, in the order they had."""
    kept = set(sorted(groups, key=lambda name: -len(groups[name]))[:most])
    return {name: members for name, members in groups.items() if name in kept}


def clips_map(material: Material, view: View) -> Picture | None:
    """A map of clips by the distance of their signatures (figures 7 and 8); None below three clips."""
    if len(view.shown) < LEAST_ON_MAP:
        return None
    title = f"{view.name}: clips that move alike lie close together"
    chosen = count_of(len(view.shown), view.total)
    figure, said = _map(material, view.clips[view.shown].tolist(), view.distances, view.shown_classes, title, chosen)
    caption = (
        "A map of clips (Deep Motifs, figures 7 and 8). A point is a clip; near points have near signatures. "
        f"{said}{view.about_clusters}"
    )
    return picture(f"{view.name}-map", title, caption, figure)


def subjects_map(material: Material, view: View) -> Picture | None:
    """A map of the clips of the largest class by who moves (figure 8); None where that cannot be told apart."""
    corpus = material.corpus
    name, members = max(view.by_class().items(), key=lambda group: len(group[1]))
    clips = material.some(members, BY_SUBJECT)
    subjects = [corpus.clips[i].subject or "" for i in clips]
    counts = Counter(subjects)
    if view.kind != "class" or "" in counts or len(counts) not in SUBJECTS or min(counts.values()) < A_SUBJECT:
        return None
    title = f"{view.name}: who moves, within {name}"
    distances = emd_matrix(material.signatures[clips], corpus.ground)
    chosen = count_of(len(clips), len(members))
    figure, said = _map(material, clips, distances, subjects, title, chosen)
    caption = (
        "Fine differences (Deep Motifs, figure 8): the clips of the largest class alone, coloured by subject. Where "
        f"colours part, signatures tell the subjects, or their roles, from each other. {said}"
    )
    return picture(f"{view.name}-subjects", title, caption, figure)


def _map(
    material: Material, clips: list[int], distances: Float64Array, classes: list[str], title: str, chosen: str
) -> tuple[Figure, str]:
    """The map, and a sentence on its errors; beside it the map by whole-clip DTW where that is soon made."""
    points, stress = plane_of(distances)
    note = f"{chosen}; Earth Mover's Distance of signatures, metric MDS, stress {stress:.2f}; {material.about_model}"
    said = f"Distances on the page are off by {stress:.0%} (Kruskal's stress); the axes have no meaning of their own."
    hidden = len(clips) - len(np.unique(material.signatures[clips], axis=0))
    said += f" Clips of equal signatures share one point ({hidden} are hidden that way)." if hidden else ""
    aligned = _dtw_distances(material, clips)
    if aligned is None:
        return clip_map(points, classes, title, note), said
    plane, error = plane_of(aligned)
    other = (f"the same clips by DTW of whole clips (stress {error:.2f})", plane)
    said += " The smaller map has the same clips by dynamic time warping of whole clips, the baseline."
    return clip_map(points, classes, title, note, other), said


def _dtw_distances(material: Material, clips: list[int]) -> Float64Array | None:
    if frame_pairs([round(material.seconds(i) * BASELINE.fps) for i in clips]) > MOST_PAIRS:
        return None
    known = [material.corpus.clips[i] for i in clips]
    positions = material.poses.many([clip.clip for clip in known])
    features = [baseline_features(positions[clip.clip].astype(np.float64), clip.fps) for clip in known]
    with limited(1):  # matrices too small for threads
        return dtw_matrix(features)


def two_bands(material: Material, view: View) -> Picture | None:
    """Two clips with near signatures as bands of motifs (figure 9)."""
    pair = _closest_pair(material, view)
    if pair is None:
        return None
    clips = view.clips[view.shown[list(pair)]].tolist()
    one, other = (view.shown_classes[i] for i in pair)
    classes = one if one == other else f"{one} and {other}"
    title = f"{view.name}: two clips of near signatures, motif by motif"
    note = "" if classes == ALL else f"{classes}; "
    note += f"distance of the signatures {view.distances[pair]:.3f}; {material.about_model}"
    caption = (
        "Motif bands (Deep Motifs, figure 9). The upper band of each clip is its motifs in time, one colour a motif; "
        "the lower one its signature, the same motifs sorted and weighted. The order in time may differ, the "
        "signatures hardly do. The pair is the closest among the longest clips shown, of two subjects where there "
        "are such."
    )
    bands = [material.band(i, name) for i, name in zip(clips, material.short_names(clips), strict=True)]
    return picture(f"{view.name}-bands", title, caption, motif_bands(bands, material.order, title, note))


def _closest_pair(material: Material, view: View) -> tuple[int, int] | None:
    """The two clips (positions in `view.shown`) of one class with the nearest signatures, among the longest shown.

    Pairs of several motifs come first, then pairs of one class, then of two subjects.
    """
    clips, classes = view.clips[view.shown], view.shown_classes
    long = np.argsort([-material.seconds(i) for i in clips], kind="stable")[:LONGEST]
    kinds = np.count_nonzero(material.signatures[clips], axis=1)
    subjects = [material.corpus.clips[i].subject for i in clips]

    def key(pair: tuple[int, int]) -> tuple[int, bool, bool, float, tuple[int, int]]:
        held = int(min(*kinds[list(pair)], ENOUGH_MOTIFS))
        a, b = pair
        return -held, classes[a] != classes[b], subjects[a] == subjects[b], float(view.distances[pair]), pair

    return min(combinations(sorted(long.tolist()), 2), key=key, default=None)


def hits_of_one(lake: Lake, material: Material) -> Picture | None:
    """An example of search: the clips nearest to one of them (section 6.3); None for a single clip."""
    corpus = material.corpus
    if len(corpus.clips) < 2:
        return None
    lengths = np.diff(corpus.offsets)
    middling = np.argsort(lengths, kind="stable")[len(lengths) // 2 :].tolist()
    (query,) = material.some(middling, 1)
    distances = emd_many(material.signatures[query], material.signatures, corpus.ground)
    nearest = [i for i in np.argsort(distances, kind="stable").tolist() if i != query][:HITS]
    rows = [
        {"rank": rank, "clip": corpus.clips[i].clip, "distance": float(distances[i])}
        for rank, i in enumerate(nearest, start=1)
    ]
    name = corpus.clips[query].clip
    title = f"What is most like {name}"
    caption = (
        "A search by example (Deep Motifs, section 6.3): the query, shaded, and the clips with the nearest signatures, "
        "as moments evenly spread over each. `motionlake search CLIP --picture hits.html` draws it for any query."
    )
    return picture("search", title, caption, hits_page(material.con, lake, name, rows, about="distances of signatures"))


WORDS_A_MOTIF: Final = 3
POSES: Final = 5
ROWS: Final = 16
STRONGEST: Final = 10
LEAST_SHARE: Final = 0.005  # of the words shown, for a motif to be one of them


def strongest_motifs(material: Material, view: View) -> Picture:
    """The strongest motifs of a lake as stick figures (figure 5, section 4.1)."""
    counts = material.counts(view.clips).sum(axis=0)
    held = counts >= LEAST_SHARE * counts.sum()
    motifs = [m for m in np.argsort(-material.corpus.strength, kind="stable").tolist() if held[m]][:STRONGEST]
    clips = view.clips.tolist()
    rows = _rows(material, view, [(f"strength {material.corpus.strength[m]:.3f}", m, clips) for m in motifs])
    title = f"The {len(rows)} strongest motifs"
    caption = (
        "Strong motifs are frequent and compact (Deep Motifs, section 4.1: density of the cluster). Those with at "
        f"least {LEAST_SHARE:.1%} of the words here are shown. Stick figures run from the start of a word to its end, "
        "left limbs blue, right limbs orange, turned to face the same way. "
        f"On the right: the share of the words of each {view.kind} that belong to the motif."
    )
    note = f"{count_of(view.total, view.total)}; {material.about_model}"
    return picture(
        f"{view.name}-strongest", title, caption, contact_sheet(rows, title, note, f"share by {view.kind}")
    )  # fmt: skip


def class_motifs(material: Material, view: View) -> list[Picture]:
    """For each class the motif that stands for it (figure 5); some rows a picture. None for a single class."""
    by_class = view.by_class()
    if len(by_class) < 2:
        return []
    kept = _largest({n: c for n, c in by_class.items() if n != UNLABELLED}, MOST_CLASSES)
    chosen = [(name, motif) for name, motif in discriminative(shares(material, view)) if name in kept]
    pictures = []
    pages = -(-len(chosen) // ROWS)
    for i in range(pages):
        part = chosen[i * len(chosen) // pages : (i + 1) * len(chosen) // pages]
        rows = _rows(material, view, [(name, motif, by_class[name]) for name, motif in part])
        title = f"{view.name}: for each {view.kind}, the motif that is most its own"
        title += f" ({i + 1} of {pages})" if pages > 1 else ""
        caption = (
            f"Motifs that are frequent in one {view.kind} and in few others (Deep Motifs, figure 5), shown by words of "
            f"that {view.kind} near the motif's centre. On the right: the share of the words of each {view.kind} that "
            f"belong to the motif, largest first. A motif that stands for two {view.plural} is the most telling of "
            f"either.{view.about_clusters}"
        )
        note = f"{count_of(len(view.clips), view.total)}; {material.about_model}"
        figure = contact_sheet(rows, title, note, f"share by {view.kind}")
        pictures.append(picture(f"{view.name}-motifs-{i + 1}", title, caption, figure))
    return pictures


def _rows(material: Material, view: View, wanted: Sequence[tuple[str, int, list[int]]]) -> list[MotifRow]:
    """Of (reason, motif, clips that its words are taken from)."""
    by_class = shares(material, view)
    rows = []
    found = material.nearest_words([motif for _, motif, _ in wanted], material.names(view.clips))
    for reason, motif, clips in wanted:
        members = set(material.names(clips))
        words = [word for word in found[motif] if word.clip in members][:WORDS_A_MOTIF]
        poses = [spread(material.poses.positions(w.clip)[w.start : w.stop], POSES) for w in words]
        strips = [WordStrip(*material.source(word), moments) for word, moments in zip(words, poses, strict=True)]
        common = {name: float(share[motif]) for name, share in by_class.items()}
        rows.append(MotifRow(motif, reason, material.colours[motif], strips, common))
    return rows
