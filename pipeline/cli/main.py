"""The command line: `motionlake`. The module of a command is imported when the command is called."""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import select
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn

import typer
from motionlake.cli._event_log import ending, event, log_to
from motionlake.cli._output import notice
from motionlake.cli.common import SETTINGS, publish_copies
from motionlake.errors import UserError, denied, explained
from motionlake.names import printable
from motionlake.stopping import end_at_once, obeying, signal_asked
from typer.core import TyperGroup

# What each command does, by what people come for. The first line of its own help is the same (a test compares them).
COMMANDS: Final = {
    "Fill a lake": {
        "init": "Create an empty lake, the folder that holds clips and all that is computed of them.",
        "fetch": "Fetch a dataset that others publish, with licence and citation; without a name, list what there is.",
        "ingest": "Take clips into a lake, which is created if it is not there.",
        "run": "Bring a lake up to date: only what is missing is computed.",
        "status": "What a lake holds, what is made, what is missing, what was rejected and what failed.",
        "remove": "Take clips out of a lake, with all that was computed of them.",
        "migrate": "Bring a lake that an earlier motionlake wrote up to date; clips and all made of them stay.",
        "rig": "Which rig a clip file has, and a rig map to edit for a rig that is not known.",
    },
    "Keep it": {
        "verify": "Compare a lake with what was written: one row a fault; exit status 1 where there is one, else 0.",
        "repair": "Make damaged or missing files of a lake again, as they were.",
        "compact": "Merge the small files that many runs have left into few; nothing is computed anew.",
        "backup": "Copy into one archive what could not be made again.",
        "restore": "Make a lake from a backup; what that does not hold is made again from the sources.",
        "push": "Publish a lake in a bucket, as its next version; only what is not there yet is sent.",
        "pull": "Make a folder a copy of the lake in a bucket, or bring it up to date; only what is new is fetched.",
    },
    "Search it": {
        "search": "The clips most like one, nearest first.",
        "find": "Where a piece of motion occurs inside other clips, nearest first.",
        "align": "Where a piece of motion occurs inside other clips, pose by pose, and which poses match.",
        "duplicates": "Clips that are one recording: exported again, resampled, cut, or mirrored.",
        "sql": "Run SQL on a lake, with the lake's functions and macros. It reads the lake alone, and changes nothing.",
    },
    "Look at it": {
        "browse": "Look at a lake in the browser, and work on it; or serve it to programs.",
        "check": "What is wrong with recordings, worst first; exit status 1 where a clip is bad, else 0.",
        "clean": "Write mended copies of clips as BVH, and beside each what was mended where.",
        "view": "Play a clip beside the recorded one most like it: an HTML page, a GIF or a PNG.",
        "cite": "The licences and citations of what a lake holds, as BibTeX with comments.",
        "report": "One HTML page that shows what a lake holds: signatures, maps, motifs, sequences, a search.",
        "export": "Write clips, or ranges of them, as files of many formats, on their own rig or on your character.",
    },
    "Sort it": {
        "classify": "The class of clips, learned from the labelled clips of the lake.",
        "segment": "Which class each part of a clip shows, learned from labelled clips.",
        "cluster": "Groups of similar clips; no labels are used.",
        "suggest": "What clips may be called: suggestions, which nothing takes for the truth unless you do.",
    },
    "Make new motion": {
        "compose": "A new motion cut together from a dataset's clips, as BVH.",
        "synthesize": "New motion of classes that you name: recorded frames joined anew, or made by networks.",
        "inbetween": "Motion between your own poses: marked frames of a file become a dense BVH.",
    },
    "Train and measure": {
        "train": "Train a model on a lake's own clips.",
        "evaluate": "How well search, classes and made motion do on the labelled clips of a lake.",
    },
}
# The module of every command.
MODULES: Final = {
    "fill": ("ingest", "run", "remove"),
    "fetch": ("fetch", "cite"),
    "lake": ("init", "migrate", "status"),
    "rig": ("rig",),
    "compact": ("compact",),
    "mend": ("verify", "repair", "backup", "restore"),
    "bucket": ("push", "pull"),
    "search": ("search", "find"),
    "align": ("align",),
    "duplicates": ("duplicates",),
    "sql": ("sql",),
    "browse": ("browse",),
    "look": ("view", "report"),
    "check": ("check", "clean"),
    "export": ("export",),
    "sort": ("classify", "segment", "cluster"),
    "suggest": ("suggest",),
    "make": ("compose",),
    "synthesize": ("synthesize",),
    "inbetween": ("inbetween",),
    "train": ("train",),
    "evaluate": ("evaluate",),
}


class InterruptError(Exception):
    """A signal that ends the command, as an exception that typer does not turn into an exit without a word."""


class UnreadError(Exception):
    """Nobody reads what is printed, as an exception that typer does not turn into the status of rejected files."""


