"""The recorded frames that motion was made from."""

from __future__ import annotations

from motionlake.matching.course import Course
from motionlake.matching.database import MotionDatabase
from motionlake.matching.recordings import FPS
from motionlake.motion.generation import Source


def course_sources(database: MotionDatabase, course: Course) -> list[Source]:
    """Of every run of a course the recorded frames, in order."""
    stops = [*course.jumps[1:], len(course.at)]
    return [
        run_source(
            database, (start, stop), (float(course.at[start]), float(course.at[stop - 1])), bool(course.mirrored[start])
        )
        for start, stop in zip(course.jumps, stops, strict=True)
    ]


def run_source(database: MotionDatabase, frames: tuple[int, int], rows: tuple[float, float], mirrored: bool) -> Source:
    """The recorded frames of frames [start, stop) of a motion, from the first to the last of two rows of a piece."""
    piece = int(database.piece_of[int(rows[0])])
    low, _, _, frame = database.pieces[piece]
    first, last = (int(frame + round((row - low) / FPS * database.fps[piece])) for row in rows)
    return Source(*frames, database.clips[piece], first, last, mirrored)
