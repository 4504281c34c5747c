"""Commands one after the other, as the installed script runs them: several share a process, and its imports."""

from __future__ import annotations

import atexit
import io
import json
import os
import runpy
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from unittest import mock

ROOT = Path(__file__).parents[2]
# One thread each, so that two commands share two cores and sums have one order.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


@dataclass(frozen=True)
class Said:
    """What a command said, and how long it took."""

    status: int
    out: str
    err: str
    seconds: float


def script() -> Path:
    """The command, beside the interpreter."""
    return Path(sys.executable).parent / "motionlake"


def say(words: Sequence[str]) -> Said:
    """Run the command line within this process."""
    out, err = io.StringIO(), io.StringIO()
    status: object = 0
    began = time.perf_counter()
    with (
        mock.patch.object(sys, "argv", [str(script()), *words]),
        mock.patch.object(os, "_exit", sys.exit),  # the command ends its process so
        mock.patch.object(atexit, "_run_exitfuncs"),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            runpy.run_path(str(script()), run_name="__main__")
        except SystemExit as stopped:
            status = stopped.code or 0
    return Said(status if isinstance(status, int) else 1, out.getvalue(), err.getvalue(), time.perf_counter() - began)


def chain(commands: Mapping[str, Sequence[str]]) -> dict[str, Said]:
    """Run commands in a process of their own, in their order."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("MOTIONLAKE_")}
    with NamedTemporaryFile("r", suffix=".json", encoding="utf-8") as answers:
        asked = json.dumps({"answers": answers.name, "commands": {k: list(v) for k, v in commands.items()}})
        subprocess.run(
            [sys.executable, "-m", "bench.golden", "serve"],
            input=asked, text=True, check=True, cwd=ROOT, env=environment | ONE_THREAD,
        )  # fmt: skip
        return {name: Said(**said) for name, said in json.load(answers).items()}


def serve() -> None:
    """The other side of `chain`."""
    asked = json.load(sys.stdin)
    said = {}
    for name, words in asked["commands"].items():
        said[name] = asdict(say(words))
        print(f"{said[name]['seconds']:6.1f} s  {name}", file=sys.stderr, flush=True)
    Path(asked["answers"]).write_text(json.dumps(said), encoding="utf-8")
