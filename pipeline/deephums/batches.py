"""Variants of clips to train on: other speeds, views and bodies, noise, missing joints, limbs of another clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from motionlake.arrays import Float32Array, Float64Array
from motionlake.motion.resampling import beside, paced_places
from motionlake.motion.skeleton import COMMON
from torch import Tensor

LIMBS: Final = tuple(
    [COMMON.index(f"{side}_{joint}") for joint in joints]
    for joints in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
    for side in ("left", "right")
)
_SWAPPED: Final = [
    COMMON.index(name.replace("left", "l").replace("right", "left").replace("l_", "right_"))
    if name.startswith(("left", "right"))
    else i
    for i, name in enumerate(COMMON)
]


@dataclass(frozen=True)
class Augmentation:
    """How far variants go; 0 leaves that out.

    Attributes:
        crop: most of the clip's length cut off at either end.
        warp: how much faster or slower the motion runs in parts, as a share of its speed.
        yaw: standard deviation of a turn about the vertical, radians.
        tilt: of a turn about the left-right axis, radians.
        scale: of the stretch of each axis.
        offset: of a displacement of each joint that stays, body lengths.
        noise: of a displacement of each joint in each frame, body lengths.
        missing: mean share of joints that are not seen in any frame, from none to twice as many.
        limbs: chance that a clip takes some limbs from another of its class, where classes are known.
        mirror: chance that left and right are swapped.
    """

    crop: float = 0.1
    warp: float = 0.4
    yaw: float = 0.15
    tilt: float = 0.1
    scale: float = 0.08
    offset: float = 0.03
    noise: float = 0.01
    missing: float = 0.15
    limbs: float = 0.5
    mirror: float = 0.0

    def __call__(self, clips: Tensor, rng: np.random.Generator, partners: Tensor | None = None) -> Tensor:
        """A variant of each clip.

        Args:
            clips: [B, T, 15, 3].
            rng: what chance is drawn from.
            partners: [B, T, 15, 3] another clip of the same class each.
        """
        varied = self._moved(clips, rng)
        if self.limbs and partners is not None:
            varied = self._with_limbs(varied, self._moved(partners, rng), rng)
        if self.mirror:
            chosen = torch.from_numpy(rng.random((len(clips), 1, 1, 1)) < self.mirror)
            varied = torch.where(chosen, torch.from_numpy(mirrored(varied.numpy())), varied)
        if self.missing:
            shares = 2 * self.missing * rng.random((len(clips), 1, 1, 1))
            varied = varied * torch.from_numpy(rng.random((len(clips), 1, len(COMMON), 1)) >= shares)
        return varied

    def _moved(self, clips: Tensor, rng: np.random.Generator) -> Tensor:
        count, frames = clips.shape[:2]
        varied = _interpolated(clips, self._instants(count, frames, rng))
        varied = torch.cat([varied[:, :, :1] - varied[:, :1, :1], varied[:, :, 1:]], dim=2)
        turns = _turns(rng.normal(0, self.yaw, count), 1) @ _turns(rng.normal(0, self.tilt, count), 0)
        varied = torch.einsum("btjx,bxy->btjy", varied, torch.from_numpy(turns.astype(np.float32)))
        varied = varied * _normal(rng, (count, 1, 1, 3), self.scale, 1.0)
        varied = varied + _normal(rng, (count, 1, len(COMMON), 3), self.offset)
        return varied + _normal(rng, tuple(varied.shape), self.noise)

    def _instants(self, count: int, frames: int, rng: np.random.Generator) -> Float64Array:
        """[B, T] where in a clip, from 0 to T - 1, each frame of its variant is taken."""
        start, stop = rng.random((2, count, 1)) * self.crop
        time = np.linspace(0, 1, frames)[None]
        once, twice = rng.uniform(-self.warp, self.warp, (2, count, 1))
        time = time + once * np.sin(np.pi * time) / np.pi + 0.5 * twice * np.sin(2 * np.pi * time) / (2 * np.pi)
        return np.asarray((start + (1 - stop - start) * time).clip(0, 1) * (frames - 1))

    def _with_limbs(self, clips: Tensor, partners: Tensor, rng: np.random.Generator) -> Tensor:
        taken = np.zeros((len(clips), 1, len(COMMON), 1), dtype=bool)
        mixed = rng.random(len(clips)) < self.limbs
        for limb in LIMBS:
            taken[:, 0, limb, 0] = (mixed & (rng.random(len(clips)) < 0.3))[:, None]
        return torch.where(torch.from_numpy(taken), partners, clips)


def _normal(rng: np.random.Generator, shape: tuple[int, ...], deviation: float, mean: float = 0.0) -> Tensor:
    drawn = rng.standard_normal(shape, dtype=np.float32)
    return torch.from_numpy(drawn * np.float32(deviation) + np.float32(mean))


def _turns(angles: Float64Array, axis: int) -> Float64Array:
    """[B, 3, 3] turns of row vectors about an axis."""
    cos, sin = np.cos(angles), np.sin(angles)
    turns = np.zeros((len(angles), 3, 3))
    a, b = [i for i in range(3) if i != axis]
    turns[:, axis, axis] = 1
    turns[:, a, a] = turns[:, b, b] = cos
    turns[:, a, b], turns[:, b, a] = -sin, sin
    return turns


def _interpolated(clips: Tensor, instants: Float64Array) -> Tensor:
    frames = clips.shape[1]
    before = np.minimum(instants.astype(np.int64), max(0, frames - 2))
    share = torch.from_numpy((instants - before).astype(np.float32))[..., None, None]
    rows = np.arange(len(clips))[:, None]
    earlier = clips[rows, before]
    return earlier + (clips[rows, np.minimum(before + 1, frames - 1)] - earlier) * share


def mirrored(clips: Float32Array) -> Float32Array:
    """[..., 15, 3] clips whose left and right are swapped."""
    return np.asarray(clips[..., _SWAPPED, :] * np.array([-1, 1, 1], dtype=np.float32))


NO_AUGMENTATION: Final = Augmentation(0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
# A longer clip is read in windows of at most so many frames (at 30 a second), each half over the one before.
LONGEST: Final = 600
CALM: Final = 2.0  # frames; standard deviation of the filter before what moves is summed


def resampled(clip: Float32Array, frames: int, paced: float = 0.0) -> Float32Array:
    """[frames, J, 3] a clip [T, J, 3] at so many instants from its first frame to its last.

    Args:
        clip: 15 joints and the path in the place of the hips, as `clip_sequence` has it, where it is paced.
        frames: how many instants.
        paced: 0: even in time; 1: between two of them all joints together move as far as between any two others, so
            that a pause does not count; in between: so much of both.
    """
    at = _instants(clip, frames, paced) if paced and len(clip) > 2 else np.linspace(0, len(clip) - 1, frames)
    before, after, share = beside(at, len(clip))
    weight = share.astype(np.float32)[:, None, None]
    return np.asarray(clip[before] + (clip[after] - clip[before]) * weight, dtype=np.float32)


def _instants(clip: Float32Array, frames: int, paced: float) -> Float64Array:
    """[frames] where in a clip [T, J, 3], from 0 to T - 1, instants are that keep pace with what moves."""
    from scipy.ndimage import gaussian_filter1d

    smooth = gaussian_filter1d(clip.reshape(len(clip), -1).astype(np.float64), CALM, axis=0, mode="nearest")
    return paced_places(smooth, frames, paced)


def windows(clip: Float32Array, longest: int = LONGEST) -> list[Float32Array]:
    """A clip in windows of equal length, each starting half a window after the one before; itself if it is short."""
    if len(clip) <= longest:
        return [clip]
    count = int(np.ceil(2 * len(clip) / longest)) - 1
    starts = np.linspace(0, len(clip) - longest, count).round().astype(int)
    return [part_of(clip, start, longest) for start in starts]


def padded(clips: Sequence[Float32Array]) -> tuple[Tensor, Tensor]:
    """[B, T, J, 3] clips of any length, filled up with their last frame, and their lengths [B]."""
    lengths = np.array([len(clip) for clip in clips])
    filled = [np.pad(clip, [(0, lengths.max() - len(clip)), (0, 0), (0, 0)], mode="edge") for clip in clips]
    return torch.from_numpy(np.stack(filled)), torch.from_numpy(lengths)


def at_speeds(clip: Float32Array) -> list[Float32Array]:
    """The clip, every other frame of it, and with a frame put between each two (DeepHuMS, section 3.3.2)."""
    return [clip, clip[::2], resampled(clip, max(1, 2 * len(clip) - 1))]


def part_of(clip: Float32Array, start: int, count: int) -> Float32Array:
    """`count` frames of a clip [T, J, 3] from one on, the root's path starting at zero there."""
    part = clip[start : start + count].copy()
    part[:, 0] -= clip[start, 0]
    return part
