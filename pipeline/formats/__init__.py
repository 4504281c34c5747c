"""File formats: one module each, found by the registry. Reading a clip starts with `read_clips`."""

from motionlake.formats.registry import (
    clip_by_name,
    companions,
    is_clip,
    is_clip_file,
    load_bytes,
    may_have_companions,
    read_clips,
    reader_for,
    readers,
)

__all__ = [
    "clip_by_name",
    "companions",
    "is_clip",
    "is_clip_file",
    "load_bytes",
    "may_have_companions",
    "read_clips",
    "reader_for",
    "readers",
]
