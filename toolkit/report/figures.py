"""Draw a `Plot` as a lossless PNG: Agg, no global state, the same colour per load in every figure."""

from __future__ import annotations

import io
import re
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.report.content import Curve, Plot

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette: distinct for every common colour vision and in print; yellow left out.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = "os^Dvp*"
SIZE_IN = (6.3, 3.7)
LETTERS_PT = 10.0
"""Of the numbers at the axes, in a figure of this size."""
DPI = 150
_LINE, _WORD = 15, 13  # characters of a line and of a single word that fit beside the axes in a legend
_GREY = "#8a8a8a"


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A drawn figure: PNG bytes and its size in pixels."""

    png: bytes
    width_px: int
    height_px: int


def draw(plot: Plot) -> Picture:
    """Draw one figure.

    The margins are fixed fractions: measuring every text to trim them doubles the time.
    """
    import matplotlib as mpl
    from PIL import Image

    with mpl.rc_context(_RC):
        canvas: Any = _figure(plot).canvas
        canvas.draw()
        pixels = canvas.buffer_rgba()
    width, height = canvas.get_width_height()
    # The background is opaque: without the alpha channel LibreOffice writes no soft mask, in half the time.
    stream = io.BytesIO()
    image = Image.frombuffer("RGBA", (width, height), pixels, "raw", "RGBA", 0, 1).convert("RGB")
    image.save(stream, "PNG", compress_level=3, dpi=(DPI, DPI))
    return Picture(png=stream.getvalue(), width_px=width, height_px=height)


def draw_svg(plot: Plot) -> bytes:
    """Draw one figure as SVG, letters as outlines: the same data give the same file."""
    import matplotlib as mpl

    with mpl.rc_context(_RC | {"svg.hashsalt": "toolkit", "svg.fonttype": "path"}):
        stream = io.BytesIO()
        metadata: Any = {"Date": None}
        _figure(plot).savefig(stream, format="svg", metadata=metadata)
    return stream.getvalue()


def figure_of(plot: Plot) -> Figure:
    """Return one figure as matplotlib holds it, before it is a picture: for a notebook."""
    import matplotlib as mpl

    with mpl.rc_context(_RC):
        return _figure(plot)


def _figure(plot: Plot) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE_IN, dpi=DPI)
    FigureCanvasAgg(figure)
    labels = {(c.label, c.group) for c in plot.curves if c.label}
    aside = bool(plot.legend_title) or len(labels) > 1
    foot = 0.20 if plot.names else 0.135
    axes = figure.add_axes((0.115, foot, 0.70 if aside else 0.86, 0.97 - foot))
    _furnish(axes, plot)
    for curve in plot.curves:
        _curve(axes, curve)
    _legend(figure, plot)
    if plot.watermark:
        axes.text(
            0.5,
            0.5,
            plot.watermark,
            transform=axes.transAxes,
            ha="center",
            va="center",
            rotation=24,
            fontsize=30,
            color="#000000",
            alpha=0.10,
            fontweight="bold",
            zorder=0,
        )
    return figure


_RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Carlito", "Calibri", "Liberation Sans", "DejaVu Sans"],
    "font.size": LETTERS_PT,
    "axes.linewidth": 0.8,
    "axes.formatter.use_mathtext": False,
    "axes.unicode_minus": True,
    "path.simplify": True,
}


def _furnish(axes: Axes, plot: Plot) -> None:
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    axes.set_xlabel(plot.x_label)
    axes.set_ylabel(plot.y_label)
    axes.grid(visible=True, color="#d9d9d9", linewidth=0.6)
    axes.set_axisbelow(True)
    if plot.zero_y:
        axes.axhline(0.0, color="#606060", linewidth=0.8, zorder=1)
    if plot.zero_x:
        axes.axvline(0.0, color="#606060", linewidth=0.8, zorder=1)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if plot.decimal_comma:
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(_comma_formatter())
    round_steps = [1, 2, 2.5, 5, 10]
    axes.yaxis.set_major_locator(MaxNLocator(nbins=8, steps=round_steps))
    axes.xaxis.set_major_locator(
        MultipleLocator(2) if plot.zero_x else MaxNLocator(nbins=9, steps=round_steps)
    )
    if plot.names:
        axes.set_xticks(range(len(plot.names)), plot.names, rotation=25, ha="right", fontsize=9)
        axes.set_xlim(-0.6, len(plot.names) - 0.4)
        axes.grid(visible=False, axis="x")


def _comma_formatter() -> Any:
    from matplotlib.ticker import ScalarFormatter

    class Comma(ScalarFormatter):
        """Axis numbers with a decimal comma."""

        def __call__(self, x: float, pos: int | None = None) -> str:
            return str(super().__call__(x, pos)).replace(".", ",")

    return Comma(useOffset=False)


def _curve(axes: Axes, curve: Curve) -> None:
    colour = COLOURS[curve.group % len(COLOURS)]
    marker = MARKERS[curve.group % len(MARKERS)]
    dashes = (0, (4, 2)) if curve.open else "solid"
    face = "white" if curve.open else colour
    if curve.style == "grid":
        axes.plot(curve.x, curve.y, color=_GREY, linewidth=0.7, zorder=2)
        if curve.note:
            axes.annotate(
                curve.note,
                (curve.x[-1], curve.y[-1]),
                textcoords="offset points",
                xytext=(9 if curve.x[-1] >= 0 else -9, 7 if curve.y[-1] >= 0 else -7),
                ha="center",
                va="center",
                fontsize=7.5,
                color="#303030",
                zorder=6,
            )
        return
    if curve.style == "bars":
        axes.bar(curve.x, curve.y, curve.width, color=colour, zorder=3)
        for x, y, note in zip(curve.x, curve.y, curve.notes, strict=False):
            axes.annotate(note, (x, y), ha="center", va="bottom", fontsize=7.5, zorder=6)
        return
    if curve.style == "line":
        axes.plot(curve.x, curve.y, color=colour, linewidth=1.3, linestyle=dashes, zorder=3)
        return
    line = {"linestyle": "none"} if curve.style == "points" else {"linestyle": dashes, "linewidth": 1.2}
    if curve.error is not None and any(curve.error):
        axes.errorbar(
            curve.x,
            curve.y,
            yerr=curve.error,
            color=colour,
            marker=marker,
            markersize=5,
            mfc=face,
            capsize=3,
            elinewidth=1.0,
            zorder=4,
            **line,
        )
        return
    axes.plot(
        curve.x, curve.y, color=colour, marker=marker, markersize=4.5, mfc=face, mew=1.0, zorder=4, **line
    )


def _in_lines(label: str) -> str:
    """Return a legend's label in lines that end before the picture does."""
    lines = []
    for part in label.replace(", ", ",\n").split("\n"):
        for line in textwrap.wrap(part, _LINE, break_long_words=False):
            lines += [line] if " " in line else _chopped(line)
    return "\n".join(lines)


