"""How far a run is, told to those who look on: while it holds the lake, and not after it."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from motionlake.lake.layout import open_lake
from motionlake.lake.lock import locked
from motionlake.lake.run_progress import SharedProgress, progress_now
from motionlake.service import events
from motionlake.service.options import Options
from motionlake.service.served import Serving

from tests.lakes import on_cluster


def test_progress_is_seen_while_a_run_holds_the_lake(lake: Path) -> None:
    target, told = open_lake(lake), []
    progress = SharedProgress(target, lambda *what: told.append(what))
    progress("words", 0, 10)
    assert progress_now(target) is None, "nobody writes"
    with locked(target, "run"):
        progress("words", 10, 10)
        assert progress_now(target) == {"stage": "words", "done": 10, "total": 10, "seconds_left": 0.0}
        progress("embed", 0, 4)
        assert progress_now(target) == {"stage": "embed", "done": 0, "total": 4, "seconds_left": None}
        progress.end()
        assert progress_now(target) == {"stage": "", "done": 0, "total": 0, "seconds_left": None}
    assert progress_now(target) is None
    assert told == [("words", 0, 10), ("words", 10, 10), ("embed", 0, 4)]


def test_a_run_writes_it_down_and_takes_it_away(
    lake: Path, scheduler: str, clips_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[dict[str, Any] | None] = []
    plain = SharedProgress.__call__

    def looked_at(self: SharedProgress, stage: str, done: int, total: int) -> None:
        plain(self, stage, done, total)
        seen.append(progress_now(open_lake(lake)))

    monkeypatch.setattr(SharedProgress, "__call__", looked_at)
    assert on_cluster(["run", "quality", "--lake", lake], scheduler).status == 0
    assert any(found and found["stage"] == "quality" and found["total"] > 0 for found in seen)
    assert not (lake / ".progress").exists()
    assert progress_now(open_lake(lake)) is None


def test_pages_hear_of_runs_and_end_with_the_service(lake: Path) -> None:
    target, options = open_lake(lake), Options()
    serving = Serving(target, options)

    async def nobody_left() -> bool:
        return False

    request: Any = SimpleNamespace(app=SimpleNamespace(state=SimpleNamespace(listeners=0)), is_disconnected=nobody_left)

    async def hear() -> list[dict[str, Any]]:
        said: list[dict[str, Any]] = []
        async for line in events._told(request, serving):
            if line.startswith("data: "):
                said.append(json.loads(line.removeprefix("data: ")))
            if len(said) == 1:
                holding.__enter__()
                SharedProgress(target, lambda *_: None)("words", 1, 2)
            if len(said) == 2:
                holding.__exit__(None, None, None)
            if len(said) == 3:
                options.ending.set()
        return said

    holding = locked(target, "run")
    said = asyncio.run(asyncio.wait_for(hear(), 60))
    assert list(said[0]) == ["generation"]
    assert said[1]["run"]["stage"] == "words"
    assert said[2] == {"run": None}
    assert request.app.state.listeners == 0
    serving.close()
