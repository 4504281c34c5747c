"""Records that docs name."""

from __future__ import annotations

import json
from pathlib import Path

from bench.check_records import faults, named

NAMES = ("moves-20260101T000000Z", "search-20260102T030405Z", "sorting-20260103T000000Z", "text-20260104T000000Z")


def test_missing_and_unclean_records_are_told(tmp_path: Path) -> None:
    page = tmp_path / "search.md"
    page.write_text(
        f"Measured (record {NAMES[0]}; `results/{NAMES[1]}.json`), {NAMES[2]},\n{NAMES[3]}. No record: 2026."
    )
    records = named([page])
    assert records == {name: {"search.md"} for name in NAMES}
    for name, revision in zip(NAMES, ("0123456789ab", "0123456789ab+", "abcdefabcdef"), strict=False):
        (tmp_path / f"{name}.json").write_text(json.dumps({"revision": revision}))
    told = list(faults(records, tmp_path, frozenset({"0123456789ab"})))
    assert [line.split(" ", 2)[2].split(",")[0] for line in told] == [NAMES[1], NAMES[2], NAMES[3]]
    assert [said in line for line, said in zip(told, ("clean tree", "does not hold", "no such"), strict=True)] == [
        True
    ] * 3
    assert len(list(faults(records, tmp_path, None))) == 2
