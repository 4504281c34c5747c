"""Files that a library in C or C++ reads, in a process of their own.

With a damaged file such a library may end the process that it runs in, run on, or take all memory. So a child reads the
file within `limits` and sends what it found; whatever happens to it is a reason to reject the file and nothing else.

Python and the library take longer to start than most files to read. So a server starts once, which opens no file, and
forks children; a child reads file after file until it rejects one or has grown. What a child rejects or ends with that
has read other files before, a new one reads again: no file is rejected for what another did. A module of a library
calls `read_apart` with its own name, and `serve` where it is run as a program.
"""

from __future__ import annotations

import gc
import json
import os
import select
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Timer
from typing import IO, Any, Final

import numpy as np
from motionlake.arrays import UInt8Array
from motionlake.errors import ClipError
from motionlake.formats.limits_config import MIB, Limits, limits, within

_OWN_BYTES: Final = 1536 * MIB  # address space that Python and its libraries take
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "PXR_WORK_THREAD_LIMIT")
_ONE_THREAD: Final = dict.fromkeys(_THREADS, "1")
# Before what is asked, JSON and the file, their sizes; before an answer what it is, and its size.
_SIZES: Final = struct.Struct("<QQ")
_FOUND, _REJECTED, _REJECTED_LATER = range(3)  # the last by a child that had read other files before
_PIPE_BYTES: Final = 1 * MIB
_IDLE_SECONDS: Final = 60.0  # after which a child that is asked nothing ends, and its server with it
_MOST_FILES: Final = 200  # that one child reads
_GROWN: Final = 256 * MIB  # address space that a child may take on from file to file
_ENDED, _NOTHING_ASKED = 1, 3  # how a child ends that sent no answer
_CAN_FORK: Final = hasattr(os, "fork")

# Servers that wait, by their command, and since when.
_waiting: Final[dict[tuple[str, ...], list[tuple[subprocess.Popen[bytes], float]]]] = {}
if _CAN_FORK:
    os.register_at_fork(after_in_child=_waiting.clear)


def read_apart(module: str, library: str, data: bytes) -> UInt8Array:
    """What the child that runs `module` sends of a file's bytes.

    Raises:
        ClipError: the child rejects the file, ends while it reads it, or needs more than `limits` allow; `library` is
            its name for people.
    """
    command = (sys.executable, "-P", "-m", module)
    server = _waiting_server(command)
    answer = None if server is None else _asked(server, command, data)
    if answer is None or answer[0] == _REJECTED_LATER:
        answer = _asked(_waiting_server(command) if answer else _started(command), command, data)
    if answer is None:
        raise ClipError(f"{library} cannot read it: it ended while it read the file")
    what, content = answer
    if what != _FOUND:
        raise ClipError(content.tobytes().decode("utf-8", "replace"))
    return content


def _asked(
    server: subprocess.Popen[bytes] | None, command: tuple[str, ...], data: bytes
) -> tuple[int, UInt8Array] | None:
    """What a server answers of a file, or None where it ends; `ClipError` where it takes too long.

    One that answered waits for the next file.
    """
    server, seconds, late = server or _started(command), limits().seconds, []

    def stop() -> None:
        late.append(True)
        _end(server)

    timer = Timer(seconds, stop)
    timer.daemon = True
    try:
        if seconds:
            timer.start()
        with TemporaryDirectory(prefix="motionlake-") as folder:
            answer = _ask(server, json.dumps([asdict(limits()), folder]).encode(), data)
    except (OSError, EOFError) as error:
        _end(server)
        if late:
            raise ClipError(f"took more than {seconds} s to read; [limits] seconds in config.toml") from error
        return None
    except BaseException:
        _end(server)
        raise
    finally:
        timer.cancel()
    if _CAN_FORK and not late:
        _waiting.setdefault(command, []).append((server, time.monotonic()))
    else:
        _end(server)
    return answer


def _waiting_server(command: tuple[str, ...]) -> subprocess.Popen[bytes] | None:
    """A server that waits, if there is one."""
    waiting = _waiting.get(command, [])
    while waiting:
        server, since = waiting.pop()
        if server.poll() is None and time.monotonic() - since < _IDLE_SECONDS / 2:
            return server
        _end(server)
    return None


def _started(command: tuple[str, ...]) -> subprocess.Popen[bytes]:
    """A new server."""
    server = subprocess.Popen(
        command, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env=os.environ | _ONE_THREAD, process_group=0 if _CAN_FORK else None,
    )  # fmt: skip
    for pipe in (server.stdin, server.stdout):
        _widen(pipe)
    return server


