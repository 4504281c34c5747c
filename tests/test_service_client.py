"""The Python library with an address in the place of a folder answers what it answers of the folder."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import motionlake as library
import numpy as np
import pytest
from motionlake.errors import UserError
from motionlake.lake.layout import open_lake
from motionlake.retrieval.fused import FusedSearcher
from motionlake.retrieval.protocol import Query
from motionlake.service.errors import ServiceError
from motionlake.service.options import Options
from motionlake.service.search import SearchRequest, found
from motionlake.service.served import Serving
from motionlake.service.server import address, listening, serve

from tests.lakes import query
from tests.services import TOKEN, serving


@pytest.fixture(scope="module")
def where(built_lake: Path) -> Iterator[str]:
    """The address of a service in a thread of this process."""
    options, ready = Options(token=TOKEN, seconds=1.0), threading.Event()
    with listening("127.0.0.1", 0) as sock:
        thread = threading.Thread(
            target=serve, args=(open_lake(built_lake), sock, "127.0.0.1", options, ready.set), daemon=True
        )
        thread.start()
        assert ready.wait(60)
        yield address(sock, "127.0.0.1", TOKEN)
        options.ending.set()
        thread.join(30)


@pytest.fixture
def both(built_lake: Path, where: str) -> tuple[library.Lake, library.Lake]:
    """The lake by its folder, and by its address."""
    return library.open_lake(built_lake), library.open_lake(where)


def test_clips_and_sql_are_the_same(both: tuple[library.Lake, library.Lake]) -> None:
    near, far = both
    assert list(far.clips()) == list(near.clips())
    assert list(far.clips("seconds > 1", rig=near.clips()[0]["rig"])) == list(
        near.clips("seconds > 1", rig=near.clips()[0]["rig"])
    )
    text, given = "SELECT clip, frames FROM clips WHERE seconds > $least ORDER BY clip", {"least": 1}
    assert far.sql(text, given).fetchall() == near.sql(text, given).fetchall()
    assert far.sql("SELECT ?::INTEGER AS x", [3])[0] == {"x": 3}


def test_motion_is_the_same_to_the_bit(both: tuple[library.Lake, library.Lake]) -> None:
    near, far = both
    clip = near.clips()[0]["clip"]
    a, b = near.motion(clip), far.motion(clip)
    assert np.array_equal(a.positions, b.positions)
    assert np.array_equal(a.rotations, b.rotations)
    assert np.allclose(a.rest_offsets, b.rest_offsets, atol=1e-9)
    assert (a.fps, a.body_height, a.twist, a.filled, a.notes) == (b.fps, b.body_height, b.twist, b.filled, b.notes)


def test_searches_are_the_same(both: tuple[library.Lake, library.Lake], clips_folder: Path) -> None:
    near, far = both
    row = near.clips()[0]
    clip, short = row["clip"], row["clip"].split("/")[-1]
    assert list(far.search(short, 4)) == list(near.search(short, 4))
    assert list(far.search(text=str(row["label"]), k=2)) == list(near.search(text=str(row["label"]), k=2))
    assert list(far.find(clip, 0, row["frames"], 3, method="words")) == list(
        near.find(clip, 0, row["frames"], 3, method="words")
    )
    assert list(far.align(clip, k=3, whole=True)) == list(near.align(clip, k=3, whole=True))
    file = clips_folder / clip.split("/", 1)[1]
    assert [hit["clip"] for hit in far.search(file, 3)] == [hit["clip"] for hit in near.search(file, 3)]
    for far_search in (far.search, far.find):
        with pytest.raises(UserError, match=r"^exact: .* open the folder of the lake$"):
            far_search(clip, method="moves", exact=True)


def test_a_notebook_shows_the_same(both: tuple[library.Lake, library.Lake]) -> None:
    near, far = both
    assert far._repr_html_().partition("</b>")[2] == near._repr_html_().partition("</b>")[2]
    assert TOKEN not in far._repr_html_()
    clip = near.clips("seconds >= 1")[0]["clip"]
    one, other = near.find(clip, 0, 40, k=2), far.find(clip, 0, 40, k=2)
    assert other._repr_html_() == one._repr_html_()
    assert other.plot()._repr_png_() == one.plot()._repr_png_()
    assert far.motion(clip)._repr_html_() == near.motion(clip)._repr_html_()


def test_mistakes_are_user_errors(both: tuple[library.Lake, library.Lake], where: str, tmp_path: Path) -> None:
    far = both[1]
    with pytest.raises(UserError, match="none such"):
        far.motion("none such")
    with pytest.raises(UserError, match="no column nothing"):
        far.clips(nothing=1)
    with pytest.raises(UserError, match="open the folder"):
        far.dataset()
    with pytest.raises(UserError, match="open the folder"):
        far.synthesize("walk")
    with pytest.raises(UserError, match="COPY"):
        far.sql(f"COPY (SELECT 1) TO '{tmp_path}/a.csv'")
    with pytest.raises(UserError, match="stopped after 1 s"):
        far.sql("SELECT count(*) FROM range(10000000) a, range(10000000) b WHERE a.range * b.range % 7 = 3")
    with pytest.raises(UserError, match="takes no encoder"):
        far.search("x", encoder="model")
    with pytest.raises(UserError):
        far.search(str(tmp_path / "x.bvh"))
    with pytest.raises(UserError, match="token"):
        library.open_lake(where.replace("token=", "token=x"))
    with pytest.raises(UserError, match="does not answer"):
        library.open_lake("http://127.0.0.1:1/?token=x")
    assert TOKEN not in repr(far)
    assert "?" not in repr(far)


def test_no_file_of_the_service_is_a_query(built_lake: Path, tmp_path: Path, clips_folder: Path) -> None:
    file = next(path for path in clips_folder.rglob("*") if path.suffix in (".bvh", ".npz"))
    with serving(built_lake) as client:
        for name in (str(file), f"../{file.name}", "/etc/passwd"):
            for method in ("search", "find", "align"):
                answer = client.post("/api/call", json={"method": method, "arguments": {"query": name}})
                assert answer.status_code == 400, (name, method)
        for method in ("close", "__init__", "synthesize", "dataset", "_con"):
            assert client.post("/api/call", json={"method": method}).status_code == 400


@pytest.mark.parametrize("large", [False, True])
def test_searches_of_a_large_lake_run_beside_one_another(
    built_lake: Path, monkeypatch: pytest.MonkeyPatch, large: bool
) -> None:
    monkeypatch.setattr(FusedSearcher, "beside_others", lambda self, query, scope: large)
    serving_now = Serving(open_lake(built_lake), Options(search_seconds=0.1)).now()
    (clip,) = query(built_lake, "SELECT min(clip) FROM clips")[0]
    asked = SearchRequest(clip=clip, k=3)  # type: ignore[call-arg]
    assert found(serving_now, Query(clip), asked)
    with serving_now.searching(alone=False), nullcontext() if large else pytest.raises(ServiceError, match="others"):
        assert found(serving_now, Query(clip), asked)


def test_a_refused_turn_says_so(built_lake: Path) -> None:
    (clip,) = query(built_lake, "SELECT min(clip) FROM clips")[0]
    serving_now = Serving(open_lake(built_lake), Options(search_seconds=0.1)).now()
    started = time.monotonic()
    with serving_now.searching(), pytest.raises(ServiceError, match="others are searching"), serving_now.searching():
        pass
    assert time.monotonic() - started < 5
    assert clip
