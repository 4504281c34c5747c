"""Motion between the poses of a file: which of its frames are keys, and what the lake's generator makes of them."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from motionlake.errors import UserError
from motionlake.lake.catalog import Connection
from motionlake.lake.layout import Lake
from motionlake.lake.settings import served_config
from motionlake.motion.generation import FPS
from motionlake.stages.synthesis import chosen_generator, class_names, open_generator
from motionlake.stages.synthesis_control import Request
from motionlake.stages.synthesis_keys import Marked, read_source, with_keyframes
from motionlake.stages.synthesis_requests import canonical_motion, make, motions_of
from motionlake.stages.synthesis_settling import settle
from motionlake.stages.synthesis_starts import find_starts

if TYPE_CHECKING:
    from motionlake.motion.canonicalise import CanonicalMotion

ALL = "all"
SLOWEST, FASTEST = 1.0, 1000.0  # frames a second


@dataclass(frozen=True)
class Inbetween:
    """A dense motion, the generator that made it, and which of its frames are the given poses."""

    motion: CanonicalMotion
    model: str
    frames: list[int]


def inbetween(
    con: Connection, lake: Lake, source: str | Path, keys: str | Path | Sequence[int], classes: tuple[str, ...] = (),
    *, spacing: float | None = None, fps: float | None = None, seed: int = 0, temperature: float = 0.0,
) -> Inbetween:  # fmt: skip
    """Motion through frames of a clip of the lake (full name) or of a clip file.

    Args:
        con: to the lake.
        lake: its generator leads from pose to pose.
        source: holds the poses.
        keys: its frames, "all", text ("0,24,60"), or a CSV file with the columns frame and, if wanted, seconds.
        classes: as which it moves; none: as any that the generator knows.
        spacing: seconds from key to key; None: as the frames are apart.
        fps: of the motion; None: 30.
        seed: of what is drawn.
        temperature: how much chance varies it.

    Raises:
        UserError: there is no generator, the file cannot be read or is of another skeleton, it does not have a frame,
            or times do not rise.
    """
    rate = FPS if fps is None else fps
    if not SLOWEST <= rate <= FASTEST:
        raise UserError(f"{rate:g} frames a second: ask for {SLOWEST:g} to {FASTEST:g}")
    if spacing is not None and not 0 < spacing < math.inf:
        raise UserError(f"spacing {spacing:g}: must be more than 0 seconds")
    marked = _marked(con, lake, source, keys, spacing)
    model = chosen_generator(con, lake, config := served_config(lake), classes).model
    asked = Request(classes or tuple(class_names(model)), None, seed, temperature=temperature)
    _, request = settle(con, lake, config, with_keyframes(con, lake, asked, marked, rate))
    starts = find_starts(con, lake, model, request)
    (made,) = make(open_generator(lake, model), lake, request, motions_of(request, starts, [1]))
    frames = [round(key.seconds * rate) for key in request.keyframes]
    return Inbetween(canonical_motion(made), model.model, frames)


def _marked(
    con: Connection, lake: Lake, source: str | Path, keys: str | Path | Sequence[int], spacing: float | None
) -> list[Marked]:
    rows: list[tuple[int, float | None]]
    if isinstance(keys, str) and keys.strip() == ALL:
        rows = [(frame, None) for frame in range(len(read_source(con, lake, source)[0].positions))]
    elif isinstance(keys, Path) or (isinstance(keys, str) and keys.lower().endswith(".csv")):
        rows = _of_file(Path(keys))
    else:
        words = keys.split(",") if isinstance(keys, str) else [str(key) for key in keys]
        bad = next((word for word in words if not word.strip().isdigit()), None)
        if bad is not None:
            raise UserError(f"--keys {keys}: {bad.strip()!r} is no frame; give frames (0,24,60), all, or a CSV file")
        rows = [(int(word), None) for word in words]
    if spacing is not None:
        rows = [(frame, i * spacing) for i, (frame, _) in enumerate(rows)]
    return [Marked(source, frame, False, seconds) for frame, seconds in rows]


def _of_file(path: Path) -> list[tuple[int, float | None]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as handle:
            rows = list(csv.DictReader(handle, skipinitialspace=True))
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"--keys {path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    if not rows or "frame" not in rows[0]:
        raise UserError(f"--keys {path}: has no column frame, or no rows")
    found = []
    for line, row in enumerate(rows, 2):
        try:
            seconds = float(row["seconds"]) if row.get("seconds") else None
            found.append((int(row["frame"]), seconds))
        except (TypeError, ValueError) as error:
            raise UserError(f"--keys {path}: row {line} holds no frame, or seconds that are no number") from error
        if seconds is not None and not math.isfinite(seconds):
            raise UserError(f"--keys {path}: row {line} holds seconds that are no number")
    return found
