"""What every stage keeps to, and what follows from the registry."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import duckdb
import pytest
from motionlake import sql
from motionlake.jobs.session import Session
from motionlake.lake.config import load_config
from motionlake.lake.layout import open_lake
from motionlake.stages.clip_parts import ORPHANS
from motionlake.stages.reader import lake_reader
from motionlake.stages.registry import ALL, BY_NAME, EVERY, KINDS, ON_REQUEST, STAGES
from motionlake.stages.stage import Shard, ShardStage

from tests.lakes import Changed

ROOT = Path(__file__).parents[1]
# What makes a stage due in a lake where it is done: its shards are forgotten; source files were shaped otherwise.
FORGET = "DELETE FROM manifest WHERE stage = $stage"
RESHAPED = "UPDATE sources SET config_hash = '' WHERE $stage = 'frames'"


@pytest.fixture
def lake(built_lake: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built_lake, tmp_path / "lake"))


def shard_stage(name: str) -> ShardStage:
    stage = STAGES[name]
    assert isinstance(stage, ShardStage)
    return stage


def plan(lake: Path, stage: str) -> list[Shard]:
    target = open_lake(lake)
    with lake_reader(target, load_config(target.config_file)) as at:
        return shard_stage(stage).plan(at)


def contents(lake: Path) -> dict[str, str]:
    """A hash of the rows of every table, whatever their order; wall-clock columns stand in those left out."""
    with duckdb.connect(str(lake / "catalog.duckdb"), read_only=True) as con:
        con.execute(f"SET file_search_path = '{lake}'")
        names = [row[0] for row in con.execute("SELECT table_name FROM duckdb_tables()").fetchall()]
        return {
            name: str(con.execute(f"SELECT count(*), bit_xor(hash(t::VARCHAR)) FROM {name} t").fetchone())
            for name in names
            if name not in ("manifest", "runs", "models", "files")
        }


@pytest.mark.parametrize("name", ALL)
def test_a_stage_keeps_to_the_protocol(lake: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stage, target = shard_stage(name), open_lake(lake)
    assert plan(lake, name) == [], "done: a second run plans nothing"
    before = contents(lake)
    with Changed(target.root) as con:
        con.execute(FORGET if name != "frames" else RESHAPED, {"stage": name})
        for table in stage.tables if name != "frames" else ():
            if table != "motifs":  # new motifs would make all that follows them due
                con.execute(f"DELETE FROM {table}")
    for most in ("shortlist.WHOLE", "windows.MOST"):  # stages of larger lakes alone
        monkeypatch.setattr(f"motionlake.stages.{most}", 3)
    shards = plan(lake, name)
    assert shards
    result = stage.run(target.root, shards[0])
    assert all(file.split("/")[0] in stage.folders and target.path(file).is_file() for file in result.files)
    assert plan(lake, name) == shards, "a run that is killed before it loads is planned as it was"
    with lake_reader(target, load_config(target.config_file)) as at:
        at_once = stage.at_once(at)
    session = Session(target, load_config(target.config_file), lambda *_: None, lambda _: None)
    outcome = session.execute(stage, shards, here=True, at_once=at_once)
    assert (outcome.ok, outcome.failed) == (len(shards), 0), outcome.reason
    assert plan(lake, name) == []
    with lake_reader(target, load_config(target.config_file)) as at:
        assert stage.due(at) == 0
    after = contents(lake)
    follows = {table for later in EVERY[EVERY.index(stage) + 1 :] for table in later.tables}
    changed = {table for table in before if before[table] != after[table]}
    if name == "frames":
        assert changed <= set(stage.tables) | follows
    else:
        assert changed <= follows - set(stage.tables), "its tables are as they were, and no other is touched"


def test_every_table_is_of_one_stage_and_forgets_its_orphans() -> None:
    text = "".join(sql.read(name) for name in sql.names("schema"))
    schema = dict(re.findall(r"CREATE TABLE (?:IF NOT EXISTS )?(\w+) \((.*?)\n\);", text, re.DOTALL))
    own = {"manifest", "models", "runs", "roots", "schema_version", "files", "settings"}
    declared = {table for stage in (*EVERY, ON_REQUEST) for table in stage.tables}
    assert declared == schema.keys() - own
    forgetting = {name.removeprefix(ORPHANS) for name in sql.statements() if name.startswith(ORPHANS)}
    of_clips = {t for t, columns in schema.items() if re.search(r"^ +(from_)?clip VARCHAR", columns, re.MULTILINE)}
    assert of_clips - {"clips"} <= forgetting


def test_stages_are_named_once_and_after_those_they_read() -> None:
    names = [stage.name for stage in EVERY]
    assert len(set(names)) == len(names)
    for stage in EVERY:
        assert set(stage.upstream) <= set(names[: names.index(stage.name)])
    assert len(KINDS) == sum(stage.model is not None for stage in EVERY)


def test_the_makefile_has_a_target_for_every_stage() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    found = dict(re.findall(r"^([a-z]+): setup ## Stage(?: of its own)?: (.*)$", text, re.MULTILINE))
    assert found == {stage.name: stage.about for stage in EVERY}
    named = re.search(r"^STAGES := (.*)$", text, re.MULTILINE)
    assert named is not None
    assert tuple(named[1].split()) == ALL


def test_the_docs_have_a_row_for_every_stage() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text[text.index("| stage | made by |") :].split("\n\n")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \|", table, re.MULTILINE)
    assert [name for name, _ in rows] == [*STAGES, ON_REQUEST.name]
    assert tuple(name for name, by in rows if by.startswith("its name")) == BY_NAME
