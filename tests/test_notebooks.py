"""What a lake, answers and a motion show of themselves in a notebook, and the notebook of the documentation."""

from __future__ import annotations

import html
import json
import re
import sys
import types
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import motionlake
import nbformat
import numpy as np
import pyarrow as pa
import pytest
from motionlake.lake.rows import Rows, rows_html
from motionlake.motion.canonicalise import CanonicalMotion
from motionlake.motion.skeleton import JOINTS, PARENTS
from motionlake.pictures.answers import Hits
from motionlake.pictures.notebook import motion_html
from motionlake.pictures.player_material import MOST_SECONDS
from nbclient import NotebookClient

from tests.lakes import QUICK
from tests.lakes import motionlake as command
from tests.test_pictures import NASTY, standing
from tests.test_view import Elements, embedded, unpack

TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorial.ipynb"
SRCDOC = re.compile(r'<iframe[^>]* srcdoc="([^"]*)"', re.DOTALL)


def moving(frames: int = 60, fps: float = 30.0, lift: float = 0.4) -> CanonicalMotion:
    """A body whose left arm goes up and down."""
    positions = standing(frames)
    positions[:, 7:9, 1] += lift * np.sin(4 * np.arange(frames) / fps)[:, None]
    still = np.tile([1.0, 0.0, 0.0, 0.0], (frames, len(JOINTS), 1))
    return CanonicalMotion(
        fps, positions[:, 0], still, positions, positions[0], 1.6, True, (), "y", 1.0, 0.0, 0.0
    )  # fmt: skip


@pytest.fixture
def near(built_lake: Path) -> Iterator[motionlake.Lake]:
    with motionlake.open_lake(built_lake) as lake:
        yield lake


def test_a_lake_shows_its_counts_datasets_and_stages(near: motionlake.Lake) -> None:
    shown = near._repr_html_()
    rows = near.clips()
    assert f"</b>: {len(rows)} clips, " in shown
    for name in {row["dataset"] for row in rows}:
        assert f"<td>{name}</td><td>{sum(row['dataset'] == name for row in rows)}</td>" in shown
    stages = re.findall(r"<td>([a-z]+)</td><td>\d+</td><td>(\d+)</td>", shown.rpartition("<table>")[2])
    assert [name for name, _ in stages][:3] == ["frames", "words", "embed"]
    told = dict(stages)
    assert int(told["frames"]) == sum(row["frames"] for row in rows)
    assert int(told["signatures"]) == len(near.sql("FROM signatures"))


def test_answers_show_a_figure_of_each(near: motionlake.Lake) -> None:
    clip = near.clips("seconds >= 1")[0]["clip"]
    hits = near.search(clip, k=3)
    shown = hits._repr_html_()
    figures = re.findall(r"<svg.*?</svg>", shown)
    assert len(figures) == 4  # of the query, and of each answer
    assert len(set(figures)) == 4
    assert f"like {html.escape(clip)}: <svg" in shown
    for row in hits:
        assert f"<td>{row['rank']}</td><td>{row['clip']}</td>" in shown
    found = near.find(clip, 0, 30, k=3)._repr_html_()
    assert found.count("<svg") == 1 + len(near.find(clip, 0, 30, k=3))
    words = near.search(text=str(near.clips(clip=clip)[0]["label"]), k=2)
    assert words._repr_html_().count("<svg") == len(words) > 0  # there is no motion that was asked for
    assert "shares" not in near.align(clip, 0, 30, k=1, path=True)._repr_html_()


def test_a_figure_is_of_the_frames_that_were_found() -> None:
    motions: dict[str | Path, CanonicalMotion] = {"a": moving(60), "b": moving(60, lift=-0.4)}
    table = pa.table({"rank": [1, 2, 3], "clip": ["a", "a", "b"], "start": [0, 30, 0], "stop": [20, 60, 20]})
    first, later, other = re.findall(
        r"<svg.*?</svg>", Hits(table, motions.__getitem__, (None, None, None))._repr_html_()
    )
    assert len({first, later, other}) == 3


