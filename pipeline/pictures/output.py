"""Pictures on disk: written whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from motionlake.errors import UserError
from motionlake.lake.parts import replacing
from motionlake.pictures.html import Chapter, Picture, page
from motionlake.pictures.material import Material, Word
from motionlake.pictures.selection import ALL, View, display_names


def write_file(path: Path, content: bytes) -> None:
    """Write a file. Raises `UserError` where it cannot be written."""
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_pictures(pictures: Sequence[Picture], folder: Path) -> list[Path]:
    """Write each picture as a PNG file into a folder, which is made. Raises `UserError` where it cannot be."""
    paths = [folder / f"{p.name}.png" for p in pictures]
    for path, one in zip(paths, pictures, strict=True):
        write_file(path, one.png)
    return paths


def check_hits_file(path: Path, queries: int) -> None:
    """Raises `UserError` where the answers to so many queries cannot be drawn into a file of that name."""
    if path.suffix not in (".png", ".html"):
        raise UserError(f"{path}: pictures of hits are written as .png or .html")
    if path.suffix == ".png" and queries != 1:
        raise UserError(f"{path}: one .png holds the answers to one query, not to {queries}; name a .html file")


def write_hits(path: Path, pages: Sequence[Picture]) -> None:
    """Write pages of hits, one a query, as one PNG file or one HTML file that needs no other.

    Raises:
        UserError: another suffix, several pages for one PNG, or the file cannot be written.
    """
    check_hits_file(path, len(pages))
    if path.suffix == ".png":
        write_file(path, pages[0].png)
    else:
        write_file(path, page("Hits", [], [], [Chapter("Hits", pages)]).encode())


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
