"""labels.csv and segments.csv: what people say of clips; it lives in the catalog and recomputes no frames."""

from __future__ import annotations

import csv
import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, load_rows, table_of
from motionlake.lake.config import config_hash
from motionlake.names import kept, on_disk
from motionlake.stages.sources import Root

_S = pa.string()
LABEL_ROWS = pa.schema(
    {"path": _S, "label": _S, "subject": _S, "split": _S, "licence": _S, "attributes": pa.map_(_S, _S)}
)
SEGMENT_ROWS = pa.schema({"path": _S, "start": pa.int64(), "stop": pa.int64(), "label": _S})
MOST_FRAMES = 2**31
_OWN = ("label", "subject", "split", "licence")


class LabelError(UserError):
    """A label file that cannot be read; the labels of its folder stay as they were."""


@dataclass(frozen=True)
class LabelReport:
    """What a label file said: rows taken, and rows that name no file of the root.

    Attributes:
        first: path that its first row names, as it stands there.
        example: a path that would match; "" where the root holds no file.
        fault: why the file was not taken; "" where it was.
    """

    file: str
    rows: int
    unmatched: int
    first: str = ""
    example: str = ""
    fault: str = ""


def apply_labels(con: Connection, root: Root) -> list[LabelReport]:
    """Enter the labels and segments of one root.

    Raises:
        LabelError: a file cannot be read, lacks a column, or holds no number where one must stand.
        UserError: a label file named by the user is missing.
    """
    reports = []
    parameters = {"dataset": root.dataset, "root": root.kept_base, "licence": root.options.recorded_licence}
    kinds = (("load_labels", LABEL_ROWS, _label_rows), ("load_segments", SEGMENT_ROWS, _segment_rows))
    for file, (statement, schema, read) in zip(_files(root), kinds, strict=True):
        rows = read(root, file) if file else []
        load_rows(con, statement, table_of(rows, schema), parameters)
        if file:
            reports.append(_report(con, root, file, rows))
    return reports


def labels_hash(root: Root) -> str:
    """sha256 over what the label files of a root say, and the licence that was given with it."""
    said = [hashlib.sha256(file.read_bytes()).hexdigest() if file else None for file in _files(root)]
    return config_hash([root.options.recorded_licence, *said])


def _files(root: Root) -> list[Path | None]:
    """Labels and segments of a root: the files that the user named, else those that lie in it."""
    found: list[Path | None] = []
    for named, usual in ((root.options.labels, "labels.csv"), (root.options.segments, "segments.csv")):
        if named and not Path(named).is_file():
            raise UserError(f"{named}: no such file")
        lies_there = root.folder.is_dir() and (root.base / usual).is_file()
        found.append(Path(named) if named else root.base / usual if lies_there else None)
    return found


def _rows(file: Path, needed: set[str]) -> Iterator[tuple[int, dict[str, str]]]:
    try:
        with file.open(newline="", encoding="utf-8-sig") as handle:
            reader = csv.DictReader(handle)
            missing = needed - set(reader.fieldnames or ())
            if missing:
                raise LabelError(f"{file}: has no column {', '.join(sorted(missing))}")
            for row in reader:
                said = {k: (v or "").strip() for k, v in row.items() if isinstance(k, str)}
                yield reader.line_num, said | {"file": row["file"] or ""}
    except UnicodeDecodeError as error:
        raise LabelError(f"{file}: is not UTF-8 ({error.reason}); save it as UTF-8") from error
    except csv.Error as error:
        most = csv.field_size_limit()
        reason = f"a cell of more than {most} characters; is a quote left open?" if "limit" in str(error) else error
        raise LabelError(f"{file}, line {reader.line_num + 1}: {reason}") from error


def _relative(root: Root, file: Path, name: str) -> str:
    """A path of a label file, relative to that file, as a path relative to the root; "" where it is outside."""
    if name != name.strip() and not _exists(file.parent / on_disk(name)):  # blanks may belong to the file's name
        name = name.strip()
    path, base = Path(kept(file.parent.absolute()), name), root.kept_base
    return path.relative_to(base).as_posix() if path.is_relative_to(base) else ""


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # too long
        return False


def _label_rows(root: Root, file: Path) -> list[dict[str, object]]:
    """A row a line; of several lines for one file the last stands."""
    rows: dict[str, dict[str, object]] = {}
    for line, row in _rows(file, {"file"}):
        extra = [(k, v) for k, v in sorted(row.items()) if v and k not in {"file", *_OWN}]
        own = {name: row.get(name) or None for name in _OWN}
        path = _relative(root, file, row["file"])
        rows[path or f"line {line}"] = {"path": path, **own, "attributes": extra}
    return list(rows.values())


def _segment_rows(root: Root, file: Path) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for line, row in _rows(file, {"file", "start", "stop", "label"}):
        try:
            start, stop = int(row["start"]), int(row["stop"])
        except ValueError:
            raise LabelError(f"{file}, line {line}: start and stop must be frame numbers") from None
        if not 0 <= start < stop <= MOST_FRAMES:
            told = f"start {row['start'][:20]} and stop {row['stop'][:20]}"
            raise LabelError(f"{file}, line {line}: {told} are no range of frames")
        path = _relative(root, file, row["file"])
        rows.append({"path": path, "start": start, "stop": stop, "label": row["label"]})
    return rows


def _report(con: Connection, root: Root, file: Path, rows: list[dict[str, object]]) -> LabelReport:
    parameters = {"dataset": root.dataset, "root": root.kept_base, "paths": [r["path"] for r in rows]}
    known = fetch(con, "count_unmatched", parameters)
    files = sorted(r["path"] for r in fetch(con, "sources_of", parameters) if r["root"] == root.kept_base)
    first = next((row["file"] for _, row in _rows(file, {"file"})), "")
    example = os.path.relpath(Path(root.kept_base, files[0]), kept(file.parent)) if files else ""
    return LabelReport(str(file), len(rows), known[0]["unmatched"], first, example)
