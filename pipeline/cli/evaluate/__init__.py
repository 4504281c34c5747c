"""motionlake evaluate: one module a subcommand."""

from __future__ import annotations

import typer
from motionlake.cli.evaluate.descriptor import descriptor
from motionlake.cli.evaluate.pesta import pesta
from motionlake.cli.evaluate.segmentation import segmentation
from motionlake.cli.evaluate.signatures import signatures
from motionlake.cli.evaluate.synthesis import synthesis

ABOUT = """Measures on labelled clips of a lake.

Example: motionlake evaluate signatures --dataset hdm05 --json --lake mylake"""


def add_to(app: typer.Typer) -> None:
    evaluate = typer.Typer(name="evaluate", help=ABOUT, no_args_is_help=True)
    for command in (signatures, segmentation, pesta, descriptor, synthesis):
        evaluate.command()(command)
    app.add_typer(evaluate)
