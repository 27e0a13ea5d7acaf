"""Records and tables of known truth for budgets: one cell that reads a force."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit
from toolkit.calibration.session.table import Table


def table_of(
    cells: NDArray[np.float64],
    load: NDArray[np.float64],
    *,
    run: NDArray[np.float64] | None = None,
    direction: tuple[str, ...] | None = None,
    rotation: NDArray[np.float64] | None = None,
) -> Table:
    return Table(
        names=("S", "F"), units=("mV/V", "N"), values=np.column_stack([cells, load]),
        run=np.ones(len(load)) if run is None else run,
        up=np.array(direction or ("up",) * len(load)) == "up", rotation=rotation,
    )  # fmt: skip


def record_of_table(
    table: Table,
    terms: tuple[str, ...] = ("S", "intercept"),
    *,
    fit_zero: str = "included",
    coefficients: tuple[float, ...] | None = None,
    **settings: Any,
) -> CalibrationRecord:
    """Fit the table and return its record; ``settings`` are entries of its session."""
    cells, load = table.column("S"), table.column("F")
    fit = fit_terms(terms=terms, columns={"S": cells}, load=load)
    c = fit.coefficients if coefficients is None else coefficients
    one = LoadFit(
        load="F", unit="N", terms=terms, coefficients=c, issued=c, polarity=(1,) * len(terms),
        covariance=tuple(map(tuple, fit.covariance.tolist())), method="ols", n=len(load), dof=fit.dof,
        residual_sd=fit.residual_sd, minimum=float(load.min()), maximum=float(load.max()),
    )  # fmt: skip
    return CalibrationRecord(
        id="cell-r1", instrument="cell", kind="fit", date="2026-01-05", entered_by="operator one",
        zero=fit_zero,  # type: ignore[arg-type]
        cells=(Indication(name="S", unit="mV/V", minimum=float(cells.min()), maximum=float(cells.max())),),
        loads=(one,), golden=Golden(), data=(), settings=json.dumps(settings), inputs_sha256="",
    )  # fmt: skip


def levels(count: int = 10, runs: int = 3, both: bool = True) -> tuple[Any, ...]:
    """Return (load, run, direction) of equal runs from 100 N to 1000 N, up and down."""
    steps = np.linspace(100.0, 1000.0, count)
    one = np.concatenate([steps, steps[::-1]]) if both else steps
    word = ("up",) * count + (("down",) * count if both else ())
    return np.tile(one, runs), np.repeat(np.arange(1.0, runs + 1), len(one)), word * runs
