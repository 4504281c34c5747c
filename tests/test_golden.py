"""The small golden record: a refactoring changes neither what a lake holds nor what commands say."""

from __future__ import annotations

import json
from pathlib import Path

from bench.golden.comparing import differences
from bench.golden.small import RECORD, RERECORD, small_differences, small_record

SHOWN = 40


def test_lake_and_answers_are_those_of_the_record(tmp_path: Path, scheduler: str) -> None:
    found = small_differences(
        json.loads(RECORD.read_text(encoding="utf-8")), small_record(tmp_path, ("--scheduler", scheduler))
    )
    more = [f"… and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
    assert not found, "\n".join(
        [f"{len(found)} entries differ:", *found[:SHOWN], *more, f"if that is intended, take it down anew: {RERECORD}"]
    )


def test_differences_are_named_entry_by_entry() -> None:
    old = {"table": {"clips": {"rows": 2, "column": {"seconds": "1a", "clip": "2b"}}}, "asked": [{"distance": 0.5}]}
    new = {
        "table": {"clips": {"rows": 3, "column": {"duration": "1a", "clip": "2b", "note": "3c"}}},
        "asked": [{"distance": 0.5001}],
    }
    assert differences(old, old) == []
    assert differences(old, new) == [
        "table/clips/rows: 2 → 3",
        "table/clips/column/seconds: gone (was '1a')",
        "asked/0/distance: 0.5 → 0.5001",
        "table/clips/column/duration: new ('1a')",
        "table/clips/column/note: new ('3c')",
    ]
    renamed = {"table/clips/column/seconds": "table/clips/column/duration", "distance": "far"}
    assert differences(old, new, renamed=renamed, relative=1e-3) == [
        "table/clips/rows: 2 → 3",
        "asked/0/far: gone (was 0.5)",
        "table/clips/column/note: new ('3c')",
        "asked/0/distance: new (0.5001)",
    ]
