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
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import mkdtemp
from threading import Timer
from typing import IO, Any, Final

import numpy as np
from motionlake.allocation import keep_freed
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
_FOLDER: Final = "MOTIONLAKE_READERS_FOLDER"  # of the environment of a server


@dataclass(frozen=True)
class _Server:
    """A process whose children read files.

    Attributes:
        command: that it runs.
        process: its pipes tell at once when they are full or empty, where the system can wait for several.
        folder: for files that the library reads from the disk; removed with the server.
    """

    command: tuple[str, ...]
    process: subprocess.Popen[bytes]
    folder: Path

    @classmethod
    def started(cls, command: tuple[str, ...]) -> _Server:
        """A new one."""
        folder = mkdtemp(prefix="motionlake-")
        try:
            process = subprocess.Popen(
                command, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                env=os.environ | _ONE_THREAD | {_FOLDER: folder}, process_group=0 if _CAN_FORK else None,
            )  # fmt: skip
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        for pipe in (process.stdin, process.stdout):
            assert pipe is not None
            _widen(pipe)
            if _CAN_FORK:
                os.set_blocking(pipe.fileno(), False)
        return cls(command, process, Path(folder))

    def ask(self, about: bytes, data: bytes, until: float | None) -> tuple[int, UInt8Array]:
        """Send a file; what the answer is, and the answer. `OSError` or `EOFError` where there is none.

        `TimeoutError` where it does not come until then.
        """
        asked, answers = self.process.stdin, self.process.stdout
        assert asked is not None
        assert answers is not None
        for part in (_SIZES.pack(len(about), len(data)) + about, data):
            rest = memoryview(part)
            while rest:
                sent = asked.write(rest)
                if sent is None:
                    _wait(until, writing=asked)
                rest = rest[sent or 0 :]
        what, size = _SIZES.unpack(_received(answers, _SIZES.size, until).data)
        return what, _received(answers, size, until)

    def end(self) -> None:
        """End it and its child."""
        with suppress(OSError):
            if _CAN_FORK:
                os.killpg(self.process.pid, signal.SIGKILL)
            else:
                self.process.kill()
        with self.process:  # closes pipes and waits
            pass
        shutil.rmtree(self.folder, ignore_errors=True)


# Servers that wait, by their command, and since when.
_waiting: Final[dict[tuple[str, ...], list[tuple[_Server, float]]]] = {}
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
    answer = None if server is None else _asked(server, data)
    if answer is None or answer[0] == _REJECTED_LATER:
        fresh = (_waiting_server(command) if answer else None) or _Server.started(command)
        answer = _asked(fresh, data)
    if answer is None:
        raise ClipError(f"{library} cannot read it: it ended while it read the file")
    what, content = answer
    if what != _FOUND:
        raise ClipError(content.tobytes().decode("utf-8", "replace"))
    return content


def _asked(server: _Server, data: bytes) -> tuple[int, UInt8Array] | None:
    """What a server answers of a file, or None where it ends; `ClipError` where it takes too long.

    One that answered waits for the next file.
    """
    allowed = limits()
    until = time.monotonic() + allowed.seconds if allowed.seconds else None
    try:
        with _stopped_then(server, allowed.seconds):
            answer = server.ask(json.dumps(asdict(allowed)).encode(), data, until)
    except TimeoutError as error:
        server.end()
        reason = f"took more than {allowed.seconds} s to read; [limits] seconds in config.toml"
        raise ClipError(reason) from error
    except (OSError, EOFError):
        server.end()
        return None
    except BaseException:
        server.end()
        raise
    if _CAN_FORK:
        _waiting.setdefault(server.command, []).append((server, time.monotonic()))
    else:
        server.end()
    return answer


@contextmanager
def _stopped_then(server: _Server, seconds: float) -> Iterator[None]:
    """Where the system cannot wait for pipes, a thread ends a server after so many seconds: `TimeoutError`."""
    if _CAN_FORK or not seconds:
        yield
        return
    late: list[bool] = []

    def stop() -> None:
        late.append(True)
        server.process.kill()

    timer = Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    except (OSError, EOFError) as error:
        if late:
            raise TimeoutError from error
        raise
    finally:
        timer.cancel()


def _waiting_server(command: tuple[str, ...]) -> _Server | None:
    """A server that waits, if there is one."""
    waiting = _waiting.get(command, [])
    while waiting:
        server, since = waiting.pop()
        if server.process.poll() is None and time.monotonic() - since < _IDLE_SECONDS / 2:
            return server
        server.end()
    return None


def _received(stream: IO[bytes], size: int, until: float | None = None) -> UInt8Array:
    """So many bytes; `EOFError` where there are fewer, `TimeoutError` where they are not there until then."""
    found = np.empty(size, np.uint8)
    rest = found.data
    while rest:
        count = stream.readinto(rest)  # type: ignore[attr-defined]
        if count is None:
            _wait(until, reading=stream)
        elif not count:
            raise EOFError
        rest = rest[count or 0 :]
    return found


def _wait(until: float | None, *, reading: IO[bytes] | None = None, writing: IO[bytes] | None = None) -> None:
    """Until a pipe has something, or room; `TimeoutError` where that takes longer."""
    left = None if until is None else 1000 * max(0.0, until - time.monotonic())
    waiting = select.poll()
    for pipe, event in ((reading, select.POLLIN), (writing, select.POLLOUT)):
        if pipe is not None:
            waiting.register(pipe, event)
    if not waiting.poll(left):
        raise TimeoutError


def _widen(pipe: IO[bytes]) -> None:
    """Have a pipe hold more, where the system can."""
    try:
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    except (ImportError, AttributeError, OSError):
        return


def serve(read: Callable[[bytes, Path], Sequence[memoryview]], prepare: Callable[[], object]) -> None:
    """Be the server: `prepare` what all files need, then have child after child read, until one ends without an answer.

    `read` gets a file's bytes and an empty folder that is removed afterwards.
    """
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # what libraries print is no answer
    keep_freed()
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
    asked, own, home = os.fdopen(0, "rb", buffering=0), _address_space(), Path(os.environ[_FOLDER])
    for number in range(_MOST_FILES if _CAN_FORK else 1):
        file = _next_file(asked)
        if file is None:  # whoever asked may be gone, and then does not remove it
            shutil.rmtree(home, ignore_errors=True)
            return _NOTHING_ASKED
        data, allowed = file
        grown = _address_space() - own
        _bound_memory(_OWN_BYTES + grown + allowed.memory_megabytes * MIB)
        folder = home / f"{os.getpid()}-{number}"
        folder.mkdir(parents=True)
        what, found = _answer(read, data, folder, allowed)
        if what == _REJECTED and number:
            what = _REJECTED_LATER
        for part in (memoryview(_SIZES.pack(what, sum(map(len, found)))), *found):
            rest = part
            while rest:
                rest = rest[answers.write(rest) or 0 :]
        shutil.rmtree(folder, ignore_errors=True)  # while the answer is looked at
        del data, file, found
        if what != _FOUND or _address_space() - own > _GROWN:
            break
    return 0


def _next_file(asked: IO[bytes]) -> tuple[bytes, Limits] | None:
    """The bytes of a file and what holds for it; None where nobody asks any more."""
    if _CAN_FORK and not select.select([asked], [], [], _IDLE_SECONDS)[0]:
        return None
    try:
        head, size = _SIZES.unpack(_received(asked, _SIZES.size).data)
    except EOFError:
        return None
    about: dict[str, Any] = json.loads(_received(asked, head).tobytes())
    return _received(asked, size).tobytes(), Limits(**about)


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
