"""Which way is up, told by the body where a file does not say."""

from __future__ import annotations

from typing import Final

import numpy as np
from motionlake.arrays import Float64Array

# Share of the frames in which the head must be above the feet along one axis.
_SHARE: Final = 0.8


def up_of_body(head: Float64Array, feet: Float64Array) -> str | None:
    """The axis, one of y z -y -z, along which the head [F, 3] is above the feet [F, 3] in most frames.

    None where it is none of them: a body that lies or bends, or one that is long along x, which is up in no file.
    """
    body = head - feet
    longest = np.argmax(np.abs(body), axis=1)
    for axis, name in ((1, "y"), (2, "z")):
        along = body[longest == axis, axis]
        for sign in ("", "-"):
            if ((along < 0) if sign else (along > 0)).sum() >= _SHARE * len(body):
                return sign + name
    return None
