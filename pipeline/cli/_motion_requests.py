"""What the options of a command say of new motion: the clips and poses that it is made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from motionlake.cli.common import FrameOrSeconds, frame_or_seconds, named_source
from motionlake.errors import UserError
from motionlake.lake.catalog import Connection, reading
from motionlake.lake.layout import Lake

if TYPE_CHECKING:
    from motionlake.stages.synthesis_control import Request


def shown_poses(
    con: Connection, lake: Lake, request: Request, keyframes: Sequence[str], edit: str | None,
    edges: tuple[str | None, str | None],
) -> Request:  # fmt: skip
    """The request, with the poses of keyframes, or of the clip that is edited."""
    from motionlake.stages.synthesis_edits import with_edit
    from motionlake.stages.synthesis_keys import marked, with_keyframes

    if edit is None:
        frames = [marked(text) for text in keyframes]
        sources = {name: source_of(con, name) for name in dict.fromkeys(str(frame.source) for frame in frames)}
        return with_keyframes(
            con, lake, request, [replace(frame, source=sources[str(frame.source)]) for frame in frames]
        )
    if keyframes:
        raise UserError("a range of a clip is made anew (--edit), or motion through --keyframes: leave one out")
    places = [None if edge is None else _place(edge) for edge in edges]
    numbers = [None if place is None else place.value for place in places]
    first, stop = (place is not None and place.in_seconds for place in places)
    return with_edit(con, lake, request, source_of(con, edit), numbers[0], numbers[1], (first, stop))


def _place(text: str) -> FrameOrSeconds:
    try:
        return frame_or_seconds(text)
    except typer.BadParameter as error:
        raise UserError(str(error)) from error


def source_of(con: Connection, name: str) -> str | Path:
    """The clip of the lake, or the clip file, that a name means."""
    found = named_source(con, name)
    return found.absolute() if isinstance(found, Path) else found


def start_of(lake: Lake, name: str) -> tuple[str, bool]:
    """The clip of the lake, or the clip file, that a name means, and whether it is a file."""
    with reading(lake) as con:
        found = source_of(con, name)
    return str(found), isinstance(found, Path)
