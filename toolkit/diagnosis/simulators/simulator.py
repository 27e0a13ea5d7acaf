"""What every kind of simulation offers to the search, and what it declares of itself.

The search and the answer ask a simulation's `Capability`, never its class: a new kind of simulation is one
file that gives its outputs and states every fact.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from toolkit.effects.law import ITSELF, POSITION, TIME
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.following import Followed
    from toolkit.effects.applied import AppliedEffect
    from toolkit.effects.effect import Effect
    from toolkit.effects.surroundings import MotionSizes
    from toolkit.simulation.plan_file import CaseParameter

    # Signals of an equation, (n,) by name, to force-like terms of shape (n, forces): a `TermPattern`
    Pattern = Callable[[Mapping[str, Array]], Array]
    Parameters = Mapping[str, float]
    LedAlong = Callable[
        [Sequence[Run], Parameters, Sequence[AppliedEffect], "Following"],
        tuple[Followed, Array],
    ]
    # A channel's name to its largest recorded magnitude over the runs that are judged
    Largest = Callable[[str | None], float]


@dataclass(frozen=True, slots=True)
class TermPattern:
    """What terms of effects would add along a motion, each at several starts, as columns of forces.

    A term with a pattern has its directions in blocks of columns, (n, directions x starts); another one has
    a column for each start.
    """

    terms: tuple[tuple[Effect, tuple[Mapping[str, float], ...]], ...]

    def __call__(self, signals: Mapping[str, Array]) -> Array:
        """Return the forces, (n, forces), at what moves (`ITSELF`), its position and what laws read."""
        import numpy as np

        x, v = signals[POSITION], signals[ITSELF]
        columns = []
        for effect, starts in self.terms:
            term = effect.term
            assert term is not None  # noqa: S101  it was asked of the effect before
            if term.pattern is not None:
                columns.append(term.pattern(x, starts))
                continue
            if term.law is not None:
                made = [term.law(signals, values, signals[TIME]) for values in starts]
            else:
                assert term.force is not None  # noqa: S101
                made = [term.force(x, v, values) for values in starts]
            listed = [np.broadcast_to(column, x.shape) for column in made]
            columns.append(np.stack(listed, axis=1))
        return np.nan_to_num(np.hstack(columns))


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A channel that is judged: name, unit, and its stated total sensor noise."""

    name: str
    unit: str
    sd: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StateRange:
    """A state of an equation: name, unit, and quantiles of its values in the simulation as declared.

    ``begins_read`` tells that a case reads its start off the first row of each run.
    """

    name: str
    unit: str
    quantiles: tuple[float, ...]
    begins_read: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """What is asked of an equation that is led along its recording.

    ``steps`` are the steps of parameters to which prediction errors are to answer; ``sensor`` is the largest
    that the noise of each output's sensor can be; ``unread`` are rows of an output that do not count, over
    all runs; ``steadier`` is by what its process noise is less than that which makes the recording likeliest.
    """

    steps: Mapping[str, float]
    sensor: Mapping[str, float]
    unread: Mapping[str, tuple[int, ...]]
    steadier: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Moving:
    """What moves in a simulation, and what forces do to it; channels are those that a force may act on.

    integrates : whether the simulation integrates its own equation, so that it answers a force with another
        motion; else the motion is the recorded one
    sizes : (channel, largest magnitude of a recorded channel) -> sizes of the motion
    units : channel -> units of a force-like term, of its velocity and of its position
    way : channel -> the longest way of a run [position's unit] and the usual one from row to row, zero where
        it stands in the rows themselves
    position : channel -> the state or channel of which it is the rate, None where there is none
    states : what a law in an equation may read beside the inputs and the time; none where none is integrated
    pushed : (run, parameters, effects, channel, pattern) -> linear responses of every output to small forces
        of a pattern over the position, (rows, forces); none where none move
    followed : (runs, parameters, effects, what is asked) -> the equation along the recording, and how its
        prediction errors answer to the parameters, (rows, outputs, parameters); FitError where there is no
        following it. None where nothing is integrated
    """

    integrates: bool
    sizes: Callable[[str | None, Largest], MotionSizes]
    units: Callable[[str | None], tuple[str, str, str]]
    way: Callable[[str | None], tuple[float, float]]
    position: Callable[[str | None], str | None]
    states: tuple[StateRange, ...]
    pushed: Callable[[Run, Parameters, Sequence[AppliedEffect], str | None, Pattern], Arrays]
    followed: LedAlong | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Capability:
    """What a kind of simulation knows and can do beside giving its outputs; every kind states every fact.

    nominal_load_N : load [N] that the simulation's own files state, None where they state none
    cells : names of the load cells that a calibration turns into outputs
    unsure : output -> what the simulation itself is unsure by, in the output's unit
    findings : what a reader of the answer must know of the simulation
    averages : whether noise of its inputs may go straight into its outputs: means of its rows tell more
    repeats : (run, parameters) -> nothing; FitError where a second call gives another answer. None where the
        simulation is our own
    together : makes several simulations of some runs at once, for `simulate` to find; None where it cannot
    motion : what moves in it, None where nothing does
    """

    nominal_load_N: float | None
    cells: tuple[str, ...]
    unsure: Mapping[str, float]
    findings: tuple[Finding, ...]
    averages: bool
    repeats: Callable[[Run, Parameters], None] | None
    together: Callable[[Sequence[Run], Sequence[tuple[Parameters, Sequence[AppliedEffect]]]], None] | None
    motion: Moving | None


