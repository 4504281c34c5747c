"""What a folder of exported clips says of itself in Croissant holds of its files."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from motionlake.retrieval.croissant import file_sets, set_of_file
from pyarrow import parquet

from tests.lakes import ingested_lake, motionlake


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory, clips_folder: Path, scheduler: str) -> Path:
    return ingested_lake(tmp_path_factory.mktemp("croissant") / "lake", clips_folder, scheduler)


def described(lake: Path, out: Path, *words: object) -> dict[str, Any]:
    run = motionlake("export", "--lake", lake, "--out", out, "--dataset", "clips", *words)
    assert run.status in (0, 1), run.err
    found: dict[str, Any] = json.loads((out / "croissant.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("words", [("--format", "csv"), ("--format", "lerobot", "--rig", "canonical", "--fps", "30")])
def test_it_holds_of_the_folder(lake: Path, tmp_path: Path, words: tuple[str, ...]) -> None:
    out = tmp_path / "a set"
    found = described(lake, out, *words)
    assert found["conformsTo"] == "http://mlcommons.org/croissant/1.0"
    assert found["name"] == "a set"
    manifest, *sets = found["distribution"]
    text = (out / manifest["contentUrl"]).read_bytes()
    assert manifest["sha256"] == hashlib.sha256(text).hexdigest()
    clips = json.loads(text)["clips"]
    files = {each["@id"]: sorted(out.glob(each["includes"])) for each in sets}
    told = {path for several in files.values() for path in several}
    written = {path for path in out.rglob("*") if path.is_file()} - {out / "croissant.json", out / "manifest.json"}
    assert told == {path for path in written if not path.name.endswith(".joints.json")}
    records = {each["@id"]: each["field"] for each in found["recordSet"]}
    assert {field["name"] for field in records["clips"]} <= set(clips[0])
    assert {"clip", "dataset", "frames", "fps"} <= {field["name"] for field in records["clips"]}
    for key, fields in records.items():
        for field in fields:
            extract = field["source"]["extract"]
            if key == "clips":
                assert extract == {"jsonPath": f"$.clips[*].{field['name']}"}
                continue
            for path in files[field["source"]["fileSet"]["@id"]]:
                assert extract["column"] in parquet.read_schema(path).names
    ids = [each["@id"] for each in found["distribution"]] + [f["@id"] for fields in records.values() for f in fields]
    assert len(set(ids)) == len(ids)
    assert not any(" " in each for each in ids)
    if "lerobot" in words:
        kinds = {field["name"]: (field["dataType"], field.get("repeated")) for field in records["data-parquet-rows"]}
        assert kinds["observation.state"] == ("sc:Float", True)
        assert kinds["frame_index"] == ("sc:Integer", None)


def test_the_same_clips_are_described_alike(lake: Path, tmp_path: Path) -> None:
    found = [described(lake, tmp_path / folder / "set", "--format", "bvh") for folder in ("a", "b")]
    assert found[0] == found[1]


folders = st.lists(st.sampled_from(["data", "meta", "chunk"]), max_size=3)
names = st.text("ab .-[*", min_size=1, max_size=6).map(lambda name: f"n{name}n")


@given(st.lists(st.tuples(folders, names, st.sampled_from([".bvh", ".parquet", ""])), max_size=6))
def test_every_file_is_found_by_the_pattern_of_its_set(paths: list[tuple[list[str], str, str]]) -> None:
    files = {"/".join([*within, name.replace(".", "") + suffix]) for within, name, suffix in paths}
    sets = file_sets(files)
    assert {set_of_file(file) for file in files} == set(sets)
    assert not any(" " in key for key in sets)
    for file in files:
        pattern = sets[set_of_file(file)]["includes"]
        spelled = re.escape(pattern).replace(r"\*\*/", "(?:.*/)?").replace(r"\*", "[^/]*")
        assert file == pattern or re.fullmatch(spelled, file)
