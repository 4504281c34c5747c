"""From what a person calls a clip to its name in the lake."""

from __future__ import annotations

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch


def resolve_clip(con: Connection, name: str) -> str:
    """The one clip a name means: its full name, or an unambiguous end of it.

    Raises:
        UserError: no clip or several are meant.
    """
    found = [r["clip"] for r in fetch(con, "find_clip", {"name": name})]
    if not found:
        raise UserError(
            f"{name}: no such clip in the lake, and no such file; list the clips with "
            "`motionlake sql 'SELECT clip FROM clips'`"
        )
    if len(found) > 1:
        raise UserError(f"{name}: means {len(found)} clips, among them {found[0]} and {found[1]}; name one in full")
    return str(found[0])
