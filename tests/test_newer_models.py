"""What is compared is of the current models: a newer one makes commands ask for `run all`, but for one that writes."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path

import pytest
from motionlake.lake.catalog import reading, writing
from motionlake.lake.file_list import sums_of
from motionlake.lake.layout import open_lake
from motionlake.lake.lock import Holder
from motionlake.lake.models import add_model, current_model

from tests.lakes import motionlake

ASKED = {
    "network": [
        ["search", "--method", "signature"],
        ["find", "--from", "0", "--to", "40"],
        ["cluster", "-k", "2"],
        ["find", "--method", "words", "--from", "0", "--to", "40"],
    ],
    "motifs": [
        ["search", "--method", "signature"],
        ["evaluate", "signatures"],
        ["segment"],
        ["classify", "--method", "knn"],
    ],
    "postures": [
        ["search", "--method", "alignment"],
        ["search"],
        ["evaluate", "pesta"],
        ["classify"],
        ["align"],
        ["align", "--whole"],
    ],
    "descriptors": [["search", "--method", "descriptor"], ["search"], ["evaluate", "descriptor"]],
    "submotion": [["find", "--method", "submotion", "--from", "0", "--to", "40"]],
}
WITH_CLIP = ("search", "find", "segment", "classify", "align")


def newer(root: Path, kind: str) -> str:
    """Enter the current model of a kind a second time, as `train` does; its name."""
    lake = open_lake(root)
    with reading(lake) as con:
        model = current_model(con, kind)
    assert model is not None
    with writing(lake) as con:
        add_model(
            con, kind, key=model.key, data_hash="", config={}, metrics=dict(model.metrics),
            file=sums_of(lake, model.file), seconds=0.0,
        )  # fmt: skip
        after = current_model(con, kind)
    assert after is not None
    return after.model


@pytest.mark.parametrize("kind", ASKED)
def test_what_an_older_model_has_made_is_not_compared(kind: str, built_lake: Path, tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    shutil.copytree(built_lake, lake)
    clip = motionlake("sql", "SELECT clip FROM clips ORDER BY clip", "--json", "--lake", lake).json[0]["clip"]
    name = newer(lake, kind)
    for command in ASKED[kind]:
        asked = [command[0], *([clip] if command[0] in WITH_CLIP else []), *command[1:]]
        found = motionlake(*asked, "--lake", lake)
        assert found.status == 2, (asked, found.out)
        assert found.err.count("\n") == 1
        assert f"{name} is newer than what is compared" in found.err
        assert "motionlake run all" in found.err
    assert motionlake("search", clip, "--method", "moves", "--lake", lake).status == 0


def test_while_a_command_writes_what_is_there_serves(built_lake: Path, tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    shutil.copytree(built_lake, lake)
    clip = motionlake("sql", "SELECT clip FROM clips ORDER BY clip", "--json", "--lake", lake).json[0]["clip"]
    newer(lake, "descriptors")
    (lake / ".lock").write_text(json.dumps(asdict(Holder.here("motionlake run all"))), encoding="utf-8")
    assert motionlake("search", clip, "--lake", lake).status == 0
    killed = asdict(Holder.here("motionlake run all")) | {"process": _gone()}
    (lake / ".lock").write_text(json.dumps(killed), encoding="utf-8")
    assert motionlake("search", clip, "--lake", lake).status == 2


def _gone() -> int:
    process = os.fork()
    if not process:
        os._exit(0)
    os.waitpid(process, 0)
    return process
