"""Reduced test to characteristics: curves of every load and direction, then what is read off them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.characteristics.groups import Group, group
from toolkit.characteristics.model import Characteristics, DirectionFit
from toolkit.characteristics.pull import Direction, pull
from toolkit.characteristics.shared import Shared, line_at_zero, weights_at_zero
from toolkit.characteristics.stiffness import stiffness
from toolkit.findings import Finding
from toolkit.tires.evaluate import estimate_at
from toolkit.tires.fit import fit_curves, why_not
from toolkit.tires.model import Curve
from toolkit.units import from_si

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
    directions = [Direction(group=g, fit=f) for g, f in zip(groups, fits, strict=True)]
    shared = Shared(
        record=record,
        machine_axes=machine.axes,
        tared=reduced.tare.source != "none",
        u_SA_zero=machine.stated_uncertainty("SA").u,
        u_cell_zero=tuple(u for _, u in reduced.tare.u),
    )
    pulls = []
    for load in sorted({d.group.load_N for d in directions}):
        there = {d.group.rotation: d for d in directions if d.group.load_N == load}
        pulls.append(pull(load, there.get("forward"), there.get("reverse"), shared=shared))
    return Characteristics(
        fits=fits,
        stiffness=tuple(stiffness(d.group, d.fit, shared=shared) for d in directions),
        pull=tuple(pulls),
        findings=(*findings, *_line_findings(directions)),
    )


def _curve(group: Group, channel: Literal["FY", "MZ"]) -> Curve:
    return Curve(SA=group.SA, y=group.values(channel), channel=channel, load_N=group.load_N, axes="SAE")


def _fit(groups: tuple[Group, ...]) -> tuple[tuple[DirectionFit, ...], tuple[Finding, ...]]:
    """Fit every curve that can be fitted, all in one batch; the others become findings and None."""
    wanted = [
        (index, curve) for index, g in enumerate(groups) for curve in (_curve(g, "FY"), _curve(g, "MZ"))
    ]
    refused = {(index, curve.channel): why_not(curve) for index, curve in wanted}
    good = [(index, curve) for index, curve in wanted if refused[index, curve.channel] is None]
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
    same: dict[tuple[str, str, str], dict[str, dict[int, None]]] = {}
    for (index, channel), problem in refused.items():
        if problem is not None:
            text = f"{problem.what} (got {problem.got}, expected {problem.expected})"
            key = (groups[index].rotation, problem.rule or "not-fitted", text)
            same.setdefault(key, {}).setdefault(channel, {})[index] = None
    found = []
    for (rotation, rule, text), channels in same.items():
        loads = dict.fromkeys(index for indices in channels.values() for index in indices)
        where = ", ".join(f"{float(from_si(groups[index].load_N, 'lbf')):.0f}" for index in loads)
        found.append(
            Finding(
                rule=rule,
                where=f"drum {rotation}, {where} lbf, {' and '.join(channels)}",
                message=f"{text}; what these curves feed is null",
            )
        )
    return found


def _where(group: Group) -> str:
    return f"drum {group.rotation}, {float(from_si(group.load_N, 'lbf')):.0f} lbf"


def _line_findings(directions: list[Direction]) -> list[Finding]:
    """Hold the curve's value at SA = 0 against the line through the nearest points."""
    found = []
    for one in directions:
        if one.fit.FY is not None and not weights_at_zero(one.group):
            message = "the slip angles lie on one side of zero: stiffness and pull at SA = 0 are null"
            found.append(Finding(rule="one-sided", where=_where(one.group), message=message))
        for channel, fit in (("FY", one.fit.FY), ("MZ", one.fit.MZ)):
            line = line_at_zero(one.group, channel)
            if fit is None or line is None:
                continue
            at_zero = estimate_at(fit, 0.0)
            # The line itself is wrong by the curve's bend: a fiftieth of the range is left to it.
            limit = max(5 * at_zero.u, 0.02 * float(np.ptp(one.group.values(channel))))
            if abs(at_zero.value - line) > limit:
                found.append(
                    Finding(
                        rule="curve-against-line",
                        where=_where(one.group),
                        message=f"{channel} at SA = 0 is {at_zero.value:.4g} by the curve and {line:.4g} by "
                        "the line through the nearest points: look at the residuals",
                    )
                )
    return found
