"""Kind ``ode``: the simulation's own differential equation, integrated over the whole run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.batch_integration import (
    NotTogetherError,
    columns_of,
    integrate_together,
    takes_columns,
)
from toolkit.diagnosis.simulators.channels import channel_places, slopes, through_channels
from toolkit.diagnosis.simulators.equation import Equation, failed
from toolkit.diagnosis.simulators.forces import Forces
from toolkit.diagnosis.simulators.integrate import IntegrationError, integrate
from toolkit.diagnosis.simulators.linear_response import propagated
from toolkit.diagnosis.simulators.parameter_units import reduced
from toolkit.diagnosis.simulators.setting import nominal_load, setting
from toolkit.diagnosis.simulators.simulator import Capability, Moving, Output
from toolkit.diagnosis.simulators.states import dimensions, fitting
from toolkit.diagnosis.simulators.user_code import load_functions, silenced
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.filters import STRAIGHT
from toolkit.effects.signals import Setting
from toolkit.effects.surroundings import MotionSizes
from toolkit.errors import ConfigError, FitError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.simulator import Largest, Pattern

ATOL = 1e-7  # of a state's spread over a run; before that is known, a hundredth of it of one
_FINER = 4
_MOST_HELD = 200_000_000  # bytes of simulations to remember


class OdeModel:
    """``rhs(t, x, u, p)``, ``outputs(x, u, p)`` and ``initial(p[, run])`` of a Python file."""

    def __init__(
        self, case: Case, rhs: Callable[..., Any], outputs: Callable[..., Any], initial: Callable[..., Any]
    ) -> None:
        self.case, self._equation = case, Equation(case, rhs, outputs, initial)
        self.parameters = case.parameters
        self.outputs = tuple(Output(name=one.name, unit=one.unit, sd=one.sd) for one in case.outputs)
        self._drivers = tuple(one.name for one in case.drivers)
        self._settings: dict[Run, Setting] = {}
        self._fine: dict[Run, Run] = {}
        self._held = 0  # bytes of what is kept
        self._kept: dict[Any, dict[str, NDArray[np.float64]] | FitError] = {}
        p = {one.name: one.value for one in case.parameters}
        start = self._equation.start(case.runs[0], p)
        names = case.simulation.states or tuple(f"x{i}" for i in range(len(start)))
        if len(names) != len(start):
            raise ConfigError(
                "states and initial do not agree",
                where=f"{case.path}: simulation.states",
                got=f"{len(names)} names, {len(start)} initial values",
                expected="one name for each",
                next_step="correct the list of states",
                rule="case",
            )
        self.states = names
        terms = dict(case.simulation.force_terms)
        unknown = [name for name in terms if name not in names]
        if unknown:
            raise ConfigError(
                "a force term names no state",
                where=f"{case.path}: simulation.force_terms",
                got=", ".join(unknown),
                expected=", ".join(names),
                next_step="correct the name",
                rule="case",
            )
        self._derivative_of = self._equation.kinematics(p)
        self.force_units = terms or {
            name: "" for i, name in enumerate(names) if i not in self._derivative_of.values()
        }
        self.scale: dict[str, tuple[float, float]] = {}
        self.scale = self._sizes(p)
        self._takes_columns = self._tried(p)
        self.capability = Capability(
            nominal_load_N=None,
            cells=(),
            unsure={},
            findings=(),
            repeats=None,
            together=self._prepare,
            motion=Moving(
                integrates=True, sizes=self._motion_sizes, units=self._motion_units, way=self._way,
                pushed=self._pushed,
            ),
        )  # fmt: skip

    def _tried(self, p: Mapping[str, float]) -> bool:
        run = self.case.runs[0]
        u = self._equation.inputs(run).row(run.rows // 2)
        size = np.array([self.scale[name][1] for name in self.states])
        with silenced():
            return takes_columns(
                self._equation.rhs, float(run.t[0]), self._equation.start(run, p), size, u, p
            )

    def _sizes(self, p: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """Return for every state that a term may enter: size of its rate, and spread of itself."""
        runs = self.case.runs
        states = [self._integrate(run, p, ()) for run in runs]
        self._dimensions = dimensions(states[0], self._equation.shown(runs[0], p, states[0]), self.outputs)
        x = np.concatenate(states, axis=1)
        rates = [
            np.gradient(one, run.t, axis=1) if run.rows > 2 else np.zeros_like(one)
            for one, run in zip(states, runs, strict=True)
        ]
        fastest = np.abs(np.concatenate(rates, axis=1)).max(axis=1)
        steps = [np.abs(np.diff(one, axis=1)) for one in states]
        self._ways = {
            name: (
                max(float(np.ptp(one[i])) for one in states),
                float(np.median(np.concatenate([each[i] for each in steps] or [np.zeros(1)]))),
            )
            for i, name in enumerate(self.states)
        }
        self._largest = {name: float(x[i].max()) for i, name in enumerate(self.states)}
        farthest = np.abs(x).max(axis=1)
        self._reach = {
            name: (float(farthest[i]) or 1.0, float(farthest[self._derivative_of.get(i, i)]) or 1.0)
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
        rate, own = self.scale[state]
        position = self.position_of(state)
        place = own if position is None else self.scale[position][1]
        fastest, farthest = self._reach[state]
        return MotionSizes(
            force=rate, speed=own, place=place, fastest=fastest, farthest=farthest,
            # A state that starts at zero and only falls has no level to run over.
            level=self._largest[state] or place, has_position=position is not None,
        )  # fmt: skip

    def _motion_units(self, channel: str | None) -> tuple[str, str, str]:
        state, recorded = str(channel), {one.name: one.unit for one in self.case.channels}
        force = self.force_units.get(state) or f"{recorded.get(state, '1')}/s"
        rate = "m/s^2" if force == "N/kg" else force

        def of(name: str, implied: str) -> str:
            text = recorded.get(name, "1")
            return implied if text == "1" else text

        speed, position = of(state, reduced(f"{rate}*s")), self.position_of(state)
        return force, speed, speed if position is None else of(position, f"{speed}*s")

    def _way(self, channel: str | None) -> tuple[float, float]:
        position = self.position_of(str(channel))
        return (0.0, 0.0) if position is None else self._ways[position]

    def _pushed(
        self,
        run: Run,
        p: Mapping[str, float],
        active: Sequence[AppliedEffect],
        channel: str | None,
        pattern: Pattern,
    ) -> dict[str, NDArray[np.float64]]:
        """Return linear responses of every output to small forces of a pattern over the position.

        They have the shape (rows, forces).
        """
        at = self.states.index(str(channel))
        forces = [one for one in active if one.effect.stage == "dynamics" and one.acts_in(run)]
        acting, own = self._forces(forces), len(self.states)
        x = self._integrate(run, p, forces)
        if run.rows < 2:
            return {}
        fine = self._between(run, p, forces, x)
        rate = self._equation.rates(run, dict(p), acting, len(self.states))
        sizes = np.array([*(self.scale[name][1] for name in self.states), *acting.sizes])
        try:
            with silenced():
                moved = propagated(
                    rate, self._finer(run).t, fine, pattern(fine[self._derivative_of[at]]), at=at, sizes=sizes
                )[::_FINER]
        except (Exception, SystemExit) as error:
            raise failed(self.case, run, f"rhs: {type(error).__name__}: {error}") from error
        here = self._equation.shown(run, p, x[:own])
        made = {name: np.zeros((run.rows, moved.shape[2])) for name in here}
        for i in range(own):
            shifted = x[:own].copy()
            shifted[i] += 1e-6 * sizes[i]
            there = self._equation.shown(run, p, shifted)
            for name, column in made.items():
                column += ((there[name] - here[name]) / (1e-6 * sizes[i]))[:, None] * moved[:, i]
        shown = slopes(here, active, run, self.setting(run), run.columns)
        return {name: shown[name][:, None] * column for name, column in made.items()}

    def position_of(self, name: str) -> str | None:
        """Return the state whose rate is this state, None where there is none."""
        at = self._derivative_of.get(self.states.index(name))
        return None if at is None else self.states[at]

    def observed(self, run: Run) -> dict[str, NDArray[np.float64]]:
        """Return what was recorded of every output."""
        return {one.name: run.columns[one.name] for one in self.outputs if one.name in run.columns}

    def simulate(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]
    ) -> dict[str, NDArray[np.float64]]:
        """Return every output of a free simulation over the whole run."""
        key, forces = self._key(run, p, active)
        if key not in self._kept:
            self._keep(key, self._made(run, p, forces, self._integrate(run, p, forces), between=key[1]))
        kept = self._kept[key]
        if isinstance(kept, FitError):
            raise kept
        if not key[1]:
            return through_channels(kept, active, run, self.setting(run), run.columns)
        # An equation's outputs have a corner at each row, where its inputs have one.
        fine = [
            replace(one, values={**one.values, STRAIGHT: 1.0}) if _between_rows(one) else one
            for one in active
        ]
        finer = self._finer(run)
        made = through_channels(kept, fine, finer, self.setting(finer), finer.columns)
        return {name: values[::_FINER] for name, values in made.items()}

    def _prepare(
        self, run: Run, wanted: Sequence[tuple[Mapping[str, float], Sequence[AppliedEffect]]]
    ) -> None:
        """Integrate several sets of parameters and effects at once, for `simulate` to find."""
        if not self._takes_columns or run.rows < 2:
            return
        listed = {}
        for p, active in wanted:
            key, forces = self._key(run, p, active)
            listed[key] = (p, forces)
        # Those that are known already are done again with the others: their steps are then the same, and
        # differences between them are free of what the steps leave.
        if len(listed) < 2 or all(key in self._kept for key in listed):
            return
        self._together(run, [(key, *one) for key, one in listed.items()])

    def _together(self, run: Run, listed: list[tuple[Any, Mapping[str, float], list[AppliedEffect]]]) -> None:
        """Integrate sets together; in halves where one of them stands in the way, and that one not at all."""
        if len(listed) < 2:
            return
        sets = [p for _, p, _ in listed]
        try:
            starts = np.stack([self._equation.start(run, p) for p in sets], axis=1)
            forces = [self._forces(one) for *_, one in listed]
            rates = self._equation.rates_together(run, columns_of(sets), forces, len(self.states))
            own, added = len(self.states), max(one.added for one in forces)
            atol = np.stack([self._tolerance(starts[:, 0], one, added) for one in forces], axis=1)
            starts = np.vstack([starts, np.zeros((added, len(sets)))])
            slides = [(k, slide) for k, one in enumerate(forces) for slide in one.slides(own)]
            with silenced():
                made = integrate_together(rates, run.t, starts, atol, slides)
        except NotTogetherError:
            middle = len(listed) // 2
            self._together(run, listed[:middle])
            self._together(run, listed[middle:])
            return
        except (Exception, SystemExit):  # noqa: BLE001 - whatever it is, the same set alone raises it by name
            return
        for k, (key, p, one) in enumerate(listed):
            try:
                self._keep(
                    key, self._made(run, p, one, np.ascontiguousarray(made[:, :, k].T), between=key[1])
                )
            except FitError as error:
                self._keep(key, error)

    def _finer(self, run: Run) -> Run:
        """Return a run with rows between its rows, the inputs there as the equation sees them: linear."""
        if run not in self._fine:
            at = np.arange(_FINER * (run.rows - 1) + 1) / _FINER
            rows = np.arange(run.rows)
            columns = {name: np.interp(at, rows, values) for name, values in run.columns.items()}
            self._fine[run] = replace(run, t=np.interp(at, rows, run.t), columns=columns)
        return self._fine[run]

    def _key(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]
    ) -> tuple[tuple[Any, ...], list[AppliedEffect]]:
        forces = [one for one in active if one.effect.stage == "dynamics" and one.acts_in(run)]
        told = tuple((one.effect.name, one.channel, tuple(one.values.values())) for one in forces)
        between = any(_between_rows(one) and one.acts_in(run) for one in active)
        return (run, between and run.rows > 1, tuple(p.values()), told), forces

    def _keep(self, key: tuple[Any, ...], made: dict[str, NDArray[np.float64]] | FitError) -> None:
        if len(self._kept) > 400 or self._held > _MOST_HELD:
            self._kept.clear()
            self._held = 0
        self._kept[key] = made
        self._held += 0 if isinstance(made, FitError) else sum(one.nbytes for one in made.values())

    def _integrate(
        self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect]
    ) -> NDArray[np.float64]:
        acting = self._forces(forces)
        rate = self._equation.rates(run, dict(p), acting, len(self.states))
        start = self._equation.start(run, p)
        if run.rows == 1:
            return start[:, None]
        begun = np.concatenate([start, np.zeros(acting.added)])
        try:
            with silenced():
                atol = self._tolerance(start, acting, acting.added)
                return integrate(rate, run.t, begun, atol, acting.slides(len(self.states)))
        except IntegrationError as error:
            raise failed(self.case, run, f"the integration ended early: {error}") from error
        except (Exception, SystemExit) as error:
            raise failed(self.case, run, f"rhs: {type(error).__name__}: {error}") from error

    def _tolerance(self, start: NDArray[np.float64], acting: Forces, added: int) -> NDArray[np.float64]:
        """Return the absolute tolerance of every state, ``added`` ones among them."""
        if not self.scale:
            return 0.01 * ATOL * np.maximum(np.abs(start), 1.0)
        sizes = [self.scale[name][1] for name in self.states]
        return ATOL * np.array([*sizes, *(10 * one for one in acting.sizes), *[1.0] * (added - acting.added)])

    def _forces(self, active: Sequence[AppliedEffect]) -> Forces:
        return Forces.of(active, self.states, self._derivative_of, self.scale)

    def _made(
        self,
        run: Run,
        p: Mapping[str, float],
        forces: Sequence[AppliedEffect],
        x: NDArray[np.float64],
        *,
        between: bool,
    ) -> dict[str, NDArray[np.float64]]:
        """Return the outputs of integrated states, also ``between`` the rows."""
        if between:
            x, run = self._between(run, p, forces, x), self._finer(run)
        return self._equation.shown(run, p, x[: len(self.states)])

    def _between(
        self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect], x: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return states also between the rows, by their rates at the rows: those have no corner there."""
        from scipy.interpolate import CubicHermiteSpline

        acting = self._forces(forces)
        x = x[: len(self.states) + acting.added]
        rate = self._equation.rates(run, dict(p), acting, len(self.states))
        try:
            with silenced():
                rates = np.stack([rate(t, x[:, k]) for k, t in enumerate(run.t.tolist())], axis=1)
        except (Exception, SystemExit) as error:
            raise failed(self.case, run, f"rhs: {type(error).__name__}: {error}") from error
        return np.asarray(CubicHermiteSpline(run.t, x, rates, axis=1)(self._finer(run).t))

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return the states and outputs on which an effect could act."""
        drivers = set(self._drivers)
        if effect.term is not None:
            if effect.term.of == "state":
                return [(name, None) for i, name in enumerate(self.states) if i not in self._derivative_of]
            at = [self.states.index(name) for name in self.force_units]
            known = {} if self.case.simulation.force_terms else self._dimensions
            return [(self.states[i], None) for i in fitting(effect.term, at, self._derivative_of, known)]
        others = [(one.name, one.unit) for one in self.case.drivers]
        return channel_places(effect, [(one.name, one.unit) for one in self.outputs], others, drivers)

    def setting(self, run: Run) -> Setting:
        """Return a run's setting."""
        if run not in self._settings:
            self._settings[run] = setting(self.case, run, nominal_load_N=nominal_load(self.case))
        return self._settings[run]


def build(case: Case, _: Path | None) -> OdeModel:
    """Return the simulation of a case of this kind; ConfigError where its file lacks a function."""
    return OdeModel(case, *load_functions(case.file(), "rhs", "outputs", "initial"))


def _between_rows(applied: AppliedEffect) -> bool:
    """Tell whether an effect shows what the equation did between two rows."""
    return applied.effect.on_channel is not None and applied.effect.on_channel.between_rows