def test_of_a_clip_that_is_gone_there_is_a_row_without_a_figure() -> None:
    def read(clip: Any) -> CanonicalMotion:
        raise motionlake.UserError(f"{clip}: no such clip")

    table = pa.table({"rank": [1], "clip": ["a"], "distance": [0.5], "label": [None], "seconds": [2.0]})
    hits = Hits(table, read, ("query", None, None))
    assert "<td></td><td>1</td><td>a</td><td>0.5</td>" in hits._repr_html_()
    with pytest.raises(motionlake.UserError, match="no such clip"):
        hits.plot()


@pytest.mark.parametrize("name", [*NASTY, "<script>alert(1)</script>", "\udcff"])
def test_no_name_breaks_a_notebook(name: str) -> None:
    table = pa.table({"rank": [1], "clip": [name.replace("\udcff", "x")], "label": ["</td></table>"]})
    if name != "\udcff":
        plain = Hits(pa.table({"rank": [1], "clip": ["a"], "label": ["b"]}), lambda _: moving(), ("a", None, None))
        shown = Hits(table, lambda _: moving(), (name, None, None))._repr_html_()
        assert Elements(shown).elements == Elements(plain._repr_html_()).elements
        assert Elements(shown).attributes == Elements(plain._repr_html_()).attributes
    columns = pa.table({name.replace("\udcff", "x"): [[name.replace("\udcff", "x")]]})
    assert Elements(rows_html(columns)).elements == Elements(rows_html(pa.table({"a": [["a"]]}))).elements


def test_rows_are_a_table_of_the_first() -> None:
    rows = Rows.of({"x": at, "y": at / 3, "z": "z" * 500, "none": None} for at in range(80))
    shown = rows._repr_html_()
    assert shown.count("<tr>") == 1 + 50
    assert "50 of 80 rows" in shown
    assert "<td>1</td><td>0.3333</td>" in shown
    assert "z" * 81 not in shown
    assert "None" not in shown


def test_rows_of_a_search_go_to_other_processes(near: motionlake.Lake) -> None:
    hits = near.search(near.clips()[0]["clip"], k=2)
    with ProcessPoolExecutor(1, get_context("spawn")) as other:
        assert other.submit(list, hits).result(timeout=120) == list(hits)


def test_a_motion_is_a_player_that_needs_nothing_else() -> None:
    motion = moving()
    shown = motion._repr_html_()
    (page,) = (html.unescape(found) for found in SRCDOC.findall(shown))
    assert 'sandbox="allow-scripts"' in shown
    assert np.abs(unpack(embedded(page)["clips"][0]["motion"]) - motion.positions).max() < 1e-3
    assert not re.search(r"(src|href)=|https?:", page.replace("img-src", ""))
    assert len(shown) < 70_000
    assert "<iframe" not in motion[:0]._repr_html_()


def test_a_long_motion_plays_its_first_minutes() -> None:
    motion = moving(round((MOST_SECONDS + 5) * 30))
    (page,) = (html.unescape(found) for found in SRCDOC.findall(motion_html(motion)))
    assert embedded(page)["clips"][0]["count"] == MOST_SECONDS * 30
    assert f"motion[{MOST_SECONDS * 30:.0f}:]" in motion_html(motion)
    assert "--from" not in page


def test_pictures_are_kept_as_files(near: motionlake.Lake, tmp_path: Path) -> None:
    clip = near.clips("seconds >= 1")[0]["clip"]
    for drawing in (near.motion(clip).plot(5), near.search(clip, k=4).plot(3)):
        assert drawing._repr_png_().startswith(b"\x89PNG")
        for suffix, head in ((".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")):
            assert drawing.save(tmp_path / f"a{suffix}").read_bytes().startswith(head)
        again = (tmp_path / "a.svg").read_bytes()
        assert b"dc:date" not in again
    mistakes: dict[str, Callable[[], object]] = {
        "a picture ends with": lambda: drawing.save(tmp_path / "a.gif"),
        "1 to 40": lambda: near.motion(clip).plot(0),
        "no frames": lambda: near.motion(clip)[:0].plot(),
        "1 to 30": lambda: near.search(clip).plot(31),
        "no answers": lambda: near.search(clip, dataset="nobody").plot(),
    }
    for said, mistake in mistakes.items():
        with pytest.raises(motionlake.UserError, match=said):
            mistake()


