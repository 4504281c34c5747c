"""A lake in which everything is named to be misread: commands, pages, pictures and SQL give every name exactly."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import duckdb
import pytest
from motionlake import names
from motionlake.api import open_lake
from motionlake.formats import read_clips
from motionlake.names import folded, kept, printable
from motionlake.pictures.html import document
from motionlake.retrieval.sql_functions import connect

from tests.hostile import LABELS, STEMS, Tags, hostile_clips, obeyed
from tests.lakes import Run, made_once, motionlake, query, quick_lake

# What pages of the player are made of.
ELEMENTS = (
    {"html", "head", "meta", "title", "style", "script", "body", "main", "div", "figure", "canvas", "figcaption"}
    | {"h1", "h2", "h3", "p", "span", "dl", "dt", "dd", "ul", "details", "summary", "kbd"}
    | {"button", "label", "select", "option", "input", "output"}
)

# A lake in which everything is called so. Its folder is one that globs, and its source one that is no UTF-8.


@pytest.fixture(scope="module")
def source(shared: Path) -> Path:
    folder = Path(os.fsdecode(os.fsencode(shared) + b"/r\xe9 [x]*"))
    return made_once(folder, lambda folder: hostile_clips(folder / "src")) / "src"


@pytest.fixture(scope="module")
def hostile_lake(shared: Path, source: Path, scheduler: str) -> Path:
    def build(lake: Path) -> None:
        quick_lake(lake)
        for words in (["ingest", source], ["run", "all"]):
            run = motionlake(*words, "--lake", lake, "--scheduler", scheduler)
            assert run.status == 1, run.err  # three files are damaged
            assert "rows name no clip" not in run.err
            assert not obeyed(run.out + run.err)
        assert run.out.split("\n")[1].split()[2] == "0"

    return made_once(shared / "lakes" / "l[y]*z 'é;%20", build)


def clips_of(lake: Path) -> list[str]:
    return [row[0] for row in query(lake, "SELECT clip FROM clips ORDER BY clip")]


def ask(lake: Path, *words: object) -> Run:
    """A command that ends well, and shows no terminal what it would obey."""
    run = motionlake(words[0], "--lake", lake, *words[1:])
    assert run.status == 0, (words, run.err)
    assert not obeyed(run.out + run.err)
    return run


def test_every_file_is_a_clip_of_its_own_name(hostile_lake: Path, source: Path) -> None:
    paths = {kept(p.relative_to(source)) for p in source.iterdir() if p.suffix != ".csv"}
    assert {row[0] for row in query(hostile_lake, "SELECT path FROM sources")} == paths
    read = query(hostile_lake, "SELECT path, any_value(label), any_value(subject), count(*) FROM clips GROUP BY path")
    assert {row[0] for row in read} == {path for path in paths if not path.startswith("bad")}
    assert {row[0] for row in read if row[3] == 2} == {"two.skeleton", "two!x.skeleton", "two\x1b\\xe9.skeleton"}
    said = {row[0]: row[1:3] for row in read if row[0].endswith(".npz")}
    for i, stem in enumerate(STEMS):
        own = tuple(label.strip() for label in (LABELS[i % len(LABELS)], LABELS[-1 - i % len(LABELS)]))
        assert said[kept(os.fsdecode(stem + b".npz"))] == own
    rejects = query(hostile_lake, "SELECT path FROM rejects ORDER BY path")
    assert rejects == [("bad\nline.npz",), ("bad[red].npz",), ("bad\\xe9\x1b[31m.npz",)]


def test_an_ingest_of_unchanged_files_says_so(hostile_lake: Path, source: Path, scheduler: str) -> None:
    for more in ([], ["--checksum"]):
        run = motionlake("ingest", source, *more, "--json", "--lake", hostile_lake, "--scheduler", scheduler)
        assert (run.json["clips"], run.json["unchanged"]) == (0, len(STEMS) + 6)


def test_commands_take_and_give_every_name(hostile_lake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clips = clips_of(hostile_lake)
    monkeypatch.chdir(tmp_path)
    found = ask(hostile_lake, "search", "-k", 2, "--json", "--", *clips).json
    assert list(dict.fromkeys(hit["query"] for hit in found)) == clips
    assert {hit["clip"] for hit in found} <= set(clips)
    every = ask(hostile_lake, "search", clips[0], "--method", "descriptor", "-k", len(clips), "--own", "--json").json
    assert sorted(hit["clip"] for hit in every) == clips
    labels = dict(query(hostile_lake, "SELECT clip, label FROM clips"))
    assert all(hit["label"] == labels[hit["clip"]] for hit in every)
    shown = ask(hostile_lake, "search", clips[0], "-k", len(clips), "--own").out
    assert all(printable(clip) in shown for clip in clips if len(clip) < 60)
    known = ask(hostile_lake, "classify", "--json", "--write-labels", "found.csv", "--", *clips).json
    assert [row["clip"] for row in known] == clips
    with Path("found.csv").open(newline="", encoding="utf-8") as handle:
        rows = list(csv.DictReader(handle))
    assert [(r["file"], r["label"]) for r in rows] == [
        (path, row["label"])
        for (path,), row in zip(query(hostile_lake, "SELECT path FROM clips ORDER BY clip"), known, strict=True)
    ]
    assert {row["clip"] for row in ask(hostile_lake, "cluster", "-k", 2, "--json").json} == set(clips)
    for words in (
        ["status"], ["status", "--json"], ["cluster", "-k", 2], ["duplicates"], ["find", clips[1]], ["align", clips[1]],
        ["segment", clips[2]], ["classify", *clips], ["search", *clips[:3]], ["rig"],
        ["sql", "SELECT clip, label, subject, path, attributes FROM clips"], ["sql", "FROM rejects"],
        ["sql", "FROM segments", "--json"],
    ):  # fmt: skip
        ask(hostile_lake, *words)
    assert query(hostile_lake, "SELECT count(*) FROM clips") == [(len(clips),)]


def test_files_and_pages_of_clips_are_apart_and_inert(
    hostile_lake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    every = clips_of(hostile_lake)
    alike = Counter(map(folded, every))
    clips = [clip for i, clip in enumerate(every) if i % 2 or alike[folded(clip)] > 1]
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path / "out")
    for clip in clips:
        file = Path(ask(hostile_lake, "view", "--beside", "none", "--json", "--", clip).json["file"])
        text = file.read_text(encoding="utf-8")
        seen = Tags(text)
        assert set(seen.tags) <= ELEMENTS
        assert not any(name.startswith("on") for name in seen.attributes)
        assert seen.tags.count("script") == 2
        assert f"<title>{names.html(clip)}</title>" in text
        assert not obeyed(text)
        made = Path(ask(hostile_lake, "export", "--json", "--", clip).json["file"])
        assert read_clips(made)[0].hierarchy.joints
    left = list(Path().iterdir())
    assert len(left) == 2 * len(clips)
    pages = [path.name for path in left if path.suffix == ".html"]
    assert len({folded(name) for name in pages}) == len(pages) == len(clips)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    run = motionlake("export", "--lake", hostile_lake, "src/A.npz")
    assert (run.status, run.err) == (2, "motionlake: A.bvh: is there already; say with --out which file to write\n")


def test_pictures_of_answers_are_inert(hostile_lake: Path, tmp_path: Path) -> None:
    clips = clips_of(hostile_lake)
    file = tmp_path / "hits.html"
    ask(hostile_lake, "search", *clips[:2], "-k", 2, "--picture", file)
    text = file.read_text(encoding="utf-8")
    assert Tags(text).tags == [*Tags(document("", "", [])).tags, "h1", "h2", *["figure", "img", "figcaption"] * 2]
    assert not obeyed(text)
    longest = tmp_path / ("é" * 125 + "x.png")
    ask(hostile_lake, "align", clips[3], "--picture", longest)
    assert longest.read_bytes().startswith(b"\x89PNG")


def test_reports_and_measures_are_inert(hostile_lake: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    ask(hostile_lake, "report", "--out", page)
    text = page.read_text(encoding="utf-8")
    assert not obeyed(text)
    seen = Tags(text)
    assert not any(name.startswith("on") for name in seen.attributes)
    assert not {"red", "b", "x", "iframe"} & set(seen.tags)
    for words in (["signatures"], ["signatures", "--json"]):
        run = motionlake("evaluate", *words, "--lake", hostile_lake)
        assert run.status == 0, run.err
        assert not obeyed(run.out + run.err)


def test_functions_of_sql_take_and_give_every_name(hostile_lake: Path) -> None:
    calls = (
        "similar_clips(?, 2)", "find_motion(?, 0, 30, k := 2)", "aligned_clips(?, 2)", "nearest_clips(?, 2)",
        "find_submotion(?, 0, 30, k := 2)", "align_motion(?, 0, 30, k := 2)", "overlapping_motifs(?, 2)",
    )  # fmt: skip
    clips = clips_of(hostile_lake)
    with connect(hostile_lake) as con:
        for i, clip in enumerate(clips[::2]):
            assert con.execute("SELECT clip_named(?)", [clip]).fetchall() == [(clip,)]
            assert (clip,) in con.execute("FROM find_clip(?)", [clip]).fetchall()
            found = con.execute(f"SELECT clip FROM {calls[i % len(calls)]}", [clip]).fetchall()
            assert {row[0] for row in found} <= set(clips)
            assert con.execute("SELECT count(*) > 0 FROM frames WHERE clip = ?", [clip]).fetchall() == [(True,)]
            assert con.execute("SELECT label FROM classify_clip(?)", [clip]).fetchall()


def test_sql_says_in_a_line_what_cannot_be(hostile_lake: Path) -> None:
    faults = {
        "FROM similar_clips('src/A.npz', -3)": "UserError: k is -3: it is at least 0",
        "FROM find_motion('src/A.npz', 0, 30, k := -3)": "UserError: k is -3: it is at least 0",
        "FROM classify_clip('src/A.npz', k := -3)": "UserError: k is -3: at least 1 clip must vote",
        "FROM clip_clusters(k := -3)": "UserError: -3 clusters of",
        "FROM similar_clips(chr(0))": "UserError: \\0: no such clip",
        "FROM similar_clips(repeat('x', 5000))": "no such clip",
        "FROM similar_clips('src/UserError: star*')": "UserError: src/UserError: star*: no such clip",
    }
    with connect(hostile_lake) as con:
        for text, said in faults.items():
            with pytest.raises(duckdb.Error, match=re.escape(said)):
                con.execute(text).fetchall()
    run = motionlake("sql", "FROM similar_clips('\x1b[2JUserError: x')", "--lake", hostile_lake)
    assert run.status == 2
    assert run.err.startswith("motionlake: SQL: \\x1b[2JUserError: x: no such clip")
    assert run.err.count("\n") == 1


def test_a_name_that_is_a_file_too_means_the_clip(
    hostile_lake: Path, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "src").mkdir()
    shutil.copy(source / "a.npz", tmp_path / "src" / "A.npz")
    shutil.copy(source / "a.npz", tmp_path / "other.npz")
    monkeypatch.chdir(tmp_path)

    def asked(name: str) -> tuple[str, str]:
        run = ask(hostile_lake, "search", "-k", 1, "--json", "--", name)
        return run.json[0]["clip"], run.err

    clip, said = asked("src/A.npz")
    assert said == "src/A.npz: means src/A.npz of the lake here; ./src/A.npz means the file\n"
    assert clip != "src/A.npz", "a clip of the lake is no answer to itself"
    for name in ("./src/A.npz", str(tmp_path / "src" / "A.npz"), "other.npz"):
        assert asked(name)[1] == ""
    files = [
        row["clip"] for row in ask(hostile_lake, "view", "./src/A.npz", "--beside", "none", "--json").json["clips"]
    ]
    assert files == ["A.npz"]
    run = motionlake("search", "./no.npz", "--lake", hostile_lake)
    assert (run.status, "no such file" in run.err) == (2, True)
    assert motionlake("export", "./src/A.npz", "--lake", hostile_lake).status == 2
    with open_lake(hostile_lake) as lake:
        frames = [len(lake.motion(name).positions) for name in ("src/A.npz", Path("src/A.npz"), "./src/A.npz")]
    assert frames == [36, 37, 37]
    # Bytes that are no UTF-8 may be given as they are, or as the lake spells them.
    assert asked("caf\udce9.npz") == asked("caf\\xe9.npz")


def test_datasets_that_fold_together_are_refused(
    hostile_lake: Path, source: Path, tmp_path: Path, scheduler: str
) -> None:
    other = tmp_path / "SRC"
    other.mkdir()
    shutil.copy(source / "a.npz", other)
    run = motionlake("ingest", other, "--lake", hostile_lake, "--scheduler", scheduler)
    assert run.status == 2
    assert "dataset SRC: is the same as src where case does not count" in run.err
    long = tmp_path / ("d" * 255)
    long.mkdir()
    run = motionlake("ingest", long, "--lake", hostile_lake)
    assert run.status == 2
    assert "at most 64 characters" in run.err


def test_a_label_file_that_cannot_be_read_stops_no_run(tmp_path: Path, source: Path, scheduler: str) -> None:
    lake, folder = tmp_path / "lake", tmp_path / "clips"
    folder.mkdir()
    shutil.copy(source / "A.npz", folder / "plain.npz")
    (folder / "labels.csv").write_text("file,label\nplain.npz,walk\n")
    words = ("--lake", lake, "--scheduler", scheduler)
    assert motionlake("ingest", folder, *words).status == 0
    for content, said in (
        (b"file,label\nplain.npz," + b"x" * 1_000_000 + b"\n", "line 2: a cell of more than 131072 characters"),
        (b"file,label\nplain.npz,caf\xe9\n", "is not UTF-8"),
        (b"name,label\nplain.npz,x\n", "has no column file"),
    ):
        (folder / "labels.csv").write_bytes(content)
        for command in (["ingest", folder], ["run", "frames"]):
            run = motionlake(*command, *words)
            assert run.status == 1
            assert said in run.err
            assert "Error" not in run.err
        assert query(lake, "SELECT label FROM clips") == [("walk",)]
    (folder / "labels.csv").write_text("file,label\nplain.npz,run\n")
    assert motionlake("run", "frames", *words).status == 0
    assert query(lake, "SELECT label FROM clips") == [("run",)]


@pytest.mark.parametrize("file", ["config.toml", "rigs/mine.toml"])
def test_settings_that_are_no_utf_8_are_named(tmp_path: Path, file: str, source: Path) -> None:
    lake = quick_lake(tmp_path / "lake")
    (lake / file).parent.mkdir(exist_ok=True)
    (lake / file).write_bytes(b"# \xe9\n")
    run = motionlake("ingest", source, "--lake", lake)
    assert run.status == 2
    assert f"{file}: is not UTF-8" in run.err


def test_words_of_the_command_line_are_shown_literally() -> None:
    for words in (["search", "--\x1b[2J"], ["\x1b[2J"], ["find", "x", "--from", "\x1b"]):
        run = motionlake(*words)
        assert run.status == 2
        assert not obeyed(run.out + run.err)
        assert "\\x1b" in run.err


@pytest.mark.parametrize(
    ("ends", "status", "unbuffered"),
    [("| true", 141, ""), ("| true", 141, "1"), (">&- 2>&- <&-", 0, ""), (">/dev/full", 2, "")],
)
def test_output_that_nobody_takes_ends_quietly(ends: str, status: int, unbuffered: str) -> None:
    program = str(Path(sys.executable).with_name("motionlake"))
    run = subprocess.run(
        ["bash", "-c", f"(sleep 0.3; exec '{program}' rig) {ends}; echo ${{PIPESTATUS[0]}}"],
        capture_output=True, text=True, check=False, env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )  # fmt: skip
    assert run.stdout == f"{status}\n"
    assert run.stderr == ("motionlake: the output cannot be written (No space left on device)\n" if status == 2 else "")
