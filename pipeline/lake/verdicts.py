"""Clips that stage "quality" found good enough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

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


def good_rows(
    con: Connection, rows: Sequence[Mapping[str, Any]], min_quality: str | None, what: str
) -> list[dict[str, Any]]:
    """Those of rows whose `clip` is at least so good; None: all.

    Args:
        con: to the lake.
        rows: each with a clip.
        min_quality: the worst verdict.
        what: "clips to train on", as the error names them.

    Raises:
        UserError: as `check_least`, or there are rows and none is as good.
    """
    if min_quality is None:
        return [dict(row) for row in rows]
    good = good_clips(con, min_quality)
    kept = [dict(row) for row in rows if row["clip"] in good]
    if rows and not kept:
        raise UserError(f"--min-quality {min_quality}: of {len(rows)} {what} none is as good")
    return kept
