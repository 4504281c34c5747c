"""What makes a source file, a part or a model due again, and what does not: on a lake of a few made clips."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from motionlake.arrays import Progress
from motionlake.deep_motifs.config import NetworkConfig
from motionlake.errors import UserError
from motionlake.formats.limits_config import Limits
from motionlake.jobs import models
from motionlake.jobs.session import Session, session
from motionlake.lake.catalog import writing
from motionlake.lake.config import FramesConfig, LakeConfig, canonical_json, config_hash
from motionlake.lake.layout import Lake
from motionlake.motion.features import WordConfig
from motionlake.pesta.config import PosturesConfig
from motionlake.stages import frames, ingest
from motionlake.stages.frames import FRAMES, Intake
from motionlake.stages.model_kind import ModelKind, Selection
from motionlake.stages.posture_dictionary import POSTURE_DICTIONARY
from motionlake.stages.postures import POSTURES
from motionlake.stages.reader import LakeReader, lake_reader
from motionlake.stages.source_files import SourceFile, content_hash
from motionlake.stages.sources import IngestOptions, Root
from motionlake.stages.stage import Shard, ShardResult, live_parts
from motionlake.stages.symbols import SYMBOLS
from motionlake.stages.word_network import TRUNK, WORD_NETWORK
from motionlake.stages.words import WORDS

from tests.samples import deepmimic_frames, deepmimic_text

ALLOWED = Limits()


def text(frames: int) -> str:
    return deepmimic_text(deepmimic_frames(frames))


@contextmanager
def opened(lake: Path, notices: list[str] | None = None) -> Iterator[Session]:
    said = [] if notices is None else notices
    with session(Lake(lake), "test", lambda *_: None, said.append, create=True) as one:
        yield one


def root_of(folder: Path, **options: Any) -> Root:
    return Root("made", str(folder), IngestOptions(**options))


def compared(lake: Path, root: Root, **asked: Any) -> Intake:
    """What a source folder comes to; nothing is read."""
    with opened(lake) as one, lake_reader(one.lake, one.config) as at:
        return frames.intake_of(at, root, **asked)


def taken_in(lake: Path, root: Root, **asked: Any) -> list[str]:
    """Take a folder in, in this process; what is said meanwhile."""
    with opened(lake) as one:
        found, lines = ingest.prepare(one.lake, one.config, [root], **asked)
        one.execute(FRAMES, [shard for intake in found for shard in intake.shards], here=True)
        ingest.finish(one.lake, found)
    return lines


@dataclass(frozen=True)
class Made:
    """A lake, and the folder that it was made of."""

    lake: Path
    folder: Path

    @property
    def root(self) -> Root:
        return root_of(self.folder)

    def read(self) -> list[str]:
        """The files that would be read."""
        return [file["path"] for shard in compared(self.lake, self.root).shards for file in shard.spec["files"]]


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    base = tmp_path_factory.mktemp("keys")
    made = Made(base / "now" / "lake", base / "now" / "clips")
    (made.folder / "sub").mkdir(parents=True)
    for name, count in (("b.txt", 40), ("a.txt", 50), ("sub/c.txt", 45), (".hidden.txt", 30)):
        (made.folder / name).write_text(text(count), encoding="utf-8")
    (made.folder / "z.npz").write_bytes(b"no clip")
    taken_in(made.lake, made.root)
    shutil.copytree(base / "now", base / "kept")
    return base


@pytest.fixture
def made(first: Path) -> Made:
    """The lake and the folder as they were, where they were: the lake knows the folder by its name."""
    shutil.rmtree(first / "now", ignore_errors=True)
    shutil.copytree(first / "kept", first / "now")
    return Made(first / "now" / "lake", first / "now" / "clips")


def test_files_are_read_by_path_and_read_once(made: Made) -> None:
    intake = compared(made.lake, made.root)
    assert intake.shards == []
    assert (intake.difference.unchanged, intake.difference.changed, intake.difference.gone) == (4, [], [])
    fresh = compared(made.lake.with_name("other"), made.root)
    assert [file["path"] for shard in fresh.shards for file in shard.spec["files"]] == [
        "a.txt",
        "b.txt",
        "sub/c.txt",
        "z.npz",
    ]
    assert fresh.shards[0].items == 4
    assert fresh.difference.unchanged == 0


def test_a_file_alone_is_a_source(made: Made) -> None:
    intake = compared(made.lake.with_name("other"), root_of(made.folder / "b.txt"))
    (shard,) = intake.shards
    assert [file["path"] for file in shard.spec["files"]] == ["b.txt"]
    assert shard.spec["base"] == str(made.folder)


def test_a_lake_within_its_source_folder_is_no_source(made: Made) -> None:
    inside = made.folder / "lake"
    taken_in(inside, made.root)
    (inside / "models").mkdir(exist_ok=True)
    (inside / "models" / "x.txt").write_text(text(30), encoding="utf-8")
    assert compared(inside, made.root).shards == []
    for other in ("lakes", "sub/lake"):
        (made.folder / other).mkdir()
        (made.folder / other / "y.txt").write_text(text(30), encoding="utf-8")
    (shard,) = compared(inside, made.root).shards
    assert [file["path"] for file in shard.spec["files"]] == ["lakes/y.txt", "sub/lake/y.txt"]


def test_new_content_is_read_again_and_a_new_date_is_not(made: Made) -> None:
    clip = made.folder / "b.txt"
    os.utime(clip, ns=(1, 1))
    intake = compared(made.lake, made.root)
    assert (intake.shards, [file.path for file in intake.difference.touched]) == ([], ["b.txt"])
    assert intake.difference.unchanged == 4
    content = clip.read_text(encoding="utf-8")
    clip.write_text(content.replace("0.85", "0.86"), encoding="utf-8")
    os.utime(clip, ns=(2, 2))
    assert made.read() == ["b.txt"]
    clip.write_text(content + "\n", encoding="utf-8")
    intake = compared(made.lake, made.root)
    assert [file.path for file in intake.difference.changed] == ["b.txt"]
    assert (intake.difference.unchanged, intake.difference.again, intake.difference.touched) == (3, 0, [])


def test_a_file_of_the_same_size_and_date_is_looked_into_when_asked(made: Made) -> None:
    clip = made.folder / "a.txt"
    before = clip.stat()
    clip.write_text(clip.read_text(encoding="utf-8").replace("0.85", "0.86"), encoding="utf-8")
    os.utime(clip, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert compared(made.lake, made.root).shards == []
    (shard,) = compared(made.lake, made.root, checksum=True).shards
    assert [file["path"] for file in shard.spec["files"]] == ["a.txt"]


def test_files_that_are_gone_are_told(made: Made) -> None:
    (made.folder / "sub" / "c.txt").unlink()
    (made.folder / "a.txt").unlink()
    intake = compared(made.lake, made.root)
    assert intake.difference.gone == ["a.txt", "sub/c.txt"]
    assert intake.difference.unchanged == 2
    ignored = compared(made.lake, root_of(made.folder, ignored=("b.txt",)))
    assert ignored.difference.gone == ["a.txt", "sub/c.txt"], "one that is left out is there all the same"
    assert ignored.difference.unchanged == 1


def test_what_shapes_frames_has_all_read_again_and_nothing_else_has(made: Made) -> None:
    before, others = made.root.shaping_hash(LakeConfig(), Lake(made.lake)), set()
    for options in (
        {"up": "z"},
        {"up": "x"},
        {"up": "-y"},
        {"unit": "cm"},
        {"unit": "m"},
        {"fps": 60.0},
        {"rig": "deepmimic"},
    ):
        root = root_of(made.folder, **options)
        intake = compared(made.lake, root)
        assert intake.difference.again == len(intake.difference.changed) == 4, options
        assert intake.difference.before == before
        others.add(root.shaping_hash(LakeConfig(), Lake(made.lake)))
    assert len(others) == 7
    assert min(others) < before < max(others), "hashes have no order that means anything"
    for options in ({"licence": "CC0"}, {"labels": "labels.csv"}, {"segments": "x.csv"}):
        assert compared(made.lake, root_of(made.folder, **options)).shards == [], options
    (made.lake / "config.toml").write_text("[frames]\nposition_step = 0.002\n", encoding="utf-8")
    assert len(compared(made.lake, made.root).difference.changed) == 4
    (made.lake / "config.toml").write_text("[words]\nlength = 40\n[limits]\nframes = 999\n", encoding="utf-8")
    assert compared(made.lake, made.root).shards == []


def test_a_rejected_file_is_tried_again_when_asked(made: Made) -> None:
    assert compared(made.lake, made.root).shards == []
    intake = compared(made.lake, made.root, retry_failed=True)
    assert [file["path"] for shard in intake.shards for file in shard.spec["files"]] == ["z.npz"]
    assert (intake.difference.again, intake.difference.before) == (0, ""), "it is shaped as it was"


def test_a_file_that_a_limit_turned_away_is_tried_again_when_it_is_raised(made: Made) -> None:
    (made.lake / "config.toml").write_text("[limits]\nframes = 45\n", encoding="utf-8")
    taken_in(made.lake, root_of(made.folder, fps=60.0))
    root = root_of(made.folder, fps=60.0)
    assert compared(made.lake, root).shards == []
    (made.lake / "config.toml").write_text("[limits]\nframes = 50\n", encoding="utf-8")
    (shard,) = compared(made.lake, root).shards
    assert [file["path"] for file in shard.spec["files"]] == ["a.txt"]


def test_a_file_that_is_too_large_is_known_by_size_and_date(made: Made) -> None:
    (made.lake / "config.toml").write_text("[limits]\nfile_megabytes = 1\n", encoding="utf-8")
    large = made.folder / "large.bvh"
    large.write_bytes(b" " * (1 << 20))
    (found,) = compared(made.lake, made.root).difference.changed
    assert found.content_hash == content_hash(large)
    large.write_bytes(b" " * ((1 << 20) + 1))
    os.utime(large, ns=(7, 7))
    (found,) = compared(made.lake, made.root).difference.changed
    assert found.content_hash == sha256(b"1048577 7").hexdigest()


def test_clips_of_another_folder_under_the_same_paths_are_refused(made: Made, tmp_path: Path) -> None:
    shutil.copytree(made.folder, tmp_path / "twin")
    with pytest.raises(UserError, match=r"holds a clip of this path from"):
        compared(made.lake, root_of(tmp_path / "twin"))


def test_hashing_is_told_of(made: Made) -> None:
    told: list[tuple[int, int]] = []
    compared(made.lake, made.root, checksum=True, progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_a_planned_shard_is_run_as_it_was_cut_unless_its_files_changed(made: Made) -> None:
    lake = made.lake.with_name("other")
    with opened(lake) as one:
        found, _ = ingest.prepare(one.lake, one.config, [made.root])
        (planned,) = found[0].shards
        one.execute(FRAMES, [], here=True)
    with pytest.raises(KeyboardInterrupt), opened(lake) as one:
        one.execute(_Stopped(), [planned], here=True)
    (made.folder / "d.txt").write_text(text(30), encoding="utf-8")
    intake = compared(lake, made.root)
    assert [shard.key for shard in intake.shards][:1] == [planned.key]
    assert [[f["path"] for f in shard.spec["files"]] for shard in intake.shards[1:]] == [["d.txt"]]
    with opened(lake) as one, lake_reader(one.lake, one.config) as at:
        assert FRAMES.due(at) == 1
        assert [shard.key for shard in FRAMES.plan(at)][:1] == [planned.key]
    (made.folder / "a.txt").write_text(text(31), encoding="utf-8")
    intake = compared(lake, made.root)
    assert intake.dropped == [planned.key]
    (shard,) = intake.shards
    assert shard.items == 5
    assert compared(lake, root_of(made.folder, up="z")).dropped == [planned.key]


class _Stopped(frames.FramesStage):
    """A run that is cut short when its shards are planned."""

    def run(self, root: Path, shard: Shard, /) -> Any:
        raise KeyboardInterrupt


class _Failing(frames.FramesStage):
    def run(self, root: Path, shard: Shard, /) -> Any:
        raise ValueError("no luck")


def test_a_shard_that_failed_is_left_alone_until_it_is_asked_for(made: Made) -> None:
    lake = made.lake.with_name("other")
    with opened(lake) as one:
        found, _ = ingest.prepare(one.lake, one.config, [made.root])
        one.execute(_Failing(), found[0].shards, here=True)
    intake = compared(lake, made.root)
    assert (intake.shards, intake.failed) == ([], [(4, "ValueError: no luck")])
    again = compared(lake, made.root, retry_failed=True)
    assert [shard.key for shard in again.shards] == [shard.key for shard in found[0].shards]
    assert again.failed == []


def cut(sizes: Sequence[int]) -> list[int]:
    """How many files go into each shard, for files of some sizes."""
    files = [SourceFile(f"{i:05}.bvh", size, 0, str(i)) for i, size in enumerate(sizes)]
    shards = frames._new_shards(root_of(Path("/x")), files[::-1], LakeConfig(), ALLOWED, "")
    names = [file["path"] for shard in shards for file in shard.spec["files"]]
    assert names == [file.path for file in files], "by path, each once"
    assert all(shard.items == len(shard.spec["files"]) for shard in shards)
    return [shard.items for shard in shards]


def test_shards_are_a_sixteenth_of_what_is_new_between_two_and_24_megabytes() -> None:
    mega = 1 << 20
    assert cut([]) == []
    assert cut([1]) == [1]
    assert cut([mega] * 5) == [2, 2, 1]
    assert cut([mega] * 64) == [4] * 16
    assert cut([4 * mega] * 64) == [4] * 16
    assert cut([8 * mega] * 66) == [3] * 22
    assert cut([mega - 1] * 4) == [3, 1]
    assert cut([0] * 1025) == [512, 512, 1]


def test_a_shards_key_hangs_on_its_files_and_what_shapes_them_alone() -> None:
    def key(**given: Any) -> str:
        root = root_of(Path(given.get("root", "/x")), **given.get("options", {}))
        if "dataset" in given:
            root = replace(root, dataset=given["dataset"])
        files = [
            SourceFile(given.get("path", "a.bvh"), given.get("size", 1), given.get("date", 2), given.get("is", "c"))
        ]
        allowed = given.get("allowed", ALLOWED)
        shard = frames.shard_of(root, files, LakeConfig(), allowed, given.get("shaped", "s"))
        assert (shard.stage, shard.part, shard.items) == ("frames", shard.key[:16], 1)
        return shard.key

    assert key(size=5, date=9) == key(allowed=Limits(frames=3)) == key(root="/y") == key()
    others = [key(path="b.bvh"), key(**{"is": "d"}), key(shaped="t"), key(dataset="other")]
    assert len({key(), *others}) == 5


def test_keys_are_those_that_lakes_hold() -> None:
    """Another key for the same thing would make all of a lake's work due again."""
    plain = '["words",1,"k",{"a":1.5}]'
    assert config_hash("words", 1, "k", {"a": 1.5}) == sha256(plain.encode()).hexdigest()
    config = FramesConfig()
    assert config_hash(config) == sha256(canonical_json([vars(config)]).encode()).hexdigest()
    assert config_hash({"weights": "pretrained"}) == config_hash({"weights": "shipped"})
    assert config_hash({"weights": "own"}) != config_hash({"weights": "shipped"})
    assert config_hash({"other": "pretrained"}) != config_hash({"other": "shipped"})
    assert config_hash("pretrained") != config_hash("shipped")
    for shaping in ([], [config], [{"weights": "pretrained"}, "é", [1, None]]):
        for upstream in ("k", "0f" * 32, "", "é1", 'a"b', "a b"):
            assert SYMBOLS.key_of(upstream, shaping) == config_hash("symbols", SYMBOLS.version, upstream, *shaping)
    key = "0123456789abcdef" * 4
    assert SYMBOLS.file(key) == "staging/symbols-0123456789abcdef.parquet"
    assert POSTURES.file(key) == "postures/0123456789abcdef.parquet"


