"""Options that searches have in common: how many answers, which, and where to draw them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer
from motionlake.cli.common import option
from motionlake.errors import UserError

KOption = Annotated[
    int | None, typer.Option("-k", min=1, help="How many answers (default: 10; all of them with --below).")
]
BelowOption = Annotated[float | None, option("--below", help="Only answers whose distance is less than this.")]
MirroredOption = Annotated[
    bool, typer.Option("--mirrored", help="Look for the mirror image too: left and right exchanged.")
]
OwnOption = Annotated[
    bool, typer.Option("--own", help="The query itself may be an answer, where it is a clip of the lake.")
]
USUAL: Final = 10
EVERY: Final = 10**9
PictureOption = Annotated[Path | None, option("--picture", help="Also draw the answers into this .png or .html file.")]


def count_of(k: int | None, below: float | None) -> int:
    """How many answers there are at most."""
    if k is not None:
        return k
    return USUAL if below is None else EVERY


def check_picture(path: Path | None, queries: int) -> None:
    """Before the search is made: can so many answers be drawn there? Raises `UserError` if not."""
    if path is None:
        return
    if path.suffix not in (".png", ".html"):
        raise UserError(f"{path}: pictures of hits are written as .png or .html")
    if path.suffix == ".png" and queries != 1:
        raise UserError(f"{path}: one .png holds the answers to one query, not to {queries}; name a .html file")
