"""The stage "descriptors", training on a split, and the macros that search descriptors."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pyarrow as pa
import pytest
from motionlake.deephums.config import DIMENSION, DescriptorsConfig
from motionlake.deephums.network import load_descriptor
from motionlake.deephums.sequence import clip_sequence
from motionlake.jobs.session import Session
from motionlake.lake.catalog import reading, writing
from motionlake.lake.config import LakeConfig
from motionlake.lake.frames import read_part
from motionlake.lake.layout import open_lake
from motionlake.lake.parts import write_part
from motionlake.stages import descriptor_network as descriptor_training
from motionlake.stages import descriptors
from motionlake.stages.descriptor_network import DESCRIPTOR_NETWORK
from motionlake.stages.reader import LakeReader
from motionlake.stages.stage import Shard, ShardResult

from tests.lakes import QUICK, Changed, Run, catalog, motionlake, query, quick_lake

DESCRIPTORS = "SELECT clip, descriptor FROM descriptors ORDER BY clip"
ONE_EPOCH = QUICK + "[descriptors]\nepochs = 1\nseed = 3\n"


def run(lake: Path, scheduler: str, *words: str) -> dict[str, int]:
    """Shards made by each stage."""
    done = motionlake("run", *words, "--lake", lake, "--scheduler", scheduler, "--json")
    assert done.status == 0, done.err
    return {row["stage"]: row["shards"] for row in done.json}


def train(lake: Path, *words: str) -> Run:
    return motionlake("train", "descriptor", *words, "--lake", lake, "--json")


def sequences(lake: Path) -> dict[str, np.ndarray]:
    """Every clip as a network reads it, without the stage."""
    rates = dict(query(lake, "SELECT clip, fps FROM clips"))
    parts = [read_part(part) for part in sorted(lake.glob("frames/*/*.parquet"))]
    return {c.clip: clip_sequence(c.positions.astype(float), rates[c.clip]) for part in parts for c in part}


def expected(lake: Path, model: str) -> dict[str, np.ndarray]:
    """The descriptors of a network, clip by clip."""
    ((file,),) = query(lake, "SELECT file FROM models WHERE model = $model", model=model)
    network = load_descriptor(lake / file)
    return {clip: network.embed([sequence])[0] for clip, sequence in sequences(lake).items()}


def served(lake: Path) -> tuple[str, dict[str, np.ndarray]]:
    """The one network that is served, and its descriptors."""
    ((model,),) = query(lake, "SELECT DISTINCT model FROM descriptors")
    return model, {clip: np.array(row, dtype=np.float32) for clip, row in query(lake, DESCRIPTORS)}


def assert_near(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    assert found.keys() == wanted.keys()
    for clip, row in found.items():
        np.testing.assert_allclose(row, wanted[clip], atol=2e-5)


def test_every_clip_has_the_descriptor_of_its_frames(built_lake: Path) -> None:
    model, found = served(built_lake)
    assert_near(found, expected(built_lake, model))
    assert found.keys() == {row[0] for row in query(built_lake, "SELECT clip FROM clips")}
    rows = np.stack(list(found.values()))
    assert rows.shape == (len(found), DIMENSION)
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, atol=1e-5)
    with reading(open_lake(built_lake)) as con:
        network = descriptors.DESCRIPTORS.served(con)
    assert network is not None
    assert (network.model, network.metrics["pretrained"]) == (model, True)


def test_a_new_clip_costs_one_descriptor_and_takes_it_along(lake: Path, clips_folder: Path, scheduler: str) -> None:
    assert run(lake, scheduler, "descriptors") == {"descriptors": 0}
    model, before = served(lake)
    source = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".npz", ".bvh"))
    folder = lake.parent / "more"
    folder.mkdir()
    shutil.copyfile(source, folder / source.name)
    assert motionlake("ingest", folder, "--lake", lake, "--scheduler", scheduler).status == 0
    due = {row["stage"]: row["due"] for row in motionlake("status", "--lake", lake, "--json").json["stages"]}
    assert due["descriptors"] == 1
    assert run(lake, scheduler, "descriptors") == {"descriptors": 1}
    same, after = served(lake)
    twin = after.pop(f"more/{source.name}")
    own = f"clips/{source.relative_to(clips_folder).as_posix()}"
    assert same == model
    assert_near(after, before)
    np.testing.assert_allclose(twin, before[own], atol=2e-5)
    assert nearest(lake, own)[0] == f"more/{source.name}"
    assert motionlake("remove", "--dataset", "more", "--lake", lake).status == 0
    assert served(lake)[1].keys() == before.keys()


def nearest(lake: Path, clip: str) -> list[str]:
    return [row[0] for row in query(lake, "SELECT clip FROM nearest_clips($clip)", clip=clip)]


def test_a_network_trained_anew_replaces_all_descriptors(lake: Path, scheduler: str) -> None:
    (lake / "config.toml").write_text(ONE_EPOCH, encoding="utf-8")
    old, before = served(lake)
    said = train(lake)
    assert said.status == 0, said.err
    new = said.json["model"]
    assert new != old
    assert served(lake)[0] == old, "served until the descriptors of the new network are there"
    run(lake, scheduler, "descriptors")
    model, after = served(lake)
    assert model == new
    assert_near(after, expected(lake, new))
    assert after.keys() == before.keys()
    assert max(np.abs(after[clip] - before[clip]).max() for clip in after) > 1e-3
    assert run(lake, scheduler, "descriptors") == {"descriptors": 0}
    run(lake, scheduler, "descriptors", "--refit")
    assert served(lake)[0] not in (old, new)


def test_descriptors_of_two_networks_never_stand_together(lake: Path) -> None:
    _, before = served(lake)
    ((clip, part),) = query(lake, "SELECT clip, part FROM descriptors ORDER BY clip LIMIT 1")
    with Changed(lake) as change:
        change.execute("UPDATE descriptors SET part = 'another' WHERE clip <> $clip", {"clip": clip})
    shard = Shard("descriptors", "0" * 64, part, "clips", {"model": "descriptors-9"}, 1)
    target = open_lake(lake)
    rows = pa.Table.from_pydict({"clip": [clip], "descriptor": [before[clip]], "part": [part]}, descriptors.ROWS)
    write_part(target.path(descriptors.DESCRIPTORS.file(shard.key)), rows, {})
    with writing(target) as con:
        descriptors.DESCRIPTORS.load(con, target.root, [ShardResult(shard, 1, 0, (), 0.0)])
    assert query(lake, "SELECT clip, model FROM descriptors") == [(clip, "descriptors-9")]


def test_a_network_enters_with_all_of_its_descriptors(
    lake: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads = []
    execute = Session.execute

    def noted(*words: Any, **options: Any) -> Any:
        loads.append(options["at_once"])
        return execute(*words, **options)

    monkeypatch.setattr(Session, "execute", noted)
    with Changed(lake) as con:
        con.execute("DELETE FROM manifest WHERE stage = 'descriptors'")
    run(lake, scheduler, "descriptors")
    (lake / "config.toml").write_text(QUICK + "[descriptors]\nseed = 1\n", encoding="utf-8")
    run(lake, scheduler, "descriptors")
    assert loads == [False, True]


def test_a_lake_without_descriptors_gets_them(lake: Path, scheduler: str) -> None:
    _, before = served(lake)
    con = Changed(lake)
    con.execute("DELETE FROM descriptors")
    con.execute("DELETE FROM manifest WHERE stage = 'descriptors'; DELETE FROM models WHERE kind = 'descriptors'")
    con.close()
    with reading(open_lake(lake)) as old:
        assert descriptors.DESCRIPTORS.served(old) is None
    assert motionlake("status", "--lake", lake).status == 0
    made = run(lake, scheduler, "all")
    assert made.pop("descriptors") == 1
    assert set(made.values()) == {0}
    assert_near(served(lake)[1], before)
    assert len(nearest(lake, min(before))) == 10


@pytest.fixture
def split_lake(lake: Path) -> Path:
    """A lake whose clips are of the splits "train" and "test" in turn; clips of "bare" have no label."""
    con = Changed(lake)
    con.execute("UPDATE clips SET split = CASE rowid % 3 WHEN 0 THEN 'train' WHEN 1 THEN 'test' ELSE 'bare' END")
    con.execute("UPDATE clips SET label = NULL WHERE split = 'bare'")
    con.close()
    return lake


def test_training_takes_the_clips_and_labels_of_the_split(split_lake: Path) -> None:
    known = sequences(split_lake)
    rows = query(split_lake, "SELECT clip, label, content_hash FROM clips WHERE split = 'train' ORDER BY clip")
    target = open_lake(split_lake)
    with reading(target) as con:
        found = descriptor_training.training_set(con, target, DescriptorsConfig(), split="train")
        whole = descriptor_training.training_set(con, target, DescriptorsConfig())
    assert found is not None
    assert whole is not None
    assert [clip.label for clip in found.clips] == [row[1] for row in rows]
    for clip, row in zip(found.clips, rows, strict=True):
        np.testing.assert_array_equal(clip.sequence, known[row[0]])
    digest = hashlib.sha256()
    for clip, _, content in rows:
        digest.update(repr((clip, content)).encode())
    kept = {"split": "train", "dataset": None, "clips_there": len(rows), "data_sha256": digest.hexdigest()}
    assert found.metrics == kept
    assert len(whole.clips) == len(known)


def test_of_a_big_lake_clips_are_drawn(built_lake: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, limit = open_lake(built_lake), 200

    def drawn(seed: int, supervision: str = "auto") -> list[bytes]:
        with reading(target) as con:
            config = DescriptorsConfig(seed=seed, supervision=supervision)
            found = descriptor_training.training_set(con, target, config)
        assert found is not None
        assert 0 < sum(len(clip.sequence) for clip in found.clips) <= limit + len(found.clips)
        return [clip.sequence.tobytes() for clip in found.clips]

    monkeypatch.setattr(descriptor_training, "MOST_FRAMES", limit)
    assert drawn(0) == drawn(0)
    assert any(drawn(seed) != drawn(0) for seed in (1, 2))
    monkeypatch.setattr(descriptor_training, "MOST_FRAMES", limit := 10**6)
    monkeypatch.setattr(descriptor_training, "MOST_UNLABELLED", 3)
    assert len(drawn(0, "none")) == 3
    assert len(drawn(0)) == query(built_lake, "SELECT count(*) FROM clips")[0][0]


def test_a_network_of_a_split_becomes_the_current_one(split_lake: Path) -> None:
    (split_lake / "config.toml").write_text(ONE_EPOCH, encoding="utf-8")
    said = train(split_lake, "--split", "train", "--supervision", "none")
    assert said.status == 0, said.err
    ((model, data, file),) = query(
        split_lake, "SELECT model, data_hash, file FROM models WHERE kind = 'descriptors' AND current"
    )
    metrics = said.json["metrics"]
    assert said.json["model"] == model
    assert (metrics["split"], metrics["data_sha256"], metrics["supervision"]) == ("train", data, "none")
    assert load_descriptor(split_lake / file).metrics == metrics
    with reading(open_lake(split_lake)) as con:
        config = LakeConfig(descriptors=DescriptorsConfig(epochs=1, seed=3))
        fitting = DESCRIPTOR_NETWORK.fitting(LakeReader(con, open_lake(split_lake), config))
    assert fitting is not None
    assert fitting.model == model


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--split", "valid"), "no clip is of split 'valid'; the splits there are: bare, test, train"),
        (("--dataset", "other"), "other: no such dataset in"),
        (("--split", "bare", "--supervision", "labels"), "has a label, and supervision by labels needs them"),
        (("--supervision", "some"), "supervision is 'some', not one of auto, labels, none"),
    ],
)
def test_what_training_lacks_is_one_clear_line(split_lake: Path, words: tuple[str, ...], line: str) -> None:
    said = train(split_lake, *words)
    assert said.status == 2
    assert line in said.err
    assert len(said.err.splitlines()) == 1


def test_training_without_splits_or_frames_is_one_clear_line(lake: Path, tmp_path: Path) -> None:
    con = Changed(lake)
    con.execute("UPDATE clips SET split = NULL")
    con.close()
    assert "no clip has a split; the column `split` of labels.csv" in train(lake, "--split", "train").err
    said = train(quick_lake(tmp_path / "empty"))
    assert said.status == 2
    assert "has no frames to train on yet; take clips in with `motionlake ingest`" in said.err


@pytest.fixture(scope="module")
def two_sets(tmp_path_factory: pytest.TempPathFactory, built_lake: Path) -> Path:
    """A lake whose clips are of two datasets, by their rank in the order of names."""
    lake = Path(shutil.copytree(built_lake, tmp_path_factory.mktemp("lakes") / "sets"))
    con = Changed(lake)
    con.execute("UPDATE clips SET dataset = 'odd' WHERE rowid % 2 = 1")
    con.close()
    return lake


@pytest.mark.parametrize("within", [None, "odd", "nowhere"])
@pytest.mark.parametrize("k", [3, 1000])
def test_nearest_clips_in_plain_duckdb(two_sets: Path, within: str | None, k: int) -> None:
    _, known = served(two_sets)
    about = {row[0]: row[1:] for row in query(two_sets, "SELECT clip, label, dataset, seconds FROM clips")}
    asked = "FROM nearest_clips($clip, k := $k, dataset := $within)"
    for clip in sorted(known)[:4]:
        rows = query(two_sets, asked, clip=clip, k=k, within=within)
        others = [c for c in known if c != clip and within in (None, about[c][1])]
        order = sorted(others, key=lambda c: (np.linalg.norm(known[c] - known[clip]), c))[:k]
        assert [row[1] for row in rows] == order
        assert [row[0] for row in rows] == list(range(1, len(order) + 1))
        assert [row[3:] for row in rows] == [about[c] for c in order]
        np.testing.assert_allclose(
            [row[2] for row in rows], [np.linalg.norm(known[c] - known[clip]) for c in order], atol=1e-5
        )


def test_a_descriptor_from_outside_is_searched_alike(built_lake: Path) -> None:
    _, known = served(built_lake)
    clip = min(known)
    with catalog(built_lake) as con:
        given = {"descriptor": known[clip].tolist()}
        near = con.execute("FROM clips_near($descriptor, k := 4)", given).fetchall()
        without = con.execute(f"FROM clips_near($descriptor, k := 3, without := '{clip}')", given).fetchall()
        assert without == con.execute("FROM nearest_clips($clip, k := 3)", {"clip": clip}).fetchall()
        with pytest.raises(duckdb.InvalidInputException, match="no such clip in the lake"):
            con.execute("FROM nearest_clips('no such clip')").fetchall()
    assert near[0][1:3] == (clip, 0.0)
    assert [row[1:] for row in near[1:]] == [row[1:] for row in without]
