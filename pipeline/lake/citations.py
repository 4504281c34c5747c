"""Where clips come from: licence and citation, which lie beside fetched files, and of every dataset of a lake."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

from motionlake.lake.catalog import Connection, fetch

FILE: Final = "SOURCE.json"  # beside the files that it tells of
VERSION: Final = 1  # of that file
_LARGEST: Final = 1 << 20  # bytes of it


@dataclass(frozen=True)
class Source:
    """What is known of where a folder of clips comes from. Texts are empty where that is unknown.

    Attributes:
        name: short, as `motionlake fetch` lists it.
        licence: as those who publish the clips call it.
        licence_url: where its text stands.
        commercial: whether it allows commercial use; None where it does not say.
        terms: what it asks for, in a sentence.
        citation: what to cite, as BibTeX or as a sentence.
    """

    name: str
    title: str = ""
    homepage: str = ""
    licence: str = ""
    licence_url: str = ""
    commercial: bool | None = None
    terms: str = ""
    citation: str = ""


def source_from(said: Mapping[str, Any]) -> Source:
    """A source from JSON; keys that it does not know are ignored.

    Raises:
        ValueError: a value is not of its kind, or there is no name.
    """
    found = {field.name: said[field.name] for field in fields(Source) if field.name in said}
    for name, value in found.items():
        if not (value is None or isinstance(value, bool) if name == "commercial" else isinstance(value, str)):
            raise ValueError(f"{name} is {json.dumps(value)[:40]}")
        str(value).encode()  # JSON can spell halves of characters, which no text of a lake may hold
    if not found.get("name"):
        raise ValueError("it has no name")
    return Source(**found)


def source_json(source: Source, files: list[dict[str, Any]], version: int) -> str:
    """The text of SOURCE.json: the same for the same source and files.

    Args:
        files: url, sha256 and size of each.
        version: of the recipe that they were fetched by.
    """
    told = {"motionlake_source": VERSION, **asdict(source), "recipe_version": version, "files": files}
    return json.dumps(told, ensure_ascii=False, indent=2) + "\n"


def read_source(folder: Path) -> tuple[Path, Source] | None:
    """The nearest SOURCE.json of a folder and the one above it, with what it says; None where there is none.

    Raises:
        ValueError: it is not as `motionlake fetch` writes it; the message names the file.
    """
    for place in (folder, folder.parent):
        file = place / FILE
        if file.is_file():
            try:
                return file, _read(file)
            except (OSError, ValueError, RecursionError) as error:
                raise ValueError(f"{file}: is not as `motionlake fetch` writes it ({error})") from error
    return None


def _read(file: Path) -> Source:
    with file.open("rb") as handle:
        text = handle.read(_LARGEST + 1)
    if len(text) > _LARGEST:
        raise ValueError(f"more than {_LARGEST} bytes")
    said = json.loads(text.decode("utf-8"))
    if not isinstance(said, dict) or said.get("motionlake_source") != VERSION:
        raise ValueError(f'no "motionlake_source": {VERSION}')
    return source_from(said)


def citations(con: Connection) -> dict[str, tuple[Source, ...]]:
    """The sources of every dataset of a lake that clips are in, by name, in the order of their names.

    A dataset taken in from folders without SOURCE.json has none of these; `clips.licence` tells its licence where that
    was stated. Synthetic clips have those of the datasets that they were made from.
    """
    found: dict[str, dict[Source, None]] = {row["dataset"]: {} for row in fetch(con, "datasets_of_clips")}
    for row in fetch(con, "sources_told"):
        if row["dataset"] in found:
            found[row["dataset"]][source_from(json.loads(row["source"]))] = None
    for row in fetch(con, "origins_of_synthetic"):
        found[row["dataset"]].update(found.get(row["origin"], {}))
    return {dataset: tuple(sources) for dataset, sources in found.items()}
