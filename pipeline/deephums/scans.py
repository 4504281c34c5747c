"""Which exact scan of descriptors is quick for so many rows and queries, the time to import what it needs among it."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final

from motionlake.arrays import Float32Array
from motionlake.deephums.exact import FEW, ExactScan, Neighbours

if TYPE_CHECKING:
    from motionlake.deephums.nearest import DescriptorScan

SOME: Final = 50_000  # rows up to which a few queries have their answers before torch is imported
QUERIES: Final = 8  # that are a few


def scan_of(descriptors: Float32Array) -> ExactScan | PatientScan:
    """A scan of descriptors [n, 512]; both give the same answers."""
    return ExactScan(descriptors) if len(descriptors) <= FEW else PatientScan(descriptors)


class PatientScan:
    """n descriptors, searched by torch, which takes a second to import: of up to `SOME`, not for a few queries.

    Args:
        descriptors: [n, 512], finite.
    """

    def __init__(self, descriptors: Float32Array) -> None:
        self._plain, self._rows, self._asked = ExactScan(descriptors), descriptors, 0

    def nearest(self, queries: Float32Array, k: int) -> Neighbours:
        """See `ExactScan.nearest`; queries [m, 512]."""
        self._asked += len(queries)
        scan = self._plain if len(self._rows) <= SOME and self._asked <= QUERIES else self._quick
        return scan.nearest(queries, k)

    @cached_property
    def _quick(self) -> DescriptorScan:
        from motionlake.deephums.nearest import DescriptorScan

        return DescriptorScan(self._rows)
