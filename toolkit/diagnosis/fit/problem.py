"""The problem that a case poses: runs, outputs and rows that count, nominal parameters with their priors."""

from __future__ import annotations

import bisect
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Layout, Memory, layout
from toolkit.diagnosis.fit.row_order import drivers_of
from toolkit.diagnosis.policy import ROWS
from toolkit.diagnosis.simulators.run_starts import RunStart
from toolkit.diagnosis.simulators.simulator import Model, TermPattern
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.simulator import Pattern
    from toolkit.simulation.plan_file import CaseParameter

    Stacked = dict[str, Array]


_QUARTERS = 2  # of a cycle, by which the columns of a pattern are apart: sine and cosine make every phase


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What is fitted and judged.

    ``kept`` masks the rows that count, for each output over all runs in their order; ``slices`` are the
    rows of each run; ``floor`` is the resolution of each output's numbers, or what the simulation itself is
    unsure by, below which no noise is known. ``rates`` has the outputs that only drift, and the rows by which
    the values are apart whose rate is judged. ``shown_sd`` has the noise of outputs that nobody stated, and
    that the recording shows to be less than what is left. ``memory`` has the rows to one independent value of
    the outputs whose rest is known to be no noise.
    """

    case: Case
    model: Model
    runs: tuple[Run, ...]
    free: tuple[CaseParameter | RunStart, ...]
    known: dict[str, float]
    observed: Stacked
    kept: dict[str, NDArray[np.bool_]]
    floor: dict[str, float]
    slices: tuple[slice, ...]
    rates: Mapping[str, int] = field(default_factory=dict)
    shown_sd: Mapping[str, float] = field(default_factory=dict)
    memory: Mapping[str, Memory] = field(default_factory=dict)

    @property
    def declared(self) -> tuple[CaseParameter, ...]:
        """Free parameters that the case declares; starts of runs stand behind them."""
        return tuple(parameter for parameter in self.free if not isinstance(parameter, RunStart))

    @property
    def starts(self) -> tuple[RunStart, ...]:
        """Free starts of runs, behind the parameters that the case declares."""
        return tuple(parameter for parameter in self.free if isinstance(parameter, RunStart))

    def begun(self, p: Sequence[float]) -> tuple[float, ...]:
        """Return free parameters of a fit, with the starts of the runs where they are to begin."""
        return (*p[: len(self.declared)], *(start.value for start in self.starts))

    @property
    def values(self) -> float:
        """Values that count of all outputs, of those with a memory the independent ones."""
        return sum(
            self.memory[name].independent(self.layout(name)) if name in self.memory else float(kept.sum())
            for name, kept in self.kept.items()
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(output.name for output in self.model.outputs)

    @property
    def rows(self) -> int:
        """Rows of all runs."""
        return int(self.slices[-1].stop)

    @property
    def drivers(self) -> list[Array]:
        """What drives the runs, (rows,) each; of another program's output without inputs, that output."""
        listed = [drivers_of(self.case, run) for run in self.runs]
        return [np.concatenate([each[name] for each in listed]) for name in listed[0]]

    def layout(self, name: str, rows: NDArray[np.bool_] | None = None) -> Layout:
        """Return the layout of an output's kept values, confined to some rows."""
        good = self.kept[name] if rows is None else self.kept[name] & rows
        return layout(
            [run.t for run in self.runs],
            [good[rows] for rows in self.slices],
            ordered=self.case.has_order,
        )

    def judged(self, name: str, values: Array) -> Array:
        """Return what counts of an output's values, (rows,): those of its kept rows, or their rates [1/s]."""
        kept, apart = self.kept[name], self.rates.get(name)
        if apart is None:
            return values[kept]
        rates = []
        for run, rows in zip(self.runs, self.slices, strict=True):
            t, there = run.t[kept[rows]], values[rows][kept[rows]]
            rates.append((there[apart:] - there[:-apart]) / (t[apart:] - t[:-apart]))
        return np.concatenate(rates)

    def judged_at(self, name: str) -> NDArray[np.intp]:
        """Return the rows at which stands what counts of an output; a rate stands at its end."""
        kept = [rows.start + np.flatnonzero(self.kept[name][rows]) for rows in self.slices]
        return np.concatenate([each[self.rates.get(name, 0) :] for each in kept])

    def judged_sd(self, name: str, sd: float) -> float:
        """Return the standard deviation of what is judged of an output by that of its values' white noise."""
        return float(np.sqrt(2) * sd / self.rate_s(name)) if name in self.rates else sd

    def rate_s(self, name: str) -> float:
        """Return the time over which the rates of a drifting output are taken [s]."""
        return self.rates[name] * float(np.median(np.concatenate([np.diff(run.t) for run in self.runs])))

    def simulate(self, p: Sequence[float], active: Sequence[AppliedEffect]) -> Stacked:
        """Return every output over all runs in their order; ``p`` are the free parameters."""
        values = self._values(p)
        if self.model.capability.together is not None and len(self.runs) > 1:
            self.model.capability.together(self.runs, [(values, active)])
        outputs = [self.model.simulate(run, values, active) for run in self.runs]
        return {name: np.concatenate([output[name] for output in outputs]) for name in self.names}

    def simulated_run(self, run: Run, p: Sequence[float], active: Sequence[AppliedEffect]) -> Stacked:
        """Return every output over one run; ``p`` are the free parameters."""
        return self.model.simulate(run, self._values(p), active)

    def _values(self, p: Sequence[float]) -> dict[str, float]:
        values = (float(value) for value in p)
        return self.known | dict(zip((parameter.name for parameter in self.free), values, strict=True))

    def prepare(self, points: Sequence[tuple[Sequence[float], Sequence[AppliedEffect]]]) -> None:
        """Have several simulations made at once where the model can; `simulate` then finds them."""
        together = self.model.capability.together
        if together is None:
            return
        together(self.runs, [(self._values(p), active) for p, active in points])

    def pushed(
        self,
        p: Sequence[float],
        active: Sequence[AppliedEffect],
        applied: AppliedEffect,
        pattern: Pattern,
        forces: int,
    ) -> Stacked:
        """Return linear responses of every output over all runs to small forces, (rows, forces).

        What acts on a channel already is taken row by row: a channel that is saturated shows nothing.

        Parameters
        ----------
        applied : where and in which runs they act
        pattern : positions and rates (n,) to forces (n, forces)
        """
        values = self._values(p)
        parts: dict[str, list[Array]] = {name: [] for name in self.names}
        moving = self.model.capability.motion
        for run in self.runs:
            responses: Stacked = {}
            if moving is not None and applied.acts_in(run):
                responses = moving.pushed(run, values, active, applied.channel, pattern)
            for name, column in parts.items():
                column.append(responses.get(name, np.zeros((run.rows, forces))))
        return {name: np.concatenate(column) for name, column in parts.items()}

    def prior_rows(self, sizes: Array, columns: int) -> Array:
        """Return d(parameter over its prior's sd)/dx below the rows of the data, (free, columns).

        Parameters
        ----------
        sizes : of the searched vector x, the free parameters first
        columns : of the whole matrix; what stands behind the free parameters has no prior
        """
        rows = np.zeros((len(self.free), columns))
        for i, parameter in enumerate(self.free):
            rows[i, i] = sizes[i] / (parameter.sd or 1.0)
        return rows

    def off_priors(self, p: Sequence[float]) -> Array:
        """Return how far free parameters are off their declared values, in prior sd, (free,)."""
        pairs = zip(p, self.free, strict=True)
        return np.array([(value - parameter.value) / (parameter.sd or 1.0) for value, parameter in pairs])

    def patterned(
        self,
        p: Sequence[float],
        active: Sequence[AppliedEffect],
        applied: AppliedEffect,
        starts: Sequence[Mapping[str, float]],
    ) -> list[Stacked]:
        """Return the responses of an output to a term with a pattern, (rows, 2) for each start.

        Hundreds of starts would be too many simulations; their linear responses along one are not.

        Parameters
        ----------
        applied : where and in which runs the term acts
        starts : its parameters; the columns are a quarter of a cycle apart

        Raises
        ------
        FitError
            the simulation cannot be run, or has no linear response
        """
        if applied.effect.term is None or applied.effect.term.pattern is None:
            return []
        pattern = TermPattern(((applied.effect, tuple(starts)),))
        responses = self.pushed(p, active, applied, pattern, _QUARTERS * len(starts))
        for column in responses.values():
            if not np.isfinite(column).all():
                raise FitError(
                    "an equation cannot be linearised along its motion",
                    where=str(applied.channel),
                    got="responses without bound",
                    expected="an equation that is smooth where it moves",
                    next_step="look at the equation where it has corners",
                    rule="simulator",
                )
        return [
            {name: column[:, [k, k + len(starts)]] for name, column in responses.items()}
            for k in range(len(starts))
        ]

    def stated_sd(self, name: str) -> float | None:
        """Return the stated noise of an output."""
        return next(output.sd for output in self.model.outputs if output.name == name)

    def sd_of(self, name: str) -> float | None:
        """Return the noise of an output as it is stated, or as the recording shows it to be."""
        return self.shown_sd.get(name) if (sd := self.stated_sd(name)) is None else sd


