"""Which exact scan of descriptors is quick for so many, the time to import what it needs among it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motionlake.arrays import Float32Array
from motionlake.deephums.exact import FEW, ExactScan

if TYPE_CHECKING:
    from motionlake.deephums.nearest import DescriptorScan


def scan_of(descriptors: Float32Array) -> ExactScan | DescriptorScan:
    """A scan of descriptors [n, 512]; both give the same answers."""
    if len(descriptors) <= FEW:
        return ExactScan(descriptors)
    from motionlake.deephums.nearest import DescriptorScan

    return DescriptorScan(descriptors)
