"""The pictures of a report that show motifs as stick figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from motionlake.pictures.captions import about_clusters, count, count_of, model, source
from motionlake.pictures.contact_sheet import MotifRow, WordStrip, contact_sheet
from motionlake.pictures.html import Picture, picture
from motionlake.pictures.material import Material
from motionlake.pictures.selection import MOST_CLASSES, View, discriminative, largest, shares
from motionlake.pictures.style import UNLABELLED

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
    rows = _rows(material, view, [(f"strength {material.corpus.strength[m]:.3f}", m, view.clips) for m in motifs])
    title = f"The {len(rows)} strongest motifs"
    caption = (
        "Strong motifs are frequent and compact (Deep Motifs, section 4.1: density of the cluster). Those with at "
        f"least {LEAST_SHARE:.1%} of the words here are shown. Stick figures run from the start of a word to its end, "
        "left limbs blue, right limbs orange, turned to face the same way. "
        f"On the right: the share of the words of each {view.kind} that belong to the motif."
    )
    figure = contact_sheet(rows, title, f"{count(view.total, 'clip')}; {model(material)}", f"share by {view.kind}")
    return picture(f"{view.name}-strongest", title, caption, figure)


def class_motifs(material: Material, view: View) -> list[Picture]:
    """For each class the motif that stands for it (figure 5); some rows a picture. None for a single class."""
    by_class = view.by_class()
    if len(by_class) < 2:
        return []
    kept = set(largest({n: c for n, c in by_class.items() if n != UNLABELLED}, MOST_CLASSES))
    chosen = [(name, motif) for name, motif in discriminative(shares(material, view)) if name in kept]
    pictures = []
    pages = -(-len(chosen) // ROWS)
    for i in range(pages):
        part = chosen[i * len(chosen) // pages : (i + 1) * len(chosen) // pages]
        rows = _rows(material, view, [(name, motif, np.array(by_class[name])) for name, motif in part])
        title = f"{view.name}: for each {view.kind}, the motif that is most its own"
        title += f" ({i + 1} of {pages})" if pages > 1 else ""
        caption = (
            f"Motifs that are frequent in one {view.kind} and in few others (Deep Motifs, figure 5), shown by words of "
            f"that {view.kind} near the motif's centre. On the right: the share of the words of each {view.kind} that "
            f"belong to the motif, largest first. A motif that stands for two {view.plural} is the most telling of "
            f"either.{about_clusters(view)}"
        )
        note = f"{count_of(len(view.clips), view.total, 'clip')}; {model(material)}"
        figure = contact_sheet(rows, title, note, f"share by {view.kind}")
        pictures.append(picture(f"{view.name}-motifs-{i + 1}", title, caption, figure))
    return pictures


def _rows(material: Material, view: View, wanted: Sequence[tuple[str, int, np.ndarray]]) -> list[MotifRow]:
    corpus = material.corpus
    by_class = shares(material, view)
    rows = []
    found = material.nearest_words([m for _, m, _ in wanted], [corpus.clips[i].clip for i in view.clips])
    for reason, motif, clips in wanted:
        members = {corpus.clips[i].clip for i in clips}
        words = [w for w in found[motif] if w.clip in members][:WORDS_A_MOTIF]
        strips = [WordStrip(*source(material, w), material.poses.sample(w.clip, w.start, w.stop, POSES)) for w in words]
        common = [(name, float(share[motif])) for name, share in by_class.items()]
        rows.append(MotifRow(motif, reason, material.colours[motif], strips, common))
    return rows