def problem_of(case: Case, model: Model) -> Problem:
    """Return the problem of a case: runs of the phase ``tare`` are no part of it."""
    runs = tuple(run for run in case.runs if run.conditions.get("phase") != "tare")
    observed: dict[str, list[Array]] = {output.name: [] for output in model.outputs}
    for run in runs:
        recorded = model.observed(run)
        for name, column in observed.items():
            column.append(recorded.get(name, np.full(run.rows, np.nan)))
    stacked = {name: np.concatenate(columns) for name, columns in observed.items()}
    unsure = model.capability.unsure
    ends = np.cumsum([run.rows for run in runs])
    slices = tuple(slice(int(end - run.rows), int(end)) for end, run in zip(ends, runs, strict=True))
    return Problem(
        case=case,
        model=model,
        runs=runs,
        free=tuple(parameter for parameter in model.parameters if parameter.sd is not None),
        known={parameter.name: parameter.value for parameter in model.parameters},
        observed=stacked,
        kept={name: np.isfinite(column) for name, column in stacked.items()},
        floor={name: max(_resolution(column), unsure.get(name, 0.0)) for name, column in stacked.items()},
        slices=slices,
    )


def without_outliers(problem: Problem, residual: Stacked) -> Problem:
    """Return the problem without single rows that stand far off all their neighbours.

    The rows are chosen once, on the residual of the refitted simulation, so that every hypothesis is
    judged on the same rows. An outlier is one of the recording. Where a recording is smooth, or an input
    moves sharply, a value to which its neighbours lead is none: there it is the simulation that jumps, as
    one does that is late by a part of a row, and is far off in that row alone. Where an input's own value is
    none that it can have, the simulation jumps by that. What the simulation meets to the last digit it starts
    from: it is the rows behind that are off.
    """
    from dataclasses import replace

    counted = {}
    misread = np.zeros(problem.rows, dtype=bool)
    for run, rows in zip(problem.runs, problem.slices, strict=True):
        for driver in problem.case.drivers:
            if driver.name in run.columns and run.rows >= ROWS.fewest_for_outliers:
                misread[rows] |= _misread(run.columns[driver.name])
    for name, r in residual.items():
        good = problem.kept[name].copy()
        for order, beside in _neighbours(problem):
            counting = good[order]
            places = order[counting]
            if len(places) < ROWS.fewest_for_outliers:
                continue
            values = r[places]
            away = values - _running_median(values)
            scale = 1.4826 * float(np.median(np.abs(away))) or float(np.std(away))
            steps = 1.4826 * float(np.median(np.abs(np.diff(values)))) / np.sqrt(2)
            noise = max(scale, steps, 1e-300)
            far = (np.abs(away) > ROWS.isolated * noise) & (values != 0)
            answering = beside[counting] & _answers(beside[counting], far)
            if problem.case.has_order:
                recorded = problem.observed[name][places]
                rough = max(_roughness(recorded), problem.floor[name])
                smooth = rough < ROWS.smooth * noise
                least = ROWS.isolated * (rough if smooth else noise)
                plain = misread[order][counting] | ~(smooth | beside[counting])
                far &= plain | _off_neighbours(recorded, far, least)
            far &= ~answering
            if 0 < far.sum() <= max(1, ROWS.outliers * len(places)):
                good[places[far]] = False
        counted[name] = good
    return replace(problem, kept=counted)