def _ask(server: subprocess.Popen[bytes], about: bytes, data: bytes) -> tuple[int, UInt8Array]:
    """Send a file; what the answer is, and the answer. `OSError` or `EOFError` where there is none."""
    assert server.stdin is not None
    assert server.stdout is not None
    for part in (_SIZES.pack(len(about), len(data)) + about, data):
        rest = memoryview(part)
        while rest:
            rest = rest[server.stdin.write(rest) :]
    what, size = _SIZES.unpack(_received(server.stdout, _SIZES.size).data)
    return what, _received(server.stdout, size)


def _received(stream: IO[bytes], size: int) -> UInt8Array:
    """So many bytes; `EOFError` where there are fewer."""
    found = np.empty(size, np.uint8)
    rest = found.data
    while rest:
        count = stream.readinto(rest)  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        rest = rest[count:]
    return found


def _end(server: subprocess.Popen[bytes]) -> None:
    """End a server and its child."""
    with suppress(OSError):
        if _CAN_FORK:
            os.killpg(server.pid, signal.SIGKILL)
        else:
            server.kill()
    with server:  # closes pipes and waits
        pass


def _widen(pipe: IO[bytes] | None) -> None:
    """Have a pipe hold more, where the system can."""
    try:
        import fcntl

        assert pipe is not None
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    except (ImportError, AttributeError, OSError):
        return


def serve(read: Callable[[bytes, Path], Sequence[memoryview]], prepare: Callable[[], object]) -> None:
    """Be the server: `prepare` what all files need, then have child after child read, until one ends without an answer.

    `read` gets a file's bytes and an empty folder that is removed afterwards.
    """
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what libraries print is no answer
    with suppress(ImportError):  # `read` says so
        prepare()
    gc.disable()  # a search for cycles takes longer than most files, and frees what libraries free wrongly
    while _CAN_FORK:
        child = os.fork()
        if not child:
            break
        if os.waitpid(child, 0)[1]:
            os._exit(_ENDED)
    code = _ENDED
    try:
        code = _answer_all(read, answers)
    finally:  # nothing is let go: what a library frees may be what it frees wrongly
        os._exit(code)


def _answer_all(read: Callable[[bytes, Path], Sequence[memoryview]], answers: IO[bytes]) -> int:
    """Be the child: read files until one is rejected or memory has grown; the code to end with."""
    asked, own = os.fdopen(0, "rb", buffering=0), _address_space()
    for number in range(_MOST_FILES if _CAN_FORK else 1):
        if _CAN_FORK and not select.select([asked], [], [], _IDLE_SECONDS)[0]:
            return _NOTHING_ASKED
        try:
            head, size = _SIZES.unpack(_received(asked, _SIZES.size).data)
        except EOFError:
            return _NOTHING_ASKED
        about: tuple[dict[str, Any], str] = json.loads(_received(asked, head).tobytes())
        data, allowed = _received(asked, size).tobytes(), Limits(**about[0])
        grown = _address_space() - own
        _bound_memory(_OWN_BYTES + grown + allowed.memory_megabytes * MIB)
        what, found = _answer(read, data, Path(about[1]), allowed)
        if what == _REJECTED and number:
            what = _REJECTED_LATER
        for part in (memoryview(_SIZES.pack(what, sum(map(len, found)))), *found):
            rest = part
            while rest:
                rest = rest[answers.write(rest) or 0 :]
        del data, found
        if what != _FOUND or _address_space() - own > _GROWN:
            break
    return 0


def _answer(
    read: Callable[[bytes, Path], Sequence[memoryview]], data: bytes, folder: Path, allowed: Limits
) -> tuple[int, list[memoryview]]:
    try:
        with within(allowed):
            return _FOUND, [memoryview(part).cast("B") for part in read(data, folder)]
    except ClipError as error:
        reason = " ".join(error.reason.split())
    except MemoryError:
        most = allowed.memory_megabytes
        reason = f"needs more than {most} MiB of memory; [limits] memory_megabytes = {most} in config.toml"
    return _REJECTED, [memoryview(reason.encode("utf-8", "replace"))]


def _address_space() -> int:
    """Bytes of this process; 0 where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, AttributeError, ValueError):
        return 0


def _bound_memory(most: int) -> None:
    try:
        import resource
    except ImportError:  # where there is none, the limit of the worker holds
        return
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
