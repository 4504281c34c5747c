"""A synthesized motion as a motion of the canonical skeleton."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from motionlake.motion.canonicalise import METRES_PER_UNIT, CanonicalMotion, body_height
from motionlake.motion.kinematics import continuous_signs, forward_kinematics

if TYPE_CHECKING:
    from motionlake.glogen.requests import GeneratedMotion


def canonical_motion(made: GeneratedMotion, filled: Sequence[str] = ()) -> CanonicalMotion:
    """The motion as clips have it; in its own rig, the canonical skeleton's BVH, it is in centimetres.

    Args:
        made: as a generator gives it.
        filled: joints that rigs of the training clips lack.
    """
    positions = np.asarray(made.positions, dtype=float)
    rotations = continuous_signs(np.asarray(made.rotations, dtype=float))
    rest_offsets = np.asarray(made.rest_offsets, dtype=float)
    rebuilt = forward_kinematics(positions[:, 0], rotations, rest_offsets)
    errors = np.linalg.norm(rebuilt - positions, axis=-1)
    return CanonicalMotion(
        fps=made.fps,
        root=positions[:, 0],
        rotations=rotations,
        positions=positions,
        rest_offsets=rest_offsets,
        body_height=body_height(rest_offsets),
        twist=False,
        filled=tuple(filled),
        up="y",
        metres_per_unit=METRES_PER_UNIT,
        fk_error=float(errors.max()),
        fk_error_mean=float(errors.mean()),
    )
