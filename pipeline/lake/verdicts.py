"""Clips that stage "quality" found good enough."""

from __future__ import annotations

from typing import Final

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch

LEAST: Final = ("ok", "doubtful")  # the worst verdict that a clip may have


def check_least(con: Connection, min_quality: str | None) -> str | None:
    """The least verdict as it is; None: any will do.

    Raises:
        UserError: there is no such verdict, or clips of the lake have none yet.
    """
    if min_quality is None:
        return None
    if min_quality not in LEAST:
        raise UserError(f"--min-quality {min_quality}: use {' or '.join(LEAST)}")
    missing = fetch(con, "clips_without_verdict")[0]["clips"]
    if missing:
        raise UserError(f"--min-quality: {missing} clips have no verdict yet; make them with `motionlake run quality`")
    return min_quality


def good_clips(con: Connection, min_quality: str) -> frozenset[str]:
    """The clips that are at least so good.

    Raises:
        UserError: as `check_least`.
    """
    least = check_least(con, min_quality)
    return frozenset(row["clip"] for row in fetch(con, "clips_good_enough", {"min_quality": least}))
