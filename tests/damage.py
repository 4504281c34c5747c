"""Damaged files on purpose: real clips with bytes cut off, flipped, spliced, repeated or overwritten, numbers and words
that no recording has, and damage inside of archives whose sums are right."""

from __future__ import annotations

import gzip
import io
import re
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from motionlake.formats import companions, is_clip

from tests.samples import SAMPLES, deepmimic_frames, deepmimic_text, kinect_2_from_1, ntu_text, readable

MAX_BYTES = 400_000
COMPRESSED_SHARE = 0.25
COMPANION_SHARE = 0.3

Damage = Callable[[bytes, np.random.Generator], bytes]


def truncate(data: bytes, rng: np.random.Generator) -> bytes:
    """Keep a beginning of any length."""
    return data[: rng.integers(0, len(data))]


def behead(data: bytes, rng: np.random.Generator) -> bytes:
    """Keep an end of any length."""
    return data[rng.integers(1, len(data)) :]


def flip_bits(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip one bit in each of 1 to 20 bytes."""
    damaged = bytearray(data)
    for at in rng.integers(0, len(data), rng.integers(1, 21)):
        damaged[at] ^= 1 << rng.integers(0, 8)
    return bytes(damaged)


def change_digits(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace 1 to 5 digits near the beginning, where counts and names stand, by up to 12 nines."""
    head = min(len(data), 4000)
    digits = [at for at in range(head) if data[at : at + 1].isdigit()] or [0]
    damaged = data
    for at in sorted(rng.choice(digits, rng.integers(1, 6)), reverse=True):
        damaged = damaged[:at] + b"9" * int(rng.integers(1, 13)) + damaged[at + 1 :]
    return damaged


def splice(data: bytes, rng: np.random.Generator) -> bytes:
    """Insert a piece of the file somewhere else."""
    begin, end = np.sort(rng.integers(0, len(data), 2))
    at = rng.integers(0, len(data))
    return data[:at] + data[begin : min(end, begin + 5000)] + data[at:]


def cut_out(data: bytes, rng: np.random.Generator) -> bytes:
    """Leave out a piece."""
    begin = rng.integers(0, len(data))
    return data[:begin] + data[begin + rng.integers(1, 2000) :]


def overwrite(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrite a piece with zero bytes, as a failed disk leaves it, or with noise."""
    begin, length = rng.integers(0, len(data)), int(rng.integers(1, 600))
    noise = rng.integers(0, 256, length, np.uint8).tobytes() if rng.random() < 0.5 else bytes(length)
    return (data[:begin] + noise + data[begin + length :])[: len(data)]


def swap_lines(data: bytes, rng: np.random.Generator) -> bytes:
    """Exchange two lines."""
    lines = data.split(b"\n")
    one, other = rng.integers(0, len(lines), 2)
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


_NUMBER = re.compile(rb"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?")
_WORD = re.compile(rb"[^\s,\[\]{}]+")
HUGE = (
    b"1e308",
    b"-1e308",
    b"9" * 30,
    b"1" * 900,
    b"4294967296",
    b"-1",
    b"1e-320",
    b"1e999",
    b"0x1F",
    b"1_0",
    b"1e-99999999999",
)
NO_NUMBER = (b"NaN", b"nan", b"inf", b"-Infinity", b"1.#QNAN", b"-nan(ind)", b"null", b"true", b'""', b"", b"1,5")
FOREIGN = (
    b"\xff\xfe",
    b"\xc3(",
    b"\0",
    b"\0" * 40,
    b"\xef\xbb\xbf",
    b"\xe2\x80\xae",
    b"\r",
    b"\x1b[31m",
    b"\x85",
    b"\xf0\x9f",
)


def _replaced(data: bytes, rng: np.random.Generator, pattern: re.Pattern[bytes], words: tuple[bytes, ...]) -> bytes:
    """1 to 5 of what a pattern finds, at any place or near the beginning, replaced by words."""
    reach = len(data) if rng.random() < 0.5 else min(len(data), 3000)
    for _ in range(rng.integers(1, 6)):
        found = pattern.search(data, int(rng.integers(0, reach)))
        if found is not None:
            data = data[: found.start()] + words[rng.integers(0, len(words))] + data[found.end() :]
    return data


def huge_numbers(data: bytes, rng: np.random.Generator) -> bytes:
    """Write numbers that no recording has."""
    return _replaced(data, rng, _NUMBER, HUGE)


def no_numbers(data: bytes, rng: np.random.Generator) -> bytes:
    """Write what is no number in the place of numbers."""
    return _replaced(data, rng, _NUMBER, NO_NUMBER)


def foreign_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Insert bytes that are no text, or no text that a person sees."""
    for _ in range(rng.integers(1, 6)):
        at = rng.integers(0, len(data) if rng.random() < 0.5 else min(len(data), 3000))
        data = data[:at] + FOREIGN[rng.integers(0, len(FOREIGN))] + data[at:]
    return data


def exchange_words(data: bytes, rng: np.random.Generator) -> bytes:
    """Write words of the file in the place of others."""
    words = tuple(found[0] for at in rng.integers(0, len(data), 5) if (found := _WORD.search(data, int(at))))
    return _replaced(data, rng, _WORD, words or (b"}",))


def repeat(data: bytes, rng: np.random.Generator) -> bytes:
    """Repeat a piece many times, as a program that is stuck writes it; brackets and braces among them nest."""
    begin, length = int(rng.integers(0, len(data))), int(rng.integers(1, 400))
    if rng.random() < 0.3 and (at := data.find(b"{", begin)) >= 0:
        begin, length = data.rfind(b"\n", 0, at) + 1, at + 1 - data.rfind(b"\n", 0, at)
    piece = data[begin : begin + length]
    return data[:begin] + piece * int(rng.integers(2, 200)) + data[begin:]


def within_archive(data: bytes, rng: np.random.Generator) -> bytes:
    """Damage a member of an archive and pack it again, so that all sums are right; other files as `exchange_words`."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # it was damaged before
        return exchange_words(data, rng)
    victim = sorted(members)[rng.integers(0, len(members))]
    head, damages = (
        members[victim][:128],
        (flip_bits, change_digits, huge_numbers, no_numbers, exchange_words, truncate),
    )
    if rng.random() < 0.6:  # of the header, which says shape and type
        members[victim] = damages[rng.integers(0, len(damages))](head, rng) + members[victim][128:]
    else:
        members[victim] = DAMAGES[rng.integers(0, len(DAMAGES) - 1)](members[victim] or b"0", rng)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


DAMAGES: tuple[Damage, ...] = (
    truncate,
    behead,
    flip_bits,
    change_digits,
    splice,
    cut_out,
    overwrite,
    swap_lines,
    huge_numbers,
    no_numbers,
    foreign_bytes,
    exchange_words,
    repeat,
    within_archive,
)


def damaged_bytes(good: bytes, count: int, seed: int) -> Iterator[bytes]:
    """`count` damaged copies of a file, of every kind of damage in turn, half of them by its first kilobyte alone."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        damage = DAMAGES[number // 2 % len(DAMAGES)]
        yield damage(good, rng) if number % 2 else damage(good[:1024], rng) + good[1024:]


def gather(recordings: Path, folder: Path) -> None:
    """Small real clips of every format; NTU files hold real Kinect motion."""
    folder.mkdir()
    bvh = sorted((recordings / "bandai1" / "clips").rglob("*.bvh"), key=lambda path: path.stat().st_size)[:12]
    amc = sorted((recordings / "hdm05" / "clips").rglob("*.amc"), key=lambda path: path.stat().st_size)[:12]
    npz = sorted((recordings / "utd_mhad" / "clips").glob("*.npz"))[::70]
    for path in [*bvh, *amc, *npz, *(recordings / "hdm05" / "clips").glob("*.asf")]:
        shutil.copy(path, folder / path.name)
    for path in npz[:6]:
        with np.load(path, allow_pickle=False) as archive:
            body = kinect_2_from_1(archive["positions"].astype(np.float64))
        beside = body[:-5] + np.array([1.0, 0.0, 0.2])
        bodies = [("72057594037944738", 0, body), ("72057594037944739", 5, beside)]
        (folder / f"{path.stem}.skeleton").write_text(ntu_text(bodies, newline="\r\n"), newline="")
    (folder / "humanoid3d_made.txt").write_text(deepmimic_text(deepmimic_frames(60)))


def gather_made(folder: Path) -> None:
    """Small made clips of every format, where there are no recordings."""
    folder.mkdir()
    for suffix in readable():
        data = SAMPLES[suffix](folder)
        (folder / f"sample{suffix}").write_bytes(data)


def damaged_files(source: Path, target: Path, count: int, seed: int) -> list[Path]:
    """Write `count` damaged copies of the clips under a folder, every format equally often.

    Each lies in a folder of its own under its clip's name, with its companions (an .asf) beside it, so that
    only the damage is wrong with it. A part of them is damaged within a gzip stream, or the stream itself
    is; for a part of the clips with companions the companion is damaged instead.

    Args:
        source: searched for clips of at most `MAX_BYTES`, names in order.
        target: receives the folders.
        count: how many.
        seed: the same seed gives the same bytes.

    Returns:
        The damaged clips' paths.
    """
    rng = np.random.default_rng(seed)
    by_suffix: dict[str, list[Path]] = {}
    for path in sorted(source.rglob("*")):
        if path.is_file() and path.stat().st_size <= MAX_BYTES and is_clip(path):
            by_suffix.setdefault(path.name.removesuffix(".gz").rpartition(".")[2], []).append(path)
    suffixes = sorted(by_suffix)
    made = []
    for index in range(count):
        clips = by_suffix[suffixes[index % len(suffixes)]]
        clip = clips[rng.integers(0, len(clips))]
        damage = DAMAGES[index // len(suffixes) % len(DAMAGES)]
        folder = target / f"{index:04d}_{damage.__name__}"
        folder.mkdir(parents=True)
        made.append(_damage_into(folder, clip, damage, rng))
    return made


def _damage_into(folder: Path, clip: Path, damage: Damage, rng: np.random.Generator) -> Path:
    data = clip.read_bytes()
    others = companions(clip)
    victim = int(rng.integers(0, len(others))) if others and rng.random() < COMPANION_SHARE else None
    for number, other in enumerate(others):
        content = other.read_bytes()
        (folder / other.name).write_bytes(damage(content, rng) if number == victim else content)
    path = folder / clip.name
    if victim is not None:
        path.write_bytes(data)
    elif not clip.name.endswith(".gz") and rng.random() < COMPRESSED_SHARE:
        path = folder / f"{clip.name}.gz"
        within = rng.random() < 0.5
        stream = gzip.compress(damage(data, rng) if within else data, mtime=0)
        path.write_bytes(stream if within else damage(stream, rng))
    else:
        path.write_bytes(damage(data, rng))
    return path
