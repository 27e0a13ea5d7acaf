"""The load-time refit of many records at once: the criteria of `refit`, on stacks of records of one shape.

It only ever says yes. A record that misses any criterion here, that has another method than ordinary least
squares, or that stands alone in its shape, is left to `refit.check_reproduces`, which
decides and names what is wrong. Each record of a stack is decomposed by itself, by the same algorithm: what
is shared is Python's time.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.calibration.registry.refit import (
    CRITERION,
    GOLDEN,
    GOLDEN_REFIT,
    RESIDUAL,
    SPREAD,
    reference_u,
    scatter_covariance,
)
from toolkit.calibration.terms import INTERCEPT, evaluate, issued_value, parse_term

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.session.table import Table

_EPS = float(np.finfo(float).eps)
Pair = tuple["CalibrationRecord", "Table"]


def reproducing(pairs: Sequence[Pair]) -> list[bool]:
    """Return for each record with its reference loads whether it certainly meets all criteria of `refit`."""
    reproduced = [False] * len(pairs)
    shapes: dict[Hashable, list[int]] = {}
    for at, (record, table) in enumerate(pairs):
        shape = _shape(record, table)
        if shape is not None:
            shapes.setdefault(shape, []).append(at)
    for places in shapes.values():
        if len(places) < 2:
            continue
        try:
            with np.errstate(all="ignore"):
                good = _accepted([pairs[at] for at in places])
        except (ValueError, TypeError, OverflowError, np.linalg.LinAlgError):
            # One of them is of another shape inside: each is judged alone.
            continue
        for at, is_good in zip(places, good.tolist(), strict=True):
            reproduced[at] = is_good
    return reproduced


def _shape(record: CalibrationRecord, table: Table) -> Hashable | None:
    """Return what records must have in common to be stacked; None for one that cannot be."""
    loads = record.loads
    if not loads or any(load.method != "ols" or load.terms != loads[0].terms for load in loads):
        return None
    units = dict(zip(table.names, table.units, strict=True))
    told = {cell.name: cell.unit for cell in record.cells} | {load.load: load.unit for load in loads}
    names = tuple(told)
    p, inputs = len(loads[0].terms), record.golden.inputs
    if (
        len(names) != len(record.cells) + len(loads)
        or any(units.get(name) != text for name, text in told.items())
        or any((load.n, load.dof) != (table.rows, table.rows - p) for load in loads)
        or any(
            load.reference_u not in (None, reference_u(table, load.load, load.unit, load.method))
            for load in loads
        )
        or len(inputs) <= len(record.cells)
        or table.rows <= p
    ):
        return None
    return (table.names, table.rows, names, len(loads), loads[0].terms, len(inputs))


def _accepted(pairs: Sequence[Pair]) -> NDArray[np.bool_]:
    """Judge records of one shape: m records, n rows, p terms, q loads, g golden vectors."""
    records, tables = [part for part, _ in pairs], [part for _, part in pairs]
    first = records[0]
    names, terms = tables[0].names, first.loads[0].terms
    values = np.array([table.values.T for table in tables])
    cells = values[:, [names.index(name) for name in first.indications]]
    loads = values[:, [names.index(load.load) for load in first.loads]]
    ranges = _numbers([[[c.minimum, c.maximum] for c in record.cells] for record in records])
    good = _equal(ranges, np.stack([cells.min(axis=2), cells.max(axis=2)], axis=2))
    low, high = loads.min(axis=2), loads.max(axis=2)
    ranges = _numbers([[[f.minimum, f.maximum] for f in record.loads] for record in records])
    good &= _equal(ranges, np.stack([low, high], axis=2))
    largest = np.maximum(np.abs(low), np.abs(high))
    coefficients = _numbers([[f.coefficients for f in record.loads] for record in records])
    good &= _equal(
        _numbers([[f.polarity for f in record.loads] for record in records]), np.sign(coefficients)
    )

    matrix = _terms(terms, first.indications, cells)
    m, n, p = matrix.shape
    has_constant = terms[-1] == INTERCEPT
    k = p - 1 if has_constant else p
    centre = matrix[:, :, :k].mean(axis=1) if has_constant else np.zeros((m, k))
    design = np.full((m, n, p), n**-0.5)
    design[:, :, :k] = matrix[:, :, :k] - centre[:, None]
    scale = np.sqrt(np.einsum("mij,mij->mj", design[:, :, :k], design[:, :, :k]))
    good &= (scale > 0).all(axis=1)
    scale[scale == 0] = 1.0
    design[:, :, :k] /= scale[:, None]
    basis, singular, right = np.linalg.svd(design, full_matrices=False)
    pseudo = right.transpose(0, 2, 1) / singular[:, None]
    y, across = loads.transpose(0, 2, 1), basis.transpose(0, 2, 1)
    solution = pseudo @ (across @ y)
    solution = solution + pseudo @ (across @ (y - design @ solution))
    residuals = y - design @ solution
    sd = np.sqrt(np.einsum("mij,mij->mj", residuals, residuals) / (n - p))
    back = np.zeros((m, p, p))
    back[:, range(k), range(k)] = 1 / scale
    if has_constant:
        back[:, k, :k] = -centre / scale
        back[:, k, k] = n**-0.5

    reach = np.ptp(matrix, axis=1)
    if has_constant:
        reach[:, -1] = 1.0
    moved = np.abs((back @ solution).transpose(0, 2, 1) - coefficients) * reach[:, None]
    good &= (moved.max(axis=2) <= CRITERION * largest).all(axis=1)
    extent = np.abs(matrix).max(axis=1)
    good &= np.array(
        [
            _issued(record, e, f)
            for record, e, f in zip(records, extent.tolist(), largest.tolist(), strict=True)
        ]
    )
    stored_sd = _numbers([[f.residual_sd for f in record.loads] for record in records])
    good &= (np.abs(stored_sd - sd) <= SPREAD * sd + RESIDUAL * largest).all(axis=1)

    root = back @ pseudo
    expected = (stored_sd**2)[:, :, None, None] * (root @ root.transpose(0, 2, 1))[:, None]
    operators = root @ basis.transpose(0, 2, 1)
    for i, (record, table) in enumerate(pairs):
        for j, load in enumerate(record.loads):
            if load.scatter is not None:
                likeliest = scatter_covariance(record, load, operators[i], table)
                expected[i, j] = np.nan if likeliest is None else likeliest
    errors = np.sqrt(np.einsum("mqii->mqi", expected))
    covariance = _numbers([[f.covariance for f in record.loads] for record in records])
    slack = SPREAD + 10 * _EPS * (singular[:, 0] / singular[:, -1]) ** 2
    allowed = slack[:, None, None, None] * errors[:, :, :, None] * errors[:, :, None]
    good &= (np.abs(covariance - expected) <= allowed).all(axis=(1, 2, 3))

    inputs = _numbers([record.golden.inputs for record in records])
    outputs = _numbers([record.golden.outputs for record in records])
    golden = _terms(terms, first.indications, inputs.transpose(0, 2, 1))
    golden_design = np.full(golden.shape, n**-0.5)
    golden_design[:, :, :k] = (golden[:, :, :k] - centre[:, None]) / scale[:, None]
    ours = coefficients @ golden.transpose(0, 2, 1)
    theirs = (golden_design @ solution).transpose(0, 2, 1)
    rounding = 64 * _EPS * (np.abs(coefficients) @ np.abs(golden).transpose(0, 2, 1))
    if outputs.shape != ours.shape or inputs.shape[2] != len(first.indications):
        raise ValueError("golden vectors of another shape")
    for predicted, share in ((ours, GOLDEN), (theirs, GOLDEN_REFIT)):
        good &= (np.abs(predicted - outputs) <= share * largest[:, :, None] + rounding).all(axis=(1, 2))
    return good


def _terms(terms: Sequence[str], names: Sequence[str], cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return terms (records, rows, terms) of indications (records, indications, rows)."""
    columns = {name: cells[:, at] for at, name in enumerate(names)}
    matrix = np.empty((len(cells), cells.shape[2], len(terms)))
    for at, name in enumerate(terms):
        matrix[:, :, at] = evaluate(parse_term(name), columns, 1.0)
    return matrix


def _issued(record: CalibrationRecord, extent: list[float], largest: list[float]) -> bool:
    return all(
        load.issued == tuple(issued_value(c, e, full) for c, e in zip(load.coefficients, extent, strict=True))
        for load, full in zip(record.loads, largest, strict=True)
    )


def _numbers(values: list[Any]) -> NDArray[np.float64]:
    """Return nested numbers as an array; what is missing, or only looks like a number, is a TypeError."""
    numbers = np.array(values)
    if numbers.dtype.kind not in "if":
        raise TypeError("not numbers")
    return numbers.astype(np.float64, copy=False)


def _equal(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
    if a.shape != b.shape:
        raise ValueError("stored numbers of another shape")
    return np.asarray((a == b).reshape(len(a), -1).all(axis=1))
