"""Figures in docs, and the records that they are from."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.check_figures import faults, power, recorded, sections

RECORD = "moves-20260101T000000Z"
OTHER = "rigs_of_all-20260102T000000Z"
PAGE = f"""# Moves

Not measured: .125, but by `bench.moves`.

## How good ({RECORD})

MAP .912, 91.2 % of all, 68.4 ms; bars `.95`; section 4.3 and Table 5.2; version-1.25.

```sh
motionlake search --below 0.77
# not a heading: .66
```

### Speed

By `python -m bench.moves`: 3.25 times.

## Both: {OTHER} and {RECORD}

1,234.5 pairs and .070.
"""


@pytest.fixture
def page(tmp_path: Path) -> Path:
    figures = {"map": [0.91234, float("nan")], "seconds": {"warm": 0.0684}, "good": True}
    (tmp_path / f"{RECORD}.json").write_text(json.dumps({"figures": figures}))
    (tmp_path / f"{OTHER}.json").write_text(json.dumps({"figures": {"pairs": 1234.52}}))
    path = tmp_path / "moves.md"
    path.write_text(PAGE)
    return path


def test_sections_and_their_figures(page: Path) -> None:
    found = [(each.heading.split(" ")[0], each.figures, len(each.records)) for each in sections(page)]
    assert found == [
        ("", (), 0),
        ("Moves", (".125",), 0),
        ("How", (".912", "91.2", "68.4"), 1),
        ("Speed", ("3.25",), 0),
        ("Both:", ("1,234.5", ".070"), 2),
    ]


def test_figures_that_no_record_has_are_told(page: Path) -> None:
    told = list(faults([page], page.parent))
    assert len(told) == 3
    assert told[0].startswith("moves.md: Moves: names a bench and no record for .125")
    assert told[1].startswith("moves.md: Speed: names a bench and no record for 3.25")
    assert told[2].startswith(f"moves.md: Both: {OTHER} and {RECORD}: .070 are in none of")


def test_a_figure_is_a_number_of_the_record_rounded(page: Path) -> None:
    import numpy as np

    known = [np.array([0.91234, 1_977_291.5])]
    for figure in (".9", ".91", ".912", "91.2", "91.23", "1.98", "1,977.3"):
        assert recorded(figure, known), figure
    for figure in (".913", ".911", "91.3", "1.97"):
        assert not recorded(figure, known), figure
    altered, seen = power([page], page.parent)
    assert altered >= 4
    assert seen >= altered - 1
