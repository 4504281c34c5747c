"""motionlake suggest, with its subcommands."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from motionlake.cli._output import check_folder_of, notice, tell, write_csv
from motionlake.cli._progress import stage_progress
from motionlake.cli.common import SETTINGS, DatasetOption, JsonOption, LabelColumn, LakeOption, MinQualityOption, option
from motionlake.lake.catalog import reading
from motionlake.lake.layout import Lake, open_lake

if TYPE_CHECKING:
    from motionlake.retrieval.suggestions import Suggestion

suggest = typer.Typer(
    help="What clips may be called: suggestions, which nothing takes for the truth unless you do.\n\n"
    "Example: motionlake suggest labels --dataset shots --json --lake mylake",
    no_args_is_help=True,
    **SETTINGS,
)


@suggest.callback()
def _commands() -> None:
    """Keeps the name of a single subcommand."""


@suggest.command()
def labels(
    lake: LakeOption,
    dataset: DatasetOption = None,
    min_quality: MinQualityOption = None,
    column: LabelColumn = "label",
    at_least: Annotated[
        float, typer.Option("--at-least", min=0, max=1, help="Leave out suggestions of less confidence.")
    ] = 0.0,
    out: Annotated[Path | None, option("--out", help="Write a labels.csv with them, for `ingest --labels`.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Labels for clips that have none: those of the labelled clips most like them by the default search.

    The confidence says how often such a label is right, judged by the labelled clips of the lake, each of which is
    suggested a label as if it had none. The lake is not changed.

    Example: motionlake suggest labels --dataset shots --lake mylake

    To read through and take in: motionlake suggest labels --at-least 0.9 --out found.csv --lake mylake
    """
    from motionlake.retrieval.fused import FusedSearcher
    from motionlake.retrieval.suggestions import LabelSuggester

    target = open_lake(lake)
    if out is not None:
        check_folder_of(out)
    with stage_progress() as progress:
        suggester = LabelSuggester(
            target, FusedSearcher(target), column, lambda done, count: progress("clips", done, count), min_quality
        )
        found = [each for each in suggester.suggest(dataset) if each.confidence >= at_least]
    if out is not None and found:
        _write(target, found, column, out)
    tell([asdict(each) for each in found], as_json=as_json)


def _write(lake: Lake, found: Sequence[Suggestion], column: str, out: Path) -> None:
    from motionlake.retrieval.suggestions import label_file

    with reading(lake) as con:
        made = label_file(con, found, column, out.parent)
    write_csv(out, made.columns, made.rows)
    words = shlex.join(["motionlake", "ingest", made.folder, "--labels", str(out), "--lake", str(lake.root)])
    notice(f"{out}: {len(found)} suggestions; read through them, then take them in: {words}")
