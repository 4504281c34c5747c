"""A lake as stages and models plan on it: what it holds, where its files lie, and what its config.toml asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

from motionlake.lake.catalog import Connection, reading, run_sql
from motionlake.lake.config import LakeConfig
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.models import file_hash

Value = TypeVar("Value")


@dataclass(frozen=True)
class LakeReader:
    """A lake, open for reading.

    Attributes:
        con: to its catalog.
        lake: its folder.
        config: what its models and stages are to be made by.
    """

    con: Connection
    lake: Lake
    config: LakeConfig
    _found: dict[tuple[str, str], Any] = field(default_factory=dict)

    def once(self, what: str, of: str, find: Callable[[], Value]) -> Value:
        """What `find` gives, found once: the catalog does not change while it is open."""
        if (what, of) not in self._found:
            self._found[what, of] = find()
        found: Value = self._found[what, of]
        return found

    def done(self, stage: str) -> set[str]:
        """Keys of the shards of a stage that ended well."""

        def find() -> set[str]:
            return {key for (key,) in run_sql(self.con, "done_keys", {"stage": stage}).fetchall()}

        return self.once("done", stage, find)

    def clips(self) -> tuple[int, str]:
        """How many clips the lake holds, and a hash of all their names."""

        def find() -> tuple[int, str]:
            return run_sql(self.con, "digest_of_clips").fetchall()[0]

        return self.once("clips", "", find)

    def file_hash(self, file: str) -> str:
        """sha256 of a file of the lake."""
        return self.once("sha256", file, lambda: file_hash(sound(self.lake, file)))


@contextmanager
def lake_reader(
    lake: Lake, config: LakeConfig, found: dict[tuple[str, str], Any] | None = None
) -> Iterator[LakeReader]:
    """Open a lake to plan on it; `found` is what another reader found in the same catalog by the same configuration."""
    with reading(lake) as con:
        yield LakeReader(con, lake, config, {} if found is None else found)
