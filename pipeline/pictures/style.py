"""How every picture looks: sizes, fonts, palettes that colour-blind readers can tell apart, safe texts, PNG."""

from __future__ import annotations

import io
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, wraps
from typing import Any, Final, ParamSpec, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.patches import Rectangle
from motionlake.arrays import Float64Array, IntArray

P = ParamSpec("P")
R = TypeVar("R")

DPI: Final = 150
HINTED: Final = 1.05  # letters on whole pixels take a little more room than their outlines
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
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "text.color": INK,
    "text.parse_math": False,  # a clip may be called "$1"
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
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

    def image(self, left: float, top: float, width: float, height: float, colours: Float64Array) -> None:
        """Rows and columns of colours [rows, columns, 3] as blocks."""
        extent = (left, left + width, top + height, top)
        self.canvas.imshow(colours, extent=extent, aspect="auto", interpolation="nearest")

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        box = (left / self.width, 1 - (top + height) / self.height, width / self.width, height / self.height)
        return self.figure.add_axes(box)

    def text(
        self, x: float, y: float, text: str, *, size: float = 8.5, color: str = INK, weight: str = "normal",
        ha: str = "left", va: str = "baseline", room: float = 1e9,
    ) -> None:  # fmt: skip
        """Text at `x`, `y` inches from the top left, cut in the middle where it is wider than `room` inches."""
        self.figure.text(
            x / self.width, 1 - y / self.height, fitted(text, room, size, weight), fontsize=size, color=color,
            weight=weight, ha=ha, va=va,
        )  # fmt: skip


TOP: Final = 0.62  # inches that a sheet's title and note take


def bare(axes: Axes, *keep: str) -> Axes:
    """Without ticks, and without the sides that are not kept."""
    axes.set_xticks([])
    axes.set_yticks([])
    for name, side in axes.spines.items():
        side.set_visible(name in keep)
    return axes


@cache
def _glyphs() -> frozenset[int]:
    return frozenset(get_font(findfont(FontProperties(family="DejaVu Sans"))).get_charmap())


def plain(text: str) -> str:
    """A text that draws without warnings: one line, no character that the font lacks."""
    glyphs = _glyphs()
    return "".join(c if c.isprintable() and ord(c) in glyphs else "�" for c in " ".join(text.split()))


@cache
def _advance(character: str, weight: str) -> float:
    """Width of a character in inches at one point of size."""
    font = get_font(findfont(FontProperties(family="DejaVu Sans", weight=weight)))
    font.set_size(100, 72)
    return float(font.load_char(ord(character)).linearHoriAdvance / 65536 / 100 / 72)


def width_of(text: str, size: float, weight: str = "normal") -> float:
    """Inches that a line of text takes."""
    return HINTED * size * sum(_advance(c, weight) for c in text)


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


def class_styles(names: Sequence[str]) -> dict[str, ClassStyle]:
    """One style a class, in the order given; 63 differ. Unknown and unlabelled are grey."""
    grey = {
        UNKNOWN: ClassStyle("#c4c4c4", ".", "////"),
        UNLABELLED: ClassStyle("#a0a0a0", ".", ""),
    }
    named = [n for n in dict.fromkeys(names) if n not in grey]
    styles = {
        name: ClassStyle(
            PALETTE[i % len(PALETTE)],
            MARKERS[i // len(PALETTE) % len(MARKERS)],
            HATCHES[i // len(PALETTE) % len(HATCHES)],
        )
        for i, name in enumerate(named)
    }
    return styles | {name: style for name, style in grey.items() if name in names}


def frequency_map() -> Colormap:
    """From cold and light (rare) to hot and dark (frequent): lightness falls all the way."""
    stops = ["#a9d0ec", "#6f9fd8", "#7b63b8", "#a63a8d", "#cf2554", "#b01017", "#5c0404"]
    return LinearSegmentedColormap.from_list("frequency", stops)


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


def ink_on(colour: str | Float64Array) -> str:
    """Black or white, whichever reads better on a colour."""
    rgb = np.array(to_rgb(colour) if isinstance(colour, str) else colour[:3])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return "black" if linear @ [0.2126, 0.7152, 0.0722] > 0.18 else "white"


def percent(share: float) -> str:
    """A share for reading: one digit after the point below one per cent."""
    value = 100 * share
    if 0 < value < 0.05:
        return "< 0.1 %"
    return f"{value:.0f} %" if value >= 0.95 or value == 0 else f"{value:.1f} %"
