"""What the subcommands of `motionlake evaluate` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer
from motionlake.errors import UserError
from motionlake.lake.layout import Lake, check_dataset, open_lake

BASELINES: Final = {"auto": None, "dtw": True, "none": False}

DatasetOption = Annotated[str | None, typer.Option("--dataset", help="Clips of this dataset only.", show_default=False)]
OnlyOption = Annotated[
    str | None, typer.Option("--only", help="COLUMN=VALUE: clips with this value alone.", show_default=False)
]
BaselineOption = Annotated[
    str, typer.Option(help="Whole-clip DTW beside it: auto (where it takes minutes at most), dtw, none.")
]


def target_of(lake: Path, dataset: str | None, baseline: str) -> Lake:
    if baseline not in BASELINES:
        raise UserError(f"--baseline {baseline}: use one of {', '.join(BASELINES)}")
    if dataset is not None:
        check_dataset(dataset)
    return open_lake(lake)


def criterion(text: str | None) -> tuple[str, str] | None:
    if text is None:
        return None
    column, equals, value = text.partition("=")
    if not (column and equals):
        raise UserError(f"--only {text}: give COLUMN=VALUE")
    return column, value
