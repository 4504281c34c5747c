"""motionlake report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from motionlake.cli.common import DatasetOption, JsonOption, LakeOption, notice, tell
from motionlake.errors import UserError
from motionlake.lake.catalog import reading
from motionlake.lake.layout import check_dataset, open_lake


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
    if dataset is not None:
        check_dataset(dataset)
    if out.suffix not in (".html", ".htm"):
        raise UserError(f"{out}: a report is written as .html")
    if out.is_dir():
        raise UserError(f"{out}: cannot be written (there is a folder of that name)")
    with reading(target) as con:
        made = make_report(con, target, dataset, notice)
    paths = write_pictures(made.pictures, pictures) if pictures else []
    write_file(out, made.html.encode())
    rows = [{"name": p.name, "title": p.title, "caption": p.caption} for p in made.pictures]
    files = [str(path) for path in paths]
    found = {"report": str(out), "pictures": rows, "files": files}
    tell(found, f"wrote {out}" + (f" and {len(files)} pictures into {pictures}" if files else ""), as_json=as_json)
