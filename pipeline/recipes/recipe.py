"""Recipes: where a dataset lies, what it asks of those who use it, what is fetched by hand. One TOML file each.

docs/fetch.md shows one with all its keys.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from importlib import resources
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlsplit

from motionlake.errors import UserError
from motionlake.lake.citations import Source
from motionlake.lake.layout import check_dataset
from motionlake.names import folded

UNPACK: Final = ("zip", "tar", "none")
WRITTEN: Final = ("SOURCE.json", "fetched.json", "labels.csv")  # by motionlake itself, beside what is fetched
_PLAIN: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")  # a file's or folder's name, never hidden
_HEX: Final = {"sha256": re.compile("[0-9a-f]{64}"), "md5": re.compile("[0-9a-f]{32}")}


@dataclass(frozen=True)
class Licence:
    """What may be done with the clips of a dataset.

    Attributes:
        commercial: whether commercial use is allowed.
        accept: whether it must be accepted before anything is fetched.
        terms: what it asks for, in a sentence.
    """

    name: str
    url: str
    commercial: bool
    accept: bool
    terms: str


@dataclass(frozen=True)
class RecipeFile:
    """A file of a dataset.

    Attributes:
        name: what it is called where it is kept.
        into: folder, of the dataset's, that it or its content goes into.
        url: where it is fetched; empty where a person puts it there.
        size: bytes; None where nobody says.
        only: folder of the archive that is unpacked; empty: all.
    """

    name: str
    into: str
    unpack: str
    url: str = ""
    sha256: str = ""
    md5: str = ""
    size: int | None = None
    only: str = ""

    @property
    def known_hash(self) -> str | None:
        """As pooch takes it: algorithm and digits."""
        if self.sha256:
            return f"sha256:{self.sha256}"
        return f"md5:{self.md5}" if self.md5 else None


@dataclass(frozen=True)
class Recipe:
    """A dataset that others publish; the fields are those of the TOML file."""

    version: int
    name: str
    title: str
    homepage: str
    licence: Licence
    citation: str
    formats: tuple[str, ...]
    checked: str
    files: tuple[RecipeFile, ...] = ()
    clips: int | None = None
    size: int | None = None
    rig: str = ""
    by_hand: str = ""
    labels: str = ""

    @property
    def source(self) -> Source:
        """What goes with its clips."""
        licence = self.licence
        return Source(
            self.name, self.title, self.homepage, licence.name, licence.url, licence.commercial, licence.terms,
            self.citation,
        )  # fmt: skip


def recipes() -> dict[str, Recipe]:
    """Every recipe of the package, by name, in the order of their names."""
    found = [r for r in resources.files("motionlake.recipes").iterdir() if r.name.endswith(".toml")]
    read = [parse_recipe(file.read_text(encoding="utf-8"), file.name) for file in found]
    return {recipe.name: recipe for recipe in sorted(read, key=lambda recipe: recipe.name)}


def find_recipe(name: str) -> Recipe:
    """The recipe of a name, or of a TOML file that a person has written.

    Raises:
        UserError: there is none, or the file is no recipe.
    """
    if name.endswith(".toml"):
        try:
            return parse_recipe(Path(name).read_text(encoding="utf-8"), name)
        except OSError as error:
            raise UserError(f"{name}: cannot be read ({error.strerror})") from error
        except UnicodeDecodeError as error:
            raise UserError(f"recipe {name}: is not UTF-8 ({error.reason}); save it as UTF-8") from error
    known = recipes()
    if name not in known:
        raise UserError(f"{name}: no such recipe; there are {', '.join(known)}, and files of your own, as ./mine.toml")
    return known[name]


def parse_recipe(text: str, origin: str) -> Recipe:
    """A recipe from TOML text; `origin` names it in errors.

    Raises:
        UserError: not TOML, a key that is missing, unknown or of another kind, or a path that leads out of the folder.
    """
    try:
        table = tomllib.loads(text)
        licence = _made(Licence, table.pop("licence"))
        files = tuple(_file(file) for file in table.pop("files", []))
        table["formats"] = tuple(table["formats"])
        recipe: Recipe = _made(Recipe, {**table, "licence": licence, "files": files})
        _check(recipe)
    except KeyError as error:
        raise UserError(f"recipe {origin}: no key {error}; see docs/fetch.md") from error
    except UserError as error:
        raise UserError(f"recipe {origin}: {error}; see docs/fetch.md") from error
    except (TypeError, ValueError, AttributeError, re.error) as error:
        raise UserError(f"recipe {origin}: {error}; see docs/fetch.md") from error
    return recipe


def _made(kind: Any, table: Mapping[str, Any]) -> Any:
    unknown = sorted(table.keys() - {field.name for field in fields(kind)})
    if unknown:
        raise ValueError(f"unknown key {unknown[0]!r}")
    missing = [field.name for field in fields(kind) if field.default is MISSING and field.name not in table]
    if missing:
        raise KeyError(missing[0])
    kinds = {"str": str, "bool": bool, "int": int, "int | None": int}
    for field in fields(kind):
        if field.name in table and field.type in kinds:
            value, wanted = table[field.name], kinds[str(field.type)]
            if type(value) is not wanted:
                raise ValueError(f"{field.name} = {value!r}: must be of type {wanted.__name__}")
    return kind(**table)


def _file(table: Mapping[str, Any]) -> RecipeFile:
    url = table.get("url", "")
    usual = unquote(urlsplit(url).path.rpartition("/")[2])
    file: RecipeFile = _made(RecipeFile, {"name": usual, **table})
    if url and urlsplit(url).scheme not in ("http", "https"):
        raise ValueError(f"url {url!r}: must begin with https:// or http://")
    for name in (file.name, file.into):
        if not _PLAIN.fullmatch(name) or folded(name) in map(folded, WRITTEN):
            raise ValueError(f"{name!r}: must be a plain name of letters, digits, '_', '-' and '.'")
    if file.unpack not in UNPACK:
        raise ValueError(f"unpack = {file.unpack!r}: use one of {', '.join(UNPACK)}")
    for name, digits in _HEX.items():
        if getattr(file, name) and not digits.fullmatch(getattr(file, name)):
            raise ValueError(f"{name} of {file.name}: not as many digits 0-9 a-f as such a hash has")
    if file.size is not None and file.size <= 0:
        raise ValueError(f"size of {file.name}: must be more than 0")
    return file


def _check(recipe: Recipe) -> None:
    check_dataset(recipe.name)
    folders = [file.into for file in recipe.files]
    if len(set(folders)) < len(folders) or len({file.name for file in recipe.files}) < len(folders):
        raise ValueError("two files have one name, or go into one folder")
    if not recipe.by_hand and not any(file.url for file in recipe.files):
        raise ValueError("neither files with a url nor by_hand")
    if recipe.by_hand and any(file.url for file in recipe.files):
        raise ValueError("files with a url, and by_hand")
    for told in ("title", "homepage", "citation", "checked"):
        if not getattr(recipe, told).strip():
            raise ValueError(f"{told} is empty")
    if recipe.labels and not re.compile(recipe.labels).groupindex:
        raise ValueError("labels has no named group, such as (?P<label>...)")
