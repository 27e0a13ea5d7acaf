"""A simulation and its recordings in means over some rows, what acts in it along smooth inputs.

The simulation as it is declared runs on every row as it was recorded, and is averaged by the same window as
the recording: of whatever is linear in its inputs that is exact. What effects change runs on every row as
well, along inputs that are smoothed by cubic polynomials, which leave slow motion as it is: noise of a
velocity has no sign to rub against, and no low-pass wins by taking it away.

Source: Savitzky and Golay, Anal. Chem. 36 (1964) 1627; Schafer, IEEE Signal Process. Mag. 28 (2011) 4, 111,
for the cut-off of such a polynomial.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import NOISE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.simulator import Model, Parameters, Pattern
    from toolkit.effects.applied import AppliedEffect
    from toolkit.effects.effect import Effect


_DEGREE = 3  # of the polynomials


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """The rows of every mean of a run, (means, width), and their weights, (width,), which add up to one.

    A window is a raised cosine over twice the distance of two means: a plain mean would let quicker noise
    through and fold it into the slow changes.
    """

    rows: NDArray[np.int64]
    weights: Array

    def mean(self, column: Array) -> Array:
        """Return means, (means, ...) of (n, ...): NaN where less than half of a window's weight is there."""
        values = np.moveaxis(column[self.rows], 1, -1)
        there = np.isfinite(values)
        weight = there @ self.weights
        total = np.where(there, values, 0.0) @ self.weights
        return np.asarray(np.where(weight >= 0.5, total / np.maximum(weight, 0.5), np.nan))


def usual_step(run: Run) -> float:
    """Return the usual step of a run's time [s]."""
    return float(np.median(np.diff(run.t))) if run.rows > 1 else math.inf


