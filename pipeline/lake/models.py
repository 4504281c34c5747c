"""Fitted models as frozen versions: networks, motifs, dictionaries, indexes."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, remembered, run_sql
from motionlake.lake.config import canonical_json
from motionlake.lake.file_list import FileSums, list_files
from motionlake.lake.layout import Lake
from motionlake.lake.lock import writes_now
from motionlake.lake.parts import replacing

OF_TRAINING = ("sets", "data_sha256")  # metrics that every pretrained file has


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
    metrics: Mapping[str, Any]


def current_model(con: Connection, kind: str) -> Model | None:
    rows = fetch(con, "current_model", {"kind": kind})
    return model_of(rows[0]) if rows else None


def model_of(row: Mapping[str, Any]) -> Model:
    """A model from its row."""
    return Model(row["model"], row["kind"], row["key"], row["file"], json.loads(row["metrics"]))


def keyed_model(con: Connection, kind: str, key: str) -> Model | None:
    """The newest version of a kind, current or not, that has a key."""
    rows = fetch(con, "keyed_model", {"kind": kind, "key": key})
    return model_of(rows[0]) if rows else None


def fitting_model(con: Connection, kind: str, key: str) -> Model | None:
    """The current version if it has the key that a configuration asks for."""
    model = current_model(con, kind)
    return model if model and model.key == key else None


def check_served(lake: Lake, *methods: str) -> None:
    """Refuse to compare clips by what a model has made where there is a newer one, which has made nothing yet.

    While a command brings the lake up to date, what is there serves.

    Args:
        lake: the lake.
        methods: ways to compare: "signature", "alignment", "descriptor", "submotion".

    Raises:
        UserError: there is a newer model.
    """
    for row in remembered(lake, "models behind", partial(fetch, name="models_behind")):
        if row["method"] in methods and not writes_now(lake):
            raise UserError(
                f"{lake.root}: {row['model']} is newer than what is compared, which {row['served']} has made; bring "
                f"the lake up to date with `motionlake run all --lake {lake.root}`"
            )


def next_file(con: Connection, kind: str, suffix: str) -> str:
    version = fetch(con, "next_version", {"kind": kind})[0]["version"]
    return f"models/{kind}-{version}{suffix}"


def add_model(
    con: Connection,
    kind: str,
    *,
    key: str,
    data_hash: str,
    config: Mapping[str, Any],
    metrics: Mapping[str, Any],
    file: FileSums,
    seconds: float,
) -> None:
    """Make a fitted model the current version of its kind."""
    parameters = {
        "kind": kind,
        "key": key,
        "data_hash": data_hash,
        "config": canonical_json(config),
        "metrics": canonical_json(metrics),
        "file": file.file,
        "seconds": seconds,
    }
    run_sql(con, "add_model", parameters)
    list_files(con, [file])


def save_model(lake: Lake, file: str, save: Callable[[Path], None]) -> None:
    """Have a model written as a file of the lake, whole or not at all."""
    with replacing(lake.path(file)) as temporary:
        save(temporary)


def copy_weights(lake: Lake, weights: Path, file: str, metrics: Mapping[str, Any], *kept: str) -> dict[str, Any]:
    """Copy a pretrained model into the lake as `file`; returns the metrics to keep of its training."""
    with replacing(lake.path(file)) as temporary:
        shutil.copyfile(weights, temporary)
    return {"pretrained": True, **{name: metrics[name] for name in (*OF_TRAINING, *kept) if name in metrics}}


def checkpoint_file(lake: Lake, name: str) -> Path:
    """Where the training of a model is saved to, and goes on from."""
    path = lake.path(f"training/{name}.safetensors")
    path.parent.mkdir(exist_ok=True)
    return path


def file_hash(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()
