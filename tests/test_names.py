"""Names are only data: whatever files, labels and joints are called, it is shown literally and comes back exactly."""

from __future__ import annotations

import csv
import io
import json
import os
import tomllib
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from motionlake.cli._output import notice, tell, write_csv
from motionlake.errors import UserError
from motionlake.formats.write.bvh import write_bvh
from motionlake.lake.layout import Lake
from motionlake.motion.clip import Hierarchy, SourceClip
from motionlake.names import file_name, folded, kept, on_disk, printable, safe_name, told_apart, toml_text, typed
from motionlake.pictures.html import document, page
from motionlake.stages.synthesis_control import Keyframe, Request
from motionlake.stages.synthesize import clip_path

from tests.hostile import Tags, obeyed
from tests.lakes import motionlake

ANY = st.text(max_size=60) | st.text("\x00\x1b\n\r\t\x9b[]/\\:#.-<>&\"'=+@ax9e\u202e\u2028\U000e0041é", max_size=30)
TEXT = ANY.filter(lambda text: not any("\ud800" <= c <= "\udfff" for c in text))
FILE_BYTES = st.binary(max_size=40) | st.text("\\x5ce9\x80/", max_size=20).map(str.encode)


@given(FILE_BYTES)
@example(b"\\xe9")
@example(b"\\\xe9")
@example(b"\\x5cxe9")
def test_the_bytes_of_a_file_s_name_come_back(raw: bytes) -> None:
    name = os.fsdecode(raw)
    text = kept(name)
    assert text.encode().decode() == text
    assert on_disk(text) == name
    assert typed(text) == text


@given(TEXT.filter(lambda text: "\\x" not in text))
def test_names_of_utf_8_are_kept_as_they_are(text: str) -> None:
    assert kept(text) == text == on_disk(text)


@given(ANY)
@example("take[a].bvh")
@example("[/red]")
@example(":smile:")
def test_a_terminal_gets_names_literally_and_json_exactly(text: str) -> None:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        tell([{"n": text}], as_json=False)
        notice(text)
        tell(text, as_json=False)
    shown = printable(text)
    head, row, *rest = out.getvalue().split("\n")
    assert not obeyed(out.getvalue() + err.getvalue())
    assert (head.strip(), rest[-2:]) == ("n", [shown, ""])
    if len(shown) < 100:
        assert row.rstrip() == shown.rstrip()
    assert err.getvalue() == f"{shown}\n"
    out = io.StringIO()
    with redirect_stdout(out):
        tell([{text: text}], as_json=True)
    assert json.loads(out.getvalue()) == [{text: text}]
    assert not obeyed(out.getvalue())


@given(ANY)
def test_a_page_holds_names_as_text_alone(text: str) -> None:
    plain, hostile = (Tags(page(t, [t], [[{t: t}]], {t: [], f"{t}2": []})) for t in ("a", text))
    assert hostile.tags == plain.tags
    assert hostile.attributes == plain.attributes
    assert "".join(hostile.texts).count(printable(text)) >= 5 or not text
    assert not obeyed("".join(hostile.texts))
    assert Tags(document(text, "", [])).tags == Tags(document("a", "", [])).tags


@given(st.lists(TEXT, min_size=1, max_size=6, unique=True))
@example(["A", "a", "K", "\u212a", "café", "cafe\u0301", "a.", "a ", "a/b", "a-b", "CON", "nul", "", ".", "..", "-x"])
def test_files_of_clips_never_are_one(clips: list[str]) -> None:
    for make in (file_name, safe_name):
        found = told_apart(clips, make)
        assert len({folded(name) for name in found.values()}) == len(clips)
        for name in found.values():
            assert not obeyed(name)
            assert not set(name) & set('/\\:*?"<>|')
            assert len(f".{name}.bvh.{'0' * 12}.tmp".encode()) <= 255
            assert name[0] not in ".- "
            assert name.partition(".")[0].lower() not in ("con", "nul", "aux", "prn", "com1", "lpt1")


@pytest.mark.parametrize(
    ("one", "other"),
    [("A", "a"), ("K", "\u212a"), ("caf\u00e9", "cafe\u0301"), ("STRASSE", "stra\u00dfe"), ("x.", "x"), ("x ", "x")],
)
def test_names_that_a_file_system_takes_for_one_get_marks(one: str, other: str) -> None:
    assert folded(one) == folded(other)
    found = told_apart([one, other, "third"], lambda clip: clip)
    assert found["third"] == "third"
    assert all(found[clip].startswith(f"{clip}-") for clip in (one, other))


