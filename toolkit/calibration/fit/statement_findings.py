"""Findings of what a session states: what no laboratory can have had, and what its own rows contradict."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.printed_digits import own_scatter
from toolkit.calibration.fit.session_fit import SessionFit, session_statements
from toolkit.calibration.session.read import CellSetting
from toolkit.calibration.session.table import Table
from toolkit.findings import Finding

FIRST_YEAR = 1938  # of bonded strain gauges (Simmons, Ruge)
_OFF_STEP = 0.02  # of a resolution: what the conversion of units may move a reading
_OFF_ROWS = 0.1
_FEWEST_ROWS = 5
_MOST_NAMED = 10
_UNLOADED = 2e-3  # of the largest load
_ALONG = 0.99  # cosine of loads that are of one series


def statement_findings(fit: SessionFit) -> list[Finding]:
    """Return what of a session's statements cannot be, or is not what its rows show."""
    session, where = fit.session, fit.session.path.name
    findings: list[Finding] = []
    if session.date.year < FIRST_YEAR:
        message = (
            f"{session.date.isoformat()}, before the first bonded strain gauges of {FIRST_YEAR}: is the year "
            "right?"
        )
        findings.append(Finding(rule="session-date", where=where, message=message, level="error"))
    for stated in session_statements(session).reference.uncertainties:
        if stated.U == 0:
            message = (
                "U = 0 is stated of the reference: no standard is certified so, and the budget would take it "
                "for exact; state the U of its certificate, or leave the entry out"
            )
            findings.append(Finding(rule="reference-zero", where=stated.load, message=message, level="error"))
    findings += _resolutions(fit)
    wrong = direction_conflicts(session.table, [load.name for load in session.loads])
    if wrong:
        row_list = ", ".join(str(row) for row in wrong[:_MOST_NAMED])
        further = f" and {len(wrong) - _MOST_NAMED} more" if len(wrong) > _MOST_NAMED else ""
        message = (
            f"the load falls through rows labelled up, or rises through rows labelled down: rows {row_list}"
            f"{further}; the labels are wrong, or the rows are not in the order of loading. Reversibility is "
            "evaluated by these labels"
        )
        findings.append(Finding(rule="direction", where=where, message=message))
    return findings


def direction_conflicts(table: Table, loads: list[str]) -> list[int]:
    """Return the rows (from 1) that lie between a smaller and a larger load and have the other label.

    Neighbours are those of a run in the order of the file, of loads along one line through zero. Turning
    points may have either label. Of loads below zero, up may mean away from zero or towards larger numbers:
    what contradicts less is taken.
    """
    up = table.up
    if up is None:
        return []
    applied = table.matrix(loads)
    largest = np.abs(applied).max(axis=0)
    applied = applied / np.where(largest > 0, largest, 1.0)
    run = np.zeros(table.rows) if table.run is None else table.run
    order = np.argsort(run, kind="stable")
    before, at, after = order[:-2], order[1:-1], order[2:]
    size = np.linalg.norm(applied, axis=1)
    along = size[at] > _UNLOADED
    for beside in (before, after):
        product = np.einsum("ij,ij->i", applied[beside], applied[at])
        along &= (run[beside] == run[at]) & (
            (size[beside] <= _UNLOADED) | (product >= _ALONG * size[beside] * size[at])
        )
    first, last = size[at] - size[before], size[after] - size[at]
    monotone = along & (first * last > 0) & (np.minimum(np.abs(first), np.abs(last)) > _UNLOADED)
    at, rises = at[monotone], first[monotone] > 0
    main = applied[at, np.abs(applied[at]).argmax(axis=1)]
    conflicts = [np.sort(at[up[at] != (rises ^ turned)]) for turned in (np.zeros(len(at), bool), main < 0)]
    return [int(row) + 1 for row in min(conflicts, key=len)]


def _resolutions(fit: SessionFit) -> list[Finding]:
    """Return the stated resolutions whose steps the readings do not keep, and steps that nobody stated."""
    session = fit.session
    equations = [(session.terms, load.fit.coefficients, load.fit.residual_sd) for load in fit.loads]
    scatters = own_scatter(session.indications, equations)
    findings = []
    for cell, scatter in zip(session.cells, scatters, strict=True):
        if cell.step is not None:
            findings.append(_found_step(cell))
        if cell.resolution is None:
            continue
        off = _off_steps(session.table.column(cell.name), session.table.run, cell.resolution)
        if off.size < _FEWEST_ROWS or np.mean(off) <= _OFF_ROWS:
            continue
        text = f"{cell.resolution:.3g} {cell.unit}"
        alone = cell.resolution / math.sqrt(12)
        message = (
            f"a resolution of {text} is stated, and {np.count_nonzero(off)} of {off.size} readings are no "
            "whole number of such steps apart"
        )
        if scatter < alone:
            message += (
                f"; they scatter by {scatter:.2g} {cell.unit}, where rounding to {text} alone makes "
                f"{alone:.2g}: is its unit right?"
            )
        else:
            message += ": they are means of several, or the resolution is finer"
        findings.append(
            Finding(
                rule="resolution", where=cell.name, message=message,
                level="warning" if scatter < alone else "note",
            )
        )  # fmt: skip
    return findings


def _found_step(cell: CellSetting) -> Finding:
    return Finding(
        rule="resolution-found", where=cell.name, level="note",
        message=f"no resolution is stated, and the readings are whole steps of {cell.step:.4g} {cell.unit} "
        "apart, with little noise beside it: the step counts as the resolution, in U as if it were stated",
    )  # fmt: skip


def _off_steps(readings: Array, run: Array | None, step: float) -> NDArray[np.bool_]:
    """Return which readings are no whole number of steps from the first of their run, those left out."""
    group = np.zeros(len(readings)) if run is None else run
    _, first, inverse = np.unique(group, return_index=True, return_inverse=True)
    apart = (readings - readings[first][inverse.ravel()]) / step
    others = np.ones(len(readings), dtype=np.bool_)
    others[first] = False
    return np.asarray(np.abs(apart - np.rint(apart)) > _OFF_STEP)[others]
