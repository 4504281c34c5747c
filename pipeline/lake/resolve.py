"""From what a person calls a clip to its name in the lake."""

from __future__ import annotations

import re
from difflib import get_close_matches

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch

SHOWN = 3  # clips that an error names


def resolve_clip(con: Connection, name: str) -> str:
    """The one clip a name means: its full name, or an unambiguous end of it, with or without the suffix.

    Raises:
        UserError: no clip or several are meant; it names those that are, or that are called nearly so.
    """
    found = [str(row["clip"]) for row in fetch(con, "find_clip", {"name": name})]
    if len(found) == 1:
        return found[0]
    if found:
        more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        raise UserError(f"{name}: means {len(found)} clips: {', '.join(found[:SHOWN])}{more}; name one in full")
    clips = [str(row["clip"]) for row in fetch(con, "clip_names")]
    if not clips:
        raise UserError(f"{name}: no such file, and the lake holds no clips yet; `motionlake ingest` takes some in")
    near = _near(name, clips)
    hint = f"did you mean {' or '.join(near)}?" if near else "`motionlake sql 'SELECT clip FROM clips'` lists the clips"
    raise UserError(f"{name}: no such clip in the lake, and no such file; {hint}")


def _near(name: str, clips: list[str]) -> list[str]:
    """The clips whose file names are most like a name, or hold it, whatever their case and suffix."""
    wanted = _stem(name)
    stems = {_stem(clip): clip for clip in reversed(clips)}  # the first clip of each
    close = get_close_matches(wanted, stems, SHOWN, 0.6)
    holding = [s for s in stems if wanted in s or get_close_matches(wanted, re.split("[-_ ]", s), 1, 0.8)]
    return [stems[s] for s in dict.fromkeys([*close, *sorted(holding, key=lambda s: (len(s), s))])][:SHOWN]


def _stem(name: str) -> str:
    return name.rpartition("/")[2].partition("#")[0].split(".")[0].lower()
