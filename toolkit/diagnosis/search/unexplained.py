"""What stays unexplained about a fit: smooth structure, lines, and more than the stated noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.lines import strongest_line
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.fit.structure import SmoothDependence, groups
from toolkit.diagnosis.policy import STEP, STRUCTURE
from toolkit.diagnosis.search.null import search_p_values
from toolkit.diagnosis.search.screen import LinearisedFit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StructureFound:
    """Structure that stays: where it is, and its p-value in the search."""

    output: str
    variables: tuple[str, ...]
    gain: float
    p_value: float


def remainder(problem: Problem, screen: LinearisedFit, base: Fit, seed: int) -> tuple[StructureFound, ...]:
    """Return what stays unexplained about a fit, the largest first; nothing that matters to nobody."""
    listed: list[SmoothDependence] = groups(problem, base)
    directions = [dependence.directions(problem) for dependence in listed]
    quick = [screen.quick(dependence) for dependence in directions]
    order = sorted(range(len(listed)), key=lambda i: -quick[i][0])
    gains = [gain for gain, _ in quick]
    trusts = [screen.trust(base.noise)] * len(listed)
    for place, i in enumerate(order):
        if place < STRUCTURE.sharpened:
            gains[i], _, trusts[i] = screen.gain(directions[i])
    least = min((gains[i] for i in order[: STRUCTURE.sharpened]), default=0.0)
    for i in order[STRUCTURE.sharpened :]:
        gains[i] = min(gains[i], least)
    weighed = [gain * trust for gain, trust in zip(gains, trusts, strict=True)]
    p_values = search_p_values(screen, [block for _, block in quick], weighed, seed)
    findings = [
        StructureFound(output=dependence.output, variables=dependence.variables, gain=gain, p_value=p)
        for dependence, gain, p in zip(listed, gains, p_values, strict=True)
        if p < STRUCTURE.alpha and _share(problem, base, dependence) > STEP.first
    ]
    for name in problem.names:
        line = strongest_line(problem, name, base.residual[name])
        if line is not None and line.p_value < STRUCTURE.line and line.share > STRUCTURE.line_share:
            gain = -2 * math.log(max(line.p_value, 1e-300))
            line_text = f"time (a line at {line.frequency:.4g} Hz)"
            findings.append(
                StructureFound(output=name, variables=(line_text,), gain=gain, p_value=line.p_value)
            )
        beyond = _beyond_noise(problem, base, name)
        if beyond is not None:
            findings.append(beyond)
    return tuple(sorted(findings, key=lambda dependence: -dependence.gain))


def _beyond_noise(problem: Problem, base: Fit, name: str) -> StructureFound | None:
    """Return the finding that a residual is larger than the sensor noise which a certificate states."""
    from scipy.stats import chi2

    sd, counted = problem.sd_of(name), problem.kept[name]
    if sd is None or counted.sum() < STRUCTURE.stated_rows:
        return None
    # Coarse steps add their own to what the sensor is stated to have.
    ratio = float(np.mean(base.residual[name][counted] ** 2)) / (sd**2 + problem.floor[name] ** 2)
    worth = max(counted.sum() / base.noise[name].correlation_rows, STRUCTURE.stated_worth)
    p = float(chi2.sf(ratio / STRUCTURE.stated**2 * worth, worth))
    if p >= STRUCTURE.alpha:
        return None
    gain = float(worth * (ratio - 1 - math.log(ratio)))
    return StructureFound(output=name, variables=("more than its stated noise",), gain=gain, p_value=p)


def _share(problem: Problem, base: Fit, group: SmoothDependence) -> float:
    """Return the share of a residual's variance that a group's columns explain."""
    counted = problem.kept[group.output]
    residual, columns = base.residual[group.output][counted], group.columns[counted]
    coefficients = np.linalg.lstsq(columns, residual, rcond=None)[0]
    return 1 - float(np.sum((residual - columns @ coefficients) ** 2)) / max(
        float(np.sum(residual**2)), 1e-300
    )