def _neighbours(problem: Problem) -> Iterator[tuple[NDArray[np.intp], NDArray[np.bool_]]]:
    """Give rows as neighbours of each other, and which of them stand beside a sharp move of an input.

    Of time they are those of a run. Readings without an order are neighbours in their inputs, of whatever
    run: repeats of a load are what a reading at that load is far off, and they follow no move.
    """
    if not problem.case.has_order:
        order = np.lexsort(problem.drivers[::-1])
        yield order, np.zeros(len(order), dtype=bool)
        return
    for rows in problem.slices:
        yield np.arange(rows.start, rows.stop), _moved_sharply(problem, rows)


def _answers(beside: NDArray[np.bool_], far: NDArray[np.bool_]) -> bool:
    """Tell whether rows far off stand beside sharp moves more often than chance puts them there."""
    from scipy.stats import binom

    count, hit, share = int(far.sum()), int((far & beside).sum()), float(np.mean(beside))
    return hit > ROWS.sharp * count and float(binom.sf(hit - 1, count, share)) < ROWS.coincidence


def _moved_sharply(problem: Problem, rows: slice) -> NDArray[np.bool_]:
    """Return which rows of a run stand beside a sharp move of an input: what follows it is no outlier."""
    run = problem.runs[problem.slices.index(rows)]
    sharp = np.zeros(run.rows, dtype=bool)
    for driver in problem.case.drivers:
        if driver.name not in run.columns or run.rows < ROWS.fewest_for_outliers:
            continue
        column = run.columns[driver.name]
        if (misread := _misread(column)).any():
            column = np.interp(np.arange(run.rows), np.flatnonzero(~misread), column[~misread])
        bends = np.abs(np.diff(column, n=2, prepend=column[0], append=column[-1]))
        least = max(1.4826 * float(np.median(bends)), 1e-6 * float(np.ptp(column)))
        sharp |= bends > ROWS.isolated * least
    beside = sharp.copy()
    for shift in (1, 2):
        beside[shift:] |= sharp[:-shift]
        beside[:-shift] |= sharp[shift:]
    return beside


