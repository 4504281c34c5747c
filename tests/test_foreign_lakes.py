"""Lakes that nobody may write to, and of other users: they are searched, and what may not be read is told of."""

from __future__ import annotations

import os
import pwd
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.lakes import files, motionlake, query

NOBODY = 65534


@contextmanager
def unprivileged() -> Iterator[None]:
    """As a user whom the modes of files bind; root becomes nobody."""
    root = os.geteuid() == 0
    if root:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that any user can see, and its folder `out` that any can write to."""
    with tempfile.TemporaryDirectory(prefix="foreign-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        (folder / "out").mkdir()
        (folder / "out").chmod(0o777)
        yield folder


@pytest.fixture
def foreign(place: Path, built_lake: Path) -> Iterator[Path]:
    """A lake that nobody may write to."""
    lake = Path(shutil.copytree(built_lake, place / "lake"))
    everything = [lake, *lake.rglob("*")]
    for path in everything:
        path.chmod(path.stat().st_mode & 0o555)
    yield lake
    for path in everything:
        path.chmod(0o755)


def asked(lake: Path, clips_folder: Path, out: Path) -> list[tuple[object, ...]]:
    """Commands that only read."""
    clip = query(lake, "SELECT min(clip) FROM clips")[0][0]
    outside = next(p for p in sorted(clips_folder.rglob("*")) if p.suffix in (".npz", ".bvh"))
    return [
        ("status",), ("search", clip), ("search", outside), ("search", clip, "--method", "descriptor"),
        ("find", clip, "--from", "0", "--to", "30"), ("align", clip, "--whole"), ("duplicates",),
        ("sql", "SELECT count(*) FROM frames"), ("sql", f"FROM similar_clips('{clip}', 3)"),
        ("export", clip, "-o", out / "clip.bvh"), ("view", clip, "--out", out / "clip.html"),
    ]  # fmt: skip


def test_a_lake_that_nobody_may_write_to_is_searched(foreign: Path, clips_folder: Path, place: Path) -> None:
    commands = asked(foreign, clips_folder, place / "out")
    before = files(foreign)
    # Once as root, which imports what nobody may not find where root has the interpreter.
    expected = [motionlake(*words, "--lake", foreign) for words in commands]
    for path in (place / "out").iterdir():
        path.unlink()
    source = Path(shutil.copy(str(commands[2][1]), place / "out"))
    commands[2] = ("search", source)
    with unprivileged():
        found = [motionlake(*words, "--lake", foreign) for words in commands]
        written = [motionlake(*words, "--lake", foreign) for words in (("run", "all"), ("remove", "--gone"))]
    for wanted, run in zip(expected, found, strict=True):
        assert (run.status, run.out) == (wanted.status, wanted.out), run.err
        assert run.status == 0
    owner = pwd.getpwuid(foreign.stat().st_uid).pw_name
    for run in written:
        assert run.status == 2
        assert run.err.startswith(f"motionlake: {foreign}/.lock: Permission denied; it belongs to {owner} (mode 444)")
    assert files(foreign) == before


@pytest.mark.parametrize("pattern", ["catalog.duckdb", "config.toml", "frames/*/*.parquet", "models", "."])
def test_what_may_not_be_read_is_told_with_its_owner(foreign: Path, pattern: str) -> None:
    (path,) = list(foreign.glob(pattern))[:1] if pattern != "." else [foreign]
    words = ("sql", "SELECT sum(root_y) FROM frames") if "frames" in pattern else ("status",)
    assert motionlake(*words, "--lake", foreign).status == 0
    path.chmod(0)
    with unprivileged():
        run = motionlake(*words, "--lake", foreign)
    path.chmod(0o555)
    assert run.status == 2
    assert run.err.count("\n") == 1
    assert f"{path}" in run.err
    assert "Permission denied; it" in run.err
    assert f"belongs to {path.owner()} (mode 0)" in run.err


def test_others_may_read_what_a_command_writes(built_lake: Path) -> None:
    modes = {p.relative_to(built_lake).as_posix(): p.stat().st_mode for p in built_lake.rglob("*") if p.is_file()}
    assert not [name for name, mode in modes.items() if not mode & stat.S_IROTH]