def test_clips_are_counted_and_their_names_hashed(made: Made) -> None:
    with reader(made) as at:
        found = [row[0].encode() for row in at.con.execute("SELECT clip FROM clips ORDER BY clip").fetchall()]
        spelled = b"".join(b"%d:%s" % (len(name), name) for name in found)
        assert at.clips() == (3, sha256(spelled).hexdigest())


def test_a_folder_that_cannot_be_read_hides_no_other(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    scandir = os.scandir

    def refused(folder: str) -> Any:
        if Path(folder).name == "sub":
            raise PermissionError(folder)
        return scandir(folder)

    monkeypatch.setattr(os, "scandir", refused)
    intake = compared(made.lake.with_name("other"), made.root)
    assert [file["path"] for shard in intake.shards for file in shard.spec["files"]] == ["a.txt", "b.txt", "z.npz"]


def test_a_file_that_cannot_be_read_is_known_as_one_without_content(tmp_path: Path) -> None:
    nothing = sha256().hexdigest()
    assert content_hash(tmp_path / "gone.bvh") == nothing
    memory = Path("/proc/self/mem")  # opens, and gives nothing where nothing lies
    if memory.is_file():
        (tmp_path / "clip.bvh").symlink_to(memory)
        assert content_hash(tmp_path / "clip.bvh") == nothing


def test_a_stage_without_files_of_its_own_counts_none() -> None:
    shard = Shard("s", "k", "p", "d", {}, 1)
    given = ShardResult(shard)
    assert (given.rows, given.size, given.files, given.seconds, given.sums, given.rejected) == (0, 0, (), 0.0, (), 0)


@contextmanager
def reader(made: Made, **config: Any) -> Iterator[LakeReader]:
    with opened(made.lake) as one:
        changed = one.config
        for value in config.values():
            changed = changed.replacing(value)
        with lake_reader(one.lake, changed) as at:
            yield at


def test_a_part_is_due_until_it_is_made_and_again_when_what_shapes_it_changes(made: Made) -> None:
    with reader(made) as at:
        (shard,) = WORDS.plan(at)
        assert (WORDS.due(at), WORDS.lacking(at), shard.items) == (1, None, 3)
        assert WORDS.again(at, shard.key) == shard
        assert WORDS.again(at, "no key") is None
        (above,) = at.done("frames")
        assert shard.key == config_hash("words", WORDS.version, above, at.config.words)
        assert WORDS.files(at) == {shard.part: f"features/{shard.key[:16]}.arrow"}
    with opened(made.lake) as one:
        outcome = one.execute(WORDS, [shard], here=True)
    assert (outcome.ok, outcome.clips) == (1, 3)
    file = made.lake / "features" / f"{shard.key[:16]}.arrow"
    assert outcome.bytes == file.stat().st_size
    assert pa.ipc.open_file(file).schema.metadata[b"key"] == shard.key.encode()
    with reader(made) as at:
        assert (WORDS.plan(at), WORDS.due(at)) == ([], 0)
        assert WORDS.again(at, shard.key) == shard
    with reader(made, words=WordConfig(length=40)) as at:
        assert WORDS.due(at) == 1
        assert WORDS.plan(at)[0].key != shard.key


def test_a_stage_waits_for_the_stage_that_it_reads(made: Made) -> None:
    (made.folder / "d.txt").write_text(text(60), encoding="utf-8")
    with reader(made) as at:
        assert SYMBOLS.source is not None
        assert SYMBOLS.upstream == (SYMBOLS.source.name,)
        assert SYMBOLS.parts(at) is None, "there is no dictionary yet"
        assert (SYMBOLS.plan(at), SYMBOLS.due(at)) == ([], 1)
        assert SYMBOLS.lacking(at) == f"what `run {SYMBOLS.source.name}` makes"
        assert SYMBOLS.again(at, "any") is None
        assert SYMBOLS.files(at) == {}


def test_a_part_of_no_clips_is_refused(made: Made) -> None:
    with reader(made) as at:
        (shard,) = WORDS.plan(at)
    with pytest.raises(ValueError, match="holds no clip"):
        WORDS.run(made.lake, replace(shard, spec={**shard.spec, "clips": []}))
    assert not (made.lake / WORDS.file(shard.key)).exists()


def test_word_networks_made_before_an_option_was_added_keep_their_key(made: Made) -> None:
    with reader(made) as at:
        config, words = at.config.network, at.config.words
        known = {name: value for name, value in asdict(config).items() if name not in ("recipe", "negatives")}
        assert WORD_NETWORK.key(at) == config_hash("network", WORD_NETWORK.version, words, known)
    with reader(made, network=replace(config, negatives="semi-hard")) as at:
        changed = {**known, "negatives": "semi-hard"}
        assert WORD_NETWORK.key(at) == config_hash("network", WORD_NETWORK.version, words, changed)
    with reader(made, network=replace(config, recipe="deep_motifs")) as at:
        changed = {**known, "recipe": "deep_motifs"}
        assert WORD_NETWORK.key(at) == config_hash("network", WORD_NETWORK.version, words, changed, TRUNK)


@pytest.mark.parametrize(
    ("weights", "small", "large"), [("auto", True, False), ("pretrained", True, True), ("own", False, False)]
)
def test_a_lake_that_holds_enough_takes_the_pretrained_model_only_when_told(
    made: Made, monkeypatch: pytest.MonkeyPatch, weights: str, small: bool, large: bool
) -> None:
    for kind, config in (
        (WORD_NETWORK, NetworkConfig(weights=weights)),
        (POSTURE_DICTIONARY, PosturesConfig(weights=weights)),
    ):
        with reader(made, config=config) as at:
            assert kind.takes_pretrained(at) == small
        with monkeypatch.context() as enough:
            enough.setattr("motionlake.stages.word_network.ENOUGH", 0)
            enough.setattr("motionlake.pesta.config.ENOUGH", 0)
            with reader(made, config=config) as at:
                assert kind.takes_pretrained(at) == large


class Dictionary:
    """What a training gave."""

    metrics: Mapping[str, Any] = {"error": 0.5}

    def save(self, path: Path) -> None:
        path.write_bytes(b"weights")


class Kind(ModelKind[int]):
    """A kind whose training counts how often it was run, and fails where it is told to."""

    name = "postures"
    config = PosturesConfig
    title = "test model"
    use = "tests"
    command = "postures"

    def __init__(self, data: int | None = 7) -> None:
        self.runs, self.given = 0, data

    def data(self, at: LakeReader, where: Selection) -> int | None:
        return self.given

    def fit(self, lake: Lake, config: LakeConfig, data: int, checkpoint: Path, progress: Progress) -> Dictionary:
        self.runs += 1
        assert checkpoint.parent.is_dir()
        if data < 0:
            raise ValueError("too little")
        return Dictionary()

    def load(self, path: Path) -> Dictionary:
        return Dictionary()


def test_a_model_serves_until_its_configuration_or_its_version_is_another(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, started = Kind(), time.perf_counter()
    with reader(made) as at:
        assert kind.fitting(at) is None
    with opened(made.lake) as one:
        model = models.obtain(one, kind, stage="symbols")
        assert model is not None
        assert models.obtain(one, kind, stage="symbols") == model
        assert (kind.runs, model.file, model.metrics) == (1, "models/postures-1.safetensors", {"error": 0.5})
        second = models.obtain(one, kind, stage="symbols", refit=True)
        assert second is not None
        assert (kind.runs, second.file) == (2, "models/postures-2.safetensors")
    passed = time.perf_counter() - started
    with reader(made) as at:
        kept = at.con.execute("SELECT seconds, data_hash FROM models").fetchall()
        assert all(0 <= seconds <= passed for seconds, _ in kept)
        clips = at.con.execute("SELECT clip, content_hash FROM clips ORDER BY clip").fetchall()
        assert len(clips) == 3
        assert {data for _, data in kept} == {frames.clips_key(clips)}, "what it was trained on: the whole lake"
        assert frames.clips_key(clips) != frames.clips_key(clips[1:])
    with reader(made) as at:
        assert kind.serving(at) == second
        assert second.key == config_hash("postures", 1, at.config.postures)
        monkeypatch.setattr(Kind, "version", 2)
        assert kind.fitting(at) == second, "a lake is looked at once"
    with reader(made) as at:
        assert kind.fitting(at) is None
        monkeypatch.setattr(Kind, "version", 1)
    with reader(made, postures=PosturesConfig(m=30)) as at:
        assert kind.fitting(at) is None
        with pytest.raises(AssertionError, match="no test model yet"):
            kind.serving(at)
        assert not kind.takes_pretrained(at)


@pytest.mark.parametrize("fine_tune", [True, False])
def test_only_what_is_fine_tuned_takes_the_pretrained_model_first(made: Made, fine_tune: bool) -> None:
    class Taken(Kind):
        pretrained = POSTURE_DICTIONARY.pretrained

    kind = Taken()
    with opened(made.lake) as one:
        model = models.train(one, kind, Selection(fine_tune=fine_tune))
    assert model is not None
    assert (kind.runs, model.file) == (1, f"models/postures-{2 if fine_tune else 1}.safetensors")


def test_what_cannot_be_trained_makes_no_model(made: Made) -> None:
    notices: list[str] = []
    with opened(made.lake, notices) as one:
        assert models.obtain(one, Kind(None), stage="symbols") is None
        assert notices[-1].startswith("symbols: there are no frames to train on yet")
        with pytest.raises(UserError, match="no test model can be trained: too little"):
            models.train(one, Kind(-1))
        assert Kind().fitting(_reader(one)) is None


def _reader(one: Session) -> LakeReader:
    with lake_reader(one.lake, one.config) as at:
        Kind().fitting(at)
        return at


def test_a_small_lake_takes_the_pretrained_model_and_says_so(made: Made) -> None:
    notices: list[str] = []
    with opened(made.lake, notices) as one:
        model = models.obtain(one, POSTURE_DICTIONARY, stage="symbols")
        assert model is not None
        assert model.metrics["pretrained"] is True
        assert notices[-1].startswith("symbols: takes the pretrained dictionary; `motionlake train postures`")
        assert models.obtain(one, POSTURE_DICTIONARY, stage="symbols") == model
    with reader(made) as at:
        (shard,) = SYMBOLS.source.plan(at) if SYMBOLS.source is not None else ()
        hashed = at.file_hash(model.file)
        (above,) = at.done("frames")
    assert hashed == sha256((made.lake / model.file).read_bytes()).hexdigest()
    assert SYMBOLS.source is not None
    assert shard.key == config_hash(SYMBOLS.source.name, SYMBOLS.source.version, above, hashed)


def test_what_was_found_in_a_lake_stands_until_the_command_writes(made: Made) -> None:
    with opened(made.lake) as one:
        with one.reader() as at:
            parts, done = live_parts(at), at.done(FRAMES.name)
        with one.reader() as at:
            assert live_parts(at) is parts
            assert at.done(FRAMES.name) is done
        with writing(one.lake) as con:
            con.execute("DELETE FROM clips")
        with one.reader() as at:
            assert parts
            assert live_parts(at) == []
