"""Versions of a lake in object storage or a shared folder: every file once, by its hash, and numbered lists of files.

Below the address lie

- `objects/<two digits>/<sha256>`: a file of the lake by its bytes, never written over;
- `versions/<number>.json`: the files of one version. It is created only where there is none, so of two who publish
  the same number one is told; nothing is ever read by listing a folder, which some stores bring up to date late;
- `latest.json`: a number from which on the latest version is looked for. It may be an old one.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import uuid
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from motionlake.errors import UserError
from motionlake.lake.parts import replacing
from motionlake.lake.stores import FOLDER, Place

FORMAT: Final = 1
KEPT: Final = 3  # versions that are kept with their files
_SHA256: Final = re.compile(r"[0-9a-f]{64}")


class ConflictError(UserError):
    """Somebody else has published that version."""


@dataclass(frozen=True)
class Stored:
    """A file of a version.

    Attributes:
        file: its name relative to the lake.
        size: in bytes.
        sha256: of its bytes.
        mtime_ns: when it was written last.
    """

    file: str
    size: int
    sha256: str
    mtime_ns: int


@dataclass(frozen=True)
class Version:
    """All files of a lake at one time.

    Attributes:
        number: from 1 up.
        by: who published it, from where.
        at: when, ISO 8601.
        files: by name.
        token: drawn by who publishes, by which one whose answer was lost knows their own.
    """

    number: int
    by: str
    at: str
    files: tuple[Stored, ...]
    token: str

    def text(self) -> bytes:
        body = json.dumps({"format": FORMAT, **asdict(self)}, sort_keys=True)
        return json.dumps({"sha256": hashlib.sha256(body.encode()).hexdigest(), "version": body}).encode()

    @classmethod
    def read(cls, text: bytes) -> Version:
        """Raises `ValueError` where these are not the bytes that were written, or of a later motionlake."""
        try:
            outer = json.loads(text)
            if hashlib.sha256(outer["version"].encode()).hexdigest() != outer["sha256"]:
                raise ValueError("is damaged")
            found = json.loads(outer["version"])
            if found.pop("format") != FORMAT:
                raise ValueError("was written by a later motionlake; update")
            files = tuple(Stored(**each) for each in found.pop("files"))
            version = cls(files=files, **found)
        except (KeyError, TypeError, AttributeError, RecursionError) as error:
            raise ValueError("is no version of a lake") from error
        if not all(_SHA256.fullmatch(each.sha256) and type(each.size) is int for each in files):
            raise ValueError("is no version of a lake")
        return version


class Bucket:
    """Where versions of one lake are kept: an address such as `s3://bucket/lake` or `file:///mnt/share/lake`.

    Raises:
        UserError: from every method: the store cannot be reached or read, or refuses.
    """

    def __init__(self, address: str | Path) -> None:
        self._place = Place.of(address)
        self._local, self._root = self._place.store == FOLDER, self._place.root
        self.address = self._place.address
        self._files = self._place.connect()

    def latest(self) -> Version | None:
        """The latest version; None where none was published."""
        with self._place.told():
            number = self._hint()
            found = self._version(number) if number else None
            while (newer := self._version((found.number if found else number) + 1)) is not None:
                found = newer
            if found is None and not self._local:
                self._check_there()
        return found

    def publish(self, version: Version) -> None:
        """Make a version the latest one.

        Raises:
            ConflictError: there is one of its number.
        """
        path = self._version_path(version.number)
        with self._place.told():
            try:
                self._create(path, version.text())
            except FileExistsError:
                found = self._version(version.number)
                if found is None or found.token != version.token:  # else it was ours, and the answer was lost
                    raise ConflictError(
                        f"{self.address}: {found.by if found else 'somebody'} has published version {version.number} "
                        "meanwhile"
                    ) from None
            with suppress(Exception):  # it is published, and found by the number before
                self._files.pipe_file(self._path("latest.json"), json.dumps({"number": version.number}).encode())

    def has(self, stored: Stored) -> bool:
        """Whether the bytes of a file are there."""
        with self._place.told():
            try:
                return bool(self._files.info(self._object(stored))["size"] == stored.size)
            except FileNotFoundError:
                return False

    def put(self, path: Path, stored: Stored) -> None:
        """Bring a file there."""
        with self._place.told():
            if self._local:  # a kill must not leave half an object under its name
                with replacing(Path(self._object(stored))) as temporary:
                    shutil.copyfile(path, temporary)
            else:
                self._files.put_file(str(path), self._object(stored))

    def get(self, stored: Stored, path: Path) -> None:
        """Write the bytes of a file to a path, and compare them.

        Raises:
            UserError: they are missing or not what was published.
        """
        with self._place.told():
            try:
                self._files.get_file(self._object(stored), str(path))
            except FileNotFoundError:
                raise UserError(f"{self.address}: {stored.file} is missing there; push the lake anew") from None
        with path.open("rb") as handle:
            if hashlib.file_digest(handle, "sha256").hexdigest() != stored.sha256:
                raise UserError(f"{self.address}: {stored.file} holds other bytes there than were pushed")

    def forget(self, last: Version, keep: int = KEPT) -> int:
        """Delete versions but the last `keep`, and the files that only they have; returns how many files.

        Nobody may push meanwhile: a file that comes back in the next version would be missing there.
        """
        with self._place.told():
            kept, old = [last], list[Version]()
            number = last.number - 1
            while number > 0 and (found := self._version(number)) is not None:
                (kept if len(kept) < keep else old).append(found)
                number -= 1
            used = {each.sha256 for version in kept for each in version.files}
            dead = {each.sha256: each for version in old for each in version.files if each.sha256 not in used}
            for stored in dead.values():
                self._delete(self._object(stored))
            for version in reversed(old):
                self._delete(self._version_path(version.number))
        return len(dead)

    def _check_there(self) -> None:
        """A bucket that is not there says of each of its objects that it is missing."""
        with suppress(PermissionError):
            self._files.info(self._root.partition("/")[0])

    def _delete(self, path: str) -> None:
        try:
            self._files.rm_file(path)
        except FileNotFoundError:
            return

    def _hint(self) -> int:
        try:
            number = json.loads(self._files.cat_file(self._path("latest.json")))["number"]
        except (FileNotFoundError, ValueError, KeyError, TypeError):
            return 0
        return number if type(number) is int and number > 0 else 0

    def _version(self, number: int) -> Version | None:
        path = self._version_path(number)
        try:
            text = self._files.cat_file(path)
        except FileNotFoundError:
            return None
        try:
            found = Version.read(text)
        except ValueError as error:
            raise UserError(f"{self.address}: version {number} {error}") from error
        if found.number != number:
            raise UserError(f"{self.address}: version {number} is damaged")
        return found

    def _create(self, path: str, text: bytes) -> None:
        """Write an object where there is none. Raises `FileExistsError` where there is one."""
        if not self._local:
            self._files.pipe_file(path, text, mode="create")
            return
        whole = Path(path)
        whole.parent.mkdir(parents=True, exist_ok=True)
        half = whole.with_name(f".{whole.name}.{uuid.uuid4().hex[:12]}.tmp")
        try:
            with half.open("wb") as handle:
                handle.write(text)
                handle.flush()
                os.fsync(handle.fileno())
            os.link(half, whole)
        finally:
            half.unlink(missing_ok=True)

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"

    def _version_path(self, number: int) -> str:
        return self._path(f"versions/{number:08d}.json")

    def _object(self, stored: Stored) -> str:
        return self._path(f"objects/{stored.sha256[:2]}/{stored.sha256}")
