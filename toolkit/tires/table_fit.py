"""Fit every load block of a table, and hold its small-angle slopes against the axes it declares."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Axes, channel_of, signs
from toolkit.errors import FitError
from toolkit.findings import Finding
from toolkit.reduction.limits import CONDITIONS, LARGEST_TRAIL_M, LEAST_LOAD_N, condition_finding, farthest
from toolkit.reduction.physics import departures, of_sizes, sliding
from toolkit.reduction.selection import Selection, of_one_condition
from toolkit.tires.evaluate import slope_estimate_at, value_at
from toolkit.tires.fit import Curve, fit_curves, why_not
from toolkit.tires.global_data import load_blocks, loaded_blocks
from toolkit.tires.model import CHANNEL_UNIT, CurveFit, Loss, TireModel
from toolkit.tires.models import fit_model
from toolkit.tires.plausibility import size_findings
from toolkit.tires.quality import median, shares
from toolkit.tires.table import TireTable
from toolkit.units import in_both, split_header

# Gross outliers that a least squares fit has followed: told, never removed.


_SUSPECT_PERCENT = 5.0  # fit error above which the curve is looked at again, whatever its residuals
_SUSPECT_SD = 4.0
_SURE_SD = 10.0  # robust standard deviations: misfit of a model and heavy tails of noise stay below
_SURE_SHARE = 0.05  # of the curve's largest value: what matters to the fit
_SD_OF_MEDIAN = 1.4826  # sd of a normal over the median of its absolute values


def gross_outliers(curves: Sequence[Curve], fits: Sequence[CurveFit]) -> tuple[Finding, ...]:
    """Return a finding for every Magic Formula fit by least squares whose rows hold gross outliers."""
    suspects = [
        curve
        for curve, fit in zip(curves, fits, strict=True)
        if fit.loss == "linear"
        and (fit.error_percent > _SUSPECT_PERCENT or _largest(_residual(fit, curve), curve) > _SUSPECT_SD)
    ]
    if not suspects:
        return ()
    findings = []
    for curve, fit in zip(suspects, fit_curves(suspects, loss="robust"), strict=True):
        residual = _residual(fit, curve)
        size = np.abs(residual)
        away = size > np.maximum(
            _SURE_SD * _SD_OF_MEDIAN * _typical(size, curve), _SURE_SHARE * np.abs(curve.y - residual).max()
        )
        if away.any():
            worst, unit = int(np.argmax(size)), CHANNEL_UNIT[curve.channel]
            load = "all loads" if curve.load_N is None else in_both(curve.load_N, "N", ".0f")
            text = (
                f"{int(away.sum())} of {len(size)} rows lie far from the curve of the others, the farthest "
                f"{in_both(curve.y[worst], unit, '.5g')} at {np.degrees(curve.SA[worst]):.2f} deg, by "
                f"{in_both(size[worst], unit)}: least squares follows them"
            )
            findings.append(Finding(rule="gross-outliers", where=f"{curve.channel} at {load}", message=text))
    return tuple(findings)


def _residual(fit: CurveFit, curve: Curve) -> Array:
    return np.asarray(curve.y - value_at(fit, curve.SA))


def _largest(residual: Array, curve: Curve) -> float:
    # In robust standard deviations; an exact fit has none.
    size = np.abs(residual)
    middle = _typical(size, curve)
    return float(size.max()) / (_SD_OF_MEDIAN * middle) if middle > 0 else 0.0


def _typical(size: Array, curve: Curve) -> float:
    low, high = curve.SA.min(), curve.SA.max()
    u = (2 * curve.SA - low - high) / (high - low)
    return float(median(size[None], shares(u[None], np.ones((1, len(u)), dtype=np.bool_)))[0])


# Sign of dy/dSA at small angles of a tire, see `toolkit.channels`.
_SLOPE_SIGN: dict[Axes, dict[str, int]] = {
    "SAE": {"FY": -1, "MZ": 1},
    "adapted-SAE": {"FY": 1, "MZ": -1},
    "ISO-W": {"FY": -1, "MZ": 1},
    "machine": {"FY": -1, "MZ": 1},
}
_NO_LOAD = 1.0  # N: a block below stands in the air, or its load was not recorded
_OUTLIERS = 0.02  # of a table's rows
_COPIES = 0.1  # of the rows
_SURE = 4.0  # standard errors by which a slope must differ from zero before its sign counts


@dataclass(frozen=True, slots=True, kw_only=True)
class TableFits:
    """Fits by model, load and channel, and what should be known about them."""

    fits: tuple[CurveFit, ...]
    findings: tuple[Finding, ...]


def slope_sign(axes: Axes, channel: str) -> int:
    """Return the sign of dFY/dSA or dMZ/dSA of a tire at small slip angles in an axis system.

    >>> slope_sign("SAE", "FY"), slope_sign("adapted-SAE", "FY")
    (-1, 1)
    """
    return _SLOPE_SIGN[axes][channel]


def table_curves(table: TireTable) -> tuple[Curve, ...]:
    """Return the curves of a table: every load block, FY and MZ; ``load_N`` is the block's mean load."""
    curves = []
    for rows in load_blocks(table["FZ"], table["SA"]):
        for channel in ("FY", "MZ"):
            y = table.get(channel)
            if y is not None:
                curves.append(
                    Curve(
                        SA=table["SA"][rows],
                        y=y[rows],
                        channel="FY" if channel == "FY" else "MZ",
                        load_N=float(table["FZ"][rows].mean()),
                        load_sd_N=float(table["FZ"][rows].std()),
                        axes=table.axes,
                    )
                )
    return tuple(curves)