def _chopped(word: str) -> list[str]:
    """Return a word in pieces that fit: parted where names of files are joined, without a joint anywhere."""
    room = _WORD - 3 if sum(map(str.isupper, word)) > len(word) / 2 else _WORD
    pieces = [""]
    for part in re.split(r"(?<=[_./-])", word):
        if len(pieces[-1]) + len(part) <= room:
            pieces[-1] += part
        else:
            pieces += [part[i : i + room] for i in range(0, len(part), room)]
    return [piece for piece in pieces if piece]


def _legend(figure: Figure, plot: Plot) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Artist] = []
    labels = set()
    for curve in plot.curves:
        # A reversed run or a negative angle shares its colour and its entry with the other one.
        key = (curve.label, curve.group)
        if not curve.label or key in labels:
            continue
        labels.add(key)
        colour = COLOURS[curve.group % len(COLOURS)]
        alone = curve.open and curve.style == "both" and not plot.legend_title
        if curve.style == "bars":
            handles.append(Patch(color=colour, label=_in_lines(curve.label)))
            continue
        lines = {c.style for c in plot.curves if (c.label, c.group) == key} == {"line"}
        handles.append(
            Line2D(
                [],
                [],
                color=colour,
                marker="" if lines else MARKERS[curve.group % len(MARKERS)],
                markersize=5,
                linewidth=1.2,
                label=_in_lines(curve.label),
                mfc="white" if alone else colour,
                linestyle=(0, (4, 2)) if alone or (lines and curve.open) else "solid",
            )
        )
    if len(handles) > 1 or plot.legend_title:
        figure.legend(
            handles=handles,
            title=plot.legend_title,
            loc="upper left",
            bbox_to_anchor=(0.825, 0.975),
            frameon=False,
            fontsize=8.5,
            title_fontsize=8.5,
            borderaxespad=0.0,
            handlelength=1.8,
            alignment="left",
        )
