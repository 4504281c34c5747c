"""docs/lake-format.md against a real lake: every table, column, folder and footer key it names, and no other."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from motionlake.lake import frames
from motionlake.lake.catalog import SCHEMA_VERSION
from motionlake.motion.skeleton import JOINTS
from motionlake.stages.registry import FOLDERS

from tests.lakes import query

PAGE = (Path(__file__).parents[1] / "docs" / "lake-format.md").read_text(encoding="utf-8")
_COLUMNS = re.compile(r"^\| (`.+?`) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)


def section(title: str) -> str:
    """The text below a heading, up to the next one of its level or above."""
    level = title.split()[0]
    following = PAGE.split(f"\n{title}\n", 1)[1]
    return re.split(rf"^#{{1,{len(level)}}} ", following, maxsplit=1, flags=re.MULTILINE)[0]


def columns(text: str) -> dict[str, str]:
    """Columns of a table of the page with their types, `<joint>` filled in."""
    found = {}
    for names, kind, _ in _COLUMNS.findall(text):
        for name in re.findall(r"`([^`]+)`", names):
            # The hips' position is the root's.
            joints = JOINTS if "_q" in name else JOINTS[1:]
            for filled in [name.replace("<joint>", j) for j in joints] if "<joint>" in name else [name]:
                found[filled] = kind.strip()
    return found


def described() -> dict[str, dict[str, str]]:
    """Every table and view of the page."""
    names = re.findall(r"^### `(\w+)`$", PAGE, re.MULTILINE)
    return {name: columns(section(f"### `{name}`")) for name in names}


def real(lake: Path) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}
    for table, column, kind in query(
        lake, "SELECT table_name, column_name, data_type FROM duckdb_columns() WHERE NOT internal"
    ):
        found.setdefault(table, {})[column] = kind
    return found


def test_the_page_has_every_table_and_column(built_lake: Path) -> None:
    page, there = described(), real(built_lake)
    of_quality = ("quality", "quality_ranges", "quality_usual", "quality_unusual")
    made_when_asked_for = ("word_neighbours", "clip_map", *of_quality)
    assert all(page.pop(name) for name in made_when_asked_for)
    frames = there.pop("frames")
    assert page.pop("frames") == {}
    assert page == there
    parts = columns(section("## Frames parts"))
    assert {name: kind for name, kind in frames.items() if name != "dataset"} == {
        name: kind for name, kind in parts.items() if name != "part"
    }


def test_the_page_has_every_folder(built_lake: Path) -> None:
    named = set(re.findall(r"`(\w+)/", section("## Files")))
    assert named >= set(FOLDERS)
    assert named >= {path.name for path in built_lake.iterdir() if path.is_dir()}


@pytest.mark.parametrize("folder", ["features", "moves", "embeddings", "assigned", "postures"])
def test_columns_of_parts_are_as_the_page_says(built_lake: Path, folder: str) -> None:
    row = next(line for line in section("## Files").splitlines() if line.startswith(f"| `{folder}/"))
    named = re.findall(r"`(\w+)`", row)
    part = next(path for path in built_lake.glob(f"{folder}/*") if path.suffix in (".parquet", ".arrow"))
    schema = pa.ipc.open_file(part).schema if part.suffix == ".arrow" else pq.read_schema(part)
    assert schema.names[: len(named)] == named


def test_the_page_has_the_present_versions_and_the_footer(built_lake: Path) -> None:
    versions = re.findall(r"^\| [^|]+ \| (\d+) \| ", section("## Versions"), re.MULTILINE)
    assert versions == [str(SCHEMA_VERSION), str(frames.VERSION)]
    assert query(built_lake, "FROM schema_version") == [(SCHEMA_VERSION,)]
    text = re.search(r"```json\n(.*?)```", PAGE, re.DOTALL)
    assert text is not None
    shown = json.loads(text[1])
    part = next(built_lake.glob("frames/*/*.parquet"))
    footer = json.loads(pq.read_metadata(part).metadata[b"motion"])
    assert shown.keys() == footer.keys()
    for name in ("version", "unit", "up", "handedness", "rest_pose"):
        assert shown[name] == footer[name]
    for name in ("rotations", "columns"):
        assert shown[name].keys() == footer[name].keys()
    assert next(iter(shown["clips"].values())).keys() == next(iter(footer["clips"].values())).keys()


def test_duckdb_reads_the_footer(built_lake: Path) -> None:
    text = re.search(r"```sql\n(.*?)```", PAGE, re.DOTALL)
    assert text is not None
    rows = query(built_lake, text[1].strip().rstrip(";"))
    clips = [clip for (footer,) in rows for clip in json.loads(footer)["clips"]]
    assert sorted(clips) == [row[0] for row in query(built_lake, "SELECT clip FROM clips ORDER BY clip")]
