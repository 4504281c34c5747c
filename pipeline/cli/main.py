"""The command line: `motionlake`, one module a command."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Annotated

import typer
from motionlake.errors import UserError

COMMANDS = (
    "init",
    "ingest",
    "run",
    "train",
    "status",
    "search",
    "sql",
    "export",
    "compose",
    "synthesize",
    "segment",
    "classify",
    "cluster",
    "evaluate",
    "remove",
    "rig",
    "find",
    "align",
    "duplicates",
    "report",
    "view",
)

app = typer.Typer(
    name="motionlake",
    help="Find, organise and reuse motion capture: clips in, Parquet and DuckDB out, answers to searches.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Results go to stdout, progress and notices to stderr.

    Exit status: 0 done, 1 done with rejects or failures, 2 failed.
    """
    if debug:
        os.environ["MOTIONLAKE_DEBUG"] = "1"


for _name in COMMANDS:
    importlib.import_module(f"motionlake.cli.{_name}").add_to(app)


def main() -> None:
    """Run the command line; a mistake gets one line on stderr and exit status 2."""
    os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")  # else POT takes a second to import torch for nothing
    try:
        app(standalone_mode=True)
    except UserError as error:
        _fail(str(error), error)
    except KeyboardInterrupt as error:
        _fail("interrupted; the same command goes on where this one stopped", error)
    except Exception as error:
        _fail(f"{type(error).__name__}: {error} (--debug before the command shows where)", error)


def _fail(message: str, error: BaseException) -> None:
    if os.environ.get("MOTIONLAKE_DEBUG"):
        raise error
    print(f"motionlake: {' '.join(message.split())}", file=sys.stderr)
    raise SystemExit(2)


if __name__ == "__main__":
    main()
