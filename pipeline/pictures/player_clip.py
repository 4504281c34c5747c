"""A motion as the player shows it: thinned, capped, and packed into few bytes."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from motionlake.motion.facing import facing
from motionlake.pictures.bands import Segment
from motionlake.pictures.stick_figures import body_height
from motionlake.pictures.style import Float64Array
from numpy.typing import NDArray

MOST_FPS: Final = 30.0
MOST_SECONDS: Final = 180.0
FLOOR: Final = 2.0  # percentile of the lowest joint of each frame: a glitch or two below the floor is not the floor


@dataclass(frozen=True)
class PlayerClip:
    """A motion and what is said of it.

    Attributes:
        name: of the clip or file.
        positions: [F, 21, 3] joints, metres, y up, at `fps`.
        fps: frames a second.
        frames: of the whole clip.
        first: which of the clip's frames `positions` begins at.
        facts: what is known of it, such as ("label", "walk"), in the order shown.
        bands: rows of labelled stretches by name; seconds from the beginning of `positions`.
    """

    name: str
    positions: NDArray[np.floating]
    fps: float
    frames: int
    first: int = 0
    facts: Sequence[tuple[str, str]] = ()
    bands: Sequence[tuple[str, Sequence[Segment]]] = ()

    @cached_property
    def step(self) -> int:
        """One of so many frames is shown."""
        return max(1, int(np.ceil(self.fps / MOST_FPS - 1e-3)))

    @cached_property
    def shown_fps(self) -> float:
        return self.fps / self.step

    @cached_property
    def shown(self) -> NDArray[np.floating]:
        """[n, 21, 3] positions at `shown_fps`, of the first three minutes."""
        most = round(MOST_SECONDS * self.shown_fps)
        return self.positions[:: self.step][:most]

    @cached_property
    def seconds(self) -> float:
        """How long `shown` lasts."""
        return len(self.shown) / self.shown_fps

    @property
    def duration(self) -> float:
        """Seconds of `positions`."""
        return len(self.positions) / self.fps

    @property
    def cut(self) -> bool:
        """Is it longer than what the player shows?"""
        return self.duration > MOST_SECONDS

    @cached_property
    def floor(self) -> float:
        """Height of the ground, metres."""
        return float(np.percentile(self.positions[..., 1].min(axis=1), FLOOR))

    @cached_property
    def heading(self) -> float:
        """Radians about +y from +z to where the body faces at first."""
        return float(facing(self.positions[:1])[0])

    @cached_property
    def height(self) -> float:
        """About that of the standing body, metres."""
        return body_height(self.positions)


def pack(positions: NDArray[np.floating]) -> str:
    """Positions [n, 21, 3] in whole millimetres as base64: [n, 3] int32 roots, then [n, 20, 3] int16 joints off them.

    Numbers are little-endian. Joints are rounded off the rounded root, so that no coordinate is off by more than half
    a millimetre; joints more than 32 m from their root are moved to there.
    """
    millimetres = np.asarray(positions, np.float64) * 1000
    root = np.round(millimetres[:, 0])
    joints = np.round(millimetres[:, 1:] - root[:, None])
    limits = np.iinfo(np.int16)
    packed = root.astype("<i4").tobytes() + np.clip(joints, limits.min, limits.max).astype("<i2").tobytes()
    return base64.b64encode(packed).decode("ascii")


def unpack(text: str, joints: int = 21) -> Float64Array:
    """[n, 21, 3] metres of what `pack` made."""
    packed = base64.b64decode(text)
    count = len(packed) // (12 + 6 * (joints - 1))
    root = np.frombuffer(packed, "<i4", 3 * count).reshape(count, 1, 3)
    others = np.frombuffer(packed, "<i2", offset=12 * count).reshape(count, joints - 1, 3)
    return np.concatenate([root, root + others.astype(np.int64)], axis=1) / 1000
