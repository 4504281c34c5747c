"""Files that a library in C or C++ reads, in a process of their own.

With a damaged file such a library may end the process that it runs in, run on, or take all memory. So a child reads the
file within `limits`, sends what it found, and ends at once; whatever happens to it is a reason to reject the file and
nothing else. A module of a library calls `read_apart` with its own name, and `serve` where it is run as a program.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from motionlake.errors import ClipError
from motionlake.formats.limits_config import MIB, Limits, limits, within

_OWN_BYTES: Final = 1536 * MIB  # address space that Python and its libraries take
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "PXR_WORK_THREAD_LIMIT")
_ONE_THREAD: Final = dict.fromkeys(_THREADS, "1")
_REASON: Final = "reason: "  # begins the last line that a child writes of a file that it rejects


def read_apart(module: str, library: str, data: bytes) -> bytes:
    """What the child that runs `module` sends of a file's bytes.

    Raises:
        ClipError: the child rejects the file, ends while it reads it, or needs more than `limits` allow; `library` is
            its name for people.
    """
    with TemporaryDirectory(prefix="motionlake-") as folder:
        try:
            ran = subprocess.run(
                [sys.executable, "-P", "-m", module, json.dumps(asdict(limits())), folder],
                input=data, capture_output=True, check=False,
                timeout=limits().seconds or None, env=os.environ | _ONE_THREAD,
            )  # fmt: skip
        except subprocess.TimeoutExpired as error:
            raise ClipError(f"took more than {limits().seconds} s to read; [limits] seconds in config.toml") from error
    said = ran.stderr.decode("utf-8", "replace").splitlines()
    if ran.returncode == 1 and said and said[-1].startswith(_REASON):
        raise ClipError(said[-1].removeprefix(_REASON))
    if ran.returncode:
        raise ClipError(f"{library} cannot read it: it ended while it read the file")
    return ran.stdout


def serve(read: Callable[[bytes, Path], bytes]) -> None:
    """Be the child: have a file read from standard input, send what was found, or the reason, and end.

    `read` gets the file's bytes and an empty folder that is removed afterwards. Nothing is let go: what a library frees
    may be what it frees wrongly.
    """
    sending = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    allowed = Limits(**json.loads(sys.argv[1]))
    _bound_memory(_OWN_BYTES + allowed.memory_megabytes * MIB)
    try:
        with within(allowed):
            sending.write(read(sys.stdin.buffer.read(), Path(sys.argv[2])))
        sending.flush()
        os._exit(0)
    except ClipError as error:
        reason = error.reason
    except MemoryError:
        most = allowed.memory_megabytes
        reason = f"needs more than {most} MiB of memory; [limits] memory_megabytes = {most} in config.toml"
    print(f"\n{_REASON}{' '.join(reason.split())}", file=sys.stderr, flush=True)
    os._exit(1)


def _bound_memory(most: int) -> None:
    try:
        import resource
    except ImportError:  # where there is none, the limit of the worker holds
        return
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