class Model(Protocol):
    """A simulation that can be run with effects in it."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Channels that are judged."""
        ...

    @property
    def parameters(self) -> tuple[CaseParameter, ...]:
        """Nominal parameters, the free ones with their priors."""
        ...

    @property
    def capability(self) -> Capability:
        """What this kind of simulation knows and can do."""
        ...

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output, (n,), NaN where a sample is missing."""
        ...

    def simulate(self, run: Run, p: Parameters, active: Sequence[AppliedEffect]) -> Arrays:
        """Return what the simulation says of every output, (n,), free over the whole run."""
        ...

    def places(self, effect: Effect) -> Sequence[tuple[str | None, str | None]]:
        """Return where an effect could act in this case, as pairs of channel and source; nothing: nowhere."""
        ...


class Supervised:
    """A simulation of which every question goes through a guard, which times or ends it, until released."""

    def __init__(
        self,
        plain: Model,
        simulate: Callable[[Run, Parameters, Sequence[AppliedEffect]], Arrays],
        guarded: Callable[[Callable[..., Any]], Callable[..., Any]],
    ) -> None:
        self._plain = plain
        self._simulate: Callable[[Run, Parameters, Sequence[AppliedEffect]], Arrays] = guarded(simulate)
        self.outputs, self.parameters = plain.outputs, plain.parameters
        known = plain.capability
        together, motion, repeats = known.together, known.motion, known.repeats
        self.capability = dataclasses.replace(
            known,
            repeats=None if repeats is None else guarded(repeats),
            together=None if together is None else guarded(together),
            motion=None if motion is None else _guarded(motion, guarded),
        )

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output."""
        return self._plain.observed(run)

    def simulate(self, run: Run, p: Parameters, active: Sequence[AppliedEffect]) -> Arrays:
        """Return every output of a run, as the guard lets it through."""
        return self._simulate(run, p, active)

    def places(self, effect: Effect) -> Sequence[tuple[str | None, str | None]]:
        """Return where an effect could act."""
        return self._plain.places(effect)

    def release(self) -> None:
        """Let every further question through as it is."""
        self._simulate, self.capability = self._plain.simulate, self._plain.capability


def _guarded(motion: Moving, guarded: Callable[[Callable[..., Any]], Callable[..., Any]]) -> Moving:
    followed = None if motion.followed is None else guarded(motion.followed)
    return dataclasses.replace(motion, pushed=guarded(motion.pushed), followed=followed)
