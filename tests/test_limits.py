"""What one file may ask for: bombs of every format are turned away before room is made for them."""

from __future__ import annotations

import gzip
import io
import re
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats import read_clips
from motionlake.formats.limits_config import MIB, Limits

from tests.lakes import motionlake, query, quick_lake, tables
from tests.marker_samples import mot_text, motive_skeleton, motive_text, walking_angles
from tests.samples import (
    AMC,
    ASF,
    BVH,
    KINECT_1,
    KINECT_1_PARENTS,
    SAMPLES,
    deepmimic_frames,
    deepmimic_text,
    kinect_2_from_1,
    npz_bytes,
    ntu_text,
    readable,
    swinging_body,
    table_parquet,
    table_text,
)

SMALL = Limits(file_megabytes=24, frames=1_000, joints=40, bodies=3, memory_megabytes=32)
ROW = next(line for line in BVH.splitlines() if line[:1].isdigit() or line[:1] == "-")
SKELETON = ntu_text([("7", 0, kinect_2_from_1(swinging_body(12)))])
BODY = SKELETON.partition("\n1\n")[2].partition("\n1\n")[0]  # of one frame


def archive(**members: bytes) -> bytes:
    """An `.npz` of a good clip, some arrays of which are other bytes."""
    good = zipfile.ZipFile(io.BytesIO(npz_bytes(swinging_body(12), KINECT_1, KINECT_1_PARENTS, 30.0)))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target:
        for name in good.namelist():
            target.writestr(name, members.get(name.removesuffix(".npy"), good.read(name)))
    return stream.getvalue()


