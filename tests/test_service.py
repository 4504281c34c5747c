"""What the service answers of a small lake: clips by filters, motion, timelines, searches, maps, files."""

from __future__ import annotations

import io
import json
import math
import struct
import time
import zipfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from threading import Event, Lock
from typing import Any

import motionlake as library
import numpy as np
import pytest
from motionlake.service import served as served_module
from motionlake.service.motion import block_of, unpacked
from starlette.testclient import TestClient

from tests.lakes import query
from tests.samples import swinging_body
from tests.services import serving


@pytest.fixture(scope="module")
def client(built_lake: Path) -> Iterator[TestClient]:
    with serving(built_lake) as found:
        yield found


@pytest.fixture(scope="module")
def rows(client: TestClient) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = client.get("/api/clips", params={"limit": 1000}).json()["clips"]
    return found


def patient(client: TestClient, path: str) -> dict[str, Any]:
    """An answer that is ready."""
    for _ in range(60):
        found: dict[str, Any] = client.get(path).json()
        if found.get("ready", True):
            return found
        time.sleep(0.2)
    raise AssertionError(f"{path} is never ready: {found}")


def test_the_lake_says_what_it_is(client: TestClient, built_lake: Path) -> None:
    found = client.get("/api/lake").json()
    ((clips, seconds),) = query(built_lake, "SELECT count(*), sum(seconds) FROM clips")
    assert (found["name"], found["clips"]) == (built_lake.name, clips)
    assert found["seconds"] == pytest.approx(seconds, abs=1e-3)
    ready = {(method["finds"], method["name"]) for method in found["search_methods"] if method["ready"]}
    assert {("clip", "fused"), ("range", "fused"), ("clip", "descriptor")} <= ready
    assert "bvh" in found["exports"]
    assert found["read_only"] is False
    assert found["generation"]


def test_pages_of_clips_are_all_clips_in_order(client: TestClient, built_lake: Path) -> None:
    for column in ("clip", "seconds", "label"):
        for descending in (False, True):
            pages = [
                client.get("/api/clips", params={"offset": i, "limit": 4, "sort": column, "descending": descending})
                for i in range(0, 20, 4)
            ]
            names = [row["clip"] for page in pages for row in page.json()["clips"]]
            way = "DESC" if descending else "ASC"
            order = f"{column} {way} NULLS LAST" + ("" if column == "clip" else ", clip")
            assert names == [name for (name,) in query(built_lake, f"SELECT clip FROM clips ORDER BY {order}")]


