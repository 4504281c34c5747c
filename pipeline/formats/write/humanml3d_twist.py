"""Writing clips as HumanML3D has them, but with the rotations that their joints have, turns about bones and all."""

from __future__ import annotations

from typing import Final

from motionlake.formats.write.humanml3d import HumanML3DWriter

WRITER: Final = HumanML3DWriter("humanml3d-twist", twist=True)
