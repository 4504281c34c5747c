"""Downloads that go on where they stopped: what pooch downloads with, by HTTP ranges into a file that a kill leaves.

pooch compares hashes and puts whole files in place, but begins anew whenever a connection breaks. Here the bytes go
into `NAME.part`, and `NAME.part.json` says of which version of the file they are: a server that has another one by now
is asked for all of it.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias
from urllib.parse import urlsplit

from motionlake.errors import UserError
from motionlake.lake.parts import replacing
from motionlake.recipes.recipe import RecipeFile

# Told of (file, bytes that are there, bytes in all where the server says).
Arriving: TypeAlias = Callable[[str, int, int | None], None]

CHUNK: Final = 1 << 14  # bytes that are written at once, and that a connection which breaks loses at most
MOST_UNSAID: Final = 1 << 40  # bytes of a file whose size nobody declares
_LATER: Final = frozenset({408, 425, 429, 500, 502, 503, 504})  # answers after which a server may be asked again
_RANGE: Final = re.compile(r"bytes (\d+)-\d+/(\d+|\*)")


@dataclass(frozen=True)
class Patience:
    """How long a server is waited for.

    Attributes:
        tries: in a row that bring no byte, before it counts as out of reach.
        pause: seconds before the second of them; each later one waits twice as long, and at most `longest`.
        silence: seconds without a byte after which a connection is given up.
    """

    tries: int = 6
    pause: float = 1.0
    longest: float = 60.0
    silence: float = 60.0


class _AnewError(Exception):
    """The bytes that are there are of no use."""


class ResumingDownloader:
    """What pooch calls to download: `(url, file to write, pooch)`. One for each file of a recipe."""

    def __init__(
        self, file: RecipeFile, part: Path, arriving: Arriving, notice: Callable[[str], object], patience: Patience
    ) -> None:
        self._file, self._part, self._arriving = file, part, arriving
        self._notice, self._patience = notice, patience
        self._notes = part.with_name(part.name + ".json")
        self._asked_pause = 0.0  # seconds that the server has asked for
        self.resumed = False

    def __call__(self, url: str, output_file: str, pooch: Any) -> None:
        """Raises `UserError` where the file cannot be had; what has arrived stays for the next call."""
        import requests

        failed, tries, furthest = "", 0, self._there()
        with requests.Session() as session:
            while tries < self._patience.tries:
                if tries:
                    self._wait(tries, failed)
                try:
                    self._ask(session, url)
                except _AnewError:
                    self.forget()
                    tries += 1
                    failed = "it cannot go on from where it stopped"
                except (requests.RequestException, _LaterError) as error:
                    failed = _reason(error)
                    tries = 1 if self._there() > furthest else tries + 1
                    furthest = max(furthest, self._there())
                else:
                    self._hand_over(Path(output_file))
                    return
        raise UserError(
            f"{url}: cannot be reached ({failed}); {self._there()} bytes are kept, and the same command goes on"
        )

    def _hand_over(self, file: Path) -> None:
        """Let pooch have the bytes. They stay here until they are found right, which takes minutes of a large file."""
        file.unlink(missing_ok=True)
        try:
            os.link(self._part, file)
        except OSError:  # a file system without links
            self._part.replace(file)

    def _wait(self, tries: int, failed: str) -> None:
        """Pause before a server is asked again; long pauses are told."""
        pause = max(self._patience.pause * 2 ** (tries - 1), self._asked_pause)
        pause = min(pause, self._patience.longest)
        if pause > 1:
            self._notice(f"{self._file.name}: {failed}; is asked for again in {pause:.0f} s")
        time.sleep(pause)

    def forget(self) -> None:
        """Throw away what has arrived."""
        self._part.unlink(missing_ok=True)
        self._notes.unlink(missing_ok=True)

    def _there(self) -> int:
        with suppress(OSError):
            return self._part.stat().st_size
        return 0

    def _ask(self, session: Any, url: str) -> None:
        """Ask for what is missing and write it. Raises an error of this module or of requests where that fails."""
        self._asked_pause = 0.0
        known = self._known_version(url)
        have = self._there()
        if have and have == self._expected(known):
            self.resumed = True
            return
        headers = {"Accept-Encoding": "identity"}
        if have:
            headers["Range"] = f"bytes={have}-"
            if known.get("validator"):
                headers["If-Range"] = known["validator"]
        silence = self._patience.silence
        with session.get(url, headers=headers, stream=True, timeout=(silence, silence)) as answer:
            self._check_way(url, answer)
            if answer.status_code in _LATER:
                with suppress(ValueError):
                    self._asked_pause = float(answer.headers.get("Retry-After", 0))
                raise _LaterError(f"the server says {answer.status_code} {answer.reason}")
            if answer.status_code == 416 and have:
                raise _AnewError
            if answer.status_code not in (200, 206):
                raise UserError(
                    f"{url}: the server says {answer.status_code} {answer.reason}; is there a newer recipe?"
                )
            start, total = self._place(answer, have, known)
            self._check_size(url, total)
            self._write(url, answer, start, total)

    def _expected(self, known: Mapping[str, Any]) -> int | None:
        return self._file.size or known.get("total")

    def _place(self, answer: Any, have: int, known: Mapping[str, Any]) -> tuple[int, int | None]:
        """Where the bytes of an answer belong, and how many the file has."""
        if answer.status_code == 200:  # a server without ranges, or one that has another version of the file by now
            length = answer.headers.get("Content-Length", "")
            return 0, int(length) if length.isdecimal() else None
        found = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        if found is None or int(found[1]) != have:
            raise _AnewError
        total = None if found[2] == "*" else int(found[2])
        if total is not None and known.get("total") not in (None, total):
            raise _AnewError
        return have, total or known.get("total")

    def _check_way(self, url: str, answer: Any) -> None:
        """Raises `UserError` where an answer did not come as safely as it was asked for."""
        hops = [urlsplit(hop.url).scheme for hop in (*answer.history, answer)]
        if urlsplit(url).scheme == "https" and "http" in hops and not self._file.sha256:
            raise UserError(f"{url}: leads to an address without https, {answer.url}; nothing is fetched from there")

    def _check_size(self, url: str, total: int | None) -> None:
        if self._file.size is not None and total not in (None, self._file.size):
            self.forget()
            raise UserError(
                f"{url}: has {total} bytes where the recipe says {self._file.size}; is there a newer recipe?"
            )

    def _write(self, url: str, answer: Any, start: int, total: int | None) -> None:
        from requests.exceptions import ConnectionError as BrokenError

        self.resumed = self.resumed or start > 0
        if start == 0:
            self.forget()
        # A weak validator may stand for files that differ in bytes.
        tag = answer.headers.get("ETag", "")
        validator = tag if tag and not tag.startswith("W/") else answer.headers.get("Last-Modified", "")
        with replacing(self._notes) as temporary:
            temporary.write_text(json.dumps({"url": url, "validator": validator, "total": total}), encoding="utf-8")
        most, there = self._file.size or total or MOST_UNSAID, start
        with self._part.open("ab") as part:
            for chunk in answer.iter_content(CHUNK):
                there += len(chunk)
                if there > most:
                    break
                part.write(chunk)
                self._arriving(self._file.name, there, self._file.size or total)
        if there > most:
            self.forget()
            raise UserError(f"{url}: sends more than the {most} bytes that are expected; is there a newer recipe?")
        if there < (self._file.size or total or 0):
            raise BrokenError("the connection ended early")

    def _known_version(self, url: str) -> dict[str, Any]:
        """What is known of the file that the bytes which are there come from; those of another one are thrown away."""
        try:
            found = json.loads(self._notes.read_text(encoding="utf-8"))
            if found["url"] == url and isinstance(found["validator"], str):
                return {"validator": found["validator"], "total": found["total"]}
        except (OSError, ValueError, KeyError, TypeError):
            pass
        self.forget()
        return {}


class _LaterError(Exception):
    """The server may answer when it is asked again."""


def _reason(error: Exception) -> str:
    """What broke, in a few words: requests tells of its own objects."""
    import requests

    if isinstance(error, requests.Timeout):
        return "no answer in time"
    if isinstance(error, requests.exceptions.SSLError):
        return "its certificate is not accepted"
    text = str(error)
    for sign, told in (
        ("timed out", "no answer in time"),
        ("NameResolution", "no such host, or no network"),
        ("refused", "connection refused"),
        ("IncompleteRead", "the connection broke"),
        ("reset", "the connection broke"),
        ("aborted", "the connection broke"),
    ):
        if sign in text:
            return told
    return text.splitlines()[0][:200] if text else type(error).__name__
