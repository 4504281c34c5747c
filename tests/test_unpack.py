"""Archives that mean ill: nothing lands outside of the folder, no links, no bombs, and a line that says why."""

from __future__ import annotations

import io
import shutil
import stat
import tarfile
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motionlake.errors import UserError
from motionlake.recipes import unpack as module
from motionlake.recipes.unpack import LEAST, unpack

CONTENT = {"a/walk.bvh": b"HIERARCHY\n" * 50, "a/b/run.bvh": b"MOTION\n" * 90, "readme.txt": b"hello"}


def zip_of(files: dict[str, bytes], change: Callable[[zipfile.ZipInfo], object] = lambda info: None) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name)
            info.filename = name  # as it is: ZipInfo mends some
            info.compress_type = zipfile.ZIP_DEFLATED
            change(info)
            archive.writestr(info, content)
    return buffer.getvalue()


def tar_of(
    files: dict[str, bytes], change: Callable[[tarfile.TarInfo], object] = lambda member: None, mode: str = "w:gz"
) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode=mode) as archive:  # type: ignore[call-overload]
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            change(member)
            archive.addfile(member, io.BytesIO(content))
    return buffer.getvalue()


def linked(member: tarfile.TarInfo, kind: bytes, to: str) -> None:
    member.type, member.linkname, member.size = kind, to, 0


def below(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        ("zip", zip_of(CONTENT)),
        ("tar", tar_of(CONTENT)),
        ("tar", tar_of(CONTENT, mode="w:xz")),
        ("tar", tar_of(CONTENT, mode="w:bz2")),
        ("tar", tar_of(CONTENT, mode="w")),
    ],
)
def test_archives_come_out_as_they_went_in(tmp_path: Path, kind: str, data: bytes) -> None:
    archive = tmp_path / "archive"
    archive.write_bytes(data)
    assert unpack(archive, kind, tmp_path / "all") == 3
    assert below(tmp_path / "all") == CONTENT
    assert unpack(archive, kind, tmp_path / "some", "a/b") == 1
    assert below(tmp_path / "some") == {"run.bvh": CONTENT["a/b/run.bvh"]}
    with pytest.raises(UserError, match="holds no files below c"):
        unpack(archive, kind, tmp_path / "none", "c")


def test_a_folder_of_its_own_as_an_entry(tmp_path: Path) -> None:
    """As `tar cz .` writes it."""

    def folder(member: tarfile.TarInfo) -> None:
        member.type = tarfile.DIRTYPE if member.name in (".", "./a") else tarfile.REGTYPE

    (tmp_path / "archive").write_bytes(tar_of({".": b"", "./a": b"", "./a/walk.bvh": b"x"}, folder))
    assert unpack(tmp_path / "archive", "tar", tmp_path / "new") == 1
    assert below(tmp_path / "new") == {"a/walk.bvh": b"x"}


def symlink(info: zipfile.ZipInfo) -> None:
    info.external_attr = (stat.S_IFLNK | 0o777) << 16