def fit_table(table: TireTable, model: TireModel, *, loss: Loss = "linear") -> TableFits:
    """Fit a model to every load block and channel of a table, to the rows of one condition.

    Raises
    ------
    FitError
        not one curve of the table can be fitted; where only some cannot, that is a finding; ``no-pure-slip``
    """
    selection = _selection(table, model)
    curves = table_curves(table.take(selection.rows))
    problems = [_no_load(curve) or why_not(curve) for curve in curves]
    good = [curve for curve, problem in zip(curves, problems, strict=True) if problem is None]
    refused = [problem for problem in problems if problem is not None]
    if not good:
        first = refused[0]
        apart = f" of one condition: {'; '.join(selection.apart)}" if selection.left_out else ""
        raise FitError(
            first.what,
            where=f"{table.path}, {first.where}",
            got=f"{first.got}{apart}",
            expected=first.expected,
            next_step=first.next_step,
            rule=first.rule,
        )
    fits = list(fit_model(model, good, loss=loss))
    findings = list(selection.findings(models=[model.name], where=table.path.name))
    findings += [
        Finding(
            rule=refusal.rule or "not-fitted",
            where=refusal.where or str(table.path),
            message=f"{refusal.what}: {refusal.got}",
        )
        for refusal in refused
    ]
    findings += fit_findings(fits)
    if model.name == "magic_formula":
        findings += gross_outliers(good, fits)
    findings += (*row_findings(table), *axes_findings(table, fits), *size_findings(fits, table.path.name))
    return TableFits(fits=tuple(fits), findings=tuple(findings))


def _selection(table: TireTable, model: TireModel) -> Selection:
    # Of the loaded rows, as the models over all loads see them; blocks without load are told apart below.
    blocks = loaded_blocks(table["FZ"], table["SA"])
    if not blocks:
        return Selection(rows=np.ones(len(table["FZ"]), dtype=np.bool_))
    loaded = np.sort(np.concatenate(blocks))
    recorded = {symbol: column[loaded] for symbol, column in table.columns}
    selection = of_one_condition(recorded, model.reads, rows=len(loaded))
    rows = np.ones(len(table["FZ"]), dtype=np.bool_)
    rows[loaded] = selection.rows
    return replace(selection, rows=rows)


def _no_load(curve: Curve) -> FitError | None:
    if curve.load_N is None or curve.load_N >= _NO_LOAD:
        return None
    return FitError(
        "the load is missing: FZ is zero",
        where=f"{curve.channel} at {curve.load_N:.0f} N",
        got=f"a mean |FZ| of {curve.load_N:g} N over {len(curve.y)} rows",
        expected="the wheel load of every row, of either sign",
        next_step="put the measured load into the column FZ, in the unit that its header names",
        rule="no-load-block",
    )


def fit_findings(fits: list[CurveFit]) -> list[Finding]:
    """Return a finding for every fit whose minimum is not confirmed, and a note for every limitation."""
    findings = []
    for fit in fits:
        load = "all loads" if fit.load_N is None else in_both(fit.load_N, "N", ".0f")
        where = f"{fit.model} {fit.channel} at {load}"
        if not fit.converged:
            findings.append(Finding(rule="not-converged", where=where, message=fit.message))
        elif fit.not_determined:
            findings.append(Finding(rule="not-determined", where=where, message=fit.message, level="note"))
    return findings


