"""motionlake view and report: clips to look at."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from motionlake.cli._output import check_folder_of, notice, tell
from motionlake.cli.common import (
    ClipArgument,
    DatasetOption,
    JsonOption,
    LakeOption,
    StartOption,
    StopOption,
    named_query,
    option,
)
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, fetch, reading
from motionlake.lake.layout import Lake, open_lake
from motionlake.names import safe_name, told_apart

if TYPE_CHECKING:
    from motionlake.pictures.player_material import PlayerClip
    from motionlake.retrieval.protocol import Query

SUFFIXES: Final = (".html", ".gif", ".png")


def view(
    lake: LakeOption,
    clip: ClipArgument,
    beside: Annotated[
        list[str] | None,
        typer.Option(
            help="What is shown beside it: a clip, a clip file, nearest (recorded clip), source (of a made one), none; "
            "up to three times (default: nearest)."
        ),
    ] = None,
    start: StartOption = None,
    stop: StopOption = None,
    out: Annotated[
        Path | None, option("--out", "-o", help="A .html, .gif or .png file (default: CLIP.html here).")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Play a clip beside the recorded one most like it: an HTML page, a GIF or a PNG.

    The page needs no other file and no network. Frames are the clip's own, from 0.

    Example: motionlake view walk_01 --lake mylake

    Beside another one: motionlake view walk_01 --beside walk_02 --out two_walks.html --lake mylake

    A made clip over what it was made from: motionlake view synthetic/walk-s0-0001 --beside source --lake mylake

    Some seconds of a file that is not in the lake: motionlake view shots/new_take.bvh --from 1.5s --to 4s --out
    take.gif --beside none --lake mylake
    """
    target = open_lake(lake)
    from motionlake.pictures.html import write_file
    from motionlake.pictures.player import MOST_CLIPS
    from motionlake.pictures.player_material import player_clip

    if out is not None:
        if out.suffix not in SUFFIXES:
            raise UserError(f"--out {out}: its name must end in one of {', '.join(SUFFIXES)}")
        _check_no_folder(out)
        check_folder_of(out)
    with reading(target) as con:
        query = named_query(con, target, clip, start, stop)
        shown = [player_clip(con, target, query)]
        path = out or Path(f"{_page_name(con, query, shown[0].name)}.html")
        named = beside or ["nearest"]
        most = MOST_CLIPS if path.suffix == ".html" else 2
        if len(named) >= most:
            raise UserError(f"--beside: a {path.suffix} shows {most - 1} beside the clip at most, not {len(named)}")
        shown += [other for name in named if (other := _beside(con, target, query, name)) is not None]
    notes = _left_out(path, shown)
    write_file(path, _drawn(path, shown))
    for note in notes:
        notice(note)
    found = {"file": str(path), "bytes": path.stat().st_size, "notes": notes, "clips": list(map(_row, shown))}
    tell(found, str(path), as_json=as_json)


def report(
    lake: LakeOption,
    out: Annotated[Path, typer.Option("--out", "-o", help="The page to write.")] = Path("report.html"),
    dataset: DatasetOption = None,
    pictures: Annotated[
        Path | None, typer.Option("--pictures", help="Also write each picture as PNG into this folder.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """One HTML page that shows what a lake holds: signatures, maps, motifs, sequences, a search.

    Example: motionlake report --lake mylake --out report.html

    One dataset, and its pictures as files: motionlake report --dataset hdm05 --pictures figures --lake mylake
    """
    from motionlake.pictures.html import write_file, write_pictures
    from motionlake.pictures.report import make_report

    target = open_lake(lake)
    if out.suffix not in (".html", ".htm"):
        raise UserError(f"{out}: a report is written as .html")
    _check_no_folder(out)
    with reading(target) as con:
        made = make_report(con, target, dataset, notice)
    files = [str(path) for path in write_pictures(made.pictures, pictures)] if pictures else []
    write_file(out, made.html.encode())
    rows = [{"name": p.name, "title": p.title, "caption": p.caption} for p in made.pictures]
    found = {"report": str(out), "pictures": rows, "files": files}
    tell(found, f"wrote {out}" + (f" and {len(files)} pictures into {pictures}" if files else ""), as_json=as_json)


def _page_name(con: Connection, query: Query, name: str) -> str:
    """The name of a clip's page, which no other clip of the lake has."""
    if query.clip is None:
        return safe_name(name)
    return told_apart((row["clip"] for row in fetch(con, "clip_names")), safe_name)[name]


def _check_no_folder(out: Path) -> None:
    if out.is_dir():
        raise UserError(f"{out}: cannot be written (there is a folder of that name)")


def _beside(con: Connection, lake: Lake, query: Query, beside: str) -> PlayerClip | None:
    from motionlake.pictures.player_material import nearest_real_clip, player_clip
    from motionlake.retrieval.protocol import Query

    if beside == "none":
        return None
    if beside == "source":
        return player_clip(con, lake, _source(con, lake, query))
    if beside != "nearest":
        return player_clip(con, lake, named_query(con, lake, beside))
    try:
        found = nearest_real_clip(lake, Query(query.source))
    except UserError as error:
        notice(f"shown alone, without the nearest recorded clip: {error}")
        return None
    return player_clip(con, lake, Query(found[1].clip), nearest=found)


def _source(con: Connection, lake: Lake, query: Query) -> Query:
    """The clip that a made one starts from."""
    found = None if query.clip is None else next(iter(fetch(con, "synthetic_clip", {"clip": query.clip})), None)
    if found is None:
        raise UserError(f"--beside source: {query.name} was recorded; a clip that `motionlake synthesize` made has one")
    return named_query(con, lake, found["seed_clip"])


def _drawn(path: Path, shown: list[PlayerClip]) -> bytes:
    if path.suffix == ".gif":
        from motionlake.pictures.clip_images import motion_gif

        return motion_gif(shown)
    if path.suffix == ".png":
        from motionlake.pictures.clip_images import film_strip
        from motionlake.pictures.style import png

        return png(film_strip(shown))
    from motionlake.pictures.player import player_page

    return player_page(shown).encode(errors="replace")


def _left_out(path: Path, shown: list[PlayerClip]) -> list[str]:
    """What is left out of a file that holds so many seconds at most."""
    from motionlake.pictures.clip_images import MOST_SECONDS as MOST_OF_GIF
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
