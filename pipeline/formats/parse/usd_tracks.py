"""The numbers of attributes of a USD stage, and of what a skeleton's animation says of its joints."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from motionlake.arrays import Float64Array
from motionlake.errors import ClipError
from motionlake.motion.rotations import MIN_LENGTH
from numpy.typing import NDArray

QUATERNION: Final = 4  # numbers


def numbers_of_attribute(attribute: Any, *code: float) -> Float64Array:
    """The numbers of an attribute, none where it has no value; `ClipError` where they are of no kind of its own."""
    value = attribute.Get(*code)
    try:
        return np.array(() if value is None else value, np.float64)
    except (TypeError, ValueError) as error:
        raise ClipError(f"its {attribute.GetName()} are no numbers") from error


def sampled(track: Any, codes: Float64Array, joints: int, width: int) -> NDArray[Any]:
    """[F, A, width] what an animation says of its joints at time codes, or [1, A, width] where it says one thing.

    Of quaternions the real part comes first.
    """
    from pxr import Usd

    query = Usd.AttributeQuery(track)
    said = (codes if query.ValueMightBeTimeVarying() else codes[:1]).tolist()
    try:
        values = np.array([np.asarray(query.Get(code)) for code in said])
    except ValueError:  # of several lengths
        values = np.empty(0)
    if values.shape != (len(said), joints, width) or values.dtype.kind != "f":
        for code in said:
            if numbers_of_attribute(track, code).shape != (joints, width):
                raise ClipError(f"its {track.GetName()} at {code:g} are not one for each of its {joints} joints")
        values = np.array([numbers_of_attribute(track, code) for code in said])
    return values if width != QUATERNION else values[..., [3, 0, 1, 2]]


def normalise_turns(turns: Float64Array, codes: Float64Array) -> None:
    """Scale quaternions [F, J, 4] to length 1, in place."""
    lengths = np.sqrt(np.einsum("fjn,fjn->fj", turns, turns))
    sound = (lengths > MIN_LENGTH).all(axis=1)
    if not sound.all():
        raise ClipError(f"has a rotation of length zero at {codes[sound.argmin()]:g}")
    turns /= lengths[..., None]
