"""Which files of a lake a JSON value names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from motionlake.lake.file_list import Listed


def frames_by_part(listed: Listed) -> dict[str, str]:
    """The listed frames parts, by the name of the part."""
    return {file[file.rindex("/") + 1 : -len(".parquet")]: file for file in listed if file.startswith("frames/")}


def named_files(listed: Listed, by_part: Mapping[str, str], value: object) -> set[str]:
    """The listed files that a JSON value names anywhere: by their names, or frames parts by that of the part."""

    def within(value: object) -> Iterator[str]:
        if isinstance(value, str):
            if value in listed:
                yield value
            elif value in by_part:
                yield by_part[value]
        elif isinstance(value, Mapping):
            for inner in value.values():
                yield from within(inner)
        elif isinstance(value, list | tuple):
            for inner in value:
                yield from within(inner)

    return set(within(value))
