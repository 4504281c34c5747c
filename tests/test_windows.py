"""Pieces in a large lake: the codes of windows, and answers by them, which are those of comparing every window."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.layout import open_lake
from motionlake.retrieval import near_moves
from motionlake.retrieval.moves import MovesRangeSearcher
from motionlake.retrieval.near_moves import NearMovesSearcher
from motionlake.retrieval.protocol import Query, Scope
from motionlake.retrieval.registry import searcher
from motionlake.retrieval.submotion_search import SubmotionSearcher
from motionlake.retrieval.window_codes import CodedPiece
from motionlake.stages import windows
from motionlake.stages.windows import WINDOWS, WindowFile

from tests.lakes import motionlake, query
from tests.test_newer_models import newer
from tests.test_submotion_search import find, longest, run


@contextmanager
def few() -> Iterator[None]:
    """Within the block any lake is a large one."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(windows, "MOST", 1)
        yield


@pytest.fixture(scope="module")
def coded_lake(tmp_path_factory: pytest.TempPathFactory, built_lake: Path, scheduler: str) -> Path:
    root = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("windows") / "lake"))
    assert run(root, scheduler, "windows") == {"windows": 0}
    with few():
        assert run(root, scheduler, "windows")["windows"] > 0
        assert run(root, scheduler, "all").pop("windows") == 0
    return root


def test_codes_are_the_vectors_rounded(coded_lake: Path) -> None:
    codes = sorted(coded_lake.glob("windows/*.arrow"))
    assert len(codes) == len(list(coded_lake.glob("submotions/*.parquet")))
    held = query(coded_lake, "SELECT s.files[1], w.files[1] FROM manifest s JOIN manifest w USING (part)"
                             " WHERE s.stage = 'submotions' AND w.stage = 'windows'")  # fmt: skip
    for vectors, file in held:
        found, wanted = WindowFile.open(coded_lake / file), pq.read_table(coded_lake / vectors)
        for name in ("clip", "start", "stop"):
            assert found.table[name].to_pylist() == wanted[name].to_pylist()
        exact = np.array(wanted["descriptor"].to_pylist(), dtype=np.float32)
        np.testing.assert_allclose(found.codes * found.scales[:, None], exact, atol=float(found.scales.max()) * 0.51)
        near = CodedPiece.of(exact[0]).apart(found)
        np.testing.assert_allclose(np.sqrt(np.maximum(near, 0)), np.linalg.norm(exact - exact[0], axis=1), atol=0.02)


def test_answers_are_those_of_every_window(coded_lake: Path, built_lake: Path) -> None:
    assert SubmotionSearcher(open_lake(coded_lake))._scan is not None
    assert SubmotionSearcher(open_lake(built_lake))._scan is None
    for clip, _ in longest(built_lake, 4):
        for words in ([], ["--mirrored"], ["--own"], ["--dataset", clip.partition("/")[0]], ["-k", 3]):
            asked = find(built_lake, clip, 3, 33, *words)
            assert asked.status == 0, asked.err
            assert find(coded_lake, clip, 3, 33, *words).json == asked.json


def with_newer_vectors(lake: Path, folder: Path, scheduler: str) -> tuple[Path, str, Any]:
    """A copy of a lake with windows by a newer encoder, a clip, and the answers to a piece of it before."""
    root = Path(shutil.copytree(lake, folder / "lake"))
    (clip, _), *_ = longest(root, 1)
    found = find(root, clip, 3, 33).json
    newer(root, "submotion")
    assert run(root, scheduler, "submotions")["submotions"] > 0
    return root, clip, found


def test_stale_codes_are_not_read(coded_lake: Path, tmp_path: Path, scheduler: str) -> None:
    """Where windows are made anew, the vectors themselves are compared until their codes are."""
    root, clip, found = with_newer_vectors(coded_lake, tmp_path, scheduler)
    assert SubmotionSearcher(open_lake(root))._scan is None
    assert find(root, clip, 3, 33).json == found
    with few():
        assert run(root, scheduler, "windows")["windows"] > 0
    assert SubmotionSearcher(open_lake(root))._scan is not None
    assert find(root, clip, 3, 33).json == found


def test_moves_are_looked_for_where_windows_are_near(coded_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lake, own = open_lake(coded_lake), Scope(own=True)
    ((clip, fps),) = query(coded_lake, "SELECT clip, fps FROM clips ORDER BY frames / fps DESC, clip LIMIT 1")
    asked = Query(clip, 3, 3 + round(fps))
    near, every = (searcher("range", "moves", lake, exact=exact) for exact in (False, True))
    assert (type(near), type(every)) == (NearMovesSearcher, MovesRangeSearcher)
    (expected,) = every.search([asked], 999, own)
    assert near.search([asked], 999, own) == [expected], "so few clips are all compared"
    monkeypatch.setattr(near_moves, "CLIPS", 3)
    chosen = SubmotionSearcher(lake).clips_near(asked, 3, own, mirrored=False)
    (nearest,) = searcher("range", "submotion", lake, exact=True).search([asked], 999, own)
    assert chosen is not None
    assert set(chosen) == set(list(dict.fromkeys(hit.clip for hit in nearest))[:3])
    (found,) = near.search([asked], 3, own)
    assert len(found) == 3
    compared = [hit for hit in expected if hit.clip in {*chosen, clip}][:3]  # the query's own clip is always
    assert [(hit.clip, hit.distance) for hit in found] == [(hit.clip, hit.distance) for hit in compared]
    (others,) = near.search([asked], 3, Scope())
    assert (clip, 3) not in {(hit.clip, hit.start) for hit in others}


def test_a_damaged_file_answers_nothing(coded_lake: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(coded_lake, tmp_path / "lake"))
    file = next(root.glob("windows/*.arrow"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    (clip, _), *_ = longest(root, 1)
    asked = find(root, clip, 3, 33)
    assert (asked.status, asked.out) == (2, "")
    assert file.name in asked.err
    with few():
        assert motionlake("repair", "--lake", root).status == 0
    assert find(root, clip, 3, 33).status == 0


def test_merged_codes(coded_lake: Path, tmp_path: Path) -> None:
    """Codes of merged parts are those that would be made of the merged vectors."""
    root = Path(shutil.copytree(coded_lake, tmp_path / "lake"))
    with few():
        paths = {row["part"]: root / row["codes"] for row in _files(root)}
        order = [(clip, part) for part, path in sorted(paths.items()) for clip in WindowFile.open(path).runs]
        order.sort(key=lambda pair: pair[0][::-1])
        WINDOWS.merge(paths, order, tmp_path / "merged.arrow", "all", "key")
    merged = WindowFile.open(tmp_path / "merged.arrow")
    assert list(merged.runs) == [clip for clip, _ in order]
    for clip, part in order:
        own = WindowFile.open(paths[part])
        assert np.array_equal(merged.codes[merged.runs[clip]], own.codes[own.runs[clip]])
        assert np.array_equal(merged.scales[merged.runs[clip]], own.scales[own.runs[clip]])


def _files(root: Path) -> list[dict[str, str]]:
    with reading(open_lake(root)) as con:
        return fetch(con, "window_files")
