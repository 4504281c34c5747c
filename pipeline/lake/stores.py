"""Stores of objects that an address such as `s3://bucket/lake` names, through fsspec."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from motionlake.arrays import StepProgress
from motionlake.errors import UserError
from motionlake.names import printable

Item = TypeVar("Item")
AT_ONCE: Final = 8  # objects on their way
FOLDER: Final = "file"
# A path has lost one of the slashes.
_ADDRESS: Final = re.compile(r"([a-z][a-z0-9+]+):/{1,3}(?=[^/])(.+)")
# Stores that create an object only where there is none, and what reads them.
_STORES: Final = {"s3": "s3fs", "gs": "gcsfs", "az": "adlfs", FOLDER: "fsspec"}
_EXTRAS: Final = {"s3": "motionlake[s3]"}
_OPTIONS: Final[Mapping[str, dict[str, Any]]] = {
    "s3": {"use_listings_cache": False, "config_kwargs": {"retries": {"mode": "adaptive", "max_attempts": 10}}},
    "gs": {"use_listings_cache": False},
    "az": {"use_listings_cache": False},
    FOLDER: {"auto_mkdir": True},
}


def is_address(text: str | Path) -> bool:
    """Whether this names a store of objects rather than a folder or file."""
    return _ADDRESS.match(str(text)) is not None and not os.path.lexists(text)


@dataclass(frozen=True)
class Place:
    """A place in a store.

    Attributes:
        store: "s3", "gs", "az" or "file".
        root: bucket and what stands before the names of objects; of a folder its path.
    """

    store: str
    root: str

    @classmethod
    def of(cls, address: str | Path) -> Place:
        """Raises `UserError` where this is no address, or of a store that is not known."""
        found = _ADDRESS.match(str(address).rstrip("/"))
        if found is None:
            raise UserError(f"{address}: is no address of a bucket, such as s3://bucket/lake")
        store, root = found.groups()
        if store not in _STORES:
            raise UserError(
                f"{store}://: no store that lakes can be kept in; use {', '.join(f'{s}://' for s in _STORES)}"
            )
        return cls(store, f"/{root}" if store == FOLDER else root)

    @property
    def address(self) -> str:
        return f"{self.store}://{self.root}"

    def connect(self) -> Any:
        """The file system of fsspec. Raises `UserError` where its library is not installed."""
        with self.told():
            try:
                import fsspec

                return fsspec.filesystem(self.store, **_OPTIONS[self.store])
            except ImportError as error:
                library = _STORES[self.store]
                extra = _EXTRAS.get(self.store, library)
                raise UserError(f"{self.store}:// needs {library}; get it with `pip install '{extra}'`") from error

    @contextmanager
    def told(self) -> Iterator[None]:
        """Say in one line what a store's library raises, which may be anything."""
        try:
            yield
        except UserError:
            raise
        except Exception as error:
            said = " ".join(str(error).split()) or type(error).__name__
            raise UserError(f"{self.address}: {printable(said)}; {_todo(error)}") from error


def _todo(error: Exception) -> str:
    if isinstance(error, PermissionError) or "redential" in str(error):
        return "check the credentials, which are taken from where the store's own tools take them"
    if isinstance(error, FileNotFoundError):
        return "make the bucket first"
    return "check the address and the network; the same command goes on where it stopped"


def move_all(move: Callable[[Item], int], items: Iterable[Item], progress: StepProgress) -> list[int]:
    """Bytes that each move came to, several at once; the first that fails ends it."""
    wanted = list(items)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        running = [pool.submit(move, each) for each in wanted]
        try:
            for done, each in enumerate(as_completed(running), start=1):
                each.result()
                progress("files", done, len(wanted))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return [each.result() for each in running]
