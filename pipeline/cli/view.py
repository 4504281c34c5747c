"""motionlake view."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from motionlake.cli.common import JsonOption, LakeOption, StartOption, StopOption, asked_for, notice, tell
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake, open_lake

if TYPE_CHECKING:
    from motionlake.pictures.player_material import PlayerClip
    from motionlake.retrieval.protocol import Query

SUFFIXES: Final = (".html", ".gif", ".png")
LONGEST_NAME: Final = 100


def view(
    lake: LakeOption,
    clip: Annotated[str, typer.Argument(help="A clip of the lake, or a clip file.", show_default=False)],
    beside: Annotated[
        str,
        typer.Option(help="What is shown beside it: a clip, a clip file, nearest (the nearest recorded clip), none."),
    ] = "nearest",
    start: StartOption = None,
    stop: StopOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="A .html, .gif or .png file (default: CLIP.html here).", show_default=False),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Play a clip beside the recorded one most like it: an HTML page, a GIF or a PNG.

    The page needs no other file and no network. Frames are the clip's own, from 0.

    Example: motionlake view walk_01 --lake mylake

    Beside another one: motionlake view walk_01 --beside walk_02 --out two_walks.html --lake mylake

    Some seconds of a file that is not in the lake: motionlake view shots/new_take.bvh --from 1.5s --to 4s --out
    take.gif --beside none --lake mylake
    """
    target = open_lake(lake)
    from motionlake.pictures.html import write_file
    from motionlake.pictures.player_material import player_clip

    _check(out)
    with reading(target) as con:
        asked = asked_for(con, target, clip, start, stop)
        shown = [player_clip(con, target, asked)]
        path = out or Path(f"{safe_name(shown[0].name)}.html")
        other = _beside(con, target, asked, beside)
        if other is not None:
            shown.append(other)
    notes = _capped(path, shown)
    write_file(path, _drawn(path, shown))
    for note in notes:
        notice(note)
    found = {"file": str(path), "bytes": path.stat().st_size, "notes": notes, "clips": list(map(_row, shown))}
    tell(found, str(path), as_json=as_json)


def safe_name(clip: str) -> str:
    """A clip's name as that of a file in any folder of any system: letters, digits and ._- without leading dots."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", clip).strip(".-")
    return name[-LONGEST_NAME:].lstrip(".-") or "clip"


def _check(out: Path | None) -> None:
    """Before anything is computed: can it be written there?"""
    if out is None:
        return
    if out.suffix not in SUFFIXES:
        raise UserError(f"--out {out}: its name must end in one of {', '.join(SUFFIXES)}")
    if out.is_dir():
        raise UserError(f"{out}: cannot be written (there is a folder of that name)")
    if not out.parent.is_dir():
        raise UserError(f"{out.parent}: no such folder")


def _beside(con: Connection, lake: Lake, asked: Query, beside: str) -> PlayerClip | None:
    from motionlake.pictures.player_material import nearest_real_clip, player_clip
    from motionlake.retrieval.protocol import Query

    if beside == "none":
        return None
    if beside != "nearest":
        return player_clip(con, lake, asked_for(con, lake, beside))
    try:
        found = nearest_real_clip(lake, Query(asked.source))
    except UserError as error:
        notice(f"shown alone, without the nearest recorded clip: {error}")
        return None
    return player_clip(con, lake, Query(found[1].clip), nearest=found)


def _drawn(path: Path, shown: list[PlayerClip]) -> bytes:
    if path.suffix == ".gif":
        from motionlake.pictures.motion_gif import motion_gif

        return motion_gif(shown)
    if path.suffix == ".png":
        from motionlake.pictures.film_strip import film_strip
        from motionlake.pictures.style import png

        return png(film_strip(shown))
    from motionlake.pictures.player import player_page

    return player_page(shown).encode(errors="replace")


def _capped(path: Path, shown: list[PlayerClip]) -> list[str]:
    """What is left out of a file that holds so many seconds at most."""
    from motionlake.pictures.motion_gif import MOST_SECONDS as MOST_OF_GIF
    from motionlake.pictures.player_material import MOST_SECONDS

    most = {".html": MOST_SECONDS, ".gif": MOST_OF_GIF, ".png": float("inf")}[path.suffix]
    return [
        f"{clip.name}: the first {most:g} s of {clip.duration:.1f} s are shown; --from and --to choose others"
        for clip in shown
        if clip.duration > most
    ]


def _row(clip: PlayerClip) -> dict[str, object]:
    stop = clip.first + len(clip.positions)
    return {"clip": clip.name, "start": clip.first, "stop": stop, "fps": clip.fps, **dict(clip.facts)}