ESCAPES = ("../evil", "a/../../evil", "/etc/evil", "..\\evil", "C:\\evil", "c:/evil", "a/..", "\\\\host\\evil")
HOSTILE = [
    *(("zip", zip_of({name: b"x"}), "leads out of the folder") for name in ESCAPES),
    *(("tar", tar_of({name: b"x"}), "leads out of the folder") for name in ESCAPES),
    ("zip", zip_of({"link": b"/etc/passwd"}, symlink), "is a link or a device"),
    ("zip", zip_of({"a": b"x", "a/b": b"y"}), "is there twice"),
    ("tar", tar_of({"link": b""}, lambda m: linked(m, tarfile.SYMTYPE, "/etc/passwd")), "is a link, a device"),
    ("tar", tar_of({"link": b""}, lambda m: linked(m, tarfile.LNKTYPE, "../x")), "is a link, a device"),
    ("tar", tar_of({"pipe": b""}, lambda m: linked(m, tarfile.FIFOTYPE, "")), "is a link, a device"),
    ("tar", tar_of({".": b"x"}), "is a file, not a folder"),
    ("tar", tar_of({"a": b"x", "./a": b"y"}), "is there twice"),
    ("zip", zip_of({"bomb": bytes(LEAST + 1)}), "holds more than"),
    ("zip", zip_of({f"bomb{i}": bytes(LEAST // 4) for i in range(5)}), "holds more than"),
    ("tar", tar_of({"bomb": bytes(LEAST + 1)}), "holds more than"),
    ("zip", zip_of(CONTENT)[:-30], "is damaged"),
    ("tar", tar_of(CONTENT)[:-30], "is damaged"),
    ("tar", b"", "is damaged"),
    ("zip", tar_of(CONTENT), "is damaged"),
    ("tar", zip_of(CONTENT), "is damaged"),
]


@pytest.mark.parametrize(("kind", "data", "said"), HOSTILE, ids=[f"{kind}-{n}" for n, (kind, *_) in enumerate(HOSTILE)])
def test_hostile_archives_are_refused_in_a_line(tmp_path: Path, kind: str, data: bytes, said: str) -> None:
    (tmp_path / "place").mkdir()
    archive = tmp_path / "place" / "archive"
    archive.write_bytes(data)
    with pytest.raises(UserError, match=said) as error:
        unpack(archive, kind, tmp_path / "place" / "new")
    assert "\n" not in str(error.value)
    shutil.rmtree(tmp_path / "place" / "new")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [archive]


@pytest.mark.parametrize(
    ("length", "told", "kind"), [(100_000, 10, zipfile.ZIP_DEFLATED), (10, 20, zipfile.ZIP_STORED)]
)
def test_a_file_that_is_not_as_long_as_it_says(tmp_path: Path, length: int, told: int, kind: int) -> None:
    data = bytearray(zip_of({"liar.bvh": bytes(length)}, lambda info: setattr(info, "compress_type", kind)))
    for place in (data.index(b"PK\x01\x02") + 24, data.index(b"PK\x03\x04") + 22):  # both of its headers
        data[place : place + 4] = told.to_bytes(4, "little")
    (tmp_path / "archive").write_bytes(data)
    with pytest.raises(UserError, match=r"not as long as it says|is damaged"):
        unpack(tmp_path / "archive", "zip", tmp_path / "new")
    assert sum(map(len, below(tmp_path / "new").values())) <= 10


def test_no_header_takes_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tar header of extended names is read as a whole, whatever it says its length is."""
    monkeypatch.setattr(module, "_MOST_AT_ONCE", 1 << 20)
    data = tar_of({"name": b""}, lambda m: setattr(m, "pax_headers", {"comment": "x" * (4 << 20)}))
    (tmp_path / "archive").write_bytes(data)
    with pytest.raises(UserError, match="or a header of more than"):
        unpack(tmp_path / "archive", "tar", tmp_path / "new")


def test_no_more_files_than_may_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FILES", 2)
    (tmp_path / "archive").write_bytes(zip_of(CONTENT))
    with pytest.raises(UserError, match="more than 2 files"):
        unpack(tmp_path / "archive", "zip", tmp_path / "new")


@settings(max_examples=80)
@given(
    kind=st.sampled_from(["zip", "tar"]),
    cuts=st.lists(st.tuples(st.integers(0, 1 << 16), st.binary(min_size=1, max_size=6)), max_size=6),
    stop=st.integers(0, 1 << 16),
    names=st.lists(st.text("a./\\:\0é", min_size=1, max_size=8), max_size=3, unique=True),
)
def test_damage_ends_in_a_reason_and_stays_in_the_folder(
    kind: str, cuts: list[tuple[int, bytes]], stop: int, names: list[str]
) -> None:
    files = CONTENT | dict.fromkeys(names, b"x")
    plain = {name: content for name, content in files.items() if "\0" not in name}
    data = bytearray(zip_of(plain) if kind == "zip" else tar_of(plain, mode="w"))
    for place, piece in cuts:
        data[place % len(data) : place % len(data) + len(piece)] = piece
    if stop < len(data):
        del data[stop:]
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "in"
        folder.mkdir()
        (folder / "archive").write_bytes(data)
        with suppress(UserError):  # and nothing else
            unpack(folder / "archive", kind, folder / "new")
        assert {path.name for path in Path(temporary).iterdir()} == {"in"}
        assert {path.name for path in folder.iterdir()} == {"archive", "new"}
        assert not [path for path in folder.rglob("*") if path.is_symlink()]
