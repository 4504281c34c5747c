"""motionlake fetch and cite: datasets that others publish into a folder, and whom to name for what a lake holds."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from motionlake.cli._bytes import amount, byte_progress
from motionlake.cli._output import notice, tell
from motionlake.cli.common import JsonOption, LakeOption, SchedulerOption, WorkersOption, argument, option
from motionlake.errors import UserError

if TYPE_CHECKING:
    from motionlake.lake.citations import Source
    from motionlake.recipes.recipe import Recipe


def fetch(
    name: Annotated[str | None, argument("A dataset, or a recipe of your own (a .toml file); none: list them.")] = None,
    to: Annotated[Path | None, option("--to", help="Folder to fetch into (default: ./NAME).")] = None,
    lake: Annotated[
        Path | None,
        option("--lake", "-l", help="Then take the clips into this lake, as dataset NAME.", readable=False),
    ] = None,
    accept: Annotated[bool, typer.Option("--accept-licence", help="You have read the licence and keep to it.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Fetch also what is there already.")] = False,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fetch a dataset that others publish, with licence and citation; without a name, list what there is.

    A download that was stopped goes on where it was. What lies behind a form is downloaded by hand: the command says
    how, and goes on from there.

    Example: motionlake fetch

    Example: motionlake fetch lafan1 --to recordings/lafan1 --accept-licence

    Into a lake as well: motionlake fetch 100style --to recordings/100style --lake mylake
    """
    from motionlake.recipes.fetching import fetch_dataset
    from motionlake.recipes.recipe import find_recipe, recipes

    if name is None:
        rows = [_as_row(recipe) for recipe in recipes().values()]
        tell([_as_json(recipe) for recipe in recipes().values()], rows, as_json=as_json)
        return
    recipe = find_recipe(name)
    folder = to or Path(recipe.name)
    _tell_terms(recipe)
    _check_accepted(recipe, accept)
    with byte_progress() as progress:
        done = fetch_dataset(recipe, folder, again=again, arriving=progress, notice=notice)
    line = f"{folder}: {recipe.title}; {len(done.fetched)} files fetched, {len(done.there)} there already"
    line += f", labels.csv for {done.labelled} clips" * bool(done.labelled)
    if lake is None:
        told = {"folder": str(folder), "fetched": done.fetched, "there": done.there, "labelled": done.labelled}
        tell(told, line, as_json=as_json)
        notice(f"next: motionlake ingest {folder} --dataset {recipe.name} --lake LAKE")
        return
    from motionlake.cli.fill import ingest

    notice(line)
    ingest([folder], lake, dataset=recipe.name, workers=workers, scheduler=scheduler, as_json=as_json)


def cite(
    lake: LakeOption,
    clips: Annotated[list[str] | None, argument("Only what these clips come from (default: all).")] = None,
    as_json: JsonOption = False,
) -> None:
    """The licences and citations of what a lake holds, as BibTeX with comments.

    Example: motionlake cite --lake mylake > datasets.bib

    What one clip comes from: motionlake cite walk_01 --lake mylake
    """
    from motionlake.lake.catalog import fetch as rows_of
    from motionlake.lake.catalog import reading
    from motionlake.lake.citations import citations
    from motionlake.lake.layout import open_lake
    from motionlake.lake.resolve import resolve_clip

    with reading(open_lake(lake)) as con:
        known, sources = {row["dataset"]: row for row in rows_of(con, "datasets_of_clips")}, citations(con)
        chosen = sorted({resolve_clip(con, clip).split("/")[0] for clip in clips} if clips else known)
    if as_json:
        tell([{**known[d], "sources": [vars(source) for source in sources[d]]} for d in chosen], as_json=True)
        return
    if not chosen:
        notice(f"{lake}: holds no clips yet")
    for dataset in chosen:
        row, clips_of = known[dataset], sources[dataset]
        stated = "; ".join(row["licences"]) or "not stated"
        partly = f" ({row['unlicensed']} clips: not stated)" if row["licences"] and row["unlicensed"] else ""
        lines = [f"% dataset {dataset}: {row['clips']} clips, licence {stated}{partly}"]
        for source in clips_of:
            lines += _cited(source)
        if not clips_of:
            lines.append("% where it comes from was not said: SOURCE.json of its folder, or ingest --licence")
        for line in lines:
            tell(None, line, as_json=False)


def _cited(source: Source) -> list[str]:
    use = {True: "commercial use allowed", False: "not for commercial use", None: "commercial use not said"}
    head = [f"{source.title or source.name} {source.homepage}", f"{source.licence} {source.licence_url}"]
    head[1] += f"; {use[source.commercial]}" + f"; {source.terms}" * bool(source.terms)
    text = source.citation.strip().splitlines()
    bibtex = bool(text) and text[0].startswith("@")
    return [f"% {line.strip()}" for line in head] + [line if bibtex else f"% {line}" for line in text]


def _as_json(recipe: Recipe) -> dict[str, Any]:
    return {
        **vars(recipe),
        "licence": vars(recipe.licence),
        "files": [vars(file) for file in recipe.files],
    }


def _as_row(recipe: Recipe) -> dict[str, Any]:
    how = "by hand" if recipe.by_hand else "fetched"
    licence = recipe.licence
    return {
        "name": recipe.name,
        "clips": "?" if recipe.clips is None else f"{recipe.clips:,}",
        "formats": ", ".join(recipe.formats),
        "size": amount(recipe.size),
        "licence": licence.name,
        "commercial use": "yes" if licence.commercial else "no",
        "how": how + ", --accept-licence" * licence.accept,
    }


def _tell_terms(recipe: Recipe) -> None:
    licence = recipe.licence
    use = "" if licence.commercial else ", not for commercial use"
    notice(f"{recipe.title} ({recipe.homepage})")
    notice(f"licence: {licence.name}{use} ({licence.url}). {licence.terms}")
    for line in ("cite:", *recipe.citation.strip().splitlines()):
        notice(line)


def _check_accepted(recipe: Recipe, accept: bool) -> None:
    """Raises `UserError` where a licence that must be accepted was not."""
    if accept or not recipe.licence.accept:
        return
    if sys.stdin.isatty() and sys.stderr.isatty() and typer.confirm("Do you accept the licence?", err=True):
        return
    raise UserError(f"{recipe.name}: read its licence ({recipe.licence.url}), then give --accept-licence")