def windows(case: Case, run: Run, rows: int) -> Windows:
    """Return the windows of a run, as far apart as some rows of the case's quickest run.

    None spans a gap, nor has rows so near to one or to an end that its inputs are not smooth there.
    """
    count = _count(case, run, rows)
    if count == 1:
        return Windows(np.arange(run.rows)[:, None], np.ones(1))
    reach = _reach(count)
    firsts = [
        piece.start + reach + np.arange(max((piece.stop - piece.start - 2 * reach) // count - 1, 0)) * count
        for piece in _pieces(run)
    ]
    return Windows(np.concatenate(firsts)[:, None] + np.arange(2 * count), _weights(count))


def averaged(case: Case, rows: int) -> Case:
    """Return a case whose recordings are means.

    What is stated of a sensor's noise is that of a row: a mean has what its window leaves of white noise.
    """
    runs = []
    for run in case.runs:
        of = windows(case, run, rows)
        mean = of.mean
        runs.append(
            dataclasses.replace(
                run,
                t=mean(run.t),
                columns={name: mean(column) for name, column in run.columns.items()},
                simulated={name: mean(column) for name, column in run.simulated.items()},
                file_rows=of.rows[:, [0, -1]],
            )
        )
    channels = tuple(dataclasses.replace(channel, sd=_of_mean(channel.sd, rows)) for channel in case.channels)
    return dataclasses.replace(case, channels=channels, runs=tuple(runs))


def smoothed(case: Case, rows: int, names: Collection[str]) -> Case:
    """Return a case with every row, and some of its channels without what is quicker than means show."""
    from scipy.signal import savgol_filter

    runs = []
    for run in case.runs:
        count = _count(case, run, rows)
        width = 2 * _reach(count) + 1
        columns = dict(run.columns)
        for name in set(names) & set(columns) if count > 1 else ():
            column = columns[name].copy()
            for piece in _pieces(run):
                if piece.stop - piece.start >= width:
                    column[piece] = savgol_filter(column[piece], width, _DEGREE)
            columns[name] = column
        runs.append(dataclasses.replace(run, columns=columns))
    return dataclasses.replace(case, runs=tuple(runs))


class MeansOf:
    """A simulation whose outputs are means of another one's; runs that are none of means are its own.

    ``plain`` is the simulation of the case with every row, ``smooth`` that of the case with smooth inputs;
    the three ``cases`` are these two and that in means over ``rows``.
    """

    def __init__(self, plain: Model, smooth: Model, cases: tuple[Case, Case, Case], rows: int) -> None:
        whole, even, means = (case.runs for case in cases)
        self._plain, self._smooth = plain, smooth
        self._runs = {
            mean: (run, steady, windows(cases[0], run, rows))
            for run, steady, mean in zip(whole, even, means, strict=True)
        }
        self.parameters = plain.parameters
        self.outputs = tuple(
            dataclasses.replace(output, sd=_of_mean(output.sd, rows)) for output in plain.outputs
        )
        motion = plain.capability.motion
        self.capability = dataclasses.replace(
            plain.capability,
            averages=False,
            repeats=None,
            together=None if plain.capability.together is None else self._together,
            motion=None if motion is None else dataclasses.replace(motion, pushed=self._pushed),
        )

    def observed(self, run: Run) -> Arrays:
        """Return the means of what was recorded of every output."""
        whole, _, of = self._runs[run]
        return {name: of.mean(column) for name, column in self._plain.observed(whole).items()}

    def simulate(self, run: Run, p: Parameters, active: Sequence[AppliedEffect]) -> Arrays:
        """Return the means of every output of a run."""
        if run not in self._runs:
            return self._plain.simulate(run, p, active)
        whole, even, of = self._runs[run]
        outputs = self._plain.simulate(whole, p, ())
        if active:
            without, there = self._smooth.simulate(even, p, ()), self._smooth.simulate(even, p, active)
            outputs = {name: column + there[name] - without[name] for name, column in outputs.items()}
        return {name: of.mean(column) for name, column in outputs.items()}

    def places(self, effect: Effect) -> Sequence[tuple[str | None, str | None]]:
        """Return where an effect could act."""
        return self._plain.places(effect)

    def _together(
        self, runs: Sequence[Run], points: Sequence[tuple[Parameters, Sequence[AppliedEffect]]]
    ) -> None:
        """Have both simulations make at once what `simulate` asks of them."""
        of_rows, steady = self._plain.capability.together, self._smooth.capability.together
        assert of_rows is not None  # noqa: S101  else nobody asks
        assert steady is not None  # noqa: S101  of the same kind
        known = [self._runs[run] for run in runs if run in self._runs]
        of_rows([whole for whole, _, _ in known], [(p, ()) for p, _ in points])
        acting = [(p, each) for p, active in points if active for each in ((), active)]
        steady([even for _, even, _ in known], acting)

    def _pushed(
        self,
        run: Run,
        p: Mapping[str, float],
        active: Sequence[AppliedEffect],
        channel: str | None,
        pattern: Pattern,
    ) -> Arrays:
        motion = self._smooth.capability.motion
        assert motion is not None  # noqa: S101  only its motion asks
        _, even, of = self._runs[run]
        responses = motion.pushed(even, p, active, channel, pattern)
        return {name: of.mean(columns) for name, columns in responses.items()}


def _weights(count: int) -> Array:
    return np.asarray((1 - np.cos(np.pi * (np.arange(2 * count) + 0.5) / count)) / (2 * count))


def _reach(count: int) -> int:
    """Return how many rows to each side a polynomial has: where they are not there, it is no mean's.

    The cut-off of a cubic over 2 M + 1 rows lies at 4 / (3.2 M - 4.6) of half the rate (Schafer eq. 8). It is
    put an octave above what the means keep, which it must not weaken.
    """
    return max(_DEGREE - 1, round((2 * count + 4.6) / 3.2))


def _count(case: Case, run: Run, rows: int) -> int:
    step = usual_step(run)
    if not math.isfinite(step):  # of one row there is no window
        return rows
    return max(1, round(rows * min(usual_step(each) for each in case.runs) / step))


def _pieces(run: Run) -> list[slice]:
    """Return the stretches of a run without a gap."""
    breaks = np.flatnonzero(np.diff(run.t) > NOISE.gap * usual_step(run)) + 1
    edges = [0, *breaks.tolist(), run.rows]
    return [slice(first, last) for first, last in itertools.pairwise(edges)]


def _of_mean(sd: float | None, rows: int) -> float | None:
    return None if sd is None else sd * float(np.linalg.norm(_weights(rows)))
