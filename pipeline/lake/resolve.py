"""From what a person calls a clip to its name in the lake, or to a clip file."""

from __future__ import annotations

import re
from difflib import get_close_matches
from pathlib import Path

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch
from motionlake.names import typed

SHOWN = 3  # clips that an error names


def clip_or_file(con: Connection, name: str) -> str | Path:
    """The clip of the lake that a name means, or else the clip file of that path.

    A name that begins with "/", "./" or "../" means a file alone; every other one a clip, where the lake has such.

    Raises:
        UserError: neither a clip nor a clip file, or several clips.
    """
    file = clip_file(name)
    if file is not None and (_begins_as_a_path(name) or not _found(con, name)):
        return file
    return resolve_clip(con, name)


def hidden_file(name: str, meant: str | Path) -> str | None:
    """A line that says so where a name meant a clip of the lake, and there is a clip file of that path as well."""
    if isinstance(meant, Path) or clip_file(name) is None:
        return None
    return f"{name}: means {meant} of the lake here; ./{name} means the file"


def clip_file(name: str | Path) -> Path | None:
    """The file of a path, where it is one that clips are read from."""
    from motionlake.formats import is_clip_file

    path = Path(name)
    return path if is_clip_file(path) else None


def _begins_as_a_path(name: str) -> bool:
    return name.startswith(("/", "./", "../"))


def _found(con: Connection, name: str) -> list[str]:
    return [str(row["clip"]) for row in fetch(con, "find_clip", {"name": typed(name)})]


def resolve_clip(con: Connection, name: str) -> str:
    """The one clip a name means: its full name, or an unambiguous end of it, with or without the suffix.

    Raises:
        UserError: no clip or several are meant; it names those that are, or that are called nearly so.
    """
    found = _found(con, name)
    if len(found) == 1:
        return found[0]
    if found:
        more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        file = "" if clip_file(name) is None else f", or ./{name}, which is a file"
        raise UserError(f"{name}: means {len(found)} clips: {', '.join(found[:SHOWN])}{more}; name one in full{file}")
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
