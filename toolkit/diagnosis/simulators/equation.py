"""The functions of an equation's file, called with care: what they raise or give is told with its run."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.columnwise import columnwise
from toolkit.diagnosis.simulators.forces import Forces, ForcesTogether
from toolkit.diagnosis.simulators.integrate import OFF, wrong_rates
from toolkit.diagnosis.simulators.run_starts import start_name, without_starts
from toolkit.diagnosis.simulators.user_code import raised, silenced
from toolkit.effects.law import TIME
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.columnwise import Columnwise

    RatesAt = Callable[[Array, Array], Array]

_TRIED = 16  # rows
_POINTS = 4  # at which it is asked what a rate depends on


class Inputs:
    """Inputs between rows: linear, as a dict of floats."""

    def __init__(self, run: Run, names: Sequence[str]) -> None:
        self._t = run.t.tolist()
        self._columns = [(name, run.columns[name].tolist()) for name in names]
        self._at = 0
        self._last = len(self._t) - 1

    def __call__(self, t: float) -> dict[str, float]:
        """Return the inputs at a time."""
        if not self._columns:
            return {}
        times, i = self._t, self._at
        while i > 0 and t < times[i]:
            i -= 1
        while i < self._last - 1 and t >= times[i + 1]:
            i += 1
        self._at = i
        if self._last == 0:
            return self.row(0)
        w = (t - times[i]) / (times[i + 1] - times[i])
        w = 0.0 if w < 0 else (1.0 if w > 1 else w)
        return {name: (1 - w) * column[i] + w * column[i + 1] for name, column in self._columns}

    def row(self, k: int) -> dict[str, float]:
        """Return the inputs of a row."""
        return {name: column[k] for name, column in self._columns}


class Equation:
    """``rhs(t, x, u, p)``, ``outputs(x, u, p)`` and ``initial(p[, run])``, and the inputs u that they see."""

    def __init__(
        self, case: Case, rhs: Callable[..., Any], outputs: Callable[..., Any], initial: Callable[..., Any]
    ) -> None:
        self.case, self.rhs, self._outputs, self._initial = case, rhs, outputs, initial
        self._takes_run: bool | None = None  # `initial`, once it was asked
        self._drivers = tuple(channel.name for channel in case.drivers)
        self._shown = tuple(output.name for output in case.outputs)
        self.columns: Columnwise | None = None
        self._shown_columns: Columnwise | None = None

    def inputs(self, run: Run) -> Inputs:
        """Return a run's inputs between its rows."""
        return Inputs(run, self._drivers)

    def start(self, run: Run, p: Mapping[str, float]) -> Array:
        """Return the states at a run's first row, (states,)."""
        import inspect

        try:
            if self._takes_run is None:
                self._takes_run = len(inspect.signature(self._initial).parameters) > 1
            own = without_starts(p)
            given = self._initial(own, _as_dict(run)) if self._takes_run else self._initial(own)
            start = np.atleast_1d(np.asarray(given, dtype=np.float64)).astype(np.float64)
        except (Exception, SystemExit) as error:
            raise self.failure("initial", error, run, p) from error
        if start.ndim > 1:
            raise failed(self.case, run, f"initial gives an array of shape {start.shape}, not one of states")
        return start + [p.get(start_name(i, run.name), 0.0) for i in range(len(start))]

    def begins_read(self, p: Mapping[str, float]) -> NDArray[np.bool_]:
        """Return which states start where a channel's first row says, (states,)."""
        run = self.case.runs[0]
        start = self.start(run, p)
        columns = {name: x + (1e-6 * float(np.ptp(x)) or 1e-6) for name, x in run.columns.items()}
        with contextlib.suppress(FitError):  # nobody promises a start from other values
            return np.asarray(self.start(replace(run, columns=columns), p) != start)
        return np.zeros(len(start), dtype=bool)

    def begun(self, run: Run, start: Array, forces: Forces) -> Array:
        """Return the states that forces bring along at a run's first row, (added,)."""
        first = {name: float(run.columns[name][0]) for name in self._drivers}
        return forces.start(start, {**first, TIME: float(run.t[0])})

    def failure(self, function: str, error: BaseException, run: Run, p: Mapping[str, float]) -> FitError:
        """Return the error of what a function of the file raised, with the names that it was given."""
        beside = {"run": tuple(_as_dict(run))} if function == "initial" else {"u": self._drivers}
        return failed(self.case, run, f"{function}: {raised(error, p=without_starts(p), **beside)}")

    def kinematics(self, p: Mapping[str, float]) -> dict[int, int]:
        """Return velocity state -> position state where one state's rate is another state as it is."""
        rng = np.random.default_rng(0)
        run = self.case.runs[0]
        u = {name: float(run.columns[name][0]) for name in self._drivers}
        found: dict[int, int] = {}
        start = self.start(run, p)
        size = np.maximum(np.abs(start), 1.0)
        rates, points = [], []
        for _ in range(4):
            x = start + size * rng.normal(size=len(start))
            try:
                rates.append(np.asarray(self.rhs(float(run.t[0]), x.copy(), u, dict(p)), dtype=np.float64))
            except (Exception, SystemExit) as error:
                raise self.failure("rhs", error, run, p) from error
            if rates[-1].shape != start.shape:
                raise failed(self.case, run, wrong_rates(rates[-1], len(start)))
            points.append(x)
        for i in range(len(start)):
            for j in range(len(start)):
                if i != j and all(
                    abs(r[i] - x[j]) <= 1e-9 * (1 + abs(x[j])) for r, x in zip(rates, points, strict=True)
                ):
                    found[j] = i
        return found

    def feeds(self, p: Mapping[str, float]) -> dict[int, int]:
        """Return state -> the other state whose rate depends on it, of states that have just one such."""
        rng = np.random.default_rng(0)
        run = self.case.runs[0]
        u = {name: float(run.columns[name][0]) for name in self._drivers}
        start = self.start(run, p)
        depends = np.zeros((len(start), len(start)), dtype=bool)  # rate of the row's state on the column's
        for _ in range(_POINTS):
            x = start + 0.1 * np.maximum(np.abs(start), 1e-3) * rng.normal(size=len(start))
            points = np.tile(x, (len(x) + 1, 1))
            points[1:] += 0.1 * np.diag(np.maximum(np.abs(start), 1e-3))
            rates = np.full_like(points, np.nan)
            with contextlib.suppress(Exception, SystemExit):  # not every point is one of the plant's
                rates[:] = [self.rhs(float(run.t[0]), at, dict(u), dict(p)) for at in points]
            depends |= (np.isfinite(rates[1:]) & (rates[1:] != rates[0])).T
        np.fill_diagonal(depends, False)
        return {i: int(np.argmax(depends[:, i])) for i in range(len(start)) if depends[:, i].sum() == 1}

    def rates(self, run: Run, p: dict[str, float], forces: Forces, own: int) -> Callable[..., Any]:
        """Return (time, state) -> rate with forces in it; ``own`` states come before those of the forces."""
        plain, u = self.rhs, self.inputs(run)
        if not forces.listed:
            return lambda t, x: np.asarray(plain(t, x, u(t), p), dtype=np.float64)

        def rhs(t: float, x: Array) -> Array:
            rate = np.zeros(len(x))
            inputs = u(t)
            rate[:own] = plain(t, x[:own], dict(inputs), p)
            forces.add(x, rate, own, {**inputs, TIME: t})
            return rate

        return rhs

    def try_columns(self, run: Run, x: Array, p: Mapping[str, float]) -> None:
        """Find out whether `rhs` and `outputs` take columns; ``x`` are states near to which it is tried."""
        rng = np.random.default_rng(0)
        rows = np.unique(np.linspace(0, run.rows - 1, _TRIED).astype(np.intp))
        size = np.maximum(np.std(x, axis=1), 1e-3 * np.abs(x).max(axis=1))
        stray = np.where(size > 0, size, 1.0)[:, None] * rng.normal(size=(len(x), len(rows)))
        states = np.hstack([x[:, rows], x[:, rows] + stray])
        rows = np.tile(rows, 2)
        u = {name: run.columns[name][rows] for name in self._drivers}
        sets = {name: value * (1 + 0.1 * rng.normal(size=len(rows))) for name, value in p.items()}
        with silenced():
            self.columns = columnwise(
                self.rhs, lambda rhs, t, x, u, p: rhs(t, x, u, p), run.t[rows], states, u, sets
            )
            self._shown_columns = columnwise(self._outputs, self._ask, run.t[rows], states, u, sets)

    def _ask(self, outputs: Callable[..., Any], _: Any, x: Any, u: Any, p: Any) -> list[Any]:
        shown = outputs(x, u, p)
        values = [shown[name] for name in self._shown]
        if any(isinstance(value, str | bytes) for value in values):
            raise TypeError("a text")
        return values

    def rates_at(self, run: Run, p: Mapping[str, float], forces: Forces, own: int) -> RatesAt:
        """Return (times (m,), states (n, m)) -> their rates, forces among them."""
        p = without_starts(p)
        rate, columns = self.rates(run, p, forces, own), self.columns

        def by_row(t: Array, x: Array) -> Array:
            return np.stack([rate(at, x[:, k]) for k, at in enumerate(t.tolist())], axis=1)

        def at_once(t: Array, x: Array) -> Array:
            rates = np.zeros_like(x)
            u = {name: np.interp(t, run.t, run.columns[name]) for name in self._drivers}
            sets = {name: np.full(len(t), value) for name, value in p.items()}
            assert columns is not None  # noqa: S101  else by row
            rates[:own] = columns(t, x[:own].copy(), u, sets)
            ForcesTogether([forces], own).on(np.zeros(len(t), dtype=np.intp)).add(x, rates, {**u, TIME: t})
            return rates

        return by_row if columns is None else at_once

    def shown(self, run: Run, p: Mapping[str, float], x: Array) -> dict[str, Array]:
        """Return the outputs of states, (states, rows)."""
        at_once = self._shown_together(run, p, x)
        if at_once is not None:
            return at_once
        values, inputs = without_starts(p), self.inputs(run)
        rows: dict[str, list[float]] = {name: [] for name in self._shown}
        with silenced():
            for k in range(run.rows):
                try:
                    made = self._outputs(x[:, k].copy(), inputs.row(k), values)
                except (Exception, SystemExit) as error:
                    raise self.failure("outputs", error, run, p) from error
                if not isinstance(made, Mapping):
                    raise failed(self.case, run, f"outputs gives a {type(made).__name__}, not a dict")
                for name, column in rows.items():
                    if name not in made:
                        raise failed(
                            self.case, run, f"outputs gives no {name!r}; it gives {', '.join(map(str, made))}"
                        )
                    column.append(_number(made[name]))
        result = {name: np.array(column) for name, column in rows.items()}
        for name, values_of in result.items():
            if not np.isfinite(values_of).all():
                raise failed(self.case, run, f"no number in output {name!r}")
        return result

    def _shown_together(self, run: Run, p: Mapping[str, float], x: Array) -> dict[str, Array] | None:
        """Return the outputs of all rows by one call, None where that does not do: row by row says why."""
        if self._shown_columns is None:
            return None
        u = {name: run.columns[name] for name in self._drivers}
        sets = {name: np.full(run.rows, value) for name, value in without_starts(p).items()}
        try:
            with silenced():
                shown = self._shown_columns(run.t, np.ascontiguousarray(x), u, sets)
        except (Exception, SystemExit):  # noqa: BLE001 - whatever it is, the row alone raises it by name
            return None
        if not (np.abs(shown) < OFF).all():
            return None
        return dict(zip(self._shown, shown, strict=True))


def _number(value: Any) -> float:
    """Return a number of an outputs' dict; no number of a text, a complex one, or one too large to square."""
    if isinstance(value, (str, bytes)):
        return math.nan
    try:
        number = float(value)
    except (TypeError, ValueError):
        return math.nan
    return number if abs(number) < OFF else math.nan


def _as_dict(run: Run) -> dict[str, Any]:
    first = {name: float(values[0]) for name, values in run.columns.items()}
    return {**first, **run.declared}


def failed(case: Case, run: Run, got: str) -> FitError:
    """Return the error that a simulation cannot be integrated."""
    return FitError(
        "the simulation cannot be integrated",
        where=f"{case.simulation.path}, {run.name}",
        got=got,
        expected="rhs, outputs and initial that give finite numbers over the whole run",
        next_step="run the equation on that file by itself and mend it",
        rule="simulator",
    )