def array(shape: tuple[int, ...], dtype: str, size: int) -> bytes:
    """An array as its file has it, with so many zero bytes of content."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue() + bytes(size)


def many_entries() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as target:
        for index in range(1_500):
            target.writestr(str(index), b"")
    return stream.getvalue()


def nested(joints: int) -> str:
    """A BVH whose joints hang in one chain."""
    inner = "".join(f"JOINT j{i}\n{{\nOFFSET 0 1 0\n" for i in range(joints)) + "}\n" * joints
    head = f"HIERARCHY\nROOT Hips\n{{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n{inner}}}\n"
    return head + "MOTION\nFrames: 2\nFrame Time: 0.1\n0 0 0\n0 0 0\n"


def frames_of_bvh(count: int) -> str:
    head = BVH[: BVH.index("Frames:")]
    return f"{head}Frames: {count}\nFrame Time: 0.1\n" + f"{ROW}\n" * count


def frames_of_amc(count: int) -> str:
    start, bones = AMC.partition("\n1\n")[0], AMC.partition("\n1\n")[2].partition("\n2\n")[0]
    return start + "".join(f"\n{number}\n{bones}" for number in range(1, count + 1)) + "\n"


def bones_of_asf(count: int) -> str:
    bone = "begin\nname b{i}\ndirection 0 1 0\nlength 1\naxis 0 0 0 XYZ\nend\n"
    return ASF.replace(":hierarchy", "".join(bone.format(i=i) for i in range(count)) + ":hierarchy", 1)


def c3d_with(change: Callable[[bytearray], None]) -> bytes:
    """A good C3D some bytes of which are others."""
    data = bytearray(SAMPLES[".c3d"](Path()))
    change(data)
    return bytes(data)


def many_points(data: bytearray) -> None:
    data[2:4] = b"\xff\xff"


def many_frames(data: bytearray) -> None:
    at = data.index(b"ACTUAL_END_FIELD") + 22
    data[at : at + 2] = b"\xff\xff"


def many_labels(data: bytearray) -> None:
    at = data.index(b"LABELS") + 10
    data[at : at + 2] = b"\xff\xff"


def joint_names(count: int) -> list[str]:
    return [f"part{number}" for number in range(count)]


BOMBS: dict[str, tuple[str, Callable[[], str | bytes], str]] = {
    "frames of bvh": ("x.bvh", lambda: frames_of_bvh(1_200), r"line \d+: has 1200 frames; \[limits\] frames = 1000"),
    "joints of bvh": ("x.bvh", lambda: nested(41), r"line \d+: has too many joints; \[limits\] joints = 40"),
    "header of bvh": ("x.bvh", lambda: "HIERARCHY\n" + "a " * (3 * MIB) + "\nMOTION\n", "no line MOTION"),
    "frames of amc": ("x.amc", lambda: frames_of_amc(1_200), r"line \d+: has 1002 frames; \[limits\] frames = 1000"),
    "no frame in amc": ("x.amc", lambda: "\n" * 200_000, "is empty|no frame in its first 128 KiB"),
    "comments of amc": ("x.amc", lambda: "#\n" * 100_000, "no frame in its first 128 KiB"),
    "length of skeleton": (
        "x.skeleton",
        lambda: f"2000002\n1\n{BODY}\n" + "0\n" * 2_000_000 + f"1\n{BODY}\n",
        r"has 2000002 frames; \[limits\] frames = 1000",
    ),
    "bodies of skeleton": (
        "x.skeleton",
        lambda: ntu_text([(str(i), 0, kinect_2_from_1(swinging_body(12))) for i in range(4)]),
        r"holds 4 bodies; \[limits\] bodies = 3",
    ),
    "lists of json": (
        "x.txt",
        lambda: '{"Frames": [' + "[]," * (4 * MIB) + "[]]}",
        r"MiB of memory; \[limits\] memory",
    ),
    "nested lists": (
        "x.txt",
        lambda: '{"Frames": ' + "[" * 50_000 + "]" * 50_000 + "}",
        "not JSON|no list of numbers|1 frame",
    ),
    "frames of json": ("x.txt", lambda: deepmimic_text(deepmimic_frames(1_001)), r"has 1001 frames; \[limits\] frames"),
    "frames of npz": (
        "x.npz",
        lambda: archive(positions=array((100_000, 20, 3), "<f4", 24_000_000)),
        "has 100000 frames",
    ),
    "joints of npz": (
        "x.npz",
        lambda: archive(positions=array((2, 1_000_000, 3), "<f4", 24_000_000)),
        "has 1000000 joints",
    ),
    "frames of npy": ("x.npy", lambda: array((20_000, 263), "<f4", 21_040_000), "has 20000 frames"),
    "size of npz": ("x.npz", lambda: archive(positions=array((100, 20, 3000), "<f8", 48_000_000)), "bytes long"),
    "names of npz": ("x.npz", lambda: archive(joints=array((20,), "<U300000", 24_000_000)), "24000000 bytes long"),
    "rate of npz": ("x.npz", lambda: archive(fps=array((6_000_000,), "<f4", 24_000_000)), "24000000 bytes long"),
    "a shape past all numbers": ("x.npz", lambda: archive(fps=array((2**80, 0), "<f4", 0)), "damaged|one number"),
    "entries of npz": ("x.npz", many_entries, "more than 1000 files"),
    "frames of csv": (
        "x.csv",
        lambda: table_text(np.ones((2, 20, 3)), KINECT_1) + "0\n" * 8_000_000,
        r"has 8000002 frames; \[limits\] frames = 1000",
    ),
    "joints of csv": ("x.csv", lambda: table_text(np.ones((2, 41, 3)), joint_names(41)), "has 41 joints"),
    "columns of csv": ("x.csv", lambda: "a," * 100_000 + "\n", r"has 100000 columns; \[limits\] joints = 40"),
    "a row of csv": (
        "x.csv",
        lambda: table_text(np.ones((1, 20, 3)), KINECT_1) + "1," * (8 * MIB),
        r"fields, not 61|straddling",
    ),
    "header of csv": ("x.csv", lambda: "a" * (20 * MIB), "no columns of joints"),
    "map of csv": ("mapped.csv", lambda: table_text(np.ones((2, 20, 3)), KINECT_1), r"columns.toml: is larger than"),
    "frames of parquet": (
        "x.parquet",
        lambda: table_parquet(np.ones((100_000, 20, 3)), KINECT_1),
        r"has 100000 frames; \[limits\] frames = 1000",
    ),
    "columns of parquet": (
        "x.parquet",
        lambda: table_parquet(np.ones((2, 300, 3)), joint_names(300)),
        r"has 901 columns; \[limits\] joints = 40",
    ),
    "a stream of zeros": (
        "x.bvh.gz",
        lambda: gzip.compress(b"0 " * (20 * MIB)),
        r"too large once decompressed; \[limits\]",
    ),
    "points of c3d": ("x.c3d", lambda: c3d_with(many_points), r"has 65535 joints; \[limits\] joints = 40"),
    "frames of c3d": ("x.c3d", lambda: c3d_with(many_frames), r"has \d{5,} frames; \[limits\] frames = 1000"),
    "names of c3d": ("x.c3d", lambda: c3d_with(many_labels), "has no named points"),
    "rows of mot": (
        "x.mot",
        lambda: mot_text(walking_angles()).replace("nRows=12", "nRows=999999999999"),
        r"has \d+ frames; \[limits\] frames|rows declared, 12 found",
    ),
    "frames of mot": ("x.mot", lambda: mot_text(walking_angles(1_200)), r"has 1200 frames; \[limits\] frames = 1000"),
    "columns of mot": ("x.mot", lambda: "endheader\n" + "a " * (8 * MIB) + "\n", r"its columns is \d+ bytes long"),
    "instants of mot": (
        "x.mot",
        lambda: mot_text(walking_angles() | {"time": np.array([*np.arange(11) / 1e6, 1e4])}),
        r"frames; \[limits\]",
    ),
    "frames of motive": (
        "x.csv",
        lambda: motive_text(motive_skeleton(1_200)),
        r"has 120\d frames; \[limits\] frames = 1000",
    ),
    "columns of motive": (
        "x.csv",
        lambda: "Format Version,1.23\n\n," + "Bone," * (4 * MIB) + "\n",
        r"header is \d+ bytes long|bones or more; \[limits\] joints = 40",
    ),
    "header of motive": ("x.csv", lambda: "Format Version,1.23\n" * 400_000, "no line that begins with Frame"),
    "a large file": ("x.bvh", lambda: b"0" * (25 * MIB), r"is too large; \[limits\] file_megabytes = 24"),
}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Code that readers compile takes memory, too."""
    folder = tmp_path_factory.mktemp("good")
    for suffix in readable():
        data = SAMPLES[suffix](folder)
        (folder / f"sample{suffix}").write_bytes(data)
        assert read_clips(folder / f"sample{suffix}", allowed=SMALL)


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_turned_away_before_room_is_made_for_it(name: str, tmp_path: Path) -> None:
    file, make, reason = BOMBS[name]
    content = make()
    data = content.encode() if isinstance(content, str) else content
    (tmp_path / file).write_bytes(data)
    (tmp_path / "x.asf").write_text(ASF)
    if file == "mapped.csv":
        (tmp_path / "columns.toml").write_text("\n" * (2 * MIB))
    plain = SMALL.file_bytes if file.endswith(".gz") else len(data)
    del content, data
    tracemalloc.start()
    try:
        with pytest.raises(ClipError, match=reason):
            read_clips(tmp_path / file, allowed=SMALL)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2.2 * plain + 24 * MIB


