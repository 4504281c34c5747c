"""The numbers of attributes of a USD stage, and of what a skeleton's animation says of its joints, by usd-core."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from motionlake.arrays import Float64Array, FloatArray
from motionlake.errors import ClipError
from motionlake.formats.limits_config import limits
from motionlake.formats.parse.usd_scene import QUATERNION, real_first, rows_at


def numbers_of_attribute(attribute: Any, *code: float) -> Float64Array:
    """The numbers of an attribute, none where it has no value; `ClipError` where they are of no kind of its own."""
    value = attribute.Get(*code)
    try:
        return np.array(() if value is None else value, np.float64)
    except (TypeError, ValueError) as error:
        raise ClipError(f"its {attribute.GetName()} are no numbers") from error


class Track:
    """What an animation says of its joints: an attribute that has a value for each of them, at some time codes."""

    def __init__(self, attribute: Any) -> None:
        self.attribute = attribute
        self.has_value = bool(attribute.HasValue())

    @cached_property
    def times(self) -> Float64Array:
        """[K] the time codes of its keys, growing."""
        keyed = self._keyed
        return np.array(self.attribute.GetTimeSamples() if keyed is None else list(keyed), np.float64)

    @cached_property
    def _keyed(self) -> dict[float, Any] | None:
        """Its values by time code, read at once; None where the file's own layer has none of the attribute itself, but
        of a part that is referenced, which may move at other times, or more than a body may have frames.
        """
        layer, path = self.attribute.GetStage().GetRootLayer(), self.attribute.GetPath()
        if not 0 < layer.GetNumTimeSamplesForPath(path) <= limits().frames:
            return None
        found: dict[float, Any] = layer.GetAttributeAtPath(path).GetInfo("timeSamples")
        return found

    def sampled(self, codes: Float64Array, joints: int, width: int) -> FloatArray:
        """[F, A, width] what is said of its A joints at time codes, or [1, A, width] where it says one thing.

        Of quaternions the real part comes first.
        """
        from pxr import Usd

        query = Usd.AttributeQuery(self.attribute)
        codes = codes if query.ValueMightBeTimeVarying() else codes[:1]
        values = self._of_keys(codes, joints, width)
        if values is None:
            values = _of_instants(query, codes.tolist(), joints, width)
        return real_first(values) if width == QUATERNION else values

    def _of_keys(self, codes: Float64Array, joints: int, width: int) -> FloatArray | None:
        """The same of keys, of quaternions the real part last; None where there is not one at every time code.

        This takes a fifth of the time of asking for one time code after the other.
        """
        rows = rows_at(self.times, codes) if self._keyed else None
        if not self._keyed or rows is None:
            return None
        values = list(self._keyed.values())
        first = np.asarray(values[0])
        if first.shape != (joints, width) or first.dtype.kind != "f":
            return None
        if len(set(map(type, values))) > 1 or set(map(len, values)) != {joints}:
            return None
        return np.frombuffer(b"".join(values), first.dtype).reshape(len(values), joints, width)[rows]


def _of_instants(query: Any, codes: Sequence[float], joints: int, width: int) -> FloatArray:
    """[F, A, width] of an attribute at one time code after the other; of quaternions the real part comes last."""
    try:
        values = np.array([np.asarray(query.Get(code)) for code in codes])
    except ValueError:  # of several lengths
        values = np.empty(0)
    if values.shape == (len(codes), joints, width) and values.dtype.kind == "f":
        return values
    track = query.GetAttribute()
    for code in codes:
        if numbers_of_attribute(track, code).shape != (joints, width):
            raise ClipError(f"its {track.GetName()} at {code:g} are not one for each of its {joints} joints")
    return np.array([numbers_of_attribute(track, code) for code in codes])