def _misread(column: Array) -> NDArray[np.bool_]:
    """Return which single values of an input are farther outside of all others than these are apart."""
    far = np.zeros(len(column), dtype=bool)
    low, *_, high = np.argsort(column)
    others = np.delete(column, [low, high])
    for at in (low, high):
        far[at] = min(abs(column[at] - others.min()), abs(column[at] - others.max())) > np.ptp(others) > 0
    return far


def _roughness(values: Array) -> float:
    """Return the robust standard deviation of values off the mean of the one before and the one behind."""
    return 1.4826 * float(np.median(np.abs(np.diff(values, n=2)))) / 2


def _off_neighbours(values: Array, far: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Return which of the values that are ``far`` leave what their neighbours lead to by more than ``least``.

    Neighbours lead to whatever lies between the one before and the one behind, and to where the straight
    line through two on one side ends. A value that leaves it is nobody's neighbour, one that does not is.
    """
    off, calm = far.copy(), np.flatnonzero(~far).tolist()
    rows = np.flatnonzero(far).tolist()
    while calm and rows:
        leaving = []
        for row in rows:
            at = bisect.bisect(calm, row)
            leads = []
            for side in (calm[max(at - 2, 0) : at][::-1], calm[at : at + 2]):
                leads += values[side[:1]].tolist()
                if len(side) > 1:
                    near, farther = side
                    slope = (values[near] - values[farther]) / (near - farther)
                    leads.append(float(values[near] + slope * (row - near)))
            if min(leads) - least <= values[row] <= max(leads) + least:
                off[row] = False
                calm.insert(at, row)
            else:
                leaving.append(row)
        if len(leaving) == len(rows):
            break
        rows = leaving
    return off


def _running_median(x: Array) -> Array:
    padded = np.concatenate([x[2:0:-1], x, x[-2:-4:-1]])
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))


def _resolution(column: Array) -> float:
    """Return the standard deviation that printed digits leave: the smallest step over the root of twelve."""
    values = np.unique(column[np.isfinite(column)])
    size = float(np.abs(values).max()) if len(values) else 1.0
    steps = np.diff(values)
    steps = steps[steps > 1e-12 * max(size, 1e-300)]
    least = float(steps.min()) if len(steps) else 1e-12 * max(size, 1e-300)
    # Only a lattice is a resolution: full doubles have steps of every size.
    if len(steps) and np.allclose(steps / least, np.round(steps / least), atol=1e-3) and size / least < 1e7:
        return float(least / np.sqrt(12))
    return max(1e-9 * size, 1e-300)
