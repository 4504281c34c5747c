"""What a folder of exported clips says of itself to programs that load data sets: Croissant 1.0, in JSON-LD.

https://docs.mlcommons.org/croissant/docs/croissant-spec.html
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Final

from motionlake.lake.citations import Source

CROISSANT: Final = "croissant.json"
_MANIFEST: Final = "manifest"
_SPECIFICATION: Final = "http://mlcommons.org/croissant/1.0"
_OWN: Final = "http://mlcommons.org/croissant/"
_TERMS: Final = (
    "citeAs", "column", "equivalentProperty", "extract", "field", "fileProperty", "fileObject", "fileSet", "format",
    "includes", "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex",
    "repeated", "replace", "samplingRate", "separator", "source", "subField", "transform",
)  # fmt: skip
_CONTEXT: Final[Mapping[str, Any]] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "cr": _OWN,
    "rai": f"{_OWN}RAI/",
    "sc": "https://schema.org/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{term: f"cr:{term}" for term in _TERMS},
}
_KINDS: Final = {
    ".bvh": "text/plain", ".csv": "text/csv", ".json": "application/json", ".txt": "text/plain",
    ".parquet": "application/x-parquet", ".glb": "model/gltf-binary", ".jsonl": "application/jsonlines",
}  # fmt: skip
_ANY: Final = "application/octet-stream"
# Of a clip's row in the manifest.
_TEXT, _WHOLE, _NUMBER = "sc:Text", "sc:Integer", "sc:Float"
_COLUMNS: Final = {
    "clip": _TEXT, "file": _TEXT, "format": _TEXT, "dataset": _TEXT, "label": _TEXT, "subject": _TEXT, "licence": _TEXT,
    "start": _WHOLE, "stop": _WHOLE, "frames": _WHOLE, "fps": _NUMBER, "unit_metres": _NUMBER, "up": _TEXT,
    "rig": _TEXT, "path": _TEXT, "content_hash": _TEXT,
}  # fmt: skip


def described(
    name: str,
    clips: Sequence[Mapping[str, Any]],
    sources: Iterable[Source],
    manifest: tuple[str, str],
    files: Iterable[str],
    columns: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """The description of a folder.

    Args:
        name: of the set.
        clips: their rows of the manifest.
        sources: what is known of where they come from.
        manifest: name of its file and the file's sha256.
        files: relative to the folder, with slashes.
        columns: of each file set of tables (as `file_sets` calls it) the kind of each of its columns ("list ..." where
            it holds several of them).
    """
    sources = list(sources)
    licences = sorted({str(row["licence"]) for row in clips if row.get("licence")})
    citations = sorted({source.citation for source in sources if source.citation})
    homepages = sorted({source.homepage for source in sources if source.homepage})
    datasets = sorted({str(row["dataset"]) for row in clips})
    sets = file_sets(files)
    rows = {key: f"{key}-rows" for key in sets if key in columns}
    of_clips = {key: kind for key, kind in _COLUMNS.items() if any(row.get(key) is not None for row in clips)}
    told = {
        "license": licences,
        "citeAs": "\n\n".join(citations),
        "url": homepages[0] if len(homepages) == 1 else "",
    }
    return {
        "@context": dict(_CONTEXT),
        "@type": "sc:Dataset",
        "conformsTo": _SPECIFICATION,
        "name": name,
        "description": f"{len(clips)} clips of human motion, of {', '.join(datasets) or 'no dataset'}",
        **{key: value for key, value in told.items() if value},
        "distribution": [
            {
                "@type": "cr:FileObject", "@id": _MANIFEST, "name": manifest[0], "contentUrl": manifest[0],
                "encodingFormat": _KINDS[".json"], "sha256": manifest[1],
            },
            *({"@type": "cr:FileSet", "@id": key, "name": key, **each} for key, each in sets.items()),
        ],
        "recordSet": [
            _records("clips", {"fileObject": {"@id": _MANIFEST}}, "jsonPath", of_clips, "$.clips[*]."),
            *(_records(rows[key], {"fileSet": {"@id": key}}, "column", columns[key]) for key in rows),
        ],
    }  # fmt: skip


def file_sets(files: Iterable[str]) -> dict[str, dict[str, str]]:
    """Files of one suffix below one folder, or in its parts: how they are written, and the pattern that finds them."""
    of_set: dict[str, list[PurePosixPath]] = {}
    for file in sorted(files):
        of_set.setdefault(set_of_file(file), []).append(PurePosixPath(file))
    return {
        key: {"encodingFormat": _KINDS.get(several[0].suffix.lower(), _ANY), "includes": _pattern(several)}
        for key, several in of_set.items()
    }


def _pattern(files: Sequence[PurePosixPath]) -> str:
    """What finds the files of a set; one alone goes by its name: to some readers a star stands for folders too."""
    first = files[0]
    if len(files) == 1 and not set(str(first)) & set("*?["):
        return str(first)
    parted = any(_folders(file)[1] for file in files)
    return "/".join([*_folders(first)[0], *(["**"] if parted else []), f"*{first.suffix}"])


def set_of_file(file: str) -> str:
    """The name of the set that a file is in; it holds no space, as identifiers do."""
    path = PurePosixPath(file)
    return "-".join("_".join(name.split()) for name in (*_folders(path)[0], path.suffix.lstrip(".") or "files"))


def _folders(path: PurePosixPath) -> tuple[tuple[str, ...], bool]:
    """Below which folders a file lies, but for the last of several, which is a part of its set."""
    parts = path.parts[:-1]
    return (parts[:-1], True) if len(parts) > 1 else (parts, False)


def table_columns(path: Path) -> dict[str, str]:
    """The columns of a Parquet file that Croissant has a kind for, but for what pandas makes its index of."""
    import pyarrow as pa
    from pyarrow import parquet

    schema, found = parquet.read_schema(path), {}
    index = (schema.pandas_metadata or {}).get("index_columns", ())
    for column in schema:
        if column.name in index:
            continue
        several = isinstance(column.type, pa.ListType | pa.FixedSizeListType | pa.LargeListType)
        kind = column.type.value_type if several else column.type
        for of_kind, said in (
            (pa.types.is_integer, _WHOLE),
            (pa.types.is_floating, _NUMBER),
            (pa.types.is_string, _TEXT),
        ):
            if of_kind(kind):
                found[column.name] = f"list {said}" if several else said
    return found


def _records(
    name: str, source: Mapping[str, Any], by: str, columns: Mapping[str, str], prefix: str = ""
) -> dict[str, Any]:
    """A record set: each of its fields is extracted from the same files."""
    fields = [
        {
            "@type": "cr:Field", "@id": f"{name}/{key}", "name": key, "dataType": kind.rpartition(" ")[2],
            **({"repeated": True} if kind.startswith("list ") else {}),
            "source": {**source, "extract": {by: f"{prefix}{key}"}},
        }
        for key, kind in columns.items()
    ]  # fmt: skip
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "field": fields}
