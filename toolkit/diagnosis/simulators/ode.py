"""Kind ``ode``: the simulation's own differential equation, integrated over the whole run."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.channels import (
    channel_places,
    input_places,
    through_channels,
    true_inputs,
)
from toolkit.diagnosis.simulators.equation import Equation, failed
from toolkit.diagnosis.simulators.forces import Forces, ForcesTogether
from toolkit.diagnosis.simulators.integrate import IntegrationError, integrate
from toolkit.diagnosis.simulators.memory import Memory
from toolkit.diagnosis.simulators.ode_apart import OdeApart, handlers_of
from toolkit.diagnosis.simulators.ode_following import followed
from toolkit.diagnosis.simulators.ode_responses import pushed
from toolkit.diagnosis.simulators.parameter_units import reduced
from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows
from toolkit.diagnosis.simulators.run_starts import in_columns, without_starts
from toolkit.diagnosis.simulators.setting import is_speed, known_names, nominal_load, setting
from toolkit.diagnosis.simulators.simulator import Capability, Moving, Output, StateRange
from toolkit.diagnosis.simulators.states import (
    declared_dimensions,
    dimensions,
    fitting,
    shown_alone,
    state_names,
    state_units,
    term_places,
    usual_step,
    way_of,
)
from toolkit.diagnosis.simulators.trajectory import Guesses, Nodes, Path, trajectories
from toolkit.diagnosis.simulators.turning import Turning
from toolkit.diagnosis.simulators.user_code import load_functions, silenced
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.filters import STRAIGHT
from toolkit.effects.law import is_law
from toolkit.effects.signals import Setting
from toolkit.effects.surroundings import MotionSizes
from toolkit.errors import FitError

if TYPE_CHECKING:
    import pathlib

    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.case_code import CaseCode
    from toolkit.diagnosis.simulators.simulator import Largest
    from toolkit.worker.serve import Handlers

    # Keys of the runs, parameters, forces.
    _Set = tuple[tuple[Any, ...], Mapping[str, float], list[AppliedEffect]]

ATOL = 1e-7  # of a state's spread over a run; before that is known, a hundredth of it of one
FINER = 4  # rows between two rows, one of them among them
_LEVELS = 41  # quantiles of a state
_STATES = 4  # simulations whose states are kept: a fit asks for the last one again
_MOST_KEPT, _MOST_HELD = 400, 200_000_000  # simulations of a run to remember, and their bytes


class OdeModel:
    """``rhs(t, x, u, p)``, ``outputs(x, u, p)`` and ``initial(p[, run])`` of a Python file."""

    def __init__(
        self, case: Case, rhs: Callable[..., Any], outputs: Callable[..., Any], initial: Callable[..., Any]
    ) -> None:
        self.case, self.equation = case, Equation(case, rhs, outputs, initial)
        self.parameters = case.parameters
        self.outputs = tuple(Output(name=one.name, unit=one.unit, sd=one.sd) for one in case.outputs)
        self.drivers = tuple(driver.name for driver in case.drivers)
        self._inputs = {driver.name for driver in case.drivers if driver.role == "input"}
        self._driver_sizes = {
            name: (1.0, max(float(np.ptp(run.columns[name])) for run in case.runs) or 1.0)
            for name in self.drivers
        }
        self._driven: dict[Any, Run] = {}
        self._recorded: dict[Run, Run] = {}  # of a run with other inputs: a guess of one is one of the other
        self._settings: dict[Run, Setting] = {}
        self._fine: dict[Run, Run] = {}
        self._guesses = Guesses()
        self._states: Memory[NDArray[np.float64]] = Memory(_STATES * len(case.runs), _MOST_HELD)
        self._near: dict[Run, NDArray[np.float64]] = {}  # states simulated last
        self._steps: dict[Run, NDArray[np.intp]] = {}  # of the simulation as declared
        self._turning = Turning(self)
        self._alone: set[Any] = set()  # what does not come to its end with others
        self._nodes: dict[tuple[Run, ...], Nodes | None] = {}  # the same from node to node, of several runs
        self._kept: Memory[dict[str, NDArray[np.float64]] | FitError] = Memory(_MOST_KEPT, _MOST_HELD)
        p = {parameter.name: parameter.value for parameter in case.parameters}
        start = self.equation.start(case.runs[0], p)
        self.states = names = state_names(case, len(start))
        self.derivative_of = self.equation.kinematics(p)
        # A place moves nothing into its own rate.
        self.feeds = {i: j for i, j in self.equation.feeds(p).items() if self.derivative_of.get(j) != i}
        self.force_units = dict(case.simulation.force_terms) or {
            name: "" for i, name in enumerate(names) if i not in self.derivative_of.values()
        }
        self.scale: dict[str, tuple[float, float]] = {}
        self.scale = self._sizes(p)
        self.capability = Capability(
            nominal_load_N=None,
            cells=(),
            unsure={},
            findings=(),
            averages=False,
            repeats=None,
            together=self._prepare,
            motion=Moving(
                integrates=True, sizes=self._motion_sizes, units=self._motion_units, way=self._way,
                position=lambda channel: self.position_of(str(channel)),
                states=self._ranges(self.equation.begins_read(p)),
                pushed=lambda run, p, active, channel, pattern: pushed(
                    self, self._as_driven(run, active), p, active, channel, pattern
                ),
                followed=lambda runs, p, active, asked: followed(
                    self, [self._as_driven(run, active) for run in runs], p, active, asked
                ),
            ),
        )  # fmt: skip

    def _sizes(self, p: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Return for every state that a term may enter: size of its rate, and spread of itself."""
        runs = self.case.runs
        first = self.equation.start(runs[0], p)
        self.equation.try_columns(runs[0], np.repeat(first[:, None], runs[0].rows, axis=1), p)
        states = [self.integrated(run, p, ()) for run in runs]
        self.equation.try_columns(runs[0], states[0], p)
        alone = shown_alone(states[0], self.equation.shown(runs[0], p, states[0]), self.outputs)
        self._dimensions = dimensions(alone)
        self._units = state_units(self.states, alone, (np.ptp(states[0], axis=1) > 0).tolist(), self.case)
        x = np.concatenate(states, axis=1)
        rates = [
            np.gradient(state, run.t, axis=1) if run.rows > 2 else np.zeros_like(state)
            for state, run in zip(states, runs, strict=True)
        ]
        fastest = np.abs(np.concatenate(rates, axis=1)).max(axis=1)
        self.ways = {
            name: (
                max(float(np.ptp(state[i])) for state in states),
                usual_step([state[i] for state in states]),
            )
            for i, name in enumerate(self.states)
        }
        times = [run.t for run in runs]
        self._travelled = {
            name: way_of([state[i] for state in states], times) for i, name in enumerate(self.states)
        }
        self._levels = np.quantile(x, np.linspace(0, 1, _LEVELS), axis=1).T
        self._largest = {name: float(x[i].max()) for i, name in enumerate(self.states)}
        farthest = np.abs(x).max(axis=1)
        self._reach = {
            name: (float(farthest[i]) or 1.0, float(farthest[self.derivative_of.get(i, i)]) or 1.0)
            for i, name in enumerate(self.states)
        }
        return {
            name: (
                # Its largest rate, not its spread: a body in free fall has a force that never varies.
                float(fastest[i]) or 1.0,
                float(np.std(x[i])) or float(np.abs(x[i]).max()) or 1.0,
            )
            for i, name in enumerate(self.states)
        }

    def _motion_sizes(self, channel: str | None, _: Largest) -> MotionSizes:
        state = str(channel)
        rate, size = self.scale[state]
        position = self.position_of(state)
        place = (self._travelled[state] or size) if position is None else self.scale[position][1]
        fastest, farthest = self._reach[state]
        at = self.feeds.get(self.states.index(state))
        return MotionSizes(
            force=rate, speed=size, place=place, fastest=fastest, farthest=farthest,
            # A state that starts at zero and only falls has no level to run over.
            level=self._largest[state] or (size if position is None else place),
            has_position=position is not None,
            feeds=None if at is None else self.states[at],
        )  # fmt: skip

    def _motion_units(self, channel: str | None) -> tuple[str, str, str]:
        state = str(channel)
        force = self.force_units.get(state) or f"{self._units.get(state, '1')}/s"
        rate = "m/s^2" if force == "N/kg" else force
        speed, position = self._units.get(state) or reduced(f"{rate}*s"), self.position_of(state)
        if position is not None:
            return force, speed, self._units.get(position) or f"{speed}*s"
        # A velocity has its way for a position, even where no state is one; any other state is its own.
        return force, speed, f"{speed}*s" if is_speed(speed) else speed

    def _ranges(self, begins_read: NDArray[np.bool_]) -> tuple[StateRange, ...]:
        """Return the states; one whose unit neither the recording nor a rate of it tells has none."""
        implied: dict[str, str] = {}
        for name in self.force_units:
            _, speed, position = self._motion_units(name)
            implied[name] = speed
            implied.setdefault(self.position_of(name) or name, position)
        return tuple(
            StateRange(
                name=name, unit=reduced(implied.get(name) or self._units.get(name, "1")),
                quantiles=tuple(levels.tolist()), begins_read=bool(read),
            )
            for name, levels, read in zip(self.states, self._levels, begins_read, strict=True)
        )  # fmt: skip

    def _way(self, channel: str | None) -> tuple[float, float]:
        position = self.position_of(str(channel))
        return (0.0, 0.0) if position is None else self.ways[position]

    def steps(self, runs: Sequence[Run]) -> NDArray[np.intp]:
        """Return the steps of every interval of runs behind one another, as the simulation needed them."""
        parts = [np.append(np.broadcast_to(self._steps.get(run, 1), run.rows - 1), 1) for run in runs]
        return np.concatenate(parts)[:-1].astype(np.intp)

    def position_of(self, name: str) -> str | None:
        """Return the state whose rate is this state, None where there is none."""
        at = self.derivative_of.get(self.states.index(name))
        return None if at is None else self.states[at]

    def observed(self, run: Run) -> dict[str, NDArray[np.float64]]:
        """Return what was recorded of every output."""
        return {
            output.name: run.columns[output.name] for output in self.outputs if output.name in run.columns
        }

    def simulate(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]
    ) -> dict[str, NDArray[np.float64]]:
        """Return every output of a free simulation over the whole run."""
        run = self._as_driven(run, active)
        key, forces = self._key(run, p, active)
        if key not in self._kept:
            states = self.integrated(run, p, forces, alone=key in self._alone)
            self._kept[key] = self._made(run, p, forces, states, between=key[1])
        simulated = self._kept[key]
        if isinstance(simulated, FitError):
            raise simulated
        if not key[1]:
            return through_channels(simulated, active, run, self.setting(run), run.columns)
        # An equation's outputs have a corner at each row, where its inputs have one.
        fine = [
            replace(each, values={**each.values, STRAIGHT: 1.0}) if each.effect.reads_between_rows else each
            for each in active
        ]
        finer = self.finer(run)
        shown = through_channels(simulated, fine, finer, self.setting(finer), finer.columns)
        return {name: values[::FINER] for name, values in shown.items()}

    def _as_driven(self, run: Run, active: Sequence[AppliedEffect]) -> Run:
        """Return a run with its inputs as they are without the effects that they were recorded with."""
        disturbed = [applied for applied in active if applied.channel in self._inputs]
        if not disturbed:
            return run
        key = (run, tuple((applied.key, tuple(applied.values.items())) for applied in disturbed))
        if key not in self._driven:
            true = true_inputs(run, disturbed, self._inputs, self.setting(run))
            self._driven[key] = replace(run, columns={**run.columns, **true})
            self._recorded[self._driven[key]] = run
        return self._driven[key]

    def recorded(self, run: Run) -> Run:
        """Return a run with its inputs as they were recorded."""
        return self._recorded.get(run, run)

    def _prepare(
        self,
        runs: Sequence[Run],
        points: Sequence[tuple[Mapping[str, float], Sequence[AppliedEffect]]],
    ) -> None:
        """Integrate several runs, sets of parameters and effects at once, for `simulate` to find."""
        runs = [run for run in runs if run.rows > 1]
        if self.equation.columns is None or not runs:
            return
        groups: dict[tuple[Run, ...], dict[Any, _Set]] = {}
        for p, active in points:
            driven = tuple(self._as_driven(run, active) for run in runs)
            keys = tuple(self._key(run, p, active)[0] for run in driven)
            acting = [applied for applied in active if applied.effect.stage == "dynamics"]
            groups.setdefault(driven, {})[keys] = (keys, p, acting)
        # Those that are known already are done again with the others: their steps are then the same, and
        # differences between them are free of what the steps leave.
        for driven, listed in groups.items():
            if not all(key in self._kept for keys in listed for key in keys):
                self._together(driven, list(listed.values()))

    def _together(self, runs: Sequence[Run], listed: list[_Set]) -> None:
        """Integrate sets (keys, parameters, effects); one that does not come to its end is left alone."""
        rest = listed
        for solve in (self._turning.solved, self._solved):
            if not rest:
                return
            try:
                solved, reached = solve(runs, [(p, active) for _, p, active in rest])
            except (Exception, SystemExit):  # noqa: BLE001 - whatever it is, a set alone raises it by name
                return
            for k in np.flatnonzero(reached).tolist():
                self._keep_all(runs, *rest[k], [np.ascontiguousarray(x[:, k]) for x in solved])
            rest = [one for one, there in zip(rest, reached, strict=True) if not there]
        self._alone.update(key for keys, *_ in rest for key in keys)

    def _keep_all(
        self, runs: Sequence[Run], keys: tuple[Any, ...], p: Mapping[str, float],
        active: list[AppliedEffect], states: Sequence[NDArray[np.float64]],
    ) -> None:  # fmt: skip
        for run, key, x in zip(runs, keys, states, strict=True):
            forces = [applied for applied in active if applied.acts_in(run)]
            if key[1] and len(forces) < len(active):
                continue  # its added states stand elsewhere than those of the run alone
            try:
                self._kept[key] = self._made(run, p, forces, x, between=key[1])
            except FitError as error:
                self._kept[key] = error

    def _solved(
        self,
        runs: Sequence[Run],
        listed: Sequence[tuple[Mapping[str, float], Sequence[AppliedEffect]]],
    ) -> tuple[list[NDArray[np.float64]], NDArray[np.bool_]]:
        """Return the states of several sets of parameters and effects in every run, (states, sets, rows).

        And which of the sets were simulated to the end.

        The states that forces bring along stand where `Forces` of all of a set's effects puts them.
        """
        columns, own = self.equation.columns, len(self.states)
        assert columns is not None  # noqa: S101  asked by whoever calls
        forces = [self.forces(active) for _, active in listed]
        together, rows, terms = ForcesTogether(forces, own, runs), Rows(runs, self.drivers), forces[0].terms
        starts = [np.stack([self.equation.start(run, p) for p, _ in listed], axis=1) for run in runs]
        atol = np.stack([self.tolerance(starts[0][:, 0], force, together.added) for force in forces], axis=1)
        p = in_columns([values for values, _ in listed])
        x = np.zeros((own + together.added, len(listed), len(rows.t)))
        steps = np.ones(len(rows.t) - 1, dtype=np.intp)
        runs = tuple(map(self.recorded, runs))
        for run, at, start in zip(runs, rows.slices, starts, strict=True):
            x[:own, :, at] = self._near[run][:, None] if run in self._near else start[:, :, None]
            x[:own, :, at.start] = start
            for k, force in enumerate(forces):
                x[own : own + force.added, k, at] = self.equation.begun(run, start[:, k], force)[:, None]
            steps[at.start : at.stop - 1] = self._guesses.steps(run, terms, self._steps.get(run, 1))
        last = self._nodes.get(runs)
        sizes = np.array(
            [*(self.scale.get(name, (1.0, 1.0))[1] for name in self.states), *[1.0] * together.added]
        )
        for force in forces:
            sizes[own : own + force.added] = force.sizes
        flow = RowFlow(columns, rows, p, together, atol)
        with silenced():
            smooth = ~together.abrupt & self._guesses.are_tried(terms)
            path, reached = trajectories(flow, Path(x, steps, last), sizes, smooth)
        if smooth[0] and self.scale:
            self._guesses.led(terms, on=path.nodes is not None)
        for run, at in zip(runs, rows.slices, strict=True):
            if reached[0]:
                self._near[run] = path.x[:own, 0, at]
            if path.enough is not None and self.scale:
                self._steps.setdefault(run, path.steps[at.start : at.stop - 1])
                self._guesses.did(run, terms, path.enough[at.start : at.stop - 1])
        self._nodes[runs] = path.nodes and replace(path.nodes, x=path.nodes.x[:own])
        return [path.x[:, :, at] for at in rows.slices], reached

    def finer(self, run: Run) -> Run:
        """Return a run with rows between its rows, the inputs there as the equation sees them: linear."""
        if run not in self._fine:
            at = np.arange(FINER * (run.rows - 1) + 1) / FINER
            rows = np.arange(run.rows)
            columns = {name: np.interp(at, rows, values) for name, values in run.columns.items()}
            self._fine[run] = replace(run, t=np.interp(at, rows, run.t), columns=columns)
        return self._fine[run]

    def _key(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]
    ) -> tuple[tuple[Any, ...], list[AppliedEffect]]:
        forces = [
            applied for applied in active if applied.effect.stage == "dynamics" and applied.acts_in(run)
        ]
        between = any(applied.effect.reads_between_rows and applied.acts_in(run) for applied in active)
        return (run, between and run.rows > 1, tuple(p.values()), _forces_key(forces)), forces

    def integrated(
        self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect], *, alone: bool = False
    ) -> NDArray[np.float64]:
        """Return the states of a run, (states, rows), those that forces bring along behind the own ones."""
        key = (run, tuple(p.values()), _forces_key(forces))
        if key not in self._states:
            self._states[key] = self._integrated(run, p, forces, alone=alone)
        return self._states[key]

    def _integrated(
        self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect], *, alone: bool
    ) -> NDArray[np.float64]:
        acting = self.forces(forces)
        rate = self.equation.rates(run, without_starts(p), acting, len(self.states))
        start = self.equation.start(run, p)
        if run.rows == 1:
            return start[:, None]
        if self.equation.columns is not None and not alone:
            with contextlib.suppress(Exception):  # whatever it is, row by row it is raised by name
                (states,), reached = self._solved([run], [(p, forces)])
                if reached[0]:
                    return np.ascontiguousarray(states[:, 0])
        begun = np.concatenate([start, self.equation.begun(run, start, acting)])
        try:
            with silenced():
                atol = self.tolerance(start, acting, acting.added)
                x = integrate(rate, run.t, begun, atol, acting.slides(len(self.states)))
        except IntegrationError as error:
            raise failed(self.case, run, f"the integration ended early: {error}") from error
        except (Exception, SystemExit) as error:
            raise self.equation.failure("rhs", error, run, p) from error
        self._near[self.recorded(run)] = x[: len(self.states)]
        return x

    def tolerance(self, start: NDArray[np.float64], acting: Forces, added: int) -> NDArray[np.float64]:
        """Return the absolute tolerance of every state, ``added`` ones among them."""
        if not self.scale:
            return 0.01 * ATOL * np.maximum(np.abs(start), 1.0)
        sizes = [self.scale[name][1] for name in self.states]
        return ATOL * np.array(
            [*sizes, *(10 * size for size in acting.sizes), *[1.0] * (added - acting.added)]
        )

    def forces(self, active: Sequence[AppliedEffect]) -> Forces:
        """Return effects as forces on the equation's states."""
        sizes = {**self._driver_sizes, **self.scale}
        return Forces.of(active, self.states, self.derivative_of, sizes, self.drivers, self.feeds)

    def _made(
        self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect], x: NDArray[np.float64],
        *, between: bool,
    ) -> dict[str, NDArray[np.float64]]:  # fmt: skip
        """Return the outputs of integrated states, also ``between`` the rows."""
        if between:
            x, run = self.between(run, p, forces, x), self.finer(run)
        return self.equation.shown(run, p, x[: len(self.states)])

    def between(
        self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect], x: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return states also between the rows, by their rates at the rows: those have no corner there."""
        from scipy.interpolate import CubicHermiteSpline

        acting = self.forces(forces)
        x = x[: len(self.states) + acting.added]
        try:
            with silenced():
                rates = self.equation.rates_at(run, p, acting, len(self.states))(run.t, x)
        except (Exception, SystemExit) as error:
            raise self.equation.failure("rhs", error, run, p) from error
        return np.asarray(CubicHermiteSpline(run.t, x, rates, axis=1)(self.finer(run).t))

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return the states and outputs on which an effect could act."""
        if effect.term is not None:
            if is_law(effect.name):
                return [(state, None) for state in term_places(self.places)]
            named = self.states if effect.term.of == "state" else self.force_units
            at = [self.states.index(name) for name in named]
            listed = {self.states.index(name): text for name, text in self.case.simulation.force_terms}
            meanings = declared_dimensions(listed) | self._dimensions
            return [(self.states[i], None) for i in fitting(effect.term, at, self.derivative_of, meanings)]
        others = [(driver.name, driver.unit) for driver in self.case.drivers]
        outputs = [(output.name, output.unit) for output in self.outputs]
        found = channel_places(effect, outputs, others, set(known_names(self.case)))
        return found + input_places(effect, [pair for pair in others if pair[0] in self._inputs])

    def setting(self, run: Run) -> Setting:
        """Return a run's setting."""
        if run not in self._settings:
            self._settings[run] = setting(self.case, run, nominal_load_N=nominal_load(self.case))
        return self._settings[run]


def build(case: Case, _: pathlib.Path | None, code: CaseCode | None) -> OdeModel | OdeApart:
    """Return the simulation of a case of this kind; ConfigError where its file lacks a function."""
    if code is None:
        return _loaded(case)
    code.begin(handlers, both_need=("scipy.interpolate", "scipy.signal", "scipy.stats"))
    return OdeApart(case, code)


def handlers(case: Case) -> Handlers:
    """Return what a worker answers of an equation."""
    return handlers_of(case, _loaded(case))


def _loaded(case: Case) -> OdeModel:
    return OdeModel(case, *load_functions(case.file(), "rhs", "outputs", "initial"))


def _forces_key(forces: Sequence[AppliedEffect]) -> tuple[Any, ...]:
    return tuple((force.effect.name, force.channel, tuple(force.values.values())) for force in forces)