@given(st.lists(st.lists(TEXT, min_size=3, max_size=3), min_size=1, max_size=4))
def test_csv_comes_back_exactly(rows: list[list[str]]) -> None:
    file = Path("/dev/shm" if Path("/dev/shm").is_dir() else ".") / f"motionlake-{os.getpid()}.csv"
    with redirect_stderr(io.StringIO()) as err:
        write_csv(file, ["a", "b", "c"], rows)
    with file.open(newline="", encoding="utf-8") as handle:
        assert list(csv.reader(handle))[1:] == rows
    file.unlink()
    formulas = sum(cell.startswith(("=", "+", "-", "@", "\t", "\r")) for row in rows for cell in row)
    assert (f"{formulas} cells begin as a formula does" in err.getvalue()) == bool(formulas)


@given(TEXT)
def test_a_rig_map_names_joints_exactly(text: str) -> None:
    line = toml_text(text)
    assert tomllib.loads(f"name = {line}")["name"] == text
    assert not obeyed(line)


@given(st.lists(TEXT, min_size=2, max_size=5, unique=True))
@example(["Hips", "a\n}\nMOTION\nFrames: 1", "a { }", "", " ", "  "])
@example(["End Site", "JOINT x", "CHANNELS 3", "\x1b[2J"])
def test_joints_of_any_name_are_one_line_of_bvh(joints: list[str]) -> None:
    tree = Hierarchy.of_positions(tuple(joints), (-1, *range(len(joints) - 1)))
    clip = SourceClip(tree, np.zeros((2, 3 * len(joints))), 30.0)
    stream = io.StringIO()
    write_bvh(clip, stream)
    found = read_bvh(stream.getvalue())
    assert len(found.joints) == len(joints) == len(set(found.joints))
    assert found.parents == tree.parents
    for written, name in zip(found.joints, joints, strict=True):
        if name == " ".join(name.split()) and name and not obeyed(name) and not set(name) & set("{}"):
            assert written == name or written.startswith(f"{name}.")


def read_bvh(text: str) -> Hierarchy:
    from motionlake.formats.bvh import BvhReader

    return BvhReader().read(text.encode(), Path("x.bvh"))[0].hierarchy


@given(st.lists(TEXT.filter(bool), min_size=1, max_size=3), st.lists(TEXT.filter(bool), min_size=1, max_size=3))
@example(["a/b"], ["a_b"])
@example(["a+b"], ["a", "b"])
@example(["x" * 300], ["x" * 301])
def test_motions_of_other_classes_have_other_names(one: list[str], other: list[str]) -> None:
    first, second = (clip_path(Request(tuple(classes), 8.0), 1) for classes in (one, other))
    assert (first == second) == (one == other)
    assert not obeyed(first) | set(first) & set("/#")
    assert len(first.encode()) < 255


def test_motions_along_ways_have_names_of_their_own() -> None:
    """Two edits of one class and seed are two clips: the second does not take the place of the first."""
    key = Keyframe("a", 3, 0.0, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0) * 21)
    plain = Request(("kick",), 8.0)
    asked = [
        plain, replace(plain, path="circle"), replace(plain, speed=1.0),
        replace(plain, edited=(3, 9), keyframes=(key,)),
        replace(plain, edited=(3, 8), keyframes=(key,)), replace(plain, keyframes=(replace(key, clip="b"),)),
    ]  # fmt: skip
    names = [clip_path(request, 1) for request in asked]
    assert len(set(names)) == len(names)
    assert names == [clip_path(request, 1) for request in asked]
    assert all(name.endswith("-s0-0001") for name in names)


def test_motions_of_usual_classes_are_called_by_them() -> None:
    assert clip_path(Request(("walk", "salsa"), 8.0), 1) == "walk+salsa-s0-0001"


@pytest.mark.parametrize("name", ["a,b", "a?b", "a{b", "a\\b", "caf\udce9"])
def test_a_lake_cannot_lie_where_duckdb_would_look_elsewhere(tmp_path: Path, name: str) -> None:
    for words in (["init"], ["status"], ["ingest", tmp_path]):
        run = motionlake(*words, "--lake", tmp_path / name)
        assert run.status == 2
        assert "which DuckDB misreads" in run.err
        assert run.err.count("\n") == 1
    with pytest.raises(UserError):
        Lake(tmp_path / name)
    assert list(tmp_path.iterdir()) == []
