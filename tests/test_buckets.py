"""Lakes in buckets: published, copied, changed by two at once, killed, throttled, damaged; on S3 and in a folder."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qs, urlsplit
from urllib.request import Request, urlopen

import fsspec
import motionlake as package
import pytest
from motionlake.errors import UserError
from motionlake.lake import bucket as buckets
from motionlake.lake.annotations import Annotations, new_annotation
from motionlake.lake.bucket import Bucket, ConflictError, Stored, Version
from motionlake.lake.cached import cache_folder, own_name
from motionlake.lake.copies import pull
from motionlake.lake.integrity import fetched_by
from motionlake.lake.layout import Lake, open_lake
from motionlake.lake.origin import Origin
from motionlake.lake.stores import is_address

from tests.lakes import assert_same, finish, motionlake, query, quick_lake, tables
from tests.object_store import BUCKET, ObjectStore, object_store
from tests.processes import start


def quiet(what: str, done: int, total: int) -> None:
    return None


@pytest.fixture(scope="module")
def served() -> Iterator[ObjectStore]:
    with object_store() as store:
        yield store


@pytest.fixture
def store(served: ObjectStore, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ObjectStore]:
    for name, value in served.environment().items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    yield served
    served.faults.throttled = lambda number: False
    served.faults.lost = lambda method, path: False


@pytest.fixture(params=["s3", "file"])
def address(request: pytest.FixtureRequest, store: ObjectStore, tmp_path: Path) -> str:
    """Where a lake of this test alone may be published."""
    return f"s3://{BUCKET}/{tmp_path.name}" if request.param == "s3" else f"file://{tmp_path}/bucket"


def said(*words: object) -> str:
    run = motionlake(*words)
    assert run.status == 0, run.err
    return run.out + run.err


def refused(*words: object) -> str:
    run = motionlake(*words)
    assert run.status == 2, run.out
    assert "Traceback" not in run.err
    return run.err


def tagged(lake: Path, tag: str) -> None:
    """Somebody decides something."""
    ((clip,),) = query(lake, "SELECT min(clip) FROM clips")
    Annotations(open_lake(lake)).add([new_annotation(str(clip), "tag", tag, who="anna")])


def tags(lake: Path) -> set[str]:
    return set().union(*Annotations(open_lake(lake)).tags().values())


def test_a_copy_holds_what_was_published(lake: Path, address: str, tmp_path: Path) -> None:
    tagged(lake, "good")
    (lake / "rigs").mkdir(exist_ok=True)
    assert "version 1" in said("push", address, "--lake", lake)
    assert "version 1, 0 files sent" in said("push", "--lake", lake), "the address is known, and nothing changed"
    copy = tmp_path / "copy"
    said("pull", address, "--lake", copy)
    assert_same(tables(lake), tables(copy))
    assert tags(copy) == {"good"}
    assert (copy / "config.toml").read_bytes() == (lake / "config.toml").read_bytes()
    assert "every byte" in said("verify", "--deep", "--lake", copy)
    assert "0 files fetched" in said("pull", "--lake", copy)
    assert said("run", "all", "--lake", copy), "a copy is a lake like any other"


def test_only_what_is_new_is_sent_and_fetched(lake: Path, address: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    said("push", address, "--lake", lake)
    said("pull", address, "--lake", copy)
    tagged(copy, "mine")
    said("remove", str(query(copy, "SELECT max(clip) FROM clips")[0][0]), "--lake", copy)
    moved = json.loads(said("push", "--lake", copy, "--json"))
    assert moved["version"] == 2
    assert 0 < moved["files"] < 6
    before = {path.name for path in lake.glob("frames/*/*.parquet")}
    moved = json.loads(said("pull", "--lake", lake, "--json"))
    assert 0 < moved["files"] < 6
    assert_same(tables(copy), tables(lake))
    assert tags(lake) == {"mine"}
    assert before >= {path.name for path in lake.glob("frames/*/*.parquet")}, "files that no table names are gone"


def test_a_copy_that_changed_is_not_overwritten(lake: Path, address: str, tmp_path: Path) -> None:
    mine, hers = tmp_path / "mine", tmp_path / "hers"
    said("push", address, "--lake", lake)
    said("pull", address, "--lake", mine)
    said("pull", address, "--lake", hers)
    tagged(mine, "mine")
    tagged(hers, "hers")
    said("push", "--lake", mine)
    assert "has published version 2" in refused("push", "--lake", hers)
    assert "--discard" in refused("pull", "--lake", hers)
    assert tags(hers) == {"hers"}
    said("pull", "--lake", hers, "--discard")
    assert tags(hers) == {"mine"}
    tagged(hers, "hers")
    tagged(mine, "mine too")
    said("push", "--lake", hers)
    assert "version 4" in said("push", "--lake", mine, "--replace")
    said("pull", "--lake", hers)
    assert tags(hers) == {"mine", "mine too"}
    other = quick_lake(tmp_path / "other")
    assert "another lake" in refused("pull", address, "--lake", other)


def test_one_of_many_publishes_a_number(address: str) -> None:
    given = [Version(1, f"writer {n}", "now", (), f"token {n}") for n in range(12)]
    won: list[str] = []
    told: list[str] = []

    def publish(version: Version) -> None:
        try:
            Bucket(address).publish(version)
            won.append(version.token)
        except ConflictError as error:
            told.append(str(error))

    threads = [threading.Thread(target=publish, args=(version,)) for version in given]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1
    assert len(told) == 11
    assert all("has published version 1" in line for line in told)
    latest = Bucket(address).latest()
    assert latest is not None
    assert latest.token == won[0]


def test_answers_that_are_lost_and_requests_that_are_refused(lake: Path, store: ObjectStore, tmp_path: Path) -> None:
    address = f"s3://{BUCKET}/{tmp_path.name}"
    lost: set[str] = set()

    def first(method: str, path: str) -> bool:
        """Every answer to a request that writes is lost once."""
        fresh = method == "PUT" and path not in lost
        lost.add(path)
        return fresh

    store.faults.lost = first
    store.faults.throttled = lambda number: number % 7 == 0
    failed = store.faults.failed
    assert "version 1" in said("push", address, "--lake", lake)
    said("pull", address, "--lake", tmp_path / "copy")
    assert store.faults.failed > failed + 10
    assert any("versions/" in path for path in lost)
    assert_same(tables(lake), tables(tmp_path / "copy"))
    assert "every byte" in said("verify", "--deep", "--lake", tmp_path / "copy")


@pytest.mark.parametrize("seed", range(2))
def test_killed_pushes_and_pulls_lose_nothing(lake: Path, address: str, tmp_path: Path, seed: int) -> None:
    drawn, copy = random.Random(seed), tmp_path / "copy"
    before = tables(lake)
    for words in (("push", address, "--lake", lake), ("pull", address, "--lake", copy)):
        for _ in range(4):
            process = start(*words)
            time.sleep(drawn.uniform(0.1, 2.5))
            process.kill()
            process.wait(20)
            shutil.rmtree(process.folder)
        run = finish(start(*words))
        assert run.status == 0, run.err
    assert_same(before, tables(lake))
    assert_same(before, tables(copy))
    assert "every byte" in said("verify", "--deep", "--lake", copy)
    assert not [path for path in copy.rglob("*.tmp") if path.parent != copy]


def test_a_pull_that_ends_between_settings_and_catalog_is_finished(
    lake: Path, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "copy"
    said("push", address, "--lake", lake)
    said("pull", address, "--lake", copy)
    tagged(lake, "new")
    said("push", "--lake", lake)
    with monkeypatch.context() as patched:
        patched.setattr(
            "motionlake.lake.copies._take_catalog", lambda *_: (_ for _ in ()).throw(UserError("power cut"))
        )
        assert "power cut" in refused("pull", "--lake", copy)
    assert "was not finished" in refused("push", f"file://{tmp_path}/other", "--lake", copy)
    said("pull", "--lake", copy)
    assert tags(copy) == {"new"}
    assert_same(tables(lake), tables(copy))


def test_a_pull_that_ends_before_it_has_cleaned_up_is_finished(
    lake: Path, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "copy"
    said("push", address, "--lake", lake)
    with monkeypatch.context() as patched:
        patched.setattr(
            "motionlake.lake.copies.collect_garbage", lambda *_: (_ for _ in ()).throw(UserError("power cut"))
        )
        assert "power cut" in refused("pull", address, "--lake", copy)
    (left,) = copy.glob("frames/*")
    left = (left if left.is_dir() else left.parent) / ".part.parquet.0123.tmp"
    left.write_bytes(b"half of a part")
    said("pull", address, "--lake", copy)
    assert not left.exists()
    assert_same(tables(lake), tables(copy))


def test_a_push_that_does_not_hear_that_it_published(
    lake: Path, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said("push", address, "--lake", lake)
    tagged(lake, "mine")
    with monkeypatch.context() as patched:
        publish = Bucket.publish

        def cut(bucket: Bucket, version: Version) -> None:
            publish(bucket, version)
            raise UserError("power cut")

        patched.setattr(Bucket, "publish", cut)
        assert "power cut" in refused("push", "--lake", lake)
    assert "version 2, 0 files sent" in said("push", "--lake", lake), "it is its own"
    tagged(lake, "more")
    assert "version 3" in said("push", "--lake", lake)
    assert Bucket(address).latest().number == 3  # type: ignore[union-attr]


def test_a_bucket_that_was_emptied(lake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    address = f"file://{tmp_path}/bucket"
    said("push", address, "--lake", lake)
    said("status", "--lake", address)
    shutil.rmtree(tmp_path / "bucket")
    assert "no lake there any more" in refused("status", "--lake", address)
    assert "publish one with" in refused("pull", address, "--lake", tmp_path / "copy")
    assert "version 1" in said("push", "--lake", lake), "who has it can publish it again"


def test_an_address_in_the_place_of_a_folder(clips_folder: Path, address: str, scheduler: str) -> None:
    where = ["--lake", address]
    run = motionlake("ingest", clips_folder, *where, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert "version 1" in run.err
    clip = json.loads(said("sql", "SELECT min(clip) AS clip FROM clips", "--json", *where))[0]["clip"]
    lake = package.open_lake(address)
    assert lake.clips()[0]["clip"] == clip
    assert "version" not in motionlake("status", *where).err, "who only reads publishes nothing"
    said("remove", clip, *where)
    assert clip not in [row["clip"] for row in package.open_lake(address).clips()]
    assert Bucket(address).latest().number == 2  # type: ignore[union-attr]


def held(lake: Path) -> set[str]:
    """Files that a copy has of what its catalog lists."""
    listed = {str(row[0]) for row in query(lake, "SELECT file FROM files")}
    return {name for name in listed if (lake / name).is_file()}


def test_an_address_fetches_what_a_command_reads(lake: Path, address: str, tmp_path: Path, scheduler: str) -> None:
    said("push", address, "--lake", lake)
    every = held(lake)
    copy = cache_folder("lakes") / own_name(address)
    clips = [str(row[0]) for row in query(lake, "SELECT clip FROM clips ORDER BY clip")]
    assert said("status", "--lake", address)
    assert {name.partition("/")[0] for name in held(copy)} <= {"models"}, "the catalog answers, and what is due"
    assert said("search", clips[0], "--json", "--lake", address) == said("search", clips[0], "--json", "--lake", lake)
    searched = held(copy)
    assert 0 < len(searched) < len(every)
    assert not any(name.startswith("raw/") for name in searched)
    said("verify", "--lake", address)
    assert held(copy) == searched, "what is not there yet is not damaged, and is not fetched to be looked at"
    count = "SELECT count(*) AS frames FROM frames"
    assert said("sql", count, "--json", "--lake", address) == said("sql", count, "--json", "--lake", lake)
    where = ("--lake", address, "--scheduler", scheduler)
    said("remove", clips[0], "--lake", address)
    assert motionlake("run", "quality", *where).status == 0, "a run fetches what its shards read"
    assert not any(name.startswith("raw/") for name in held(copy))
    said("remove", clips[0], "--lake", lake)
    run = motionlake("run", "quality", "--lake", lake, "--scheduler", scheduler)
    assert run.status == 0, run.err
    assert query(copy, "FROM quality ORDER BY clip") == query(lake, "FROM quality ORDER BY clip")


def test_a_file_that_a_copy_lost_is_fetched_again(lake: Path, address: str, tmp_path: Path) -> None:
    said("push", address, "--lake", lake)
    copy = tmp_path / "copy"
    said("pull", address, "--lake", copy)
    for part in copy.glob("frames/*/*.parquet"):
        part.unlink()
    clip = str(query(lake, "SELECT min(clip) FROM clips")[0][0])
    assert "`motionlake pull" in refused("view", clip, "--out", tmp_path / "clip.html", "--lake", copy)
    said("pull", "--lake", copy)
    assert "every byte" in said("verify", "--deep", "--lake", copy)


def test_a_copy_in_part_takes_the_next_version(lake: Path, address: str) -> None:
    said("push", address, "--lake", lake)
    clip = str(query(lake, "SELECT min(clip) FROM clips")[0][0])
    copy = cache_folder("lakes") / own_name(address)
    found = said("search", clip, "--json", "--lake", address)
    before = held(copy)
    tagged(lake, "hers")
    said("push", "--lake", lake)
    assert said("search", clip, "--json", "--lake", address) == found
    assert tags(copy) == {"hers"}
    assert held(copy) == before, "what is the same in both versions stays, and nothing else is fetched"


def test_a_copy_in_part_becomes_whole(lake: Path, address: str, tmp_path: Path) -> None:
    said("push", address, "--lake", lake)
    said("status", "--lake", address)
    copy = cache_folder("lakes") / own_name(address)
    clip = str(query(lake, "SELECT min(clip) FROM clips")[0][0])
    fetched_by(Lake(copy), None)  # as in another process, which names the copy by its folder
    assert "`motionlake pull" in refused("view", clip, "--out", tmp_path / "clip.html", "--lake", copy)
    tagged(copy, "mine")
    said("pull", "--lake", copy)
    assert "every byte" in said("verify", "--deep", "--lake", copy)
    assert tags(copy) == {"mine"}, "what changed here stays"
    assert_same(tables(lake), tables(copy))


def test_a_part_that_is_missing_in_the_bucket_gets_a_line(lake: Path, address: str) -> None:
    said("push", address, "--lake", lake)
    said("status", "--lake", address)
    bucket = Bucket(address)
    for stored in bucket.latest().files:  # type: ignore[union-attr]
        if stored.file.startswith(("frames/", "moves/")):
            bucket._delete(bucket._object(stored))
    clip = str(query(lake, "SELECT min(clip) FROM clips")[0][0])
    assert "is missing there; push the lake anew" in refused("search", clip, "--lake", address)


def test_what_is_decided_in_the_browser_is_published_when_it_ends(lake: Path, address: str, tmp_path: Path) -> None:
    said("push", address, "--lake", lake)
    words = ["browse", "--no-open", "--port", "0", "--json", "--lake", address]
    command = [str(Path(sys.executable).parent / "motionlake"), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            shown = "".join(process.stdout.readline() for _ in range(4))
            where = urlsplit(json.loads(shown)["address"])
            ((clip,),) = query(lake, "SELECT min(clip) FROM clips")
            request = Request(
                f"http://{where.netloc}/api/annotations",
                json.dumps({"clips": [clip], "kind": "tag", "value": "nice"}).encode(),
                {"Authorization": f"Bearer {parse_qs(where.query)['token'][0]}", "Content-Type": "application/json"},
            )
            with urlopen(request, timeout=60) as answer:
                assert json.load(answer)["ids"]
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0, told
    assert "version 2, 1 files sent" in told
    said("pull", address, "--lake", tmp_path / "copy")
    assert tags(tmp_path / "copy") == {"nice"}


def test_clips_are_taken_in_from_a_bucket(
    clips_folder: Path, store: ObjectStore, tmp_path: Path, scheduler: str
) -> None:
    files = fsspec.filesystem("s3", skip_instance_cache=True, use_listings_cache=False)
    place, lake = f"{BUCKET}/{tmp_path.name}/shots", quick_lake(tmp_path / "lake")
    files.put(str(clips_folder) + "/", place, recursive=True)
    files.pipe_file(f"{place}/empty/", b"")
    words = ("ingest", f"s3://{place}", "--lake", lake, "--json", "--scheduler", scheduler)
    first = motionlake(*words)
    assert first.status == 0, first.err
    plain = quick_lake(tmp_path / "plain")
    same = Path(shutil.copytree(clips_folder, tmp_path / "shots"))
    assert motionlake("ingest", same, "--lake", plain, "--scheduler", scheduler).status == 0
    text = "SELECT clip, label, frames, dataset FROM clips ORDER BY ALL"
    assert query(lake, text) == query(plain, text)

    before = store.faults.seen
    again = motionlake(*words)
    assert (again.json["clips"], again.json["unchanged"]) == (0, first.json["clips"])
    assert store.faults.seen - before < 5, "nothing is fetched again"
    gone, _ = sorted(name for name in files.find(place) if name.endswith((".bvh", ".npz")))[:2]
    files.rm_file(gone)
    assert motionlake(*words).json["gone"] == 1
    clip = next(name for name in files.find(place) if name.endswith(".npz"))
    one = motionlake(
        "ingest", f"s3://{clip}", "--lake", quick_lake(tmp_path / "one"), "--json", "--scheduler", scheduler
    )
    assert one.json["clips"] == 1
    assert "no such folder or file" in refused("ingest", f"s3://{BUCKET}/nowhere", "--lake", lake)
    files.pipe_file(f"{BUCKET}/{tmp_path.name}/odd/a//b.bvh", b"x")
    assert "no path below it" in refused("ingest", f"s3://{BUCKET}/{tmp_path.name}/odd", "--lake", lake)


def test_old_versions_are_deleted_with_their_files(lake: Path, address: str, tmp_path: Path) -> None:
    said("push", address, "--lake", lake)
    for number in range(4):
        tagged(lake, f"tag {number}")
        said("push", "--lake", lake, *(["--prune"] if number == 3 else []))
    latest = Bucket(address).latest()
    assert latest is not None
    assert latest.number == 5
    assert [Bucket(address)._version(number) is not None for number in (1, 2, 3, 4, 5)] == [
        False,
        False,
        True,
        True,
        True,
    ]
    said("pull", address, "--lake", tmp_path / "copy")
    assert_same(tables(lake), tables(tmp_path / "copy"))


def test_bytes_that_were_not_published_are_not_taken(lake: Path, tmp_path: Path) -> None:
    address = f"file://{tmp_path}/bucket"
    said("push", address, "--lake", lake)
    victim = max((tmp_path / "bucket" / "objects").rglob("*"), key=lambda path: path.stat().st_size)
    victim.write_bytes(b"x" * victim.stat().st_size)
    assert "other bytes there" in refused("pull", address, "--lake", tmp_path / "copy")
    assert not (tmp_path / "copy" / "catalog.duckdb").exists()
    victim.unlink()
    assert "is missing there" in refused("pull", address, "--lake", tmp_path / "copy")


@pytest.mark.parametrize(
    "name",
    [
        "../out.txt",
        "/etc/motd",
        "frames/../../out",
        ".lock",
        "bucket.json",
        "frames/.x.parquet",
        "a//b",
        "catalog.sums",
    ],
)
def test_names_lead_nowhere_else(tmp_path: Path, name: str) -> None:
    bucket = Bucket(f"file://{tmp_path}/bucket")
    content = tmp_path / "content"
    content.write_bytes(b"x")
    sha = "2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881"
    files = tuple(Stored(each, 1, sha, 0) for each in ("catalog.duckdb", name))
    bucket.put(content, files[0])
    bucket.publish(Version(1, "a", "b", files, "t"))
    with pytest.raises(UserError, match=r"no file of a lake|leads out"):
        pull(Lake(tmp_path / "lake"), bucket, quiet)
    assert not (tmp_path / "out.txt").exists()


def test_a_version_that_is_damaged_or_of_a_later_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bucket = Bucket(f"file://{tmp_path}/bucket")
    version = Version(1, "a", "b", (), "t")
    bucket.publish(version)
    path = tmp_path / "bucket" / "versions" / "00000001.json"
    text = path.read_bytes()
    for damaged in (b"", b"{}", b"[1]", text[:-9], text.replace(b'"number', b'"numbre')):
        path.write_bytes(damaged)
        with pytest.raises(UserError, match="version 1"):
            bucket.latest()
    monkeypatch.setattr(buckets, "FORMAT", 2)
    path.write_bytes(replace(version).text())
    monkeypatch.undo()
    with pytest.raises(UserError, match="later motionlake"):
        bucket.latest()


def test_the_latest_version_is_found_by_an_old_number_and_by_none(tmp_path: Path) -> None:
    bucket = Bucket(f"file://{tmp_path}/bucket")
    for number in (1, 2, 3):
        bucket.publish(Version(number, "a", "b", (), str(number)))
    hint = tmp_path / "bucket" / "latest.json"
    for text in (b'{"number": 1}', b'{"number": "x"}', b"", b"{"):
        hint.write_bytes(text)
        latest = bucket.latest()
        assert latest is not None
        assert latest.number == 3
    hint.unlink()
    assert bucket.latest() == latest


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("ftp://host/lake", "no store that lakes can be kept in"),
        ("gs://bucket/lake", "needs gcsfs"),
        ("s3://nowhere/lake", "make the bucket first"),
    ],
)
def test_mistakes_get_a_line(store: ObjectStore, address: str, told: str) -> None:
    assert told in refused("status", "--lake", address)


def test_what_is_an_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert is_address("s3://bucket/lake")
    assert is_address(Path("s3://bucket/lake"))
    assert not is_address("mylake")
    assert not is_address("/data/s3:/lake")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s3:" / "bucket").mkdir(parents=True)
    assert not is_address("s3:/bucket"), "a folder of that name is a folder"


def test_a_push_takes_no_damaged_file(lake: Path, tmp_path: Path) -> None:
    part = next(lake.glob("frames/*/*.parquet"))
    part.write_bytes(b"y" * part.stat().st_size)
    assert "other bytes" in refused("push", f"file://{tmp_path}/bucket", "--lake", lake)
    assert Bucket(f"file://{tmp_path}/bucket").latest() is None


def test_what_a_copy_says_of_itself_is_checked(lake: Path) -> None:
    for text in ("", "{}", "[1]", '[{"address": 1}]', '[{"address": "s3://a/b", "number": "x", "own": {}}]'):
        (lake / "bucket.json").write_text(text, encoding="utf-8")
        assert Origin.all(Lake(lake)) == {}
    assert "say where" in refused("push", "--lake", lake)


def test_one_lake_in_two_buckets(lake: Path, tmp_path: Path) -> None:
    first, second = (f"file://{tmp_path}/{name}" for name in ("first", "second"))
    said("push", first, "--lake", lake)
    said("push", second, "--lake", lake)
    assert "second: version 1, 0 files sent" in said("push", "--lake", lake), "the last one"
    tagged(lake, "new")
    assert "first: version 2" in said("push", first, "--lake", lake)
    assert "second: version 2" in said("push", second, "--lake", lake)
    assert "0 files fetched" in said("pull", first, "--lake", lake)


def test_fsspec_stores_create_only_where_there_is_none() -> None:
    files = fsspec.filesystem("memory")
    files.pipe_file("/once", b"1", mode="create")
    with pytest.raises(FileExistsError):
        files.pipe_file("/once", b"2", mode="create")