class Recorder:
    """What of rerun `to_rerun` calls: columns, and a recording that keeps them."""

    def __init__(self, application: str) -> None:
        self.application, self.logged, self.sent = application, dict[str, Any](), dict[str, Any]()

    def log(self, path: str, what: Any, *, static: bool) -> None:
        assert static
        self.logged[path] = what

    def send_columns(self, path: str, times: Any, columns: Any) -> None:
        self.sent[path] = times, columns


class Batch:
    def __init__(self, **given: Any) -> None:
        self.given = given

    @classmethod
    def columns(cls, **given: Any) -> Batch:
        return cls(**given)

    from_fields = columns

    def partition(self, lengths: Any) -> Batch:
        self.given["lengths"] = lengths
        return self


def rerun_stand_in() -> types.ModuleType:
    module = types.ModuleType("rerun")
    module.RecordingStream = Recorder  # type: ignore[attr-defined]
    module.Points3D = module.LineStrips3D = Batch  # type: ignore[attr-defined]
    module.TimeColumn = lambda name, **given: (name, given)  # type: ignore[attr-defined]
    module.ViewCoordinates = types.SimpleNamespace(RIGHT_HAND_Y_UP="y up")  # type: ignore[attr-defined]
    return module


def test_rerun_gets_joints_and_bones_over_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", rerun_stand_in())
    motion = moving(10, fps=20.0)
    recording = motion.to_rerun("arm")
    (frames, seconds), points = recording.sent["arm/joints"]
    assert frames[1]["sequence"].tolist() == list(range(10))
    assert seconds[1]["duration"][-1] == pytest.approx(9 / 20)
    np.testing.assert_allclose(points.given["positions"].reshape(10, 21, 3), motion.positions, atol=1e-6)
    assert points.given["lengths"].tolist() == [21] * 10
    _, lines = recording.sent["arm/bones"]
    bones = lines.given["strips"].reshape(10, 20, 2, 3)
    np.testing.assert_allclose(bones[3, 7], motion.positions[3, [8, PARENTS[8]]], atol=1e-6)
    assert recording.logged["arm"] == "y up"
    assert moving(2).to_rerun("other", recording) is recording
    assert set(recording.sent) == {"arm/joints", "arm/bones", "other/joints", "other/bones"}


def test_rerun_itself_writes_a_file(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="pip install 'motionlake[rerun]' for this test")
    recording = moving(30).to_rerun("arm")
    recording.save(tmp_path / "a.rrd")
    recording.flush()
    recording.disconnect()
    assert (tmp_path / "a.rrd").read_bytes()[:3] == b"RRF"
    assert (tmp_path / "a.rrd").stat().st_size > 30 * 21 * 12


def test_without_rerun_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(motionlake.UserError, match=r"pip install 'motionlake\[rerun\]'") as said:
        moving().to_rerun()
    assert "\n" not in str(said.value)


def test_the_tutorial_is_kept_without_outputs() -> None:
    cells = json.loads(TUTORIAL.read_text(encoding="utf-8"))["cells"]
    assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in cells)
    assert sum(cell["cell_type"] == "code" for cell in cells) > 10


def test_the_tutorial_runs(lake: Path, scheduler: str, tmp_path: Path) -> None:
    (lake / "config.toml").write_text(f'{QUICK}[synthesis]\nweights = "pretrained"\n', encoding="utf-8")
    made = command("run", "synth", "--lake", lake, "--scheduler", scheduler)
    assert made.status == 0, made.err
    lake.rename(tmp_path / "mylake")
    notebook: Any = nbformat.read(TUTORIAL, as_version=4)
    where = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, kernel_name="python3", timeout=300, resources=where).execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pages = [output["data"].get("text/html", "") for output in shown if output["output_type"] == "execute_result"]
    assert sum("<iframe" in page for page in pages) == 3  # a clip, a piece of one, and what was made
    assert sum("<svg" in page for page in pages) == 2
    assert sum("image/png" in output["data"] for output in shown if "data" in output) == 3
    assert [output["text"] for output in shown if output.get("name") == "stderr"] == []
