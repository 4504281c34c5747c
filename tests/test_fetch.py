"""Datasets fetched from a server on the loopback: cut, slow, changed, wrong, killed; then taken into a lake."""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import shutil
import signal
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import requests
from motionlake.cli._bytes import ByteProgress
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.citations import citations
from motionlake.lake.layout import open_lake
from motionlake.recipes.download import CHUNK, Patience
from motionlake.recipes.fetching import Fetched, fetch_dataset
from motionlake.recipes.recipe import Recipe, find_recipe
from rich import progress
from rich.console import Console

from tests.lakes import Changed, finish, motionlake, query
from tests.loopback import Site, serving
from tests.processes import start_fresh
from tests.samples import KINECT_1, KINECT_1_PARENTS, npz_bytes, swinging_body

HASTY = Patience(tries=3, pause=0.0, silence=2.0)
CITATION = "@misc{walks, title = {Walks}}"


@pytest.fixture
def site() -> Iterator[Site]:
    with serving() as found:
        yield found


@pytest.fixture(scope="module")
def archive() -> bytes:
    """Two clips and bytes that do not shrink, in one archive."""
    return zipped(
        {
            "top/data/walk_ann.npz": npz_bytes(swinging_body(40), KINECT_1, KINECT_1_PARENTS, 30.0),
            "top/data/run_bob.npz": npz_bytes(swinging_body(60), KINECT_1, KINECT_1_PARENTS, 30.0),
            "top/data/notes.bin": b"".join(hashlib.sha256(bytes([i % 256, i // 256])).digest() for i in range(12000)),
            "top/readme.txt": b"not below data",
        }
    )


def zipped(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def recipe_file(folder: Path, site: Site, *lines: str, accept: bool = False, path: str = "/walks.zip") -> Path:
    """A recipe of one archive on a server."""
    text = f"""
version = 3
name = "walks"
title = "Walks of two"
homepage = "https://example.org/walks"
formats = ["positions npz"]
checked = "never"
citation = '{CITATION}'
labels = '(?P<label>[a-z]+)_(?P<subject>[a-z]+)\\.npz'
[licence]
name = "CC BY 4.0"
url = "https://creativecommons.org/licenses/by/4.0/"
commercial = true
accept = {str(accept).lower()}
terms = "Name the authors."
[[files]]
url = "{site.url}{path}"
unpack = "zip"
into = "clips"
only = "top/data"
""" + "\n".join(lines)
    file = folder / "walks.toml"
    file.write_text(text, encoding="utf-8")
    return file


def fetched(recipe: Path | Recipe, folder: Path, **options: Any) -> Fetched:
    found = recipe if isinstance(recipe, Recipe) else find_recipe(str(recipe))
    settings: dict[str, Any] = {"arriving": lambda *_: None, "notice": lambda _: None, "patience": HASTY, **options}
    return fetch_dataset(found, folder, **settings)


def assert_whole(folder: Path, archive: bytes) -> None:
    """What the folder of a dataset holds, and nothing beside it."""
    with zipfile.ZipFile(io.BytesIO(archive)) as opened:
        for name in opened.namelist():
            if name.startswith("top/data/"):
                assert (folder / "clips" / Path(name).name).read_bytes() == opened.read(name)
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))
    clips = ["clips", "clips/notes.bin", "clips/run_bob.npz", "clips/walk_ann.npz"]
    assert names == sorted(["SOURCE.json", "fetched.json", "labels.csv", *clips])


def test_a_dataset_comes_with_its_licence_and_the_same_source_file_each_time(
    tmp_path: Path, site: Site, archive: bytes
) -> None:
    site.files["/walks.zip"] = archive
    recipe = recipe_file(tmp_path, site)
    seen: list[tuple[str, int, int | None]] = []
    done = fetched(recipe, tmp_path / "a", arriving=lambda *told: seen.append(told))
    assert (done.fetched, done.there, done.labelled) == (("walks.zip",), (), 2)
    assert seen[-1] == ("walks.zip", len(archive), len(archive))
    assert_whole(tmp_path / "a", archive)
    told = json.loads((tmp_path / "a" / "SOURCE.json").read_text(encoding="utf-8"))
    assert (told["name"], told["recipe_version"], told["licence"], told["citation"]) == (
        "walks", 3, "CC BY 4.0", CITATION,
    )  # fmt: skip
    digest = hashlib.sha256(archive).hexdigest()
    assert told["files"] == [
        {"name": "walks.zip", "url": f"{site.url}/walks.zip", "sha256": digest, "size": len(archive)}
    ]
    fetched(recipe, tmp_path / "b")
    assert (tmp_path / "a" / "SOURCE.json").read_bytes() == (tmp_path / "b" / "SOURCE.json").read_bytes()
    asked = len(site.asked)
    assert fetched(recipe, tmp_path / "a").there == ("walks.zip",)
    assert len(site.asked) == asked  # nothing was asked for again
    rows = (tmp_path / "a" / "labels.csv").read_text(encoding="utf-8").split()
    assert rows == ["file,label,subject", "clips/run_bob.npz,run,bob", "clips/walk_ann.npz,walk,ann"]


def test_cut_connections_are_gone_on_with(tmp_path: Path, site: Site, archive: bytes) -> None:
    site.files["/walks.zip"], site.cut, site.busy = archive, 3 * CHUNK, 2
    fetched(recipe_file(tmp_path, site), tmp_path / "a")
    assert_whole(tmp_path / "a", archive)
    starts = [int(part.removeprefix("bytes=").removesuffix("-") or 0) for _, part in site.asked]
    assert starts == [0, 0, *range(0, len(archive), 3 * CHUNK)]


def test_a_server_without_ranges_starts_anew(tmp_path: Path, site: Site, archive: bytes) -> None:
    site.files["/walks.zip"], site.cut, site.ranges = archive, 3 * CHUNK, False
    recipe = recipe_file(tmp_path, site)
    with pytest.raises(UserError, match=r"cannot be reached \(the connection .*49152 bytes are kept"):
        fetched(recipe, tmp_path / "a")
    assert len(site.asked) == HASTY.tries
    site.cut = 0
    fetched(recipe, tmp_path / "a")
    assert_whole(tmp_path / "a", archive)


def test_another_version_of_the_file_is_not_put_together_with_the_first(
    tmp_path: Path, site: Site, archive: bytes
) -> None:
    site.files["/walks.zip"], site.cut = bytes(len(archive)), 3 * CHUNK
    recipe = recipe_file(tmp_path, site)
    with pytest.raises(UserError, match="cannot be reached"):
        fetched(recipe, tmp_path / "a", arriving=lambda *_: setattr(site, "busy", 99))
    site.files["/walks.zip"], site.cut, site.busy, site.tag = archive, 0, 0, '"two"'
    fetched(recipe, tmp_path / "a")
    assert_whole(tmp_path / "a", archive)


@pytest.mark.parametrize("said", ["sha256", "md5"])
def test_a_wrong_hash_is_thrown_away(tmp_path: Path, site: Site, archive: bytes, said: str) -> None:
    site.files["/walks.zip"] = archive[:-1] + b"x"
    digest = hashlib.new(said, archive).hexdigest()
    recipe = recipe_file(tmp_path, site, f'{said} = "{digest}"')
    with pytest.raises(UserError, match=f"has another hash than the recipe says, {said}:{digest}; it is thrown away"):
        fetched(recipe, tmp_path / "a")
    assert not (tmp_path / "a" / "clips").exists()
    assert [path.name for path in (tmp_path / "a" / ".fetch").iterdir()] in ([], ["lock"])
    site.files["/walks.zip"] = archive
    fetched(recipe, tmp_path / "a")
    assert_whole(tmp_path / "a", archive)


def test_bytes_that_went_bad_on_the_way_are_fetched_again(tmp_path: Path, site: Site, archive: bytes) -> None:
    site.files["/walks.zip"], site.cut = archive, 3 * CHUNK
    recipe = recipe_file(tmp_path, site, f'sha256 = "{hashlib.sha256(archive).hexdigest()}"')
    part = tmp_path / "a" / ".fetch" / "walks.zip.part"
    lines: list[str] = []

    def spoil(_: str, there: int, __: int | None) -> None:
        if there == 6 * CHUNK and not lines:
            part.write_bytes(bytes(6 * CHUNK))

    fetched(recipe, tmp_path / "a", arriving=spoil, notice=lines.append)
    assert_whole(tmp_path / "a", archive)
    assert [line for line in lines if "all of it is fetched again" in line]


def test_what_was_fetched_before_is_compared_where_no_hash_is_declared(
    tmp_path: Path, site: Site, archive: bytes
) -> None:
    site.files["/walks.zip"] = archive
    recipe, lines = recipe_file(tmp_path, site), list[str]()
    fetched(recipe, tmp_path / "a", notice=lines.append)
    assert any("without https, and no hash" in line for line in lines)
    site.files["/walks.zip"] = zipped({"top/data/other.txt": b"other"})
    with pytest.raises(UserError, match=r"fetched\.json says it had before"):
        fetched(recipe, tmp_path / "a", again=True)
    assert_clips = sorted(path.name for path in (tmp_path / "a" / "clips").iterdir())
    assert assert_clips == ["notes.bin", "run_bob.npz", "walk_ann.npz"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda site: site.files.clear(), "the server says 404 Not Found; is there a newer recipe?"),
        (lambda site: setattr(site, "busy", 99), r"cannot be reached \(the server says 503"),
        (lambda site: site.files.update({"/walks.zip": b"<html>"}), "walks.zip: is damaged"),
        (lambda site: setattr(site, "rate", 10), r"cannot be reached \(no answer in time\)"),
    ],
)
def test_what_cannot_be_had_says_why(
    tmp_path: Path, site: Site, archive: bytes, change: Callable[[Site], object], said: str
) -> None:
    site.files["/walks.zip"] = archive
    change(site)
    with pytest.raises(UserError, match=said):
        fetched(recipe_file(tmp_path, site), tmp_path / "a", patience=Patience(tries=2, pause=0.0, silence=0.01))
    assert not (tmp_path / "a" / "clips").exists()


def test_a_file_is_as_long_as_the_recipe_says(tmp_path: Path, site: Site, archive: bytes) -> None:
    site.files["/walks.zip"] = archive
    recipe = recipe_file(tmp_path, site, "size = 1000")
    with pytest.raises(UserError, match=f"has {len(archive)} bytes where the recipe says 1000"):
        fetched(recipe, tmp_path / "a")
    site.unsaid = True
    with pytest.raises(UserError, match="sends more than the 1000 bytes that are expected"):
        fetched(recipe, tmp_path / "a")
    fetched(recipe_file(tmp_path, site), tmp_path / "a")
    assert_whole(tmp_path / "a", archive)


def test_a_connection_that_ends_early_without_a_word(tmp_path: Path, site: Site, archive: bytes) -> None:
    """A server that does not say how long its file is: the recipe does."""
    site.files["/walks.zip"], site.cut, site.unsaid = archive, 10 * CHUNK, True
    fetched(recipe_file(tmp_path, site, f"size = {len(archive)}"), tmp_path / "a")
    assert_whole(tmp_path / "a", archive)
    assert len(site.asked) == 3


def test_redirects_and_nobody_there(tmp_path: Path, site: Site, archive: bytes) -> None:
    site.files["/here.zip"], site.moved["/walks.zip"] = archive, "/here.zip"
    fetched(recipe_file(tmp_path, site), tmp_path / "a")
    assert_whole(tmp_path / "a", archive)
    nobody = Site(url="http://127.0.0.1:1")
    with pytest.raises(UserError, match=r"cannot be reached \(connection refused\); 0 bytes are kept"):
        fetched(recipe_file(tmp_path, nobody), tmp_path / "b")


@pytest.mark.parametrize("declared", [False, True])
def test_no_way_leads_from_https_to_http(
    tmp_path: Path, archive: bytes, declared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But to a file whose sha256 is known, which another one cannot have."""
    far = Site(url="https://example.org")
    answer = requests.Response()
    answer.status_code, answer.url, answer.raw = 200, "http://example.org/walks.zip", io.BytesIO(archive)
    asked = requests.Response()
    asked.url, answer.history = f"{far.url}/walks.zip", [asked]
    monkeypatch.setattr(requests.Session, "get", lambda *_, **__: answer)
    known = f'sha256 = "{hashlib.sha256(archive).hexdigest()}"' if declared else ""
    recipe = recipe_file(tmp_path, far, known)
    if declared:
        fetched(recipe, tmp_path / "a")
        assert_whole(tmp_path / "a", archive)
        return
    with pytest.raises(UserError, match=r"leads to an address without https, http://example\.org"):
        fetched(recipe, tmp_path / "a")


def test_progress_tells_bytes_rate_and_what_is_left(
    tmp_path: Path, site: Site, archive: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("motionlake.cli._bytes.SPOKEN", 0)
    site.files["/walks.zip"] = archive
    run = motionlake("fetch", recipe_file(tmp_path, site), "--to", tmp_path / "a")
    assert re.search(r"^walks\.zip: \d+ kB of 388 kB, [\d.]+ [kMG]B/s, about \d+ s left$", run.err, re.MULTILINE)
    shown = io.StringIO()
    columns = (progress.DownloadColumn(), progress.TransferSpeedColumn(), progress.TimeRemainingColumn())
    with progress.Progress(*columns, console=Console(file=shown, force_terminal=True, width=99)) as bars:
        told = ByteProgress(bars)
        told("walks.zip", 100_000, 400_000)
        told("walks.zip", 300_000, 400_000)
    assert "300.0/400.0 kB" in shown.getvalue()


def test_one_call_at_a_time(tmp_path: Path, site: Site, archive: bytes) -> None:
    site.files["/walks.zip"] = archive
    recipe, said = recipe_file(tmp_path, site), list[str]()

    def second(*_: object) -> None:
        with pytest.raises(UserError) as error:
            fetched(recipe, tmp_path / "a")
        said.append(str(error.value))

    fetched(recipe, tmp_path / "a", arriving=second)
    assert said
    assert "another motionlake fetches into it" in said[0]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_download_goes_on(tmp_path: Path, site: Site, archive: bytes, number: int) -> None:
    """kill -9 or Ctrl-C in mid-download: the next call asks for what is missing alone."""
    site.files["/walks.zip"], site.rate = archive, 400_000
    recipe, part = recipe_file(tmp_path, site), tmp_path / "a" / ".fetch" / "walks.zip.part"
    process = start_fresh("fetch", recipe, "--to", tmp_path / "a")
    until = time.monotonic() + 60
    while not (part.exists() and part.stat().st_size > 0) and time.monotonic() < until:
        time.sleep(0.01)
    os.kill(process.pid, number)
    died = finish(process)
    assert died.status == (-number if number == signal.SIGKILL else 128 + number)
    assert number == signal.SIGKILL or died.err.endswith("the same command goes on where this one stopped\n")
    have = part.stat().st_size
    assert 0 < have < len(archive)
    site.rate = 0
    run = motionlake("fetch", recipe, "--to", tmp_path / "a")
    assert run.status == 0, run.err
    assert site.asked[-1] == ("/walks.zip", f"bytes={have}-")
    assert_whole(tmp_path / "a", archive)


def test_ctrl_c_while_a_file_is_compared_loses_nothing(
    tmp_path: Path, site: Site, archive: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    site.files["/walks.zip"] = archive
    recipe = recipe_file(tmp_path, site, f'sha256 = "{hashlib.sha256(archive).hexdigest()}"')

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("pooch.core.hash_matches", interrupt)
        with pytest.raises(KeyboardInterrupt):
            fetched(recipe, tmp_path / "a")
    fetched(recipe, tmp_path / "a")
    assert len(site.asked) == 1
    assert_whole(tmp_path / "a", archive)


def test_by_hand(tmp_path: Path, site: Site, archive: bytes) -> None:
    text = recipe_file(tmp_path, site).read_text(encoding="utf-8")
    text = text.replace(f'url = "{site.url}/walks.zip"', 'name = "walks.zip"')
    text = text.replace("version = 3", 'version = 3\nby_hand = "ask for walks.zip and put it there"')
    (tmp_path / "hand.toml").write_text(text, encoding="utf-8")
    words = ("fetch", tmp_path / "hand.toml", "--to", tmp_path / "a")
    run = motionlake(*words)
    assert run.status == 2
    assert run.err.endswith(f"{tmp_path / 'a'}: holds no files of walks yet; ask for walks.zip and put it there\n")
    (tmp_path / "a" / "walks.zip").write_bytes(archive)
    assert motionlake(*words, "--json").json["fetched"] == ["walks.zip"]
    assert (tmp_path / "a" / "clips" / "walk_ann.npz").is_file()
    assert motionlake(*words, "--json").json["there"] == ["walks.zip"]
    assert (tmp_path / "a" / "walks.zip").is_file()  # it is the person's


def test_licence_and_citation_go_into_the_lake(tmp_path: Path, site: Site, archive: bytes, scheduler: str) -> None:
    site.files["/walks.zip"] = archive
    recipe, lake, folder = recipe_file(tmp_path, site, accept=True), tmp_path / "lake", tmp_path / "a"
    words = ("fetch", recipe, "--to", folder, "--lake", lake, "--scheduler", scheduler)
    run = motionlake(*words)
    assert run.status == 2
    assert run.err.splitlines()[-1].endswith("then give --accept-licence")
    assert not folder.exists()
    run = motionlake(*words, "--accept-licence")
    assert run.status == 0, run.err
    assert f"{folder / 'SOURCE.json'}: walks, licence CC BY 4.0, citation kept" in run.err
    rows = query(lake, "SELECT clip, label, subject, licence FROM clips ORDER BY clip")
    assert rows == [
        ("walks/clips/run_bob.npz", "run", "bob", "CC BY 4.0"),
        ("walks/clips/walk_ann.npz", "walk", "ann", "CC BY 4.0"),
    ]
    with reading(open_lake(lake)) as con:
        found = citations(con)
    assert [(source.name, source.licence, source.citation) for source in found["walks"]] == [
        ("walks", "CC BY 4.0", CITATION)
    ]
    told = motionlake("cite", "run_bob", "--lake", lake).out.splitlines()
    assert told[0] == "% dataset walks: 2 clips, licence CC BY 4.0"
    assert told[-1] == CITATION
    assert motionlake("cite", "--lake", lake, "--json").json[0]["sources"][0]["homepage"] == "https://example.org/walks"
    # What the user says goes first, and stays; what else is in the lake has no citation.
    shutil.copytree(folder / "clips", tmp_path / "own")
    again = (folder, "--dataset", "walks")
    for more in ((*again, "--licence", "mine"), again, (tmp_path / "own",)):
        assert motionlake("ingest", *more, "--lake", lake, "--scheduler", scheduler).status == 0
    assert query(lake, "SELECT DISTINCT dataset, licence FROM clips ORDER BY ALL") == [("own", None), ("walks", "mine")]
    told = motionlake("cite", "--lake", lake).out.splitlines()
    assert told[0] == "% dataset own: 2 clips, licence not stated"
    assert "% dataset walks: 2 clips, licence mine" in told
    # A folder within the fetched one has its licence too; what a generator made of clips has their citations.
    run = motionlake("ingest", folder / "clips", "--dataset", "inner", "--lake", lake, "--scheduler", scheduler)
    assert f"{folder / 'SOURCE.json'}: walks" in run.err
    assert query(lake, "SELECT DISTINCT licence FROM clips WHERE dataset = 'inner'") == [("CC BY 4.0",)]
    with Changed(lake) as con:
        con.execute(
            "INSERT INTO synthetic BY NAME SELECT clip, 'm' AS model, '{}' AS config, ['c'] AS classes, 1 AS seconds, "
            "1 AS seed, 1 AS number, 1 AS pace, 1 AS temperature, clip AS seed_clip, 0 AS seed_start, 9 AS seed_stop, "
            "['walks'] AS datasets, ['l'] AS licences, clip AS key FROM clips WHERE dataset = 'own' LIMIT 1"
        )
    assert "% Walks of two https://example.org/walks" in motionlake("cite", "own/run_bob.npz", "--lake", lake).out
    (folder / "SOURCE.json").write_text('{"name": 7}', encoding="utf-8")
    run = motionlake("ingest", folder, "--dataset", "walks", "--lake", lake, "--scheduler", scheduler)
    assert (run.status, "its licence is not taken" in run.err) == (0, True)
