"""Damaged files on purpose: real clips with bytes cut off, flipped, spliced, repeated or overwritten."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
from motionlake.formats import companions, is_clip

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


DAMAGES: tuple[Damage, ...] = (
    truncate,
    behead,
    flip_bits,
    change_digits,
    splice,
    cut_out,
    overwrite,
    swap_lines,
)


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
