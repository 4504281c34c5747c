"""Words that titles, notes and captions share."""

from __future__ import annotations

from motionlake.pictures.material import Material, Word
from motionlake.pictures.selection import ALL, View, display_names


def model(material: Material) -> str:
    return f"{material.corpus.model}, {len(material.corpus.idf)} motifs"


def count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def count_of(number: int, total: int, what: str) -> str:
    """So many of so many, if not all."""
    return count(number, what) if number == total else f"{number} of {total} {what}s (the same ones every time)"


def about_clusters(view: View) -> str:
    """What clusters are, where a view has them in place of classes."""
    if view.kind != "cluster":
        return ""
    if set(view.classes) == {ALL}:
        return " The clips have no labels."
    return " The clips have no labels: the clusters are k-means on their distances (MDS), numbered by size."


def short_names(material: Material, clips: list[int]) -> dict[int, str]:
    """Names of clips (corpus indices) without the folders that all of them share."""
    return dict(zip(clips, display_names([material.corpus.clips[i].clip for i in clips]), strict=True))


def source(material: Material, word: Word) -> tuple[str, str]:
    """The file of a word, and when in it."""
    fps = material.corpus.clips[material.corpus.positions[word.clip]].fps
    return word.clip.rpartition("/")[2], f", {word.start / fps:.1f}–{word.stop / fps:.1f} s"