def condition_findings(table: TireTable, only: Collection[str] = CONDITIONS) -> tuple[Finding, ...]:
    """Return the conditions of a table's rows that no tire is tested at, each by its farthest row."""
    units = {
        symbol: split_header(cell, lambda name: channel_of(name) is not None)[1]
        for (symbol, _), cell in zip(table.columns, table.header, strict=False)
    }
    findings = []
    for symbol, values in table.columns:
        if symbol not in only:
            continue
        sizes = np.abs(values) if symbol == "V" else values
        worst = farthest(symbol, (float(sizes.min()), float(sizes.max()))) if len(values) else None
        if worst is not None:
            row = int(np.argmin(np.abs(sizes - worst))) + 1
            findings.append(
                condition_finding(
                    symbol,
                    worst,
                    where=f"{table.path.name}, {symbol}, row {row}",
                    stated_in=units.get(symbol),
                )
            )
    return tuple(filter(None, findings))


def row_findings(table: TireTable) -> tuple[Finding, ...]:
    """Return where the rows of a table hold conditions, forces or moments that no tire has.

    Only sizes are judged, axes by `axes_findings`; a fiftieth of the rows may be
    gross outliers. A table may be of any tire: its trail is bounded by that of the largest.
    """
    unusual = condition_findings(table)
    FZ = table["FZ"]
    rows = FZ >= LEAST_LOAD_N
    if not rows.any():
        return unusual

    def column(symbol: str) -> Array:
        values = table.get(symbol)
        return np.zeros(int(rows.sum())) if values is None else values[rows]

    readings = of_sizes(
        [f"{table.path.name}, row {index + 1}" for index in np.flatnonzero(rows)],
        FZ=FZ[rows], SA=table["SA"][rows], FY=column("FY"), MZ=column("MZ"), FX=column("FX"),
        IA=column("IA"), trail_m=LARGEST_TRAIL_M,
    )  # fmt: skip
    cause = "is a column in another unit than its header says?"
    sideways = table.get("FY") is not None
    return unusual + tuple(
        departure.finding("warning", cause=cause)
        for departure in (*departures(readings, share=_OUTLIERS), *(sliding(readings) if sideways else ()))
    )


def repeat_findings(table: TireTable) -> list[Finding]:
    """Return a finding where over a tenth of the rows are copies of others in all columns but the time."""
    rows = np.column_stack([values for symbol, values in table.columns if symbol != "t"])
    _, count = np.unique(rows, axis=0, return_counts=True)
    copies = int((count - 1).sum())
    if copies <= _COPIES * len(rows):
        return []
    return [
        Finding(
            rule="duplicates",
            where=table.path.name,
            message=f"{copies} of {len(rows)} rows are copies of others, one of them stands {count.max()} "
            "times: they count as measurements of their own, and standard errors come out too small",
        )
    ]


def axes_findings(table: TireTable, fits: Sequence[CurveFit]) -> list[Finding]:
    """Return a finding for a channel whose slopes at small angles contradict the axes of the table."""
    findings = []
    for channel in ("FY", "MZ"):
        votes = []
        for fit in fits:
            if fit.channel == channel and fit.load_N is not None:
                slope = slope_estimate_at(fit, 0.0)
                if abs(slope.value) > _SURE * slope.u:
                    votes.append(int(np.sign(slope.value)) * _turn(fit.axes, table.axes, channel))
        expected = slope_sign(table.axes, channel)
        against = votes.count(-expected)
        if against and 2 * against > len(votes):
            word = "rises" if expected < 0 else "falls"
            findings.append(
                Finding(
                    rule="axes-contradiction",
                    where=f"{table.path.name}, {channel}",
                    message=f"{channel} {word} with SA at small angles in {against} of {len(votes)} load "
                    f"blocks: that contradicts the declared axes {table.axes}; nothing was flipped",
                )
            )
    return findings


def _turn(source: Axes | str, target: Axes, channel: str) -> int:
    # The factor by which a slope changes between two axis systems.
    flip = signs(source, target)  # type: ignore[arg-type]
    return flip[channel] * flip["SA"]
