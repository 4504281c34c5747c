"""What people decide is theirs: entered, taken back, kept through ingests, runs, backups and killed writers."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from motionlake.errors import UserError
from motionlake.lake.annotations import Annotations, new_annotation
from motionlake.lake.layout import open_lake

from tests.lakes import motionlake, on_cluster, query, quick_lake
from tests.services import serving


def annotated(lake: Path, clip: str) -> list[str]:
    """A tag, a label and a segment of a clip, by their ids."""
    with serving(lake) as client:
        return [
            client.post("/api/annotations", json={"clips": [clip], "who": "anna", **what}).json()["ids"][0]
            for what in (
                {"kind": "tag", "value": "good"},
                {"kind": "label", "value": "my own label"},
                {"kind": "segment", "value": "step", "from": 2, "to": 9},
            )
        ]


def first_clip(lake: Path) -> str:
    ((clip,),) = query(lake, "SELECT min(clip) FROM clips")
    return str(clip)


def test_a_decision_is_shown_and_taken_back(lake: Path) -> None:
    clip = first_clip(lake)
    ids = annotated(lake, clip)
    with serving(lake) as client:
        found = client.get("/api/annotations", params={"clip": clip}).json()
        assert [each["id"] for each in found["annotations"]] == ids[::-1]
        assert {each["who"] for each in found["annotations"]} == {"anna"}
        page = client.get("/api/clip", params={"clip": clip}).json()
        assert page["tags"] == ["good"]
        assert page["label"] != "my own label", "the source's label stays as it is"
        bands = {
            band["name"]: band["spans"]
            for band in client.get("/api/clip/timeline", params={"clip": clip}).json()["bands"]
        }
        assert ("step", 2, 9) in {(span["value"], span["start"], span["stop"]) for span in bands["annotations"]}
        assert client.get("/api/clips", params={"tags": "good"}).json()["total"] == 1
        assert client.get("/api/facets").json()["tags"] == [{"value": "good", "clips": 1}]

        assert client.delete("/api/annotations", params={"id": ids[0]}).json() == {"undone": [ids[0]]}
        assert client.get("/api/clips", params={"tags": "good"}).json()["total"] == 0
        undone = client.get("/api/annotations", params={"clip": clip, "undone": True}).json()["annotations"]
        assert [each["undone_at"] is not None for each in undone] == [False, False, True]
        again = client.delete("/api/annotations", params={"id": ids[0]})
        assert again.status_code == 400


def test_what_is_no_decision_is_refused_whole(lake: Path) -> None:
    clip = first_clip(lake)
    with serving(lake) as client:
        for what, status in (
            ({"clips": [clip, "no such clip"], "kind": "tag", "value": "x"}, 404),
            ({"clips": [clip], "kind": "opinion", "value": "x"}, 422),
            ({"clips": [clip], "kind": "tag", "value": "  "}, 400),
            ({"clips": [clip], "kind": "segment", "value": "x"}, 400),
            ({"clips": [clip], "kind": "segment", "value": "x", "from": 5, "to": 5}, 400),
            ({"clips": [clip], "kind": "segment", "value": "x", "from": 0, "to": 10**7}, 400),
            ({"clips": [], "kind": "tag", "value": "x"}, 422),
        ):
            answer = client.post("/api/annotations", json=what)
            assert answer.status_code == status, (what, answer.text)
    assert not (lake / "annotations.jsonl").exists()


@pytest.fixture
def own(tmp_path: Path, clips_folder: Path, scheduler: str) -> tuple[Path, Path]:
    """A source folder that a test may change, and a lake of it."""
    source, lake = Path(shutil.copytree(clips_folder, tmp_path / "own")), quick_lake(tmp_path / "lake")
    made = on_cluster(["ingest", source, "--lake", lake], scheduler)
    assert made.status == 0, made.err
    return source, lake


def test_ingest_and_runs_keep_decisions_apart(own: tuple[Path, Path], scheduler: str) -> None:
    source, lake = own
    clip = first_clip(lake)
    ids = annotated(lake, clip)
    labels = query(lake, "SELECT clip, label FROM clips ORDER BY clip")
    file = source / clip.split("/", 1)[1]
    content = file.read_bytes()

    def decided() -> list[str]:
        with serving(lake) as client:
            found = client.get("/api/annotations", params={"clip": clip}).json()["annotations"]
        return [each["id"] for each in reversed(found)]

    file.write_bytes(content + b"\n")  # the clip is read anew
    for words in (["ingest", source], ["run", "words"]):
        made = on_cluster([*words, "--lake", lake], scheduler)
        assert made.status == 0, made.err
        assert decided() == ids
    assert query(lake, "SELECT clip, label FROM clips ORDER BY clip") == labels, "no source label became another one"
    assert query(lake, "SELECT count(*) FROM segments WHERE label = 'step'") == [(0,)]
    assert motionlake("remove", clip, "--lake", lake).status == 0
    assert decided() == ids, "a clip may come back"
    on_cluster(["ingest", source, "--lake", lake], scheduler)
    assert decided() == ids
    assert motionlake("verify", "--deep", "--lake", lake).status == 0


def test_decisions_go_out_as_files_that_ingest_takes(own: tuple[Path, Path], scheduler: str) -> None:
    source, lake = own
    clip = first_clip(lake)
    annotated(lake, clip)
    with serving(lake) as client:
        for kind in ("labels", "segments"):
            text = client.get("/api/annotations/export", params={"kind": kind}).text
            (source / f"{kind}.csv").write_text(text, encoding="utf-8")
    with (source / "labels.csv").open(encoding="utf-8") as handle:
        rows = list(csv.DictReader(handle))
    assert [(row["label"], row["tags"], row["who"]) for row in rows] == [("my own label", "good", "anna")]
    made = on_cluster(["ingest", source, "--lake", lake], scheduler)
    assert made.status == 0, made.err
    assert query(lake, f"SELECT label FROM clips WHERE clip = '{clip}'") == [("my own label",)]
    assert query(lake, f"SELECT start, stop, label FROM segments WHERE clip = '{clip}'") == [(2, 9, "step")]


def test_sql_has_the_decisions_that_hold(lake: Path) -> None:
    clip = first_clip(lake)
    ids = annotated(lake, clip)
    Annotations(open_lake(lake)).undo([ids[0]])
    run = motionlake(
        "sql", "SELECT kind, value, start, stop, who FROM clip_annotations() ORDER BY kind", "--json", "--lake", lake
    )
    assert json.loads(run.out) == [
        {"kind": "label", "value": "my own label", "start": None, "stop": None, "who": "anna"},
        {"kind": "segment", "value": "step", "start": 2, "stop": 9, "who": "anna"},
    ]


def test_a_backup_has_the_decisions(lake: Path, tmp_path: Path) -> None:
    ids = annotated(lake, first_clip(lake))
    assert motionlake("backup", "-o", tmp_path / "kept.zip", "--lake", lake).status == 0
    assert motionlake("restore", tmp_path / "kept.zip", "--lake", tmp_path / "restored").status == 0
    assert [each.id for each in Annotations(open_lake(tmp_path / "restored")).current()] == ids


def test_half_a_line_of_a_killed_writer_costs_that_line_alone(lake: Path) -> None:
    target = open_lake(lake)
    ids = annotated(lake, first_clip(lake))
    reader = Annotations(target)
    assert len(reader.all()) == 3
    with target.annotations.open("ab") as handle:
        handle.write(b'{"id": "half", "clip"')
    assert [each.id for each in Annotations(target).all()] == ids
    new = new_annotation("a clip", "tag", "x")
    Annotations(target).add([new])
    assert [each.id for each in Annotations(target).all()] == [*ids, new.id]
    assert [each.id for each in reader.all()] == [*ids, new.id], "who has read it before reads what came since"


def test_two_writers_lose_nothing(lake: Path) -> None:
    target = open_lake(lake)
    one, other = Annotations(target), Annotations(target)
    for i in range(10):
        (one if i % 2 else other).add([new_annotation("c", "tag", str(i))])
    assert [each.value for each in one.all()] == [each.value for each in other.all()] == [str(i) for i in range(10)]


def test_what_cannot_be_written_is_told(lake: Path) -> None:
    target = open_lake(lake)
    target.annotations.mkdir()
    with pytest.raises(UserError, match=r"annotations\.jsonl"):
        Annotations(target).add([new_annotation("c", "tag", "x")])