def test_a_skeleton_of_too_many_bones_is_turned_away(tmp_path: Path) -> None:
    (tmp_path / "x.amc").write_text(AMC)
    (tmp_path / "x.asf").write_text(bones_of_asf(50))
    with pytest.raises(ClipError, match=r"x.asf has too many bones; \[limits\] joints = 40"):
        read_clips(tmp_path / "x.amc", allowed=SMALL)
    (tmp_path / "x.asf").write_text(ASF + "\n" * (9 * MIB))
    with pytest.raises(ClipError, match="is larger than"):
        read_clips(tmp_path / "x.amc")


def replaced(text: str, number: int, value: str) -> str:
    """The text with another number in the place of one of those of its last lines, counted from the end."""
    found = list(re.finditer(r"(?<=\s)-?[\d.]+(?=\s)", text))[-number]
    return text[: found.start()] + value + text[found.end() :]


@pytest.mark.parametrize("value", ["1e308", "-1e308", "1000001", "100000000000000000000000"])
def test_an_absurd_rotation_is_rejected_with_its_line(value: str, tmp_path: Path) -> None:
    (tmp_path / "x.asf").write_text(ASF)
    for name, text in (("x.bvh", BVH), ("x.amc", AMC)):
        text = text.rstrip() + "\n"
        (tmp_path / name).write_text(replaced(text, 1, value))
        with pytest.raises(ClipError, match="is absurdly large") as caught:
            read_clips(tmp_path / name)
        assert caught.value.line == text.count("\n"), name


