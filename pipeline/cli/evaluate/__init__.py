"""motionlake evaluate: one module a subcommand."""

from __future__ import annotations

import typer
from motionlake.cli.common import SETTINGS
from motionlake.cli.evaluate.descriptor import descriptor
from motionlake.cli.evaluate.pesta import pesta
from motionlake.cli.evaluate.segmentation import segmentation
from motionlake.cli.evaluate.signatures import signatures
from motionlake.cli.evaluate.synthesis import synthesis

evaluate = typer.Typer(
    help="How well search, classes and made motion do on the labelled clips of a lake.\n\n"
    "Example: motionlake evaluate signatures --dataset hdm05 --json --lake mylake",
    no_args_is_help=True,
    **SETTINGS,
)
for command in (signatures, segmentation, pesta, descriptor, synthesis):
    evaluate.command()(command)
