"""The picture of a budget: what each component adds, and U over the range of the load."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError
from toolkit.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.calibration.uncertainty.model import Budget

FORMATS = (".png", ".svg", ".pdf")


def write_figure(path: Path, budget: Budget, over_range: Sequence[Budget]) -> Path:
    """Draw a budget to a file, whole or not at all.

    Raises
    ------
    ConfigError
        ``output-name``: the file's ending is none of png, svg and pdf
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(
            "a picture cannot be written in this format", where=path, got=path.suffix or "no ending",
            expected=", ".join(FORMATS), next_step="choose a name with one of these endings",
            rule="output-name",
        )  # fmt: skip
    from matplotlib.figure import Figure

    from toolkit.report.calibration.chart_figures import whole_ticks

    drawing = Figure(figsize=(8.0, 3.6), layout="constrained")
    left, right = drawing.subplots(1, 2, width_ratios=(1.15, 1.0))
    parts = sorted((one for one in budget.components if one.stated and one.u > 0), key=lambda one: one.u)
    names = [f"{one.name} ({one.type})" for one in parts] + ["combined"]
    colours = ["#4477aa"] * len(parts) + ["#222222"]
    left.barh(names, [*(one.u for one in parts), budget.u], color=colours)
    left.set_xlabel(f"standard uncertainty [{budget.unit}]")
    left.set_title(f"{budget.record}: {budget.load} = {budget.at:.5g} {budget.unit}", fontsize=10)
    for at, one in enumerate(parts):
        left.text(one.u, at, f" {100 * budget.share(one):.0f} %", va="center", fontsize=8)
    left.margins(x=0.14)
    if budget.not_stated:
        missing = "not stated: " + ", ".join(budget.not_stated)
        drawing.supxlabel(missing, fontsize=8, x=0.01, ha="left")
    right.plot(
        [one.at for one in over_range], [one.U for one in over_range], color="#4477aa", marker="o", ms=3
    )
    right.set_ylim(0, 1.15 * max(one.U for one in over_range))
    right.set_xlabel(f"{budget.load} [{budget.unit}]")
    right.set_ylabel(f"U, {100 * budget.probability:.0f} % [{budget.unit}]")
    for axis in (left.xaxis, right.yaxis):
        whole_ticks(axis)
    left.locator_params(axis="x", nbins=5)
    right.grid(visible=True, alpha=0.3)
    right.set_title("expanded uncertainty over the range", fontsize=10)
    buffer = io.BytesIO()
    drawing.savefig(buffer, format=path.suffix.lower()[1:], dpi=150)
    write_atomic(path, buffer.getvalue())
    return path
