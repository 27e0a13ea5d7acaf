"""Reduced test to characteristics: curves of every load and direction, then what is read off them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.characteristics.groups import Group, group
from toolkit.characteristics.model import Characteristics, DirectionFit
from toolkit.characteristics.pull import Direction, pull
from toolkit.characteristics.shared import Shared, line_at_zero
from toolkit.characteristics.stiffness import stiffness
from toolkit.findings import Finding
from toolkit.tires.fit import Curve, estimate_at, fit_curves
from toolkit.units import from_si

if TYPE_CHECKING:
    from toolkit.calibration.record import CalibrationRecord
    from toolkit.machine import Machine
    from toolkit.reduction.model import ReducedTest

# Six parameters and at least one degree of freedom.
_FEWEST_POINTS = 7


def characterise(
    reduced: ReducedTest, *, machine: Machine, record: CalibrationRecord | None
) -> Characteristics:
    """Fit every load and direction and derive the characteristics.

    ``record`` gives the covariance of its coefficients; None where the reduced test came without it.
    """
    groups = group(reduced)
    fits = _fit(groups)
    directions = [Direction(group=g, fit=f) for g, f in zip(groups, fits, strict=True)]
    shared = Shared(
        record=record,
        machine_axes=machine.axes,
        tared=reduced.tare.source != "none",
        u_SA_zero=machine.stated_uncertainty("SA").u,
    )
    pulls = []
    for load in sorted({d.group.load_N for d in directions}):
        there = {d.group.rotation: d for d in directions if d.group.load_N == load}
        pulls.append(pull(load, there.get("forward"), there.get("reverse"), shared=shared))
    return Characteristics(
        fits=fits,
        stiffness=tuple(stiffness(d.group, d.fit, shared=shared) for d in directions),
        pull=tuple(pulls),
        findings=(*_curve_findings(directions), *_line_findings(directions)),
    )


def _fit(groups: tuple[Group, ...]) -> tuple[DirectionFit, ...]:
    enough = [g for g in groups if len(g.conditions) >= _FEWEST_POINTS and np.ptp(g.SA) > 0]
    curves = [
        Curve(SA=g.SA, y=g.values(channel), channel=channel, load_N=g.load_N, axes="SAE")
        for g in enough
        for channel in ("FY", "MZ")
    ]
    solved = dict(zip([(id(g), c) for g in enough for c in ("FY", "MZ")], fit_curves(curves), strict=True))
    return tuple(
        DirectionFit(
            rotation=g.rotation, load_N=g.load_N, FY=solved.get((id(g), "FY")), MZ=solved.get((id(g), "MZ"))
        )
        for g in groups
    )


def _curve_findings(directions: list[Direction]) -> list[Finding]:
    found = []
    for one in directions:
        where = f"drum {one.group.rotation}, {float(from_si(one.group.load_N, 'lbf')):.0f} lbf"
        for channel, fit in (("FY", one.fit.FY), ("MZ", one.fit.MZ)):
            if fit is None:
                found.append(
                    Finding(
                        rule="too-few-angles",
                        where=where,
                        message=f"{len(one.group.conditions)} slip angles are too few for a {channel} curve "
                        f"(at least {_FEWEST_POINTS}); what it feeds is null",
                    )
                )
            elif not fit.converged:
                found.append(Finding(rule="not-converged", where=f"{where}, {channel}", message=fit.message))
    return found


def _line_findings(directions: list[Direction]) -> list[Finding]:
    """Hold the curve's value at SA = 0 against the line through the nearest points."""
    found = []
    for one in directions:
        for channel, fit in (("FY", one.fit.FY), ("MZ", one.fit.MZ)):
            line = line_at_zero(one.group, channel)
            if fit is None or line is None:
                continue
            at_zero = estimate_at(fit, 0.0)
            # A tenth of the channel's range: the line itself is wrong by the curve's bend.
            limit = max(5 * at_zero.u, 0.02 * float(np.ptp(one.group.values(channel))))
            if abs(at_zero.value - line) > limit:
                found.append(
                    Finding(
                        rule="curve-against-line",
                        where=f"drum {one.group.rotation}, {float(from_si(one.group.load_N, 'lbf')):.0f} lbf",
                        message=f"{channel} at SA = 0 is {at_zero.value:.4g} by the curve and {line:.4g} by "
                        "the line through the nearest points: look at the residuals",
                    )
                )
    return found
