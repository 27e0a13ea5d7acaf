"""Reduced test to characteristics: curves of every load and direction, then what is read off them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.characteristics.groups import Direction, DirectionFit, Group, directions_of, group
from toolkit.characteristics.model import Characteristics, Point, Row
from toolkit.characteristics.rows import point_u, rows_of
from toolkit.characteristics.shared_errors import shared_errors_of
from toolkit.findings import Finding
from toolkit.tires.evaluate import estimate_at
from toolkit.tires.fit import fit_curves, why_not
from toolkit.tires.model import Curve
from toolkit.units import in_both

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.errors import FitError
    from toolkit.machine import Machine
    from toolkit.reduction.model import ReducedTest


def characterise(
    reduced: ReducedTest, *, machine: Machine, record: CalibrationRecord | None
) -> Characteristics:
    """Fit every load and direction and derive the characteristics.

    ``record`` gives the covariance of its coefficients; None where the reduced test came without it.
    """
    groups = group(reduced)
    fits, findings = _fit(groups)
    directions = directions_of(reduced, fits)
    shared = shared_errors_of(reduced, machine=machine, record=record)
    return Characteristics(
        fits=fits,
        rows=tuple(replace(row, parts=()) for row in rows_of(directions, shared=shared)),
        findings=(*findings, *_line_findings(directions)),
        points=tuple(
            Point(file=file, first_row=row, u_FY=u["FY"], u_MZ=u["MZ"])
            for (file, row), u in point_u(directions, shared=shared).items()
        ),
    )


def characteristic_rows(
    reduced: ReducedTest,
    characteristics: Characteristics,
    *,
    machine: Machine,
    record: CalibrationRecord | None,
) -> tuple[Row, ...]:
    """Return the rows that have a value, with the parts of their uncertainty, to compare them."""
    rows = rows_of(
        directions_of(reduced, characteristics.fits),
        shared=shared_errors_of(reduced, machine=machine, record=record),
    )
    return tuple(row for row in rows if row.estimate is not None)


def _curve(group: Group, channel: Literal["FY", "MZ"]) -> Curve:
    return Curve(SA=group.SA, y=group.values(channel), channel=channel, load_N=group.load_N, axes="SAE")


def _fit(groups: tuple[Group, ...]) -> tuple[tuple[DirectionFit, ...], tuple[Finding, ...]]:
    """Fit every curve that can be fitted, all in one batch; the others become findings and None."""
    declared = [
        (index, curve) for index, g in enumerate(groups) for curve in (_curve(g, "FY"), _curve(g, "MZ"))
    ]
    refused = {(index, curve.channel): why_not(curve) for index, curve in declared}
    good = [(index, curve) for index, curve in declared if refused[index, curve.channel] is None]
    solved = dict(
        zip(
            [(index, curve.channel) for index, curve in good],
            fit_curves([curve for _, curve in good]) if good else (),
            strict=True,
        )
    )
    findings = _refused_findings(groups, refused)
    findings += [
        Finding(rule="not-converged", where=f"{_where(groups[index])}, {channel}", message=fit.message)
        for (index, channel), fit in solved.items()
        if not fit.converged
    ]
    fits = tuple(
        DirectionFit(
            rotation=g.rotation, load_N=g.load_N, FY=solved.get((index, "FY")), MZ=solved.get((index, "MZ"))
        )
        for index, g in enumerate(groups)
    )
    return fits, tuple(findings)


def _refused_findings(
    groups: tuple[Group, ...], refused: Mapping[tuple[int, Literal["FY", "MZ"]], FitError | None]
) -> list[Finding]:
    """Return one finding for all curves of a direction that have the same problem."""
    places: dict[tuple[str, str, str], dict[str, dict[int, None]]] = {}
    for (index, channel), problem in refused.items():
        if problem is not None:
            text = f"{problem.what} (got {problem.got}, expected {problem.expected})"
            key = (groups[index].rotation, problem.rule or "not-fitted", text)
            places.setdefault(key, {}).setdefault(channel, {})[index] = None
    findings = []
    for (rotation, rule, text), channels in places.items():
        loads = dict.fromkeys(index for indices in channels.values() for index in indices)
        where = in_both([groups[index].load_N for index in loads], "lbf", ".0f")
        findings.append(
            Finding(
                rule=rule,
                where=f"drum {rotation}, {where}, {' and '.join(channels)}",
                message=f"{text}; what these curves feed is null",
            )
        )
    return findings


def _where(group: Group) -> str:
    return f"drum {group.rotation}, {in_both(group.load_N, 'lbf', '.0f')}"


def _line_findings(directions: Sequence[Direction]) -> list[Finding]:
    """Hold the curve's value at SA = 0 against the line through the nearest points."""
    findings = []
    for direction in directions:
        SA = direction.group.SA
        if not (len(SA) > 1 and SA[0] <= 0.0 <= SA[-1]):
            if direction.fit.FY is not None:
                message = "the slip angles lie on one side of zero: stiffness and pull at SA = 0 are null"
                findings.append(Finding(rule="one-sided", where=_where(direction.group), message=message))
            continue
        for channel, unit, fit in (("FY", "N", direction.fit.FY), ("MZ", "N*m", direction.fit.MZ)):
            if fit is None:
                continue
            at_zero = estimate_at(fit, 0.0)
            line = float(np.interp(0.0, SA, direction.group.values(channel)))
            # The line itself is wrong by the curve's bend: a fiftieth of the range is left to it.
            limit = max(5 * at_zero.u, 0.02 * float(np.ptp(direction.group.values(channel))))
            if abs(at_zero.value - line) > limit:
                findings.append(
                    Finding(
                        rule="curve-against-line",
                        where=_where(direction.group),
                        message=f"{channel} at SA = 0 is {in_both(at_zero.value, unit)} by the curve, "
                        f"{in_both(line, unit)} by the line through the nearest points: look at the "
                        "residuals",
                    )
                )
    return findings