class Commands(TyperGroup):
    """The commands, whose modules stay unread until they are called."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._modules = {name: module for module, names in MODULES.items() for name in names}
        self.commands = dict.fromkeys(self._modules, self)  # what there is; `get_command` imports the modules

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in self._modules:
            return None
        found = getattr(importlib.import_module(f"motionlake.cli.{self._modules[cmd_name]}"), cmd_name)
        if not isinstance(found, typer.Typer):
            app = typer.Typer(**SETTINGS)
            app.command(cmd_name)(found)
            found = app
        return typer.main.get_command(found)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for title, commands in COMMANDS.items():
            with formatter.section(title):
                formatter.write_dl(list(commands.items()))

    def make_context(self, *words: Any, **settings: Any) -> Any:
        with _untold_by_typer():
            return super().make_context(*words, **settings)

    def invoke(self, ctx: Any) -> Any:
        with _untold_by_typer():
            return super().invoke(ctx)


@contextmanager
def _untold_by_typer() -> Iterator[None]:
    """Keep from typer what it would end the program for in its own way."""
    try:
        yield
    except KeyboardInterrupt as error:
        raise InterruptError from error
    except BrokenPipeError as error:
        if _unread():
            raise UnreadError from error
        raise
    except Exception as error:
        if hasattr(error, "format_message"):  # a mistake in the words of the command, which typer prints as they are
            vars(error)["message"] = printable(str(vars(error)["message"]))
        raise


app = typer.Typer(
    name="motionlake",
    help="Find, organise and reuse motion capture: clips in, Parquet and DuckDB out, answers to searches.",
    epilog="Results go to stdout, progress and notices to stderr. Exit status: 0 done, 1 done but for some files,"
    " 2 failed, 128 + its number ended by a signal.",
    cls=Commands,
    no_args_is_help=True,
    **SETTINGS,
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"motionlake {version('motionlake')}")
        raise typer.Exit


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show where in the code an error arose.")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", callback=_version, is_eager=True)
    ] = False,
    log_json: Annotated[
        Path | None,
        typer.Option(
            "--log-json",
            metavar="FILE",
            help="Append events of the command to a file, a line of JSON each: motionlake --log-json run.jsonl run all",
        ),
    ] = None,
) -> None:
    if debug:
        os.environ["MOTIONLAKE_DEBUG"] = "1"
    if log_json is not None:
        log_to(log_json)


@contextmanager
def _streams() -> Iterator[None]:
    """Standard streams that are there, whatever the command was started with, and an end when nobody reads them.

    Exit status 141, as of other programs that lose their reader, and 2 where the output cannot be written.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:  # else the next file that is opened, a catalog maybe, would be what is printed to
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - of a descriptor
    sys.stderr = sys.stderr or open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a name that the terminal's encoding lacks is spelled out
            stream.reconfigure(errors="backslashreplace")
    warnings.showwarning = lambda message, *_, **__: notice(str(message))
    try:
        yield
    except (UnreadError, BrokenPipeError):  # the latter of what is said of a mistake
        _end_unread()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        except OSError as error:
            if _unread():
                _end_unread()
            _send_nowhere(1)
            print(f"motionlake: the output cannot be written ({error.strerror or error})", file=sys.stderr)
            raise SystemExit(2) from None


def _unread() -> list[int]:
    """Which of the standard streams nobody reads any more; a broken pipe may also be one of a worker."""
    poll = select.poll()
    poll.register(1, 0)
    poll.register(2, 0)
    return [descriptor for descriptor, event in poll.poll(0) if event & (select.POLLERR | select.POLLHUP)]


def _end_unread() -> NoReturn:
    for descriptor in _unread():
        _send_nowhere(descriptor)
    raise SystemExit(141) from None


def _send_nowhere(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


def main() -> None:
    """Run the command line; a mistake gets one line on stderr and exit status 2, a signal one and 128 + its number."""
    gc.set_threshold(10_000)  # to look for cycles in the rows of a large lake took a fifth of the time
    os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")  # else POT takes a second to import torch for nothing
    with _streams(), ending():
        try:
            with obeying():
                _run()
        except (UnreadError, BrokenPipeError):
            raise
        except (KeyboardInterrupt, Exception) as error:
            _end(error)


def _run() -> None:
    """Run the command; what it has changed of a lake in a bucket is published there, unless it failed."""
    try:
        app(standalone_mode=True)
    except SystemExit as end:
        if end.code in (None, 0, 1):
            publish_copies()
        raise


def _end(error: BaseException) -> NoReturn:
    """Tell why a command ends. What fails after a signal fails by it: DuckDB's queries have an error of their own."""
    number = signal_asked() or (signal.SIGINT if isinstance(error, KeyboardInterrupt | InterruptError) else None)
    if number is not None:
        how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
        _fail(f"{how}; the same command goes on where this one stopped", error, 128 + number)
    if isinstance(error, UserError):
        _fail(str(error), error)
    if isinstance(error, UnicodeEncodeError):
        _fail(f"{error.object}: is not UTF-8; give a name that is", error)
    from motionlake.memory import shortage

    short = shortage(error)
    if short:
        _fail(f"{short} ({type(error).__name__}: {error})", error)
    if isinstance(error, OSError):
        _fail(explained(error), error)
    _fail(denied(str(error)) or f"{type(error).__name__}: {error} (--debug before the command shows where)", error)


def _fail(message: str, error: BaseException, status: int = 2) -> NoReturn:
    if os.environ.get("MOTIONLAKE_DEBUG"):
        raise error
    said = " ".join(message.split())
    event("fails", reason=said)
    print(f"motionlake: {printable(said)}", file=sys.stderr)
    raise SystemExit(status)


def program() -> None:
    """`main` as a process of its own, which ends at once: Python would first free one by one all that libraries made.
    Where a thread still runs, Python ends in its own way."""
    end_at_once()
    try:
        main()
    except SystemExit as end:
        if not isinstance(end.code, int | None) or threading.active_count() > 1:
            raise
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(end.code or 0)


if __name__ == "__main__":
    program()
