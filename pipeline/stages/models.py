"""Fitted models as frozen versions: the word network and the motifs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.config import canonical_json
from pipeline.lake.catalog import Connection, fetch, run_sql


@dataclass(frozen=True)
class Model:
    """The current version of one kind of model.

    Attributes:
        model: its name, kind-version.
        key: sha256 over its configuration.
        file: relative to the lake.
    """

    model: str
    kind: str
    key: str
    file: str
    figures: Mapping[str, Any]


def current_model(con: Connection, kind: str) -> Model | None:
    rows = fetch(con, "queries/current_model.sql", {"kind": kind})
    if not rows:
        return None
    row = rows[0]
    return Model(row["model"], kind, row["key"], row["file"], json.loads(row["figures"]))


def next_file(con: Connection, kind: str, suffix: str) -> str:
    version = fetch(con, "queries/next_version.sql", {"kind": kind})[0]["version"]
    return f"models/{kind}-{version}{suffix}"


def add_model(
    con: Connection,
    kind: str,
    *,
    key: str,
    data_hash: str,
    config: Mapping[str, Any],
    figures: Mapping[str, Any],
    file: str,
    seconds: float,
) -> None:
    """Make a fitted model the current version of its kind."""
    parameters = {
        "kind": kind,
        "key": key,
        "data_hash": data_hash,
        "config": canonical_json(config),
        "figures": canonical_json(figures),
        "file": file,
        "seconds": seconds,
    }
    run_sql(con, "queries/add_model.sql", parameters)


def file_hash(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()
