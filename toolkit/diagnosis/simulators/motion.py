"""Equations of motion behind a simulator that cannot be opened: force-like terms on its outputs.

Two shapes are told apart by units. An output that is a force, a moment or the current that a drive takes to
exert them, beside a recorded velocity, is the sum of the terms of the equation: a missing one is added to it.
Where only the position was recorded in time, its rate is the velocity. An output that is a position or a
velocity moves by the simulator's own acceleration along its trajectory; a missing term changes that
acceleration, and the motion is integrated anew (exact where the simulator's acceleration depends on time
alone, as in a free fall).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.linear_response import integrated
from toolkit.diagnosis.simulators.rates import Track, reach_of, usual_speed
from toolkit.diagnosis.simulators.setting import dimension, is_speed
from toolkit.diagnosis.simulators.states import usual_step
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.forward import resisting
from toolkit.effects.law import ITSELF, POSITION
from toolkit.effects.surroundings import MotionSizes
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.simulator import Largest, Pattern
    from toolkit.effects.facts import ForceHook, Values

_LENGTHS = ("length", "angle")
_EFFORTS = ("force", "moment", "[current]")
_SUBSTEPS = 4


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Which output a term enters, and which channels are its position and velocity.

    ``speed`` is the usual rate of a position beside which a force stands and no velocity, zero where there
    is none that its noise would leave.
    """

    case: Case
    kind: str
    output: str
    position: str | None
    velocity: str | None
    speed: float = 0.0
    _rates: dict[Run, Array] = dataclasses.field(default_factory=dict)

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return the output that a dynamic effect could enter."""
        term = effect.term
        if term is None or term.of == "state":
            return []
        if term.of == "position" and self.position is None:
            return []
        if term.of == "velocity" and self.velocity is None and not self.speed and self.kind == "force":
            return []
        return [(self.output, None)]

    def sizes(self, force: float, largest: Largest) -> MotionSizes:
        """Return sizes of the motion; those of the recorded channels where the output is a force."""
        if self.kind == "force":
            speed = largest(self.velocity) if self.velocity else self._fastest()
            place = largest(self.position) if self.position else 1.0
        else:
            force, speed, place = self._scales()
        return MotionSizes(
            force=force, speed=speed, place=place, fastest=speed, farthest=place, level=place,
            has_position=self.position is not None,
        )  # fmt: skip

    def units(self) -> tuple[str, str, str]:
        """Return units of a force-like term, of its velocity and of its position."""
        output = self.case.unit(self.output)
        if self.kind == "force":
            place = None if self.position is None else self.case.unit(self.position)
            if self.velocity is not None:
                speed = self.case.unit(self.velocity)
            else:
                speed = "1" if place is None or not self.speed else f"{place}/s"
            return output, speed, place or f"{speed}*s"
        length = output if self.kind == "position" else f"{output}*s"
        return f"{length}/s^2", f"{length}/s", length

    def speeds(self, run: Run, true: Mapping[str, Array] | None = None) -> Array:
        """Return the velocity of a run beside a force, (n,): as recorded, or the rate of its position.

        Parameters
        ----------
        true : inputs, (n,) each, that were recorded otherwise than they are
        """
        true = true or {}
        if self.velocity is not None:
            return true.get(self.velocity, run.columns[self.velocity])
        if not self.speed or self.position is None:
            return np.zeros(run.rows)
        if self.position in true:
            track = _track(
                self.case, dataclasses.replace(run, columns={**run.columns, **true}), self.position
            )
            return track.rate(reach_of(track, self.speed) or track.longest)
        if run not in self._rates:
            track = _track(self.case, run, self.position)
            self._rates[run] = track.rate(reach_of(track, self.speed) or track.longest)
        return self._rates[run]

    def _fastest(self) -> float:
        largest = [float(np.abs(self.speeds(run)).max(initial=0.0)) for run in self.case.runs]
        return max(largest, default=0.0) or 1.0

    def _scales(self) -> tuple[float, float, float]:
        """Return sizes of acceleration, velocity and position of an output that moves."""
        run = max(self.case.runs, key=lambda run: run.rows)
        y = run.columns[self.output]
        good = np.isfinite(y)
        span = float(np.ptp(run.t)) or 1.0
        size = float(np.ptp(y[good])) or 1.0
        if self.kind == "position":
            return size / span**2, size / span, size
        return size / span, size, size * span

    def way(self) -> tuple[float, float]:
        """Return the longest way of a run [position's unit], and the usual way from row to row as it moves.

        None is passed unseen where the force stands on the rows' own positions.
        """
        name = self.position or ""
        columns = [run.columns[name] for run in self.case.runs if name in run.columns]
        columns = [column[np.isfinite(column)] for column in columns]
        spans = [float(np.ptp(column)) for column in columns if len(column)]
        return max(spans, default=0.0), 0.0 if self.kind == "force" else usual_step(columns)

    def pushed(
        self,
        simulated: Mapping[str, Array],
        run: Run,
        pattern: Pattern,
    ) -> dict[str, Array]:
        """Return what small forces of a pattern over the position add to every output, (rows, forces)."""
        x = simulated.get(str(self.position), run.columns.get(str(self.position)))
        if x is None:
            return {}
        pushes = pattern({POSITION: x, ITSELF: np.zeros(len(x))})  # what follows the rate is simulated
        if self.kind != "force":
            pushes = integrated(run.t, pushes)
            if self.kind == "position":
                pushes = integrated(run.t, pushes)
        none = np.zeros_like(pushes)
        return {name: pushes if name == self.output else none for name in simulated}

    def disturbed(
        self,
        simulated: Mapping[str, Array],
        forces: Sequence[AppliedEffect],
        run: Run,
        true: Mapping[str, Array],
    ) -> dict[str, Array]:
        """Return the outputs with force-like terms in the equation of motion.

        A force follows the motion as it was: friction opposes the velocity, whatever sign its sensor shows.

        Parameters
        ----------
        true : inputs, (n,) each, that were recorded otherwise than they are
        """
        result = dict(simulated)
        if self.kind == "force":
            zero = np.zeros(run.rows)
            x = zero if self.position is None else true.get(self.position, run.columns[self.position])
            push = resisting(forces, run.t, x, self.speeds(run, true))
            result[self.output] = simulated[self.output] + push
            return result
        return self._moved(result, forces, run)

    def _moved(
        self, simulated: dict[str, Array], forces: Sequence[AppliedEffect], run: Run
    ) -> dict[str, Array]:
        from scipy.interpolate import CubicSpline

        if run.rows < 4:
            return simulated
        t = run.t
        is_position = self.kind == "position"
        if is_position:
            spline = CubicSpline(t, simulated[self.output])
            x0, v0 = float(spline(t[0])), float(spline(t[0], 1))
            acceleration = spline.derivative(2)
        else:
            spline = CubicSpline(t, simulated[self.output])
            x0, v0 = 0.0, float(spline(t[0]))
            acceleration = spline.derivative(1)
        x, v = np.empty(run.rows), np.empty(run.rows)
        x[0], v[0] = a, b = x0, v0
        steps = np.diff(t) / _SUBSTEPS
        # What is known of the way beforehand is asked once: at the ends and the middle of every step.
        stages = t[:-1, None] + steps[:, None] * np.arange(2 * _SUBSTEPS + 1) / 2
        accelerations = np.asarray(acceleration(stages), dtype=np.float64).tolist()
        terms = [
            (force.effect.term.force, force.values)
            for force in forces
            if force.effect.term is not None and force.effect.term.force is not None
        ]
        for i, h in enumerate(steps.tolist()):
            for k in range(0, 2 * _SUBSTEPS, 2):
                a, b = _step(accelerations[i][k : k + 3], terms, h, a, b)
            x[i + 1], v[i + 1] = a, b
        result = dict(simulated)
        result[self.output] = x if is_position else v
        if is_position and self.velocity in result:
            result[str(self.velocity)] = v
        return result


def _step(
    acceleration: Sequence[float], terms: Sequence[tuple[ForceHook, Values]], h: float, x: float, v: float
) -> tuple[float, float]:
    """Return position and velocity after a step of Runge and Kutta's fourth order.

    ``acceleration`` (3,) is that without the terms, at the beginning, the middle and the end of the step.
    """

    def rate(undisturbed: float, position: float, speed: float) -> tuple[float, float]:
        return speed, undisturbed - sum(force(position, speed, values) for force, values in terms)

    start, middle, end = acceleration
    k1 = rate(start, x, v)
    k2 = rate(middle, x + h / 2 * k1[0], v + h / 2 * k1[1])
    k3 = rate(middle, x + h / 2 * k2[0], v + h / 2 * k2[1])
    k4 = rate(end, x + h * k3[0], v + h * k3[1])
    return (
        x + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]),
        v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]),
    )


def motion_of(case: Case) -> Motion | None:
    """Return how dynamic terms could enter a case, None where its units show no motion."""
    inputs = {driver.name: dimension(driver.unit) for driver in case.drivers}
    outputs = {output.name: dimension(output.unit) for output in case.outputs}
    velocity = next((driver.name for driver in case.drivers if is_speed(driver.unit)), None)
    position = next((name for name, kind in inputs.items() if kind in _LENGTHS), None)
    force = next((name for name, kind in outputs.items() if kind in _EFFORTS), None)
    if force is not None and (velocity is not None or position is not None):
        rate = _speed(case, position) if velocity is None and position is not None else 0.0
        return Motion(case=case, kind="force", output=force, position=position, velocity=velocity, speed=rate)
    if not case.has_time:
        return None
    moved = next((name for name, kind in outputs.items() if kind in _LENGTHS), None)
    speed = next((output.name for output in case.outputs if is_speed(output.unit)), None)
    if moved is not None:
        return Motion(case=case, kind="position", output=moved, position=moved, velocity=speed)
    if speed is not None:
        return Motion(case=case, kind="velocity", output=speed, position=None, velocity=speed)
    return None


def _speed(case: Case, position: str) -> float:
    """Return the usual rate of a position, zero where some run's noise would hide it."""
    if not case.has_time:
        return 0.0
    tracks = [_track(case, run, position) for run in case.runs if position in run.columns and run.rows]
    speed = usual_speed(tracks)
    return speed if speed and all(reach_of(track, speed) for track in tracks) else 0.0


def _track(case: Case, run: Run, position: str) -> Track:
    of = unit(case.unit(position))
    turn = 2 * math.pi / of.factor if of.dimension == "angle" else None
    return Track.of(run.t, run.columns[position], turn)
