"""What every reader of the registry owes its callers: one test body over all of them."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from motionlake.errors import ClipError
from motionlake.formats.registry import Reader, companions, is_clip, read_clips, reader_for, readers
from motionlake.motion.clip import ChannelKind, SourceClip
from motionlake.motion.kinematics import solve

from tests.samples import BINARY, SAMPLES, SHARED, lacking

CASES = [pytest.param(reader, id=reader.name) for reader in readers()]
CHANNELS = {
    ChannelKind.EULER: {f"{axis}{what}" for axis in "XYZ" for what in ("position", "rotation")},
    ChannelKind.QUATERNION: {f"{axis}position" for axis in "XYZ"} | {f"{axis}quaternion" for axis in "WXYZ"},
    ChannelKind.POSITIONS: {"x", "y", "z"},
}


def suffix_of(reader: Reader) -> str:
    suffix = SHARED.get(reader.name) or next((suffix for suffix in reader.suffixes if suffix in SAMPLES), None)
    assert suffix is not None, f"add a sample of {reader.name} to tests/samples.py"
    if reason := lacking(suffix):
        pytest.skip(reason)
    return suffix


def sample(reader: Reader, folder: Path) -> tuple[Path, bytes]:
    folder.mkdir(exist_ok=True)
    suffix = suffix_of(reader)
    data = SAMPLES[suffix](folder)
    path = folder / f"sample{suffix}"
    path.write_bytes(data)
    return path, data


def assert_same(one: list[SourceClip], two: list[SourceClip]) -> None:
    assert len(one) == len(two)
    for left, right in zip(one, two, strict=True):
        assert left.hierarchy.joints == right.hierarchy.joints
        assert left.hierarchy.channel_names == right.hierarchy.channel_names
        np.testing.assert_array_equal(left.hierarchy.offsets, right.hierarchy.offsets)
        np.testing.assert_array_equal(left.channels, right.channels)
        assert (left.fps, left.body, left.notes) == (right.fps, right.body, right.notes)


@pytest.mark.parametrize("reader", CASES)
def test_the_user_may_say_the_frame_rate(reader: Reader, tmp_path: Path) -> None:
    path, _ = sample(reader, tmp_path)
    told = read_clips(path, fps=57.5)
    assert {clip.fps for clip in told} == {57.5}
    for one, two in zip(told, read_clips(path), strict=True):
        np.testing.assert_array_equal(one.channels, two.channels)
        assert not any("frame rate" in note for note in one.notes)


@pytest.mark.parametrize("reader", CASES)
def test_a_good_clip_keeps_the_contract(reader: Reader, tmp_path: Path) -> None:
    path, _ = sample(reader, tmp_path)
    assert reader_for(path) is reader
    assert is_clip(path)
    told_by_name = not hasattr(reader, "sniff") and not hasattr(reader, "recognises")
    assert is_clip(path.with_name("SAMPLE" + path.suffix.upper())) or not told_by_name
    assert all(other.is_file() for other in companions(path))
    clips = read_clips(path)
    assert clips
    for clip in clips:
        hierarchy = clip.hierarchy
        count = len(hierarchy.joints)
        assert len(set(hierarchy.joints)) == count
        assert hierarchy.parents[0] == -1
        assert all(0 <= parent < joint for joint, parent in enumerate(hierarchy.parents) if joint)
        assert len(hierarchy.parents) == len(hierarchy.channels) == count
        assert hierarchy.offsets.shape == (count, 3)
        assert hierarchy.axes.shape == (count, 4)
        np.testing.assert_allclose(np.linalg.norm(hierarchy.axes, axis=1), 1.0, atol=1e-12)
        assert clip.channels.dtype == np.float64
        assert clip.channels.shape[1] == sum(map(len, hierarchy.channels))
        assert set().union(*hierarchy.channels) <= CHANNELS[hierarchy.kind]
        assert all(0 <= joint < count for joint, _ in hierarchy.end_sites)
        assert np.isfinite(solve(clip).positions).all()


@pytest.mark.parametrize("reader", CASES)
def test_the_same_bytes_give_the_same_clip(reader: Reader, tmp_path: Path) -> None:
    path, data = sample(reader, tmp_path)
    clips = read_clips(path)
    assert_same(clips, read_clips(path))
    twin = path.with_name(path.name + ".gz")
    twin.write_bytes(gzip.compress(data))
    assert is_clip(twin)
    assert_same(clips, read_clips(twin))
    if path.suffix in BINARY:
        return
    byte_order_mark = b"\xef\xbb\xbf" + data
    for variant in (data.replace(b"\n", b"\r\n"), data.rstrip(), data + b"\n\n", byte_order_mark):
        path.write_bytes(variant)
        assert_same(clips, read_clips(path))


@pytest.mark.parametrize("reader", CASES)
def test_a_file_cut_short_is_rejected_or_has_no_more_frames(reader: Reader, tmp_path: Path) -> None:
    path, data = sample(reader, tmp_path)
    whole = read_clips(path)
    rejected = 0
    for length in range(0, len(data) - 1, max(1, len(data) // 60)):
        path.write_bytes(data[:length])
        try:
            cut = read_clips(path)
        except ClipError:
            rejected += 1
            continue
        assert len(cut) <= len(whole)
        assert all(len(clip.channels) <= len(whole[0].channels) for clip in cut)
    assert rejected > 40


@pytest.mark.parametrize("reader", CASES)
def test_what_is_no_clip_is_rejected_with_one_line(reader: Reader, tmp_path: Path) -> None:
    path, _ = sample(reader, tmp_path)
    rng = np.random.default_rng(7)
    contents = [b"", b"\n \n", b"\0" * 5000, b"[" * 5000, b"1 " * 5000, b"{}", b"\xff\xfe"]
    contents += [rng.integers(0, 256, size, np.uint8).tobytes() for size in (1, 100, 4000)]
    for content in contents:
        path.write_bytes(content)
        with pytest.raises(ClipError) as caught:
            read_clips(path)
        assert str(caught.value)
        assert "\n" not in str(caught.value)


def test_of_readers_of_one_suffix_the_one_that_claims_a_file_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Plain:
        name = "plain"
        suffixes: tuple[str, ...] = (".moves",)

        def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
            return []

    class Marked(Plain):
        name = "marked"

        def claims(self, path: Path) -> bool:
            return path.is_file() and path.read_bytes().startswith(b"marked")

    plain: Reader = Plain()
    marked: Reader = Marked()
    file = tmp_path / "walk.moves"
    for order in ((plain, marked), (marked, plain)):
        monkeypatch.setattr("motionlake.formats.registry.readers", lambda found=order: found)
        file.write_bytes(b"marked 1 2 3")
        assert reader_for(file) is marked
        file.write_bytes(b"1 2 3")
        assert reader_for(file) is plain
    monkeypatch.setattr("motionlake.formats.registry.readers", lambda: (marked,))
    assert reader_for(file) is marked


def test_of_readers_that_claim_none_the_one_that_knows_a_file_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Begins:
        suffixes: tuple[str, ...] = (".moves",)

        def __init__(self, mark: bytes) -> None:
            self.name, self._mark = mark.decode(), mark

        def sniff(self, head: bytes) -> bool:
            return head.startswith(self._mark)

        def read(self, data: bytes, path: Path, fps: float | None = None) -> list[SourceClip]:
            return []

    class Named(Begins):
        def recognises(self, path: Path) -> bool:
            return self._mark.decode() in path.name

        sniff = None  # type: ignore[assignment]

    class Claiming(Begins):
        sniff = None  # type: ignore[assignment]

        def claims(self, path: Path) -> bool:
            return path.is_file() and path.read_bytes().startswith(self._mark)

    one, named, claiming = Begins(b"one"), Named(b"two"), Claiming(b"three")
    contents = {"one.moves": b"one 1", "two.moves": b"1", "three.moves": b"three 1", "none.moves": b"1 2 3"}
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    for order in ((one, named, claiming), (claiming, named, one), (named, claiming, one)):
        monkeypatch.setattr("motionlake.formats.registry.readers", lambda found=order: found)
        found = [(reader_for(tmp_path / name), is_clip(tmp_path / name)) for name in contents]
        assert found[:3] == [(one, True), (named, True), (claiming, True)]
        assert not found[3][1]
        assert not is_clip(tmp_path / "absent.moves")
