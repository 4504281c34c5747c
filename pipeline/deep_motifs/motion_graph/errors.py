"""What can go wrong with a walk."""

from __future__ import annotations

from motionlake.errors import UserError


class NoWalkError(UserError):
    """A graph holds no walk that starts with some clip."""
