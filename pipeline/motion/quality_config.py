"""Configuration of the faults of recordings: table [quality] of config.toml."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

TABLE: Final = "quality"


@dataclass(frozen=True)
class QualityConfig:
    """From where on something of a recording is a fault.

    Attributes:
        slide: metres a second of the slower foot point while the body stands.
        slide_seconds: for so long at least.
        slide_way: and so many metres far over the ground: a foot that goes less far trembles in its place.
        penetration: metres below the ground that the feet stand on.
        floating: metres above it, longer than a jump of that height lasts.
        jitter: metres, standard deviation of noise from frame to frame.
        jitter_seconds: for so long at least.
        spike: metres by which a joint leaves its path, beside what the acceleration below explains.
        acceleration: metres a square second that limbs reach.
        flip: degrees that a joint turns from one frame to the next.
        frozen_seconds: without any change in a joint that else moves.
        missing: share of frames in which joints were missing.
        limb_drift: share by which a limb's length differs from its median.
        tpose_degrees: by which limbs may differ from a T-pose.
        seam: metres, mean over the joints, by which a body jumps from one frame to the next.
        fps_odds: how many times likelier a frame rate that is off by two must be than the right one, or the other way
            round, before either is told.
        shortest_body, tallest_body: metres from the ankles to the head joint.
        bad_share: share of a clip's frames with faults from which on it is bad.
    """

    slide: float = 0.13
    slide_seconds: float = 0.25
    slide_way: float = 0.06
    penetration: float = 0.065
    floating: float = 0.05
    jitter: float = 0.002
    jitter_seconds: float = 0.5
    spike: float = 0.03
    acceleration: float = 300.0
    flip: float = 90.0
    frozen_seconds: float = 0.25
    missing: float = 0.02
    limb_drift: float = 0.06
    tpose_degrees: float = 25.0
    seam: float = 0.012
    fps_odds: float = 12.0
    shortest_body: float = 1.0
    tallest_body: float = 1.8
    bad_share: float = 0.1


CONFIG: Final = QualityConfig
