"""The report of a lake: every kind of picture, in one HTML page and as PNG files."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.pictures import clip_sections, sequence_sections
from motionlake.pictures.html import Chapter, Picture, page
from motionlake.pictures.material import Material, View, dataset_view, lake_view, most_cut, read_material
from motionlake.pictures.symbol_material import has_strings, read_symbols
from motionlake.pictures.symbol_sections import string_pictures

MOST_DATASETS: Final = 8
MOST_SEGMENTED: Final = 6


@dataclass(frozen=True)
class Report:
    """The page and the pictures on it."""

    html: str
    pictures: list[Picture]


def make_report(
    con: Connection, lake: Lake, dataset: str | None = None, say: Callable[[str], None] = lambda line: None
) -> Report:
    """Draw the report of a lake, or of one of its datasets.

    Args:
        con: to the lake.
        lake: whose frames are drawn.
        dataset: restricts all of it.
        say: is told what is being drawn.

    Raises:
        UserError: the lake has no motifs or no signed clips yet, or not in that dataset.
    """
    material = read_material(con, lake, dataset)
    datasets = sorted({c.dataset for c in material.corpus.clips})
    views = []
    for name in datasets[:MOST_DATASETS]:
        say(f"report: {name}")
        views.append(dataset_view(material, name))
    whole = lake_view(material) if len(datasets) > 1 else None
    chapters = [Chapter(f"Dataset {view.name}", _of_dataset(material, view)) for view in views]
    say("report: the lake as a whole")
    chapters.insert(0, Chapter("The lake as a whole", _of_lake(lake, material, whole or views[0], len(datasets))))
    if has_strings(con):
        say("report: symbol strings")
        chapters.append(Chapter("Symbol strings", _of_strings(con, lake, dataset)))
    chapters = _named_apart([chapter for chapter in chapters if chapter.pictures])
    lead = _lead(material, len(datasets))
    tables = [fetch(con, "lake_summary", {"dataset": dataset}), _models(con)]
    title = f"What is in the lake {lake.root.name}" + (f": dataset {dataset}" if dataset else "")
    pictures = [p for chapter in chapters for p in chapter.pictures]
    return Report(page(title, lead, tables, chapters), pictures)


def _named_apart(chapters: list[Chapter]) -> list[Chapter]:
    """No two pictures of one name: clips of several folders may be called alike."""
    seen: Counter[str] = Counter()

    def renamed(picture: Picture) -> Picture:
        seen[picture.name] += 1
        return replace(picture, name=f"{picture.name}-{seen[picture.name]}") if seen[picture.name] > 1 else picture

    return [Chapter(chapter.title, [renamed(p) for p in chapter.pictures]) for chapter in chapters]


def _of_lake(lake: Lake, material: Material, view: View, datasets: int) -> list[Picture]:
    found = [clip_sections.clips_map(material, view)] if datasets > 1 else []
    found += [clip_sections.strongest_motifs(material, view), clip_sections.hits_of_one(lake, material)]
    return [p for p in found if p is not None]


def _of_dataset(material: Material, view: View) -> list[Picture]:
    found = [
        clip_sections.bars(material, view),
        clip_sections.clips_map(material, view),
        clip_sections.subjects_map(material, view),
        *clip_sections.class_motifs(material, view),
        clip_sections.two_bands(material, view),
        sequence_sections.along(material, view),
    ]
    found += [sequence_sections.segmentation(material, view, i) for i in most_cut(material, view, MOST_SEGMENTED)]
    return [p for p in found if p is not None]


def _of_strings(con: Connection, lake: Lake, dataset: str | None) -> list[Picture]:
    material = read_symbols(con, lake)
    clips = [i for i, c in enumerate(material.strings.clips) if dataset in (None, c.dataset)]
    return string_pictures(material, clips)


def _lead(material: Material, datasets: int) -> list[str]:
    corpus = material.corpus
    line = f"{len(corpus.clips)} clips, {len(corpus.motifs)} motion words, {len(corpus.idf)} motifs ({corpus.model})."
    lines = [f"{line} Where not all clips fit, the same sample is shown every time."]
    if datasets > MOST_DATASETS:
        lines.append(f"Chapters on the first {MOST_DATASETS} of {datasets} datasets; --dataset gives one on any other.")
    return lines


def _models(con: Connection) -> list[dict[str, Any]]:
    return [
        {"model": row["model"], "made": str(row["created"]), "metrics": _metrics(json.loads(row["metrics"]))}
        for row in fetch(con, "status_models")
    ]


def _metrics(metrics: Mapping[str, Any]) -> str:
    """Numbers of a model in a line; sets by name; hashes and curves are left out."""
    said = []
    for name, value in metrics.items():
        if isinstance(value, bool):
            said += [name.replace("_", " ")] if value else []
        elif isinstance(value, int | float):
            said.append(f"{name.replace('_', ' ')} {value:,.0f}" if value == int(value) else f"{name} {value:.4g}")
        elif name == "sets":
            said.append(f"from {', '.join(value)}")
    return ", ".join(said)
