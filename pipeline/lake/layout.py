"""Where things lie in a lake, and the checks that a folder is one."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from motionlake.errors import UserError

_DATASET = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
# What a path of DuckDB, or a list of such, means otherwise than a folder's name does.
_MISREAD = re.compile("[,?{}\\\\\udc80-\udcff]")


@dataclass(frozen=True)
class Lake:
    """A folder of Parquet and Arrow parts with one catalog.

    Layout: `catalog.duckdb`, `config.toml`, `frames/dataset=…/<part>.parquet`,
    `raw/layout=…/<part>.parquet`, `features/<part>.arrow`, `embeddings/<part>.parquet`, `postures/<part>.parquet`,
    `models/`, `staging/` (rows on their way into the catalog), `annotations.jsonl`; for repairs `catalog.sums`,
    `records.zip` and `kept/`.
    """

    root: Path

    def __post_init__(self) -> None:
        misread = _MISREAD.search(str(self.root))
        if misread is not None:
            what = "bytes that are no UTF-8" if "\udc80" <= misread[0] <= "\udcff" else f"the character {misread[0]}"
            raise UserError(f"{self.root}: the path of a lake cannot hold {what}, which DuckDB misreads; rename it")

    @property
    def catalog(self) -> Path:
        return self.root / "catalog.duckdb"

    @property
    def mending(self) -> str:
        """The command that mends it."""
        return f"motionlake repair --lake {self.root}"

    def served(self) -> tuple[int, int]:
        """What tells the catalog that is served now from those before it."""
        found = self.catalog.stat()
        return found.st_ino, found.st_mtime_ns

    @property
    def sums(self) -> Path:
        """What the catalog, and the copy of its tables, were when they were written."""
        return self.root / "catalog.sums"

    @property
    def kept(self) -> Path:
        """The catalogs before this one."""
        return self.root / "kept"

    @property
    def records(self) -> Path:
        """The tables of the catalog as Parquet, in one archive."""
        return self.root / "records.zip"

    @property
    def annotations(self) -> Path:
        """What people decided about clips (`motionlake.lake.annotations`)."""
        return self.root / "annotations.jsonl"

    @property
    def service(self) -> Path:
        """Where a service that runs is asked (`motionlake.lake.announced`)."""
        return self.root / "service.json"

    @property
    def config_file(self) -> Path:
        return self.root / "config.toml"

    @property
    def rigs(self) -> Path:
        """A folder for the user's own rig maps (TOML)."""
        return self.root / "rigs"

    def path(self, relative: str) -> Path:
        """A file of the lake by its relative name; refuses names that lead out of the lake."""
        return self.paths([relative])[0]

    def paths(self, relative: Iterable[str]) -> list[Path]:
        """The same of several, sooner."""
        root, found, folders = self.root.resolve(), [], dict[str, Path]()
        for name in relative:
            own = name.rpartition("/")[2]
            folder = name[: len(name) - len(own)]
            if folder not in folders:
                folders[folder] = (root / folder).resolve()
            path = folders[folder] / own
            if own in ("", ".", "..") or path.is_symlink():
                path = path.resolve()
            if not path.is_relative_to(root):
                raise UserError(f"{name}: leads out of the lake {self.root}")
            found.append(path)
        return found

    def stats(self, relative: Sequence[str]) -> Iterator[os.stat_result | None]:
        """What is known of files by their relative names, without opening them; None where there is none such.

        Raises:
            UserError: a name leads out of the lake.
        """
        folders: dict[str, str] = {}
        for name in relative:
            folder, _, own = name.rpartition("/")
            if folder not in folders:
                folders[folder] = str(self.path(folder))
            try:
                found = os.lstat(f"{folders[folder]}/{own}")
                plain = stat.S_ISREG(found.st_mode)
                yield found if plain else self.path(name).stat()
            except FileNotFoundError:
                yield None

    def files(self, folders: Iterable[str]) -> Iterator[str]:
        """All that lies below some folders of the lake and is no folder, by relative names."""
        start = len(str(self.root)) + 1
        for folder in folders:
            for base, _, names in os.walk(self.root / folder):
                yield from (f"{base[start:]}/{name}" for name in names)

    def relative(self, path: Path) -> str:
        return path.relative_to(self.root).as_posix()

    def frames_part(self, dataset: str, part: str) -> str:
        return f"frames/dataset={dataset}/{part}.parquet"

    def raw_part(self, layout: str, part: str) -> str:
        return f"raw/layout={layout}/{part}.parquet"


def open_lake(root: Path | str) -> Lake:
    """The lake in a folder. Raises `UserError` if there is none."""
    lake = Lake(Path(root).absolute())
    if not lake.catalog.is_file():
        raise UserError(f"{root}: no lake here (no catalog.duckdb); create one with `motionlake init {root}`")
    return lake


def lake_folder(root: Path | str) -> Lake:
    """The lake in a folder, even if its catalog is lost. Raises `UserError` if there never was one."""
    lake = Lake(Path(root).absolute())
    if not any(path.exists() for path in (lake.catalog, lake.records, lake.kept, lake.sums)):
        raise UserError(f"{root}: no lake here (no catalog.duckdb); create one with `motionlake init {root}`")
    return lake


def check_dataset(name: str) -> str:
    """A dataset's name is part of paths: letters, digits, '_', '-', '.', at most 64."""
    if not _DATASET.fullmatch(name):
        raise UserError(
            f"dataset {name!r}: use letters, digits, '_', '-' and '.', at most 64 characters (--dataset NAME)"
        )
    return name
