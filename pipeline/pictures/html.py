"""HTML pages that need nothing but themselves, and pictures on disk: written whole or not at all."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from matplotlib.figure import Figure
from motionlake.errors import UserError
from motionlake.lake.parts import replacing
from motionlake.names import html, safe_name
from motionlake.pictures.style import png

PIXELS_AN_INCH: Final = 100
_CSS: Final = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; margin: 2em auto; max-width: 1240px;
  padding: 0 1.5em; }
h1 { font-size: 1.7em; margin-bottom: .2em; } h2 { font-size: 1.3em; margin-top: 2.2em;
  border-bottom: 1px solid #ccc; }
figure { margin: 1.5em 0 2.2em; overflow-x: auto; } img { display: block; }
figcaption { max-width: 60em; color: #444; margin-top: .3em; }
table { border-collapse: collapse; margin: 1em 0; } th, td { padding: .15em .9em .15em 0; text-align: left;
  border-bottom: 1px solid #e5e5e5; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
nav a { margin-right: 1em; } nav { margin: 1em 0; }
"""


@dataclass(frozen=True)
class Picture:
    """A drawn picture.

    Attributes:
        name: of its file, without suffix.
        title: one line, the text for those who cannot see it.
        caption: what one sees.
        png: the file.
        width: pixels at which it is to be shown.
    """

    name: str
    title: str
    caption: str
    png: bytes
    width: int


def picture(name: str, title: str, caption: str, figure: Figure) -> Picture:
    """A figure as a picture, shown at 100 pixels an inch; its name is made fit for files and links."""
    return Picture(safe_name(name), title, caption, png(figure), round(figure.get_figwidth() * PIXELS_AN_INCH))


def document(title: str, style: str, body: Iterable[str], head: str = "") -> str:
    """An HTML file with this style sheet in it, and with these elements in its head and its body."""
    lines = [
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">{head}',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html(title)}</title><style>{style}</style></head><body>",
        *body,
        "</body></html>\n",
    ]
    return "\n".join(lines)


def page(
    title: str, lead: Sequence[str], tables: Sequence[Sequence[Mapping[str, Any]]],
    chapters: Mapping[str, Sequence[Picture]],
) -> str:  # fmt: skip
    """The page: a title, lines and tables that sum up, then pictures by the titles of their chapters."""
    body = [f"<h1>{html(title)}</h1>", *(f"<p>{html(line)}</p>" for line in lead)]
    body += [_table(rows) for rows in tables if rows]
    if len(chapters) > 1:
        links = "".join(f'<a href="#c{i}">{html(name)}</a> ' for i, name in enumerate(chapters))
        body.append(f"<nav>{links}</nav>")
    for i, (name, pictures) in enumerate(chapters.items()):
        body.append(f'<h2 id="c{i}">{html(name)}</h2>')
        body += map(_figure, pictures)
    return document(title, _CSS, body)


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    numeric = {name for name in rows[0] if all(isinstance(row[name], int | float) for row in rows)}

    def cell(tag: str, name: str, value: object) -> str:
        text = f"{value:,.1f}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else value
        kind = ' class="number"' if name in numeric else ""
        return f"<{tag}{kind}>{html('' if text is None else text)}</{tag}>"

    lines = ["".join(cell("th", name, name) for name in rows[0])]
    lines += ["".join(cell("td", name, value) for name, value in row.items()) for row in rows]
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _figure(picture: Picture) -> str:
    data = base64.b64encode(picture.png).decode()
    return (
        f'<figure id="{html(picture.name)}"><img alt="{html(picture.title)}" width="{picture.width}" '
        f'src="data:image/png;base64,{data}"><figcaption>{html(picture.caption)}</figcaption></figure>'
    )


def write_file(path: Path, content: bytes) -> None:
    """Write a file. Raises `UserError` where it cannot be written."""
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_pictures(pictures: Sequence[Picture], folder: Path) -> list[Path]:
    """Write each picture as a PNG file into a folder, which is made. Raises `UserError` where it cannot be."""
    paths = [folder / f"{p.name}.png" for p in pictures]
    for path, one in zip(paths, pictures, strict=True):
        write_file(path, one.png)
    return paths


def write_hits(path: Path, pages: Sequence[Picture]) -> None:
    """Write pages of hits as one PNG file, where there is one page, or as one HTML file that needs no other.

    Raises:
        UserError: the file cannot be written.
    """
    write_file(path, pages[0].png if path.suffix == ".png" else page("Hits", [], [], {"Hits": pages}).encode())
