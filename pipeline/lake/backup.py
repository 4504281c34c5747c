"""What of a lake cannot be made again, in one archive: its tables, settings, trained models, clips without a source,
and what people decided."""

from __future__ import annotations

import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path

from motionlake.errors import UserError
from motionlake.lake.catalog import fetch, reading
from motionlake.lake.file_list import listed_in
from motionlake.lake.integrity import sound
from motionlake.lake.layout import Lake
from motionlake.lake.parts import replacing
from motionlake.lake.records import build_catalog, read_records, write_records
from motionlake.lake.settings import settings_now
from motionlake.names import on_disk

_COMMENT = b"motionlake backup 1"


@dataclass(frozen=True)
class Written:
    """What a backup holds."""

    file: str
    files: int
    bytes: int


def write_backup(lake: Lake, out: Path, *, clips: bool) -> Written:
    """Write the archive, whole or not at all; `clips`: with the motion of all clips. The caller holds the lock.

    Raises:
        DamagedError: a file that belongs into it is damaged.
    """
    write_records(lake)
    with reading(lake) as con:
        listed = listed_in(con)
        trained = [row["file"] for row in fetch(con, "trained_models")]
        parts = {row["part"] for row in fetch(con, "source_parts") if clips or not _is_there(row)}
        parts |= {row["part"] for row in fetch(con, "synthetic_parts")}
    motion = [f for f in listed if f.startswith(("frames/", "raw/")) and Path(f).stem in parts]
    own = [lake.relative(lake.annotations)] if lake.annotations.is_file() else []
    files = [*sorted(settings_now(lake)), *own, *sorted(f for f in {*trained, *motion} if f in listed)]
    with replacing(out.absolute()) as temporary:
        with zipfile.ZipFile(temporary, "w") as archive:
            archive.comment = _COMMENT
            archive.write(lake.records, lake.records.name)
            for file in files:
                archive.write(sound(lake, file) if file in listed else lake.path(file), file)
        size = temporary.stat().st_size
    return Written(str(out), len(files) + 1, size)


def _is_there(row: dict[str, str]) -> bool:
    return Path(on_disk(row["root"]), on_disk(row["path"])).is_file()


def read_backup(archive: Path, lake: Lake) -> None:
    """Unpack an archive into the folder of a new lake; only names that lead into its own folders are taken.

    Raises:
        UserError: it is no backup, or a damaged one.
    """
    try:
        with zipfile.ZipFile(archive) as packed:
            if packed.comment != _COMMENT:
                raise UserError(f"{archive}: is no backup of a lake")
            for entry in packed.infolist():
                _unpack(packed, entry, lake)
        build_catalog(lake, dict(read_records(lake.records)))
    except (OSError, zipfile.BadZipFile, ValueError, EOFError) as error:
        raise UserError(f"{archive}: cannot be restored ({error})") from error


def _unpack(packed: zipfile.ZipFile, entry: zipfile.ZipInfo, lake: Lake) -> None:
    known = (lake.records.name, lake.config_file.name, lake.annotations.name)
    if entry.filename not in known and not entry.filename.startswith(("frames/", "raw/", "models/", "rigs/")):
        raise UserError(f"{packed.filename}: holds {entry.filename!r}, which is no file of a lake")
    with replacing(lake.path(entry.filename)) as temporary, temporary.open("wb") as target:
        with packed.open(entry) as source:
            shutil.copyfileobj(source, target, 1 << 20)
        target.flush()
