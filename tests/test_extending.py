"""The worked examples of docs/extending.md: each is added to a copy of the program, and used."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.lakes import elsewhere, motionlake, quick_lake
from tests.samples import KINECT_1, KINECT_1_PARENTS, deepmimic_frames, deepmimic_text, swinging_body

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
NEW = re.compile(r"^New file `([^`]+)`:\n\n```\w+\n(.*?)```$", re.MULTILINE | re.DOTALL)
LINE = re.compile(r"^Line in `([^`]+)`[^\n]*:\n\n```python\n(.*)\n(.*)\n```$", re.MULTILINE)
BELOW = re.compile(r"^Line in `([^`]+)`, below `([^`]+)`:\n\n```python\n(.*)\n```$", re.MULTILINE)
COUNTS = re.compile(r"^\| \[([^\]]+)\]\(#[\w-]+\)[^|]* \| (\d+) \| (\d+) \|$", re.MULTILINE)


def section(title: str) -> str:
    found = re.search(rf"^## {re.escape(title)}$(.*?)(?=^## |\Z)", GUIDE, re.MULTILINE | re.DOTALL | re.IGNORECASE)
    assert found is not None, title
    return found[1]


class Copy:
    """The program as it is installed, its files linked, with the files of a section beside them."""

    def __init__(self, folder: Path, title: str) -> None:
        self.folder = folder
        package = folder / "site" / "motionlake"
        for top in ("pipeline", "jobs", "sql"):
            shutil.copytree(
                ROOT / top, package if top == "pipeline" else package / top, copy_function=os.symlink,
                dirs_exist_ok=True,  # with what Python and numba have compiled
            )  # fmt: skip
        self.added = NEW.findall(section(title))
        for name, text in self.added:
            path = package / name.removeprefix("pipeline/")
            assert not path.exists(), name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")

        for name, line, entry in LINE.findall(section(title)):
            path = package / name.removeprefix("pipeline/")
            text = path.read_text(encoding="utf-8")
            path.unlink()  # a link into the repository
            text = text.replace("\nfrom motionlake.", f"\n{line}\nfrom motionlake.", 1)
            path.write_text(re.sub(r"(\n\)\nON_REQUEST)", rf"\n{entry}\1", text, count=1), encoding="utf-8")

        for name, above, line in BELOW.findall(section(title)):
            path = package / name.removeprefix("pipeline/")
            text = path.read_text(encoding="utf-8")
            path.unlink()
            assert text.count(above) == 1, above
            path.write_text(text.replace(above, f"{above}\n{line}"), encoding="utf-8")

    def run(self, *lines: Sequence[str]) -> list[str]:
        """What command lines say."""
        runs = elsewhere(self.folder / "site", self.folder, *lines)
        for words, run in zip(lines, runs, strict=True):
            assert run.status == 0, f"{words}: {run.err}"
        return [run.out for run in runs]


def take_in(folder: Path, scheduler: str) -> None:
    """A lake, "mylake", of the clips of a folder; the program as it is makes it, for copies that only read it."""
    run = motionlake("ingest", folder / "clips", "--lake", folder / "mylake", "--scheduler", scheduler)
    assert run.status == 0, run.err


@pytest.mark.parametrize(("title", "new", "changed"), COUNTS.findall(GUIDE))
def test_the_guide_counts_its_files(title: str, new: str, changed: str) -> None:
    assert len(NEW.findall(section(title))) == int(new)
    assert len(re.findall(r"^Line in `", section(title), re.MULTILINE)) == int(changed)


def test_every_section_is_counted() -> None:
    assert [title.lower() for title, _, _ in COUNTS.findall(GUIDE)] == [
        title.lower() for title in re.findall(r"^## (.*)$", GUIDE, re.MULTILINE)
    ]


def test_a_format(tmp_path: Path) -> None:
    copy = Copy(tmp_path, "A file format")
    body = swinging_body(45).reshape(45, -1)
    rows = "\n".join(" ".join(f"{number:.5f}" for number in row) for row in body)
    (tmp_path / "clips").mkdir()
    text = f"{' '.join(KINECT_1)}\n{' '.join(map(str, KINECT_1_PARENTS))}\n{rows}\n"
    (tmp_path / "clips" / "swing.joints").write_text(text)
    text = "SELECT format, frames, min(root_z) AS z FROM clips JOIN frames USING (clip) GROUP BY ALL"
    _, found = copy.run(("ingest", "clips", "--lake", "lake"), ("sql", text, "--lake", "lake", "--json"))
    assert '"format": "joint table"' in found
    assert '"frames": 45' in found
    assert np.isclose(float(re.findall(r'"z": ([\d.]+)', found)[0]), 3.0, atol=0.01)


def test_a_stage(tmp_path: Path) -> None:
    copy = Copy(tmp_path, "A stage")
    (tmp_path / "clips").mkdir()
    for count in (41, 51):
        (tmp_path / "clips" / f"walk{count}.txt").write_text(deepmimic_text(deepmimic_frames(count)))
    query = re.findall(r'motionlake sql "(.*)" --lake mylake', section("A stage"))[0]
    lines = (("ingest", "clips"), ("run", "speeds"), ("sql", query, "--json"), ("status",))
    _, _, fastest, status = copy.run(*((*words, "--lake", "mylake") for words in lines))
    for row, count in zip(json.loads(fastest), (41, 51), strict=True):
        assert row["fastest"] == pytest.approx(30 / (count - 1), rel=0.02)  # a metre in so many frames
    assert "speeds" in status


def test_a_sql_macro(tmp_path: Path) -> None:
    copy = Copy(tmp_path, "A SQL macro")
    (tmp_path / "clips").mkdir()
    for count in (40, 50, 60):
        (tmp_path / "clips" / f"walk{count}.txt").write_text(deepmimic_text(deepmimic_frames(count)))
    command = re.findall(r"```sh\nmotionlake (.*)\n```", section("A SQL macro"))[0]
    _, answer = copy.run(("ingest", "clips", "--lake", "mylake"), shlex.split(command))
    assert re.findall(r"walk\d+", answer) == ["walk60", "walk50"]


def test_a_python_function_in_sql(tmp_path: Path, scheduler: str) -> None:
    copy = Copy(tmp_path, "A Python function in SQL")
    (tmp_path / "clips").mkdir()
    for count in (40, 70):
        (tmp_path / "clips" / f"walk{count}.txt").write_text(deepmimic_text(deepmimic_frames(count)))
    take_in(tmp_path, scheduler)
    command = re.findall(r"```sh\nmotionlake sql \"(.*)\" --lake mylake\n```", section("A Python function in SQL"))[0]
    (answer,) = copy.run(("sql", command, "--lake", "mylake"))
    assert sorted(re.findall(r"walk\d+", answer)) == ["walk40", "walk70"]


def test_a_way_to_search(tmp_path: Path, scheduler: str) -> None:
    copy = Copy(tmp_path, "A way to search")
    (tmp_path / "clips").mkdir()
    for count in (41, 46, 81):  # a metre in so many frames
        (tmp_path / "clips" / f"walk{count}.txt").write_text(deepmimic_text(deepmimic_frames(count)))
    take_in(tmp_path, scheduler)
    words = ("--method", "pace", "--lake", "mylake", "--json")
    of_lake = ("search", "walk41", *words)
    of_file = ("search", "./clips/walk81.txt", "-k", "1", "--mirrored", *words)
    hits, outside = map(json.loads, copy.run(of_lake, of_file))
    assert [(hit["rank"], hit["clip"]) for hit in hits] == [(1, "clips/walk46.txt"), (2, "clips/walk81.txt")]
    assert hits[0]["distance"] == pytest.approx(30 / 40 - 30 / 45, rel=0.05)
    assert outside[0]["clip"] == "clips/walk81.txt"
    assert outside[0]["distance"] == pytest.approx(0, abs=0.01)


def test_a_trained_model(tmp_path: Path) -> None:
    copy = Copy(tmp_path, "A trained model")
    (tmp_path / "clips").mkdir()
    for name, count in (("walk1", 50), ("walk2", 60), ("walk3", 70)):
        (tmp_path / "clips" / f"{name}.txt").write_text(deepmimic_text(deepmimic_frames(count)))
    quick_lake(tmp_path / "mylake", "[novelty]\nwidth = 2\nsteps = 120\n")
    query = re.findall(r'motionlake sql "(.*)" --lake mylake', section("A trained model"))[0]
    lines = (
        ("ingest", "clips"), ("run", "novelty"), ("sql", query, "--json"), ("train", "novelty", "--json"),
        ("run", "novelty"), ("sql", query, "--json"), ("status",),
    )  # fmt: skip
    said = copy.run(*((*words, "--lake", "mylake") for words in lines))
    first = json.loads(said[2])
    assert sorted(row["clip"] for row in first) == [f"clips/walk{number}.txt" for number in (1, 2, 3)]
    again = json.loads(said[3])
    assert again["model"] == "novelty-2"
    assert again["metrics"]["postures"] > 100
    assert json.loads(said[5]) == first, "trained alike, it says the same"
    assert "novelty-2" in said[6]
