"""Options of the commands that segment clips."""

from __future__ import annotations

from typing import Annotated

import typer

SegmentationOption = Annotated[
    str, typer.Option("--method", help="words (by the nearest labelled words), or signatures (the paper's windows).")
]
WindowOption = Annotated[int | None, typer.Option("--window", min=1, help="signatures: words of a window (19).")]
VotersOption = Annotated[int | None, typer.Option("-k", min=1, help="signatures: nearest windows that vote (5).")]
ReachOption = Annotated[
    int | None,
    typer.Option("--reach", min=0, help="signatures: how many words from its middle a window votes for (12)."),
]