def test_filters_are_those_of_sql(client: TestClient, built_lake: Path, rows: list[dict[str, Any]]) -> None:
    labels = sorted({row["label"] for row in rows})[:2]
    middle = sorted(row["seconds"] for row in rows)[len(rows) // 2]
    told: list[tuple[dict[str, Any], str]] = [
        ({"label": labels}, f"label IN ('{labels[0]}', '{labels[1]}')"),
        ({"label": labels[0], "dataset": rows[0]["dataset"]}, f"label = '{labels[0]}'"),
        ({"label": labels[0], "dataset": "none such"}, "false"),
        ({"seconds_from": middle}, f"seconds >= {middle}"),
        ({"seconds_to": middle}, f"seconds < {middle}"),
        ({"where": f"seconds < {middle} AND label <> '{labels[0]}'"}, f"seconds < {middle} AND label <> '{labels[0]}'"),
        ({"text": labels[0].upper()}, f"contains(lower(concat_ws(' ', clip, label)), lower('{labels[0]}'))"),
        ({"synthetic": "true"}, "false"),
    ]
    for given, condition in told:
        found = client.get("/api/clips", params={**given, "limit": 1000}).json()
        expected = [name for (name,) in query(built_lake, f"SELECT clip FROM clips WHERE {condition} ORDER BY clip")]
        assert [row["clip"] for row in found["clips"]] == expected, given
        assert found["total"] == len(expected)


def test_facets_count_what_a_click_would_show(client: TestClient, rows: list[dict[str, Any]]) -> None:
    label = rows[0]["label"]
    found = client.get("/api/facets", params={"label": label}).json()
    for name in ("dataset", "rig"):
        for each in found[name]:
            page = client.get("/api/clips", params={"label": label, name: each["value"] or ""}).json()
            assert page["total"] == each["clips"], (name, each)
    counts = {each["value"]: each["clips"] for each in found["label"]}
    assert sum(counts.values()) == len(rows), "its own filter leaves a facet as it is"
    lengths = client.get("/api/facets").json()["length"]
    assert sum(each["clips"] for each in lengths) == len(rows)
    one = next(each for each in lengths if each["clips"])
    between = client.get("/api/clips", params={"seconds_from": one["from"] - 1e-3, "seconds_to": one["to"] + 1e-3})
    assert between.json()["total"] >= one["clips"]


def test_motion_is_true_to_two_millimetres_and_small(
    client: TestClient, built_lake: Path, rows: list[dict[str, Any]]
) -> None:
    lake = library.open_lake(built_lake)
    for row in rows:
        answer = client.get("/api/clip/motion", params={"clip": row["clip"]})
        positions, fps, feet = unpacked(answer.content)
        step = math.ceil(row["fps"] / 30 - 1e-3)
        true = lake.motion(row["clip"]).positions[::step]
        assert positions.shape == true.shape
        assert np.abs(positions - true).max() < 2e-3
        assert fps == pytest.approx(row["fps"] / step)
        assert len(feet) == len(true)
        assert len(answer.content) <= 100 + 30_000 * row["seconds"]


def test_a_long_way_costs_no_more_than_two_millimetres() -> None:
    body = swinging_body(300).astype(np.float64)
    rng = np.random.default_rng(0)
    walked = (
        np.concatenate([body, np.repeat(body[:, -1:], 21 - body.shape[1], axis=1)], axis=1)
        if body.shape[1] < 21
        else body[:, :21]
    )
    walked = (
        walked + np.linspace(0, 60, 300)[:, None, None] * np.array([1.0, 0.0, 0.4]) + rng.normal(0, 1e-3, (300, 21, 3))
    )
    positions, _, _ = unpacked(block_of(walked, 30.0, 30.0))
    assert np.abs(positions - walked).max() < 2e-3


def test_a_range_and_fewer_frames_a_second(client: TestClient, built_lake: Path, rows: list[dict[str, Any]]) -> None:
    row = max(rows, key=lambda row: row["frames"])
    stop = row["frames"] - 3
    positions, fps, _ = unpacked(
        client.get(
            "/api/clip/motion", params={"clip": row["clip"], "from": 5, "to": stop, "fps": row["fps"] / 2}
        ).content
    )
    true = library.open_lake(built_lake).motion(row["clip"]).positions[5:stop:2]
    assert np.abs(positions - true).max() < 2e-3
    assert fps == pytest.approx(row["fps"] / 2)
    for wrong in ({"from": 8, "to": 8}, {"from": 0, "to": row["frames"] + 1}):
        answer = client.get("/api/clip/motion", params={"clip": row["clip"], **wrong})
        assert answer.status_code == 400
        assert "not a range" in answer.json()["error"]


def test_thumbnails_come_together(client: TestClient, rows: list[dict[str, Any]]) -> None:
    names = [row["clip"] for row in rows][::-1]
    content = client.get("/api/thumbnails", params={"clip": names}).content
    (count,) = struct.unpack_from("<I", content)
    assert count == len(names)
    place, blocks = 4, []
    for _ in names:
        (length,) = struct.unpack_from("<I", content, place)
        blocks.append(content[place + 4 : place + 4 + length])
        place += 4 + length
    assert place == len(content)
    for name, block in zip(names, blocks, strict=True):
        positions, fps, _ = unpacked(block)
        assert fps <= 15.01
        assert 0 < len(positions) <= 2 * fps + 1
        assert block == client.get("/api/thumbnails", params={"clip": name}).content[8:]
    assert client.get("/api/thumbnails", params={"clip": ["a"] * 65}).status_code == 422


def test_the_skeleton_is_a_tree(client: TestClient) -> None:
    found = client.get("/api/skeleton").json()
    assert len(found["joints"]) == len(found["parents"]) == len(found["radii"]) == 21
    assert found["parents"][0] == -1
    assert all(parent < joint for joint, parent in enumerate(found["parents"]))


def test_the_timeline_is_what_the_stages_made(client: TestClient, built_lake: Path, rows: list[dict[str, Any]]) -> None:
    clip = rows[0]["clip"]
    found = client.get("/api/clip/timeline", params={"clip": clip}).json()
    bands = {band["name"]: band["spans"] for band in found["bands"]}
    assert found["frames"] == rows[0]["frames"]
    assert {"motifs", "symbols"} <= set(bands)
    assert all(0 <= span["start"] < span["stop"] <= found["frames"] for spans in bands.values() for span in spans)
    symbols = [symbol for (symbol,) in query(built_lake, f"SELECT symbol FROM clip_symbols('{clip}')")]
    joined = [symbol for i, symbol in enumerate(symbols) if i == 0 or symbols[i - 1] != symbol]
    assert [span["value"] for span in bands["symbols"]] == joined


def test_searches_are_those_of_the_library(client: TestClient, built_lake: Path, rows: list[dict[str, Any]]) -> None:
    lake, row = library.open_lake(built_lake), max(rows, key=lambda row: row["frames"])
    for method in ("default", "signature", "descriptor"):
        found = client.post("/api/search", json={"clip": row["clip"], "k": 5, "method": method}).json()
        expected = lake.search(row["clip"], 5, method="fused" if method == "default" else method)
        assert [hit["clip"] for hit in found["hits"]] == [hit["clip"] for hit in expected]
        assert [hit["distance"] for hit in found["hits"]] == pytest.approx([h["distance"] for h in expected], abs=1e-5)
    assert client.post("/api/search", json={"clip": row["clip"]}).json()["hits"][0]["explanation"]
    part = {"clip": row["clip"], "from": 0, "to": row["frames"], "method": "words", "k": 3}
    ranges = client.post("/api/search", json=part).json()["hits"]
    expected = lake.find(row["clip"], 0, row["frames"], 3, method="words")
    assert [(hit["clip"], hit["from"], hit["to"]) for hit in ranges] == [
        (h["clip"], h["start"], h["stop"]) for h in expected
    ]
    among = client.post("/api/search", json={"clip": row["clip"], "where": "seconds < 1", "k": 5}).json()["hits"]
    assert all(hit["seconds"] < 1 for hit in among)
    assert {hit["clip"] for hit in among} == {
        hit["clip"] for hit in lake.search(row["clip"], 100) if hit["seconds"] < 1
    } or len(among) == 5


def test_what_cannot_be_searched_is_told_in_a_line(client: TestClient, rows: list[dict[str, Any]]) -> None:
    clip = rows[0]["clip"]
    for asked, status in (
        ({"clip": clip, "method": "none"}, 400), ({"clip": "no such clip"}, 404), ({}, 400),
        ({"clip": clip, "k": 0}, 422),
        ({"clip": clip, "from": 0, "to": 10**9}, 400), ({"clip": clip, "other": 1}, 422), ({"upload": "../x"}, 404),
        ({"clip": clip, "where": "nonsense("}, 400),
    ):  # fmt: skip
        answer = client.post("/api/search", json=asked)
        assert answer.status_code == status, (asked, answer.text)
        assert "\n" not in answer.json()["error"]
        assert "Traceback" not in answer.text


def test_a_dropped_file_is_a_query(client: TestClient, clips_folder: Path, rows: list[dict[str, Any]]) -> None:
    row = next(row for row in rows if not row["clip"].endswith(".amc"))
    file = clips_folder / row["clip"].split("/", 1)[1]
    found = client.post("/api/uploads", params={"name": file.name}, content=file.read_bytes()).json()
    assert found["frames"] == row["frames"]
    hits = client.post("/api/search", json={"upload": found["id"], "k": 3}).json()["hits"]
    assert hits[0]["clip"] == row["clip"]
    wrong = client.post("/api/uploads", params={"name": "x.bvh"}, content=b"no clip")
    assert wrong.status_code == 422
    assert "/tmp" not in wrong.json()["error"]


def test_alignment_goes_from_end_to_end(client: TestClient, rows: list[dict[str, Any]]) -> None:
    a, b = rows[0], rows[1]
    path = client.get("/api/align", params={"clip": a["clip"], "other": b["clip"]}).json()["path"]
    assert path[0] == [0, 0]
    assert np.all(np.diff(path, axis=0) >= 0)
    assert path[-1][0] > a["frames"] - 1 - a["fps"] / 7
    same = client.get("/api/align", params={"clip": a["clip"], "other": a["clip"]}).json()["path"]
    assert all(i == j for i, j in same)


def test_the_map_shows_every_clip(client: TestClient, rows: list[dict[str, Any]]) -> None:
    found = patient(client, "/api/map?colour=label")
    assert sorted(found["clips"]) == sorted(row["clip"] for row in rows)
    labels = {row["clip"]: row["label"] for row in rows}
    assert found["values"] == [labels[clip] for clip in found["clips"]]
    assert np.isfinite(found["points"]).all()
    assert np.abs(found["points"]).max() == pytest.approx(1, abs=1e-3)
    assert sum(cluster["clips"] for cluster in found["clusters"]) == len(rows)
    assert client.get("/api/map?colour=secret").status_code == 400


def test_pairs_and_faults_are_told(client: TestClient) -> None:
    assert patient(client, "/api/duplicates")["ready"] is True
    assert client.get("/api/faults").json() == {"ready": False, "faults": []}, "stage quality has not run"


def test_an_export_is_an_archive_with_a_manifest(client: TestClient, rows: list[dict[str, Any]]) -> None:
    clips = [{"clip": rows[0]["clip"]}, {"clip": rows[1]["clip"], "from": 2, "to": 12}]
    answer = client.post("/api/export", json={"clips": clips, "format": "bvh"})
    assert answer.headers["content-type"] == "application/zip"
    with zipfile.ZipFile(io.BytesIO(answer.content)) as packed:
        manifest = json.loads(packed.read("manifest.json"))
        assert [row["frames"] for row in manifest["clips"]] == [rows[0]["frames"], 10]
        assert all(packed.read(row["file"]).startswith(b"HIERARCHY") for row in manifest["clips"])


def test_the_endpoints_are_described_without_a_network(client: TestClient) -> None:
    schema = client.get("/api/openapi.json").json()
    assert {"/api/clips", "/api/search", "/api/annotations", "/api/map"} <= set(schema["paths"])
    page = client.get("/api/docs").text
    assert "/api/clip/motion" in page
    assert "<script" not in page
    assert "http" not in page.replace("https://", "http://").replace("http-equiv", "") or "//" not in page


def test_a_page_of_no_bundle_says_so(built_lake: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.txt").write_text("no")
    bundle = tmp_path / "bundle"
    (bundle / "assets").mkdir(parents=True)
    with serving(built_lake, bundle=bundle) as client:
        assert "no browser application" in client.get("/").text
    (bundle / "index.html").write_text("<p>here</p>")
    (bundle / "assets" / "a.js").write_text("1")
    (bundle / "link.txt").symlink_to(tmp_path / "secret.txt")
    with serving(built_lake, bundle=bundle) as client:
        assert client.get("/?view=map&where=x").text == "<p>here</p>"
        script = client.get("/assets/a.js")
        assert script.headers["content-type"].startswith("text/javascript")
        assert "immutable" in script.headers["cache-control"]
        for path in ("/../secret.txt", "/%2e%2e/secret.txt", "/assets/../../secret.txt", "/link.txt", "//etc/passwd"):
            answer = client.get(path)
            assert answer.status_code == 404, path
            assert answer.text != "no"


def test_another_catalog_is_served_when_it_lands(lake: Path) -> None:
    from motionlake.lake.catalog import run_sql, writing
    from motionlake.lake.layout import open_lake

    with serving(lake) as client:
        before = client.get("/api/lake").json()
        with writing(open_lake(lake)) as con:
            con.execute("DELETE FROM clips WHERE clip = (SELECT min(clip) FROM clips)")
            run_sql(con, "settings")
        for _ in range(100):
            after = client.get("/api/lake").json()
            if after["generation"] != before["generation"]:
                break
            time.sleep(0.1)
        assert after["clips"] == before["clips"] - 1


def test_what_takes_long_is_asked_for_again_where_it_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A failure is told once and tried again, a `TimeoutError` of its own too; what is not done yet is no failure."""
    served, ending, tries = object.__new__(served_module.Served), Event(), count(1)
    served._lock, served._started = Lock(), {}

    def fails_once() -> int:
        tried = next(tries)
        if tried == 1:
            raise TimeoutError("of its own")
        return tried

    monkeypatch.setattr(served_module, "PATIENCE", 5.0)
    with pytest.raises(TimeoutError, match="of its own"):
        served.later("fails", fails_once)
    assert served.later("fails", fails_once) == 2
    assert served.later("fails", fails_once) == 2, "made once"
    monkeypatch.setattr(served_module, "PATIENCE", 0.05)
    assert served.later("long", lambda: ending.wait(10)) is None
    ending.set()
    monkeypatch.setattr(served_module, "PATIENCE", 5.0)
    assert served.later("long", lambda: False) is True
