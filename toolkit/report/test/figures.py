"""A test's figures as data: curves, labels, caption and alternative text, without drawing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.characteristics.catalogue import figures
from toolkit.estimate import plus_minus
from toolkit.report.content import Curve, Plot
from toolkit.report.style import Style, kept
from toolkit.report.tags import format_number
from toolkit.report.test.content import REPORT, ReportedTest
from toolkit.units import printed

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic, Figure
    from toolkit.characteristics.model import Row
    from toolkit.pipeline import TestResult
    from toolkit.reduction.model import Condition
    from toolkit.tires.model import CurveFit

ANGLES_DEG = (1, 2, 4, 6, 8, 10)
TURNED = "the tire turned round on the hub"
_AXES_NOTE = "SAE J670 axes"
_SYMBOLS = {"FY": "lateral force FY", "MZ": "aligning moment MZ"}


def curve_values(fit: CurveFit, slip_rad: np.ndarray) -> np.ndarray:
    """Return a fitted curve at slip angles [rad] (n,), [N] or [N·m]."""
    from toolkit.tires.evaluate import value_at

    return np.asarray(value_at(fit, slip_rad), dtype=np.float64)


def load_groups(conditions: Sequence[Condition]) -> list[tuple[float, tuple[Condition, ...]]]:
    """Return the conditions by load, lightest first: (mean common load [N], conditions).

    Blocks of one nominal load share ``FZ_common``; a gap of 4 % separates two loads.
    """
    groups: list[list[Condition]] = []
    for condition in sorted(conditions, key=lambda c: c.FZ_common):
        if groups and condition.FZ_common - groups[-1][-1].FZ_common <= 0.04 * condition.FZ_common:
            groups[-1].append(condition)
        else:
            groups.append([condition])
    return [(float(np.mean([c.FZ_common for c in group])), tuple(group)) for group in groups]


@REPORT.figures(
    {
        "fy_vs_slip": "lateral force against slip angle, all loads",
        "mz_vs_slip": "aligning moment against slip angle, all loads",
        "fy_vs_load": "lateral force against load at constant slip angles",
        "mz_vs_load": "aligning moment against load at constant slip angles",
        "gough": "Gough plot: lateral force against aligning moment",
        **{figure.name: figure.text for figure in figures()},
    }
)
def build_plots(report: ReportedTest, style: Style) -> Iterable[Plot | None]:
    """Return every figure that the test has data for."""
    maker = _Plots(report.result, style, report.watermark)
    return (
        maker.against_slip("FY"),
        maker.against_slip("MZ"),
        maker.against_load("FY"),
        maker.against_load("MZ"),
        maker.gough(),
        *maker.characteristics(),
    )


class _Plots:
    def __init__(self, result: TestResult, style: Style, watermark: str | None) -> None:
        self.result, self.style, self.watermark = result, style, watermark
        self.groups = load_groups(result.reduced.used())
        self.loads = [load for load, _ in self.groups]
        self.fits = result.characteristics.fits
        self.at_angles: dict[tuple[str, str], list[Row]] = {}
        for row in result.characteristics.rows:
            if row.SA_rad is not None:
                self.at_angles.setdefault((row.name, row.rotation), []).append(row)
        self.tire = result.reduced.info.tire_size or result.reduced.info.name

    def _scale(self, channel: str) -> tuple[str, float]:
        unit, factor = self.style.unit("N" if channel in ("FY", "FZ") else "N*m")
        return printed(str(unit)), factor

    def _number(self, value: float, spec: str = ".0f", factor: float = 1.0) -> str:
        return format_number(value, kept(spec, factor), decimal_comma=self.style.decimal_comma)

    def _ends(self, values: Sequence[float], factor: float) -> str:
        return " to ".join(self._number(values[end], factor=factor) for end in (0, -1))

    def _load_text(self, load: float) -> str:
        unit, factor = self._scale("FZ")
        return f"{self._number(load * factor, factor=factor)} {unit}"

    def _group(self, load: float) -> int:
        return min(range(len(self.loads)), key=lambda i: abs(self.loads[i] - load), default=0)

    def _fit(self, rotation: str, load: float, channel: str) -> CurveFit | None:
        index = self._group(load)
        for direction in self.fits:
            if direction.rotation == rotation and self._group(direction.load_N) == index:
                fit: CurveFit | None = getattr(direction, channel)
                return fit
        return None

    def _rotations(self) -> list[str]:
        rotations = {c.rotation for c in self.result.reduced.used()}
        return [rotation for rotation in ("forward", "reverse") if rotation in rotations]

    def _plot(
        self, name: str, x: str, y: str, curves: list[Curve], caption: str, alt: str, **more: bool | str
    ) -> Plot | None:
        if not any(curve.x for curve in curves):
            return None
        mark = f"{self.watermark}. " if self.watermark else ""
        return Plot(
            name=name,
            x_label=x,
            y_label=y,
            curves=tuple(curves),
            caption=f"{caption}.",
            alt=f"{mark}{alt} Axis system: SAE J670.",
            watermark=self.watermark,
            zero_x=bool(more.get("zero_x", False)),
            legend_title=str(more["legend"]) if "legend" in more else None,
        )

    def against_slip(self, channel: str) -> Plot | None:
        """Measured means and fitted curves against slip angle, one colour a load."""
        unit, factor = self._scale(channel)
        curves, sentences, lines = [], [], False
        for index, (load, group) in enumerate(self.groups):
            for rotation in self._rotations():
                points = sorted((c for c in group if c.rotation == rotation), key=lambda c: c.SA)
                if not points:
                    continue
                x = [math.degrees(c.SA) for c in points]
                y = [getattr(c, f"{channel}_common") * factor for c in points]
                label = self._load_text(load)
                curves.append(_curve(label, x, y, index, "points", open_=rotation == "reverse"))
                sentences.append(
                    f"{label} {rotation}: {self._ends(y, factor)} {unit} "
                    f"from {self._number(x[0], '.1f')} to {self._number(x[-1], '.1f')} deg"
                )
                fit = self._fit(rotation, load, channel)
                grid = np.linspace(x[0], x[-1], 121)
                drawn = curve_values(fit, np.radians(grid)) if fit else None
                if drawn is not None:
                    lines = True
                    curves.append(
                        _curve(label, grid, drawn * factor, index, "line", open_=rotation == "reverse")
                    )
        symbol = _SYMBOLS[channel]
        how = f"reversed by {TURNED}" if self.result.reduced.info.reversal == "tire" else "reversed"
        turned = f"; filled: forward, open and dashed: {how}" if len(self._rotations()) > 1 else ""
        curves_text = ", fitted curves as lines" if lines else ""
        return self._plot(
            f"{channel.lower()}_vs_slip",
            "slip angle SA [deg]",
            f"{symbol} [{unit}]",
            curves,
            f"{_upper(symbol)} against slip angle at {len(self.groups)} loads, measured means as symbols"
            f"{curves_text}{turned}. {_AXES_NOTE}",
            f"{_upper(symbol)} [{unit}] against slip angle [deg] at {len(self.groups)} loads. "
            f"{'; '.join(sentences)}.",
            legend="load FZ",
            zero_x=True,
        )

    def _at_angle(
        self, channel: str, load: float, group: Sequence[Condition], angle: float
    ) -> tuple[float, float] | None:
        """Return a value at a slip angle [deg] and its expanded uncertainty, 0 where none is known."""
        for rotation in self._rotations():
            for row in self.at_angles.get((channel, rotation), ()):
                same_load = self._group(row.load_N) == self._group(load)
                if not same_load or row.estimate is None or row.SA_rad is None:
                    continue
                if abs(math.degrees(row.SA_rad) - angle) < 1e-6:
                    U, _ = row.estimate.expanded()
                    return row.estimate.value, U if math.isfinite(U) else 0.0
        fit = self._fit("forward", load, channel) or self._fit("reverse", load, channel)
        if fit is not None:
            return float(curve_values(fit, np.radians([angle]))[0]), 0.0
        near = [c for c in group if abs(math.degrees(c.SA) - angle) <= 0.5]
        return (float(np.mean([getattr(c, f"{channel}_common") for c in near])), 0.0) if near else None

    def against_load(self, channel: str) -> Plot | None:
        """Values at +-1, 2, 4, 6, 8, 10 deg against load."""
        unit, factor = self._scale(channel)
        load_unit, load_factor = self._scale("FZ")
        curves, sentences = [], []
        for index, size in enumerate(ANGLES_DEG):
            for angle in (size, -size):
                points = [
                    (load * load_factor, value[0] * factor, value[1] * factor)
                    for load, group in self.groups
                    if _covers(group, angle)
                    and (value := self._at_angle(channel, load, group, angle)) is not None
                ]
                if not points:
                    continue
                x, y, U = zip(*points, strict=True)
                curves.append(_curve(f"±{size} deg", x, y, index, "both", open_=angle < 0, error=U))
                sentences.append(f"{angle:+d} deg: {self._ends(y, factor)} {unit}")
        symbol = _SYMBOLS[channel]
        return self._plot(
            f"{channel.lower()}_vs_load",
            f"load FZ [{load_unit}]",
            f"{symbol} [{unit}]",
            curves,
            f"{_upper(symbol)} against load at constant slip angles, from the curves fitted to the means; "
            "filled: positive, open and dashed: negative slip angle; bars: expanded uncertainty (95 %). "
            f"{_AXES_NOTE}",
            f"{_upper(symbol)} [{unit}] against load [{load_unit}] at constant slip angles of plus and minus "
            f"{', '.join(str(a) for a in ANGLES_DEG)} deg. {'; '.join(sentences)}.",
            legend="slip angle",
        )

    def gough(self) -> Plot | None:
        """FY against MZ: lines of constant load and of constant slip angle."""
        fy_unit, fy = self._scale("FY")
        mz_unit, mz = self._scale("MZ")
        curves: list[Curve] = []
        at: dict[int, list[tuple[float, float]]] = {}
        for index, (load, group) in enumerate(self.groups):
            points = sorted((c for c in group if c.rotation == self._rotations()[0]), key=lambda c: c.SA)
            x, y = [c.MZ_common * mz for c in points], [c.FY_common * fy for c in points]
            curves.append(_curve(self._load_text(load), x, y, index, "points"))
            fits = self._fit(points[0].rotation, load, "FY"), self._fit(points[0].rotation, load, "MZ")
            if not points or fits[0] is None or fits[1] is None:
                continue
            grid = np.linspace(points[0].SA, points[-1].SA, 121)
            fitted_y, fitted_x = curve_values(fits[0], grid), curve_values(fits[1], grid)
            curves.append(_curve(self._load_text(load), fitted_x * mz, fitted_y * fy, index, "line"))
            for angle in (s * a for a in ANGLES_DEG for s in (1, -1)):
                if _covers(points, angle):
                    slip = np.radians([angle])
                    xx, yy = curve_values(fits[1], slip), curve_values(fits[0], slip)
                    at.setdefault(angle, []).append((float(xx[0]) * mz, float(yy[0]) * fy))
        for line in sorted(at):
            if len(at[line]) > 1:
                xs, ys = zip(*at[line], strict=True)
                curves.append(_curve("", xs, ys, 0, "grid", note=f"{line:+d}°"))
        loads = ", ".join(self._load_text(load) for load in self.loads)
        return self._plot(
            "gough",
            f"aligning moment MZ [{mz_unit}]",
            f"lateral force FY [{fy_unit}]",
            curves,
            "Gough plot: lateral force against aligning moment; coloured: constant load, grey: constant slip "
            f"angle. {_AXES_NOTE}",
            f"Gough plot, lateral force FY [{fy_unit}] against aligning moment MZ [{mz_unit}], with lines of "
            f"constant load ({loads}) and of constant slip angle"
            + (f" ({', '.join(f'{a:+d}' for a in sorted(at))} deg)." if at else "."),
            legend="load FZ",
        )

    def _series(self, rows: Sequence[Row], factor: float) -> tuple[list[float], list[float], list[float]]:
        """Return loads, values and expanded uncertainties as drawn; 0 where there is no uncertainty."""
        _, load_factor = self._scale("FZ")
        x, y, u = [], [], []
        for row in rows:
            if row.estimate is not None and math.isfinite(row.estimate.value):
                x.append(row.load_N * load_factor)
                y.append(row.estimate.value * factor)
                U = row.estimate.expanded()[0] * factor
                u.append(U if math.isfinite(U) else 0.0)
        return x, y, u

    def _against(
        self, figure: Figure, series: list[tuple[str, Characteristic, tuple[Row, ...]]]
    ) -> Plot | None:
        """Characteristics of one figure against load: (label, what it is, its rows)."""
        first = series[0][1]
        style_unit, style_factor = self.style.unit(first.printed_unit)
        unit, (load_unit, load_factor) = printed(str(style_unit)), self._scale("FZ")
        factor = style_factor * first.factor
        curves, listed = [], []
        for index, (label, declared, rows) in enumerate(series):
            x, y, u = self._series(rows, factor)
            if not x:
                continue
            curves.append(_curve(label, x, y, index, "both", error=u, open_="reverse" in label))
            spec = kept(f".{declared.digits}f", style_factor)
            values = ", ".join(
                plus_minus(b, c, spec=spec, decimal_comma=self.style.decimal_comma)
                + f" at {self._number(a, factor=load_factor)}"
                for a, b, c in zip(x, y, u, strict=True)
            )
            listed.append(f"{label}: {values} {load_unit}")
        return self._plot(
            figure.name,
            f"load FZ [{load_unit}]",
            f"{figure.title} [{unit}]",
            curves,
            f"{_upper(figure.title)} against load; bars: expanded uncertainty (95 %). {_AXES_NOTE}",
            f"{_upper(figure.title)} [{unit}] against load [{load_unit}] with expanded uncertainty. "
            f"{'; '.join(listed)}.",
        )

    def characteristics(self) -> list[Plot | None]:
        """The catalogue's figures against load; those of directions with a series for each."""
        plots = []
        of = self.result.characteristics.of
        for figure, members in figures().items():
            rotations = self._rotations() if members[0].scope == "direction" else [None]
            series = [
                (
                    member.series_label + (f", {rotation}" if rotation else ""),
                    member,
                    of(member.name, rotation=rotation),
                )
                for rotation in rotations
                for member in members
            ]
            plots.append(self._against(figure, series) if series else None)
        return plots


def _covers(group: Sequence[Condition], angle: float) -> bool:
    # A curve is never read outside the slip angles that were measured, beyond the tolerance of a step.
    measured = [math.degrees(c.SA) for c in group]
    return bool(measured) and min(measured) - 0.5 <= angle <= max(measured) + 0.5


def _curve(
    label: str,
    x: Sequence[float] | np.ndarray,
    y: Sequence[float] | np.ndarray,
    group: int,
    style: Literal["points", "line", "both", "grid"],
    *,
    open_: bool = False,
    error: Sequence[float] | None = None,
    note: str | None = None,
) -> Curve:
    return Curve(
        label=label,
        x=tuple(float(v) for v in x),
        y=tuple(float(v) for v in y),
        group=group,
        style=style,
        open=open_,
        note=note,
        error=tuple(error) if error is not None else None,
    )


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
