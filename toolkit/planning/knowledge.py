"""What a record knows of the session to come: its equations, its scatter, what loads will indicate.

Planned rows meet the record's own model of scatter (`records.scatter`) and the record's own budget, so that a
plan's U is the figure that `calibration budget` will print, computed by the same lines.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.rounding import rounding_of
from toolkit.calibration.fit.row_noise import weighed_rows
from toolkit.calibration.fit.run_scatter import spread
from toolkit.calibration.fit.session_rows import HIGHEST_POWER, SessionRows
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.records.scatter import RunScatter, rows_of
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import term_matrix
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.calibration.uncertainty.model import Budget
from toolkit.calibration.uncertainty.scatter import Scatter, scatter_of
from toolkit.errors import ConfigError
from toolkit.estimate import coverage_factor
from toolkit.planning.row_exchange import Response

DETECTABLE = 7.85
"""Noncentrality of one degree of freedom that a test at 5 % sees in 80 % of all sessions: (1.96 + 0.84)^2."""
RANK_TOLERANCE = 1e-6
"""Of terms scaled to unit size: singular values below are none."""
_POWERS = range(2, 8)
_DEPENDENT = 1e-6  # of a column's length: what other columns make of it
_REPEATABLE = 1e-9  # of the largest load: rows that repeat to rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Knowledge:
    """A record with its rows; ``scatter``, ``runs`` and ``today`` are of each load in the record's order.

    ``runs`` is the scatter that a plan takes (`cautious`).

    ``plane`` (loads + 1, indications) makes indications of loads, ``at`` are the loads at which U is stated,
    None the largest of the record's range, and ``today`` the budgets there.
    """

    record: CalibrationRecord
    loads: Table
    check: Table | None
    plane: Array
    scatter: tuple[Scatter, ...]
    runs: tuple[RunScatter, ...]
    today: tuple[Budget, ...]
    at: tuple[float | None, ...] = ()

    @classmethod
    def of(cls, record: CalibrationRecord, loads: Table, check: Table | None) -> Knowledge:
        """Return what a record and its stored rows tell.

        Raises
        ------
        ConfigError
            ``plan-record``: it was not fitted by ordinary least squares, or its rows do not scatter
        """
        for fit in record.loads:
            if fit.method != "ols":
                raise _unfit(record, fit, f"method {fit.method}", "a record fitted by ordinary least squares")
        names = [fit.load for fit in record.loads]
        design = np.column_stack([loads.matrix(names), np.ones(loads.rows)])
        size = np.maximum(np.abs(design).max(axis=0), 1e-300)
        plane = np.linalg.lstsq(design / size, loads.matrix(record.indications), rcond=None)[0]
        scatter = tuple(scatter_of(record, loads, fit) for fit in record.loads)
        for fit, noise in zip(record.loads, scatter, strict=True):
            if noise.runs.within <= _REPEATABLE * fit.largest:
                raise _unfit(
                    record, fit, f"scatter {noise.runs.within:.3g} {fit.unit}", "readings that scatter"
                )
        return cls(
            record=record, loads=loads, check=check, plane=plane / size[:, None], scatter=scatter,
            runs=tuple(cautious(noise) for noise in scatter),
            today=tuple(
                calibration_budget(record, loads, check, fit.load, scatter=noise)
                for fit, noise in zip(record.loads, scatter, strict=True)
            ),
        )  # fmt: skip

    def stated_at(self, at: Sequence[float]) -> Knowledge:
        """Return the same with U stated at these loads, in the record's order and units."""
        today = (
            calibration_budget(self.record, self.loads, self.check, fit.load, value, scatter=noise)
            for (fit, noise), value in zip(self._pairs(), at, strict=True)
        )
        return dataclasses.replace(self, at=tuple(at), today=tuple(today))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the loads."""
        return tuple(fit.load for fit in self.record.loads)

    def indications(self, loads: Array) -> Array:
        """Return what loads (rows, loads) will indicate (rows, indications)."""
        return np.column_stack([loads, np.ones(len(loads))]) @ self.plane

    def beside_the_loads(self, fit: LoadFit) -> tuple[str, float] | None:
        """Return the indication that least follows the named loads, and that part of its range.

        None where the loads of the record's own rows tell the terms of an equation apart: whatever cannot is
        then not for want of a name.
        """
        own_loads = self.loads.matrix(self.names)
        own = _unit_columns(self.terms(fit, own_loads))
        if np.linalg.matrix_rank(own, tol=RANK_TOLERANCE) == own.shape[1]:
            return None
        shown = self.loads.matrix(self.record.indications)
        rest = np.ptp(shown - self.indications(own_loads), axis=0)
        share = rest / np.maximum(np.ptp(shown, axis=0), 1e-300)
        return self.record.indications[int(np.argmax(share))], float(share.max())

    def terms(self, fit: LoadFit, loads: Array) -> Array:
        """Return the equation's terms (rows, terms) under loads (rows, loads)."""
        columns = dict(zip(self.record.indications, self.indications(loads).T, strict=True))
        return term_matrix(fit.terms, columns)

    def table(self, loads: Array, run: NDArray[np.intp], up: NDArray[np.bool_]) -> Table:
        """Return planned rows as a session's table, every reading as expected."""
        return Table(
            names=(*self.record.indications, *self.names),
            units=(*self.record.indication_units, *(fit.unit for fit in self.record.loads)),
            values=np.column_stack([self.indications(loads), loads]), run=run.astype(np.float64) + 1, up=up,
            rotation=None,
        )  # fmt: skip

    def responses(self, loads: Array, up: NDArray[np.bool_], *, misfits: float = 1.0) -> tuple[Response, ...]:
        """Return each load's model over feasible rows for the choice of rows.

        Beside the equation's terms, a misfit bent like powers of the load, a difference of the directions,
        and every run's zero and gain are allowed for: each of the size that the last session showed, of one
        repeatability at least, so that what it was too small to show can be seen in the next.

        Parameters
        ----------
        misfits : times that size of the misfit
        """
        return tuple(
            _response(self.terms(fit, loads), loads[:, at] / fit.largest, up, noise, self.runs[at], misfits)
            for at, (fit, noise) in enumerate(self._pairs())
        )

    def expected(self, table: Table) -> tuple[Budget, ...]:
        """Return the budgets that planned rows make where U is stated, scattering as `runs` has it.

        Raises
        ------
        SessionError
            ``budget``: the rows do not reach a load at which U is stated
        """
        return self._budgets([self._planned(at, table) for at in range(len(self.names))], table)

    def likely(self, table: Table) -> tuple[Budget, ...]:
        """Return the budgets of planned rows where runs differ as the record says, without `cautious`."""
        runs = tuple(
            dataclasses.replace(noise.runs, factor="run", correlation=0.0)
            if noise.runs.groups > 1
            else planned  # one run says nothing of the next
            for noise, planned in zip(self.scatter, self.runs, strict=True)
        )
        return dataclasses.replace(self, runs=runs).expected(table)

    def repeated(self) -> tuple[Budget, ...]:
        """Return the budgets that the record's own rows are expected to give another time."""
        table = self.loads
        run = np.ones(table.rows) if table.run is None else table.run
        up = np.ones(table.rows, dtype=bool) if table.up is None else table.up
        numbers = np.unique(run, return_inverse=True)[1].ravel().astype(np.intp)
        if not numbers.any():  # one run of all: as halves, so that they can be told apart at all
            numbers = (np.arange(table.rows) * 2 // table.rows).astype(np.intp)
        return self.expected(self.table(table.matrix(self.names), numbers, up))

    def simulated(self, table: Table, rng: np.random.Generator) -> tuple[Budget, ...]:
        """Return the budgets of one session of planned rows, its scatter drawn and estimated anew."""
        values = table.values.copy()
        run = np.asarray(table.run, dtype=np.intp) - 1
        for fit, sizes in zip(self.record.loads, self.runs, strict=True):
            at, runs = table.names.index(fit.load), int(run.max()) + 1
            relative = table.values[:, at] / fit.largest
            zero, gain = (rng.normal(size=runs) * sd for sd in (sizes.zero, sizes.gain))
            noise = rng.normal(size=table.rows) * sizes.within
            values[:, at] += zero[run] + gain[run] * relative + noise
        drawn = dataclasses.replace(table, values=values)
        scatters = [
            scatter_of(self.record, drawn, dataclasses.replace(fit, scatter=None))
            for fit in self.record.loads
        ]
        return self._budgets(scatters, table)

    def visible_misfit(self, table: Table) -> tuple[float | None, ...]:
        """Return of each load the misfit, at the rows' largest, that planned rows show in 80 % of sessions.

        The misfit is the lowest power of the load, from the square on, that neither the equation's terms nor
        the zeros of the runs make; None where the rows have too few levels for any.
        """
        sizes: list[float | None] = []
        for fit, noise in self._pairs():
            design = term_matrix(fit.terms, table.columns(self.record.indications))
            run = np.asarray(table.run)
            zeros = (run[:, None] == np.unique(run)).astype(np.float64)
            basis = np.linalg.svd(_unit_columns(np.column_stack([design, zeros])), full_matrices=False)
            q = basis[0][:, basis[1] > _DEPENDENT * basis[1][0]]
            applied = table.column(fit.load)
            relative = applied / (float(np.abs(applied).max()) or 1.0)
            rests = [relative**power - q @ (q.T @ relative**power) for power in _POWERS]
            squares = [float(rest @ rest) for rest in rests if rest @ rest > _DEPENDENT * table.rows]
            sizes.append(noise.runs.within * math.sqrt(DETECTABLE / squares[0]) if squares else None)
        return tuple(sizes)

    def weights(self, table: Table) -> Array:
        """Return what a unit error of every planned row makes where U is stated (loads, rows)."""
        weights = []
        for fit, budget in zip(self.record.loads, self.today, strict=True):
            design = term_matrix(fit.terms, table.columns(self.record.indications))
            point = np.array(budget.indications)[:, None]
            at = term_matrix(fit.terms, dict(zip(self.record.indications, point, strict=True)))
            rows = rows_of(design, table.column(fit.load), np.zeros(table.rows, dtype=np.int64))
            weights.append((at @ rows.operator)[0])
        return np.array(weights)

    def relative(self, table: Table) -> Array:
        """Return planned loads by the largest ones (loads, rows)."""
        return np.array([table.column(fit.load) / fit.largest for fit in self.record.loads])

    def floor(self, at: int) -> float:
        """Return U of a load, where it is stated, were its coefficients and its scatter known."""
        apart = [part.u**2 for part in self.today[at].components if part.name != "fit"]
        return math.sqrt(math.fsum(apart)) * coverage_factor(math.inf)

    def _pairs(self) -> list[tuple[LoadFit, Scatter]]:
        return list(zip(self.record.loads, self.scatter, strict=True))

    def _planned(self, at: int, table: Table) -> Scatter:
        fit, noise = self.record.loads[at], self.scatter[at]
        design = term_matrix(fit.terms, table.columns(self.record.indications))
        rows = SessionRows.of(design, table.column(fit.load), table, self.record.zero)
        sizes = self.runs[at]
        # A gain is a part of the load: rows that end lower have less of it at their largest.
        gain = sizes.gain * rows.largest / fit.largest
        runs = dataclasses.replace(sizes, gain=gain, groups=rows.groups, dof=rows.dof)
        planned = weighed_rows(
            design, rows.load, rows.group, None, rounding=rounding_of(self.record, fit, table)
        )
        return dataclasses.replace(noise, runs=runs, spread=spread(rows, runs), rows=planned)

    def _budgets(self, scatters: list[Scatter], table: Table) -> tuple[Budget, ...]:
        # The record that the planned rows will make ends where they end: no budget of it lies beyond.
        ends = [table.column(name) for name in self.names]
        fits = tuple(
            dataclasses.replace(fit, minimum=float(applied.min()), maximum=float(applied.max()))
            for fit, applied in zip(self.record.loads, ends, strict=True)
        )
        record = dataclasses.replace(self.record, loads=fits)
        return tuple(
            calibration_budget(record, self.loads, self.check, fit.load, at, scatter=scatter)
            for fit, scatter, at in zip(fits, scatters, self.at or (None,) * len(fits), strict=True)
        )


def cautious(scatter: Scatter) -> RunScatter:
    """Return the scatter that a plan takes for the next session's.

    Few runs tell little of how runs differ, and most often that they do not: the variances of their zeros and
    gains are taken a standard error above the estimate. One run tells nothing: what it does not state is
    taken as large as its repeatability.
    """
    runs = scatter.runs
    if runs.groups < 2:
        zero, gain = (size or runs.within for size in (runs.zero, runs.gain))
    else:
        zero, gain = (
            math.sqrt(size**2 + math.sqrt(max(float(scatter.spread[at, at]), 0.0)))
            for at, size in ((1, runs.zero), (2, runs.gain))
        )
    return dataclasses.replace(runs, factor="run", zero=zero, gain=gain, correlation=0.0)


def _response(
    terms: Array, relative: Array, up: NDArray[np.bool_], noise: Scatter, runs: RunScatter, misfits: float
) -> Response:
    """Return the model of one load, in units of its repeatability."""
    within = noise.runs.within
    side = np.where(up, 1.0, -1.0)
    bent = np.stack([relative**power for power in range(2, HIGHEST_POWER + 1)], axis=1)
    apart = np.stack([side, side * relative, side * relative**2], axis=1)
    misfit, reversal = (max(size, within) / within for size in (noise.misfit, noise.reversal))
    misfit *= misfits
    zero, gain = (max(size, within) / within for size in (runs.zero, runs.gain))
    wanted = terms.shape[1]
    scaled = _unit_columns(terms)
    precision = [np.zeros(wanted), np.full(bent.shape[1], misfit**-2), np.full(apart.shape[1], reversal**-2)]
    return Response(
        common=np.column_stack([scaled, bent, apart]),
        of_run=np.column_stack([np.ones(len(relative)), relative]),
        precision=np.concatenate(precision),
        run_precision=np.array([zero**-2, gain**-2]),
        targets=scaled,
    )


def _unit_columns(columns: Array) -> Array:
    """Return columns each divided by its largest size: terms differ by powers of ten."""
    size = np.abs(columns).max(axis=0)
    return np.asarray(columns / np.where(size > 0, size, 1.0))


def _unfit(record: CalibrationRecord, fit: LoadFit, got: str, expected: str) -> ConfigError:
    return ConfigError(
        "no plan can be made from this record", where=f"{record.id}, {fit.load}", got=got, expected=expected,
        next_step="plan from a session of its kind with --session", rule="plan-record",
    )  # fmt: skip
