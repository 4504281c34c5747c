"""The report of a lake: every kind of picture, in one HTML page and as PNG files."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from motionlake.lake.catalog import Connection, fetch
from motionlake.lake.layout import Lake
from motionlake.names import folded
from motionlake.pictures import clip_sections, sequence_sections
from motionlake.pictures.html import Picture, page
from motionlake.pictures.material import Material, View, dataset_view, lake_view, read_material
from motionlake.pictures.symbol_material import read_symbols
from motionlake.pictures.symbol_pictures import string_pictures

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
    """Draw the report of a lake, or of one of its datasets; `say` is told what is being drawn.

    Raises:
        UserError: the lake has no motifs or no signed clips yet, or not in that dataset.
    """
    material = read_material(con, lake, dataset)
    datasets = sorted({c.dataset for c in material.corpus.clips})
    views = []
    for name in datasets[:MOST_DATASETS]:
        say(f"report: {name}")
        views.append(dataset_view(material, name))
    drawn = {f"Dataset {view.name}": _of_dataset(material, view) for view in views}
    say("report: the lake as a whole")
    whole = lake_view(material) if len(datasets) > 1 else views[0]
    drawn = {"The lake as a whole": _of_lake(lake, material, whole, len(datasets))} | drawn
    if fetch(con, "served_postures"):
        say("report: symbol strings")
        symbols = read_symbols(con, lake)
        clips = [i for i, c in enumerate(symbols.strings.clips) if dataset in (None, c.dataset)]
        drawn["Symbol strings"] = string_pictures(symbols, clips)
    seen: Counter[str] = Counter()
    chapters = {title: [_named_apart(p, seen) for p in found if p is not None] for title, found in drawn.items()}
    chapters = {title: pictures for title, pictures in chapters.items() if pictures}
    tables = [fetch(con, "lake_summary", {"dataset": dataset}), _models(con)]
    title = f"What is in the lake {lake.root.name}" + (f": dataset {dataset}" if dataset else "")
    html = page(title, _lead(material, len(datasets)), tables, chapters)
    return Report(html, [p for pictures in chapters.values() for p in pictures])


def _named_apart(picture: Picture, seen: Counter[str]) -> Picture:
    """No two pictures of one name: clips of several folders may be called alike."""
    name = picture.name
    while folded(name) in seen:
        seen[folded(picture.name)] += 1
        name = f"{picture.name}-{seen[folded(picture.name)]}"
    seen[folded(name)] += 1
    return replace(picture, name=name)


def _of_lake(lake: Lake, material: Material, view: View, datasets: int) -> list[Picture | None]:
    found = [clip_sections.clips_map(material, view)] if datasets > 1 else []
    return [*found, clip_sections.strongest_motifs(material, view), clip_sections.hits_of_one(lake, material)]


def _of_dataset(material: Material, view: View) -> list[Picture | None]:
    cut = sequence_sections.most_cut(material, view, MOST_SEGMENTED)
    return [
        clip_sections.bars(material, view),
        clip_sections.clips_map(material, view),
        clip_sections.subjects_map(material, view),
        *clip_sections.class_motifs(material, view),
        clip_sections.two_bands(material, view),
        sequence_sections.along(material, view),
        *(sequence_sections.segmentation(material, view, i) for i in cut),
    ]


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