def test_an_absurd_bone_is_rejected_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "x.bvh").write_text(BVH.replace("20.5", "1e300"))
    with pytest.raises(ClipError, match=r"line 8: '1e300' is absurdly large"):
        read_clips(tmp_path / "x.bvh")
    (tmp_path / "x.amc").write_text(AMC)
    (tmp_path / "x.asf").write_text(re.sub(r"length \S+", "length 1e300", ASF))
    with pytest.raises(ClipError, match=r"x.asf, line \d+: an absurdly large number"):
        read_clips(tmp_path / "x.amc")


def test_large_numbers_that_recordings_have_are_read(tmp_path: Path) -> None:
    (tmp_path / "x.bvh").write_text(replaced(BVH.rstrip() + "\n", 1, "-99999.5"))
    assert read_clips(tmp_path / "x.bvh")[0].channels[-1, -1] == -99999.5


@pytest.mark.parametrize("text", ["frames = 0", "seconds = -1", "frames = 1.5"])
def test_a_limit_that_lets_nothing_pass_is_a_mistake(text: str, tmp_path: Path) -> None:
    lake = quick_lake(tmp_path / "lake", f"[limits]\n{text}\n")
    run = motionlake("run", "all", "--lake", lake)
    assert run.status == 2
    assert "[limits]" in run.err


def test_what_a_limit_turned_away_is_read_when_it_is_raised(tmp_path: Path, scheduler: str) -> None:
    """And nothing else is read again, whether limits rise or fall."""
    folder = tmp_path / "clips"
    folder.mkdir()
    for count in (30, 60, 90):
        (folder / f"{count}.txt").write_text(deepmimic_text(deepmimic_frames(count)))
    (folder / "huge.txt").write_text(deepmimic_text(deepmimic_frames(4_000)))
    (folder / "bad.bvh").write_text("no clip")
    lake = quick_lake(tmp_path / "lake")
    config = (lake / "config.toml").read_text()

    def ingest(limits: str) -> tuple[int, int, int]:
        (lake / "config.toml").write_text(f"{config}\n[limits]\n{limits}\n")
        run = motionlake("ingest", folder, "--lake", lake, "--scheduler", scheduler, "--json")
        return run.json["clips"], run.json["rejected"], run.json["unchanged"]

    assert ingest("frames = 50\nfile_megabytes = 1") == (1, 4, 0)
    reasons = dict(query(lake, "SELECT path, reason FROM rejects"))
    assert reasons["60.txt"] == "has 60 frames; [limits] frames = 50 in config.toml"
    assert reasons["huge.txt"] == "is too large; [limits] file_megabytes = 1 in config.toml"
    before = {name: rows for name, rows in tables(lake).items() if name != "settings"}
    assert ingest("frames = 50\nfile_megabytes = 1") == (0, 4, 5)
    assert ingest("frames = 20\nfile_megabytes = 1") == (0, 4, 5)
    assert {name: rows for name, rows in tables(lake).items() if name != "settings"} == before
    assert ingest("frames = 60\nfile_megabytes = 1") == (1, 3, 3)
    assert ingest("frames = 60\nfile_megabytes = 9") == (0, 3, 4)
    assert ingest("seconds = 60") == (2, 1, 3)
    assert query(lake, "SELECT path FROM rejects") == [("bad.bvh",)]
    assert query(lake, "SELECT count(*) FROM frames") == [(30 + 60 + 90 + 4_000,)]
