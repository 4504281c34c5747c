"""Settings as the last run found them: a change is told, for it redoes work, and a damaged one can be put back."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from difflib import unified_diff

import pyarrow as pa
from motionlake.lake.catalog import Connection, fetch, load_rows, reading, remembered, table_of, writing
from motionlake.lake.config import LakeConfig, load_config
from motionlake.lake.layout import Lake

_ROWS = pa.schema({"file": pa.string(), "text": pa.string()})


class SettingsChanged(UserWarning):
    """What is answered now follows settings that no run has seen."""


def settings_now(lake: Lake) -> dict[str, str]:
    """The text of config.toml and of every rig map of a lake, by file; bytes that are no UTF-8 are spelled out."""
    paths = [lake.config_file, *sorted(lake.rigs.glob("*.toml"))]
    return {lake.relative(p): p.read_bytes().decode("utf-8", "backslashreplace") for p in paths if p.is_file()}


def settings_then(con: Connection) -> dict[str, str]:
    """The same as the last run found it."""
    return {row["file"]: row["text"] for row in fetch(con, "settings")}


def changes(then: dict[str, str], now: dict[str, str]) -> list[tuple[str, str]]:
    """(file, what has changed in a few words) of every setting that is not as it was."""
    found = []
    for file in sorted({*then, *now}):
        if file not in now:
            found.append((file, "is missing"))
        elif file not in then:
            found.append((file, "is new"))
        elif then[file] != now[file]:
            found.append((file, f"has changed: {_difference(then[file], now[file])}"))
    return found


def _difference(before: str, after: str) -> str:
    lines = list(unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0))[2:]
    said = [line for line in lines if line[:1] in "+-" and line[1:].strip()]
    more = f" and {len(said) - 4} lines more" if len(said) > 4 else ""
    return "; ".join(said[:4]) + more if said else "line ends or spaces"


def changed_settings(lake: Lake) -> list[tuple[str, str]]:
    """(file, what has changed) since the last run; nothing where no run has found settings yet."""
    then = remembered(lake, "settings", settings_then)
    return changes(then, settings_now(lake)) if then else []


def served_config(lake: Lake) -> LakeConfig:
    """What config.toml asks for, with a warning where the last run found another one. Raises `UserError` as
    `load_config` does."""
    for file, what in changed_settings(lake):
        warnings.warn(f"{lake.root / file}: {what}, since the last run", SettingsChanged, stacklevel=2)
    return load_config(lake.config_file)


def keep_settings(lake: Lake) -> None:
    """Remember the settings as they are; the caller holds the lake's lock."""
    now = settings_now(lake)
    with reading(lake) as con:
        then = settings_then(con)
    if then != now:
        with writing(lake) as con:
            enter_settings(con, now)


def enter_settings(con: Connection, now: Mapping[str, str]) -> None:
    """Remember settings, within the caller's transaction."""
    rows = [{"file": file, "text": text} for file, text in now.items()]
    load_rows(con, "save_settings", table_of(rows, _ROWS))
