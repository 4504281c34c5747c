"""How every picture looks: sizes, fonts, palettes that colour-blind readers can tell apart, safe texts, PNG.

Every figure has a `title` of one line and below it, where there is something to say, a `note` of one line.
"""

from __future__ import annotations

import io
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, cached_property, wraps
from typing import Any, Final, ParamSpec, TypeAlias, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from motionlake.arrays import Float64Array, FloatArray, IntArray
from motionlake.names import printable

P = ParamSpec("P")
R = TypeVar("R")
Line: TypeAlias = tuple[str, dict[str, Any]]  # the name of a line, and keywords of `Axes.plot` that say how it looks

DPI: Final = 150
HINTED: Final = 1.05  # letters on whole pixels take a little more room than their outlines
TOP: Final = 0.62  # inches that a sheet's title and note take
LINE: Final = 0.2  # inches from line to line of a legend
INK: Final = "#222222"
FAINT: Final = "#777777"
NONE: Final = "#e4e4e4"
UNKNOWN: Final = "unknown"
UNLABELLED: Final = "no label"
# The "muted" scheme of Paul Tol, made for readers with any colour vision.
PALETTE: Final = (
    "#332288", "#CC6677", "#117733", "#DDAA33", "#88CCEE", "#882255", "#44AA99", "#999933", "#AA4499",
)  # fmt: skip
MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X")
HATCHES: Final = ("", "///", "...", "xxx", "\\\\\\", "ooo", "+++")
_STYLE: Final[dict[Any, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.axisbelow": True,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.labelsize": 8,
    "axes.linewidth": 0.7,
    "text.color": INK,
    "text.parse_math": False,  # a clip may be called "$1"
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.size": 2,
    "ytick.major.size": 2,
    "hatch.linewidth": 0.6,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """The style of all pictures while a function draws."""

    @wraps(draw)
    def inner(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context({**matplotlib.rcParamsDefault, **_STYLE, "backend": matplotlib.get_backend()}):
            return draw(*args, **kwargs)

    return inner


@styled
def png(figure: Figure) -> bytes:
    """A figure as a PNG file; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()


@styled
def written(figure: Figure, kind: str) -> bytes:
    """A figure as a file, "png", "svg" or "pdf", without the time at which it was made."""
    if kind == "png":
        return png(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, metadata={"Date" if kind == "svg" else "CreationDate": None})
    return buffer.getvalue()


class Sheet:
    """A figure on which all is placed in inches from the top left, so that texts keep their room."""

    def __init__(self, width: float, height: float, title: str, note: str = "") -> None:
        self.width, self.height = width, height
        self.figure = Figure(figsize=(width, height))
        self.text(0.12, 0.26, title, size=11.5, weight="bold", room=width - 0.2)
        if note:
            self.text(0.12, 0.46, note, size=8, color=FAINT, room=width - 0.2)

    @cached_property
    def canvas(self) -> Axes:
        """One axes over all of the sheet, in inches from the top left: many axes would be slow."""
        axes = self.figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_autoscale_on(False)
        axes.set_xlim(0, self.width)
        axes.set_ylim(self.height, 0)
        return axes

    def box(self, left: float, top: float, width: float, height: float, colour: Any, hatch: str = "") -> None:
        """A filled rectangle."""
        self.canvas.add_patch(
            Rectangle((left, top), width, height, facecolor=colour, hatch=hatch, edgecolor="white", linewidth=0)
        )

    def outline(self, left: float, top: float, width: float, height: float, **look: Any) -> None:
        """A rectangle that is not filled."""
        self.canvas.add_patch(Rectangle((left, top), width, height, fill=False, **look))

    def image(self, left: float, top: float, width: float, height: float, colours: Float64Array) -> None:
        """Rows and columns of colours [rows, columns, 3] as blocks."""
        extent = (left, left + width, top + height, top)
        self.canvas.imshow(colours, extent=extent, aspect="auto", interpolation="nearest")

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        box = (left / self.width, 1 - (top + height) / self.height, width / self.width, height / self.height)
        return self.figure.add_axes(box)

    def bare(self, left: float, top: float, width: float, height: float, *sides: str) -> Axes:
        """Axes without ticks, and without lines on other sides than those named."""
        axes = self.axes(left, top, width, height)
        axes.set(xticks=[], yticks=[])
        for name, side in axes.spines.items():
            side.set_visible(name in sides)
        return axes

    def plot(self, left: float, top: float, width: float, height: float, across: str, up: str) -> Axes:
        """Axes with a grid, named below and on the left."""
        axes = self.axes(left, top, width, height)
        axes.set(xlabel=across, ylabel=up)
        axes.grid(color="#ececec", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        return axes

    def line_legend(self, left: float, lines: Iterable[Line]) -> None:
        """The names of lines below one another, each behind a piece of its line."""
        for i, (name, look) in enumerate(lines):
            y = TOP + 0.15 + i * LINE
            self.canvas.plot([left, left + 0.35], [y, y], **look)
            self.text(left + 0.43, y, name, size=8, va="center_baseline", room=self.width - left - 0.5)

    def text(
        self, x: float, y: float, text: str, *, size: float = 8.5, color: str = INK, weight: str = "normal",
        ha: str = "left", va: str = "baseline", room: float = 1e9,
    ) -> None:  # fmt: skip
        """Text at `x`, `y` inches from the top left, cut in the middle where it is wider than `room` inches."""
        self.figure.text(
            x / self.width, 1 - y / self.height, fitted(text, room, size, weight), fontsize=size, color=color,
            weight=weight, ha=ha, va=va,
        )  # fmt: skip


def tick_seconds(axes: Axes, seconds: float) -> None:
    """The horizontal axis from 0 to so many seconds, with ticks at whole steps."""
    axes.set_xlim(0, seconds)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=12, steps=[1, 2, 5, 10]))
    axes.tick_params(pad=1.5)


@cache
def _glyphs() -> frozenset[int]:
    return frozenset(get_font(findfont(FontProperties(family="DejaVu Sans"))).get_charmap())


def plain(text: str) -> str:
    """A text that draws without warnings: one line, controls spelled out, no character that the font lacks."""
    glyphs = _glyphs()
    return "".join(c if c.isprintable() and ord(c) in glyphs else "�" for c in " ".join(printable(text).split()))


@cache
def _advance(character: str, weight: str) -> float:
    """Width of a character in inches at one point of size."""
    font = get_font(findfont(FontProperties(family="DejaVu Sans", weight=weight)))
    font.set_size(100, 72)
    return float(font.load_char(ord(character)).linearHoriAdvance / 65536 / 100 / 72)


def width_of(text: str, size: float, weight: str = "normal") -> float:
    """Inches that a line of text takes."""
    return HINTED * size * sum(_advance(c, weight) for c in text)


def widest(names: Iterable[str], size: float, most: float, weight: str = "normal") -> float:
    """Inches that the longest of some names takes, at most `most`."""
    return min(most, max(width_of(plain(name), size, weight) for name in names))


def fitted(text: str, inches: float, size: float, weight: str = "normal") -> str:
    """`plain` and at most so wide, cut in the middle: names tend to differ at both ends."""
    text = plain(text)
    if width_of(text, size, weight) <= inches:
        return text

    def cut(kept: int) -> str:
        return f"{text[: -(-kept // 2)]}…{text[len(text) - kept // 2 :]}"

    fits = bisect_right(range(len(text)), inches, key=lambda kept: width_of(cut(kept), size, weight))
    return cut(fits - 1) if fits else ""


@dataclass(frozen=True)
class ClassStyle:
    """How a class is drawn: colour everywhere, marker on maps, hatch in bands."""

    colour: str
    marker: str
    hatch: str


def class_styles(names: Iterable[str]) -> dict[str, ClassStyle]:
    """One style a class, in the order given; 63 differ. Unknown and unlabelled are grey."""
    grey = {UNKNOWN: ClassStyle("#c4c4c4", ".", "////"), UNLABELLED: ClassStyle("#a0a0a0", ".", "")}
    names = dict.fromkeys(names)
    styles = {}
    for i, name in enumerate(n for n in names if n not in grey):
        again, colour = divmod(i, len(PALETTE))
        styles[name] = ClassStyle(PALETTE[colour], MARKERS[again % len(MARKERS)], HATCHES[again % len(HATCHES)])
    return styles | {name: style for name, style in grey.items() if name in names}


def motif_colours(order: IntArray) -> Float64Array:
    """[K, 3] colour of each motif: a cubehelix (Green 2011), so neighbours in `order` look alike.

    Lightness rises all along it, which tells motifs apart for every colour vision and in grey print.

    Args:
        order: [K] motifs from first to last.
    """
    place = np.linspace(0, 1, len(order))
    step = np.resize([0.0, 0.07, -0.07], len(order))  # next neighbours differ a little in lightness
    light, turn = 0.18 + 0.64 * place + step, 2 * np.pi * (1 / 6 - 2 * place)
    depth = 0.9 * light * (1 - light)
    mix = np.array([[-0.14861, 1.78277], [-0.29227, -0.90649], [1.97294, 0.0]])
    helix = light[:, None] + depth[:, None] * (np.stack([np.cos(turn), np.sin(turn)], axis=1) @ mix.T)
    colours = np.empty((len(order), 3))
    colours[order] = np.clip(helix, 0, 1)
    return colours


def shades(values: FloatArray, *stops: str) -> Float64Array:
    """[..., 3] colours of values from 0 to 1, in even steps from the first to the last of some colours."""
    return np.asarray(LinearSegmentedColormap.from_list("", stops)(values))[..., :3]


def ink_on(colour: str | Float64Array) -> str:
    """Black or white, whichever reads better on a colour."""
    rgb = np.array(to_rgb(colour) if isinstance(colour, str) else colour[:3])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return "black" if linear @ [0.2126, 0.7152, 0.0722] > 0.18 else "white"
