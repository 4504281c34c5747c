"""Truth about a recording: what in it no body did, clip by clip and range by range."""

from __future__ import annotations

from motionlake.motion.quality.faults import KINDS, Fault, Recording
from motionlake.motion.quality.sentences import sentence
from motionlake.motion.quality.verdict import MEASURES, VERDICTS, Highest, Quality, check, in_dataset

__all__ = [
    "KINDS",
    "MEASURES",
    "VERDICTS",
    "Fault",
    "Highest",
    "Quality",
    "Recording",
    "check",
    "in_dataset",
    "sentence",
]
