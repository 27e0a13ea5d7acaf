"""A comparison's figures as data: characteristics against load, a series an entry (thesis 6.6 to 6.29)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.estimate import plus_minus
from toolkit.report.content import Curve, Plot
from toolkit.report.style import Style
from toolkit.report.tags import format_number

if TYPE_CHECKING:
    from toolkit.comparison.model import Comparison, Entry

_PER_DEGREE = math.pi / 180


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wanted:
    name: str
    quantities: tuple[str, ...]
    title: str
    unit: str
    per_degree: bool = False


FIGURES: tuple[_Wanted, ...] = (
    _Wanted(name="conicity", quantities=("conicity",), title="conicity", unit="N"),
    _Wanted(name="plysteer", quantities=("plysteer",), title="plysteer", unit="N"),
    _Wanted(name="crat", quantities=("CRAT",), title="conicity residual aligning torque", unit="N*m"),
    _Wanted(
        name="prat", quantities=("PRAT",), title="plysteer residual aligning torque at 0 deg", unit="N*m"
    ),
    _Wanted(
        name="prat_at_fy_zero",
        quantities=("PRAT_at_FY_zero",),
        title="plysteer residual aligning torque at FY = 0",
        unit="N*m",
    ),
    _Wanted(
        name="cornering_stiffness",
        quantities=("secant_cornering", "slope_cornering"),
        title="cornering stiffness",
        unit="N",
        per_degree=True,
    ),
    _Wanted(
        name="aligning_stiffness",
        quantities=("secant_aligning", "slope_aligning"),
        title="aligning stiffness",
        unit="N*m",
        per_degree=True,
    ),
)
_WAYS = {"secant": "±1 deg secant", "slope": "slope at 0 deg"}


def comparison_plots(comparison: Comparison, style: Style) -> dict[str, Plot]:
    """Return the figures by name; one that fewer than two entries have values for is left out.

    Stiffness is drawn by the ±1 deg secant, as the source document has it, with the drum forward.
    """
    plots = (_plot(comparison, wanted, style) for wanted in FIGURES)
    return {plot.name: plot for plot in plots if plot is not None}


def _plot(comparison: Comparison, wanted: _Wanted, style: Style) -> Plot | None:
    unit, factor = style.unit(f"{wanted.unit}/deg" if wanted.per_degree else wanted.unit)
    load_unit, load_factor = style.unit("N")
    scale = factor * (_PER_DEGREE if wanted.per_degree else 1.0)
    shown_unit = str(unit).replace("*", "·")
    curves, said = [], []
    for place, entry in enumerate(comparison.entries):
        x, y, U = _series(entry, wanted.quantities[0])
        if not x:
            continue
        x, y, U = [a * load_factor for a in x], [b * scale for b in y], [c * scale for c in U]
        curves.append(
            Curve(
                label=entry.label, x=tuple(x), y=tuple(y), error=tuple(U), group=place, style="both",
                open=entry.kind != "test",
            )
        )  # fmt: skip
        listed = ", ".join(
            f"{plus_minus(b, c, decimal_comma=style.decimal_comma)} at {_number(a, style)}"
            for a, b, c in zip(x, y, U, strict=True)
        )
        said.append(f"{entry.label}: {listed} {load_unit}")
    if len(curves) < 2:
        return None
    simulated = any(one.simulated for one in comparison.entries)
    words = (*(one.word for one in comparison.uses), "SIMULATED" if simulated else None)
    mark = " - ".join(dict.fromkeys(one for one in words if one))
    way = _WAYS.get(wanted.quantities[0].partition("_")[0])
    title = wanted.title + (f", {way}, drum forward" if way else "")
    title = title[:1].upper() + title[1:]
    return Plot(
        name=wanted.name,
        x_label=f"load FZ [{load_unit}]",
        y_label=f"{wanted.title} [{shown_unit}]",
        curves=tuple(curves),
        caption=f"{title} against load; bars: expanded uncertainty (95 %). SAE J670 axes.",
        alt=(f"{mark}. " if mark else "")
        + f"{title} [{shown_unit}] against load with expanded uncertainty. "
        + "; ".join(said)
        + ". Axis system: SAE J670.",
        watermark=mark or None,
        legend_title="compared",
    )


def _series(entry: Entry, name: str) -> tuple[list[float], list[float], list[float]]:
    """Return loads [N], values and expanded uncertainties in SI of one quantity of an entry."""
    rows = sorted(
        (row for row in entry.rows if row.name == name and row.rotation in ("both", "forward")),
        key=lambda row: row.load_N,
    )
    estimates = [row.number.estimate() for row in rows]
    U = [one.expanded()[0] for one in estimates]
    return (
        [row.load_N for row in rows],
        [one.value for one in estimates],
        [one if math.isfinite(one) else 0.0 for one in U],
    )


def _number(value: float, style: Style) -> str:
    return format_number(value, ".0f", decimal_comma=style.decimal_comma)
