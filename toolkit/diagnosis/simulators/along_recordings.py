"""A simulation of unknown insides: what drives it and what moves in it stands in its recordings.

Its own outputs are asked for with what acts before them, terms of motion are added to them, and effects on
single channels act last. Where it answers for a tire, road and carriage act on what drives the tire.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from toolkit.diagnosis.simulators.channels import (
    channel_places,
    input_places,
    slopes,
    through_channels,
    true_inputs,
)
from toolkit.diagnosis.simulators.motion import Motion, motion_of
from toolkit.diagnosis.simulators.setting import NOMINAL_SPEED, known_names, nominal_load, setting
from toolkit.diagnosis.simulators.simulator import Capability, Moving, Output
from toolkit.diagnosis.simulators.tire import slip_work_before, tire_places
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.simulator import Largest, Pattern
    from toolkit.effects.signals import Setting
    from toolkit.effects.surroundings import MotionSizes
    from toolkit.findings import Finding


class AlongRecordings(ABC):
    """What simulations of unknown insides share; a kind gives its own outputs and its tire's.

    ``inputs`` names the channels that may have been recorded with an effect in them.
    """

    case: Case
    inputs: frozenset[str] = frozenset()

    def __init__(self, case: Case) -> None:
        self.case = case
        self.parameters = case.parameters
        self.outputs = tuple(
            Output(name=output.name, unit=output.unit, sd=output.sd) for output in case.outputs
        )
        self.load_N = nominal_load(case)
        self._settings: dict[Run, Setting] = {}
        self.drivers = {driver.name for driver in case.drivers}
        self.is_tire = bool(self.drivers & {"SA", "SA_CMD"}) and bool(
            {"FY", "MZ"} & {output.name for output in self.outputs}
        )
        self.motion: Motion | None = None if self.is_tire else motion_of(case)

    @abstractmethod
    def own_outputs(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], around: Setting
    ) -> Arrays:
        """Return the outputs as the simulation gives them, with effects in its inputs."""

    @abstractmethod
    def tire_outputs(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], around: Setting
    ) -> Arrays:
        """Return the outputs with effects on road, carriage and tire."""

    @abstractmethod
    def lateral(self, run: Run) -> Array:
        """Return FY of the nominal simulation over a run, (n,), in the case's unit."""

    @abstractmethod
    def tire_inputs(self) -> tuple[bool, bool] | None:
        """Tell whether camber and pressure drive the tire; None where no other drive can be asked for."""

    def capability_with(
        self,
        *,
        unsure: Mapping[str, float],
        findings: tuple[Finding, ...],
        repeats: Callable[[Run, Mapping[str, float]], None] | None,
    ) -> Capability:
        """Return what such a simulation knows and can do, with what its kind says for itself."""
        return Capability(
            nominal_load_N=None,
            cells=(),
            unsure=unsure,
            findings=findings,
            averages=True,
            repeats=repeats,
            together=None,
            motion=self._moving(),
        )

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output."""
        return {
            output.name: run.columns[output.name] for output in self.outputs if output.name in run.columns
        }

    def simulate(self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> Arrays:
        """Return every output of a run with effects in it."""
        around = self.setting(run)
        acting = [applied.effect for applied in active if applied.acts_in(run)]
        drives = self.is_tire and any(effect.drive is not None for effect in acting)
        simulated = (self.tire_outputs if drives else self.own_outputs)(run, p, active, around)
        forces = [
            applied for applied in active if applied.effect.stage == "dynamics" and applied.acts_in(run)
        ]
        if forces and self.motion is not None:
            true = true_inputs(run, active, self.inputs, around)
            simulated = self.motion.disturbed(simulated, forces, run, true)
        return through_channels(simulated, active, run, around, run.columns)

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return where an effect could act."""
        found: list[tuple[str | None, str | None]] = []
        tire = self.tire_inputs() if self.is_tire else None
        if tire is not None:
            has_IA, has_P = tire
            commanded = "FZ_CMD" in self.drivers and "FZ" not in self.drivers
            found += tire_places(effect, has_IA=has_IA, has_P=has_P, varies={"load_commanded": commanded})
        if self.motion is not None:
            found += self.motion.places(effect)
        others = [(driver.name, driver.unit) for driver in self.case.drivers]
        if not self.is_tire:
            found += input_places(effect, [pair for pair in others if pair[0] in self.inputs])
        outputs = [(output.name, output.unit) for output in self.outputs]
        return found + channel_places(effect, outputs, others, set(known_names(self.case)))

    def setting(self, run: Run) -> Setting:
        """Return a run's setting."""
        if run not in self._settings:
            self._settings[run] = setting(
                self.case,
                run,
                nominal_load_N=self.load_N,
                speed_m_s=NOMINAL_SPEED,
                work_kJ=self._work_before(run),
            )
        return self._settings[run]

    def _work_before(self, run: Run) -> float:
        if not self.is_tire or "FY" not in {output.name for output in self.outputs}:
            return 0.0
        factor = unit(self.case.unit("FY")).factor
        return slip_work_before(
            self.case, run, lambda earlier, _: self.lateral(earlier) * factor, load_N=self.load_N
        )

    def _moving(self) -> Moving | None:
        """Return what moves along the recordings, None where their units show no motion."""
        motion = self.motion
        if motion is None:
            return None

        def sizes(channel: str | None, largest: Largest) -> MotionSizes:
            return motion.sizes(largest(channel), largest)

        def pushed(
            run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], _: str | None, pattern: Pattern
        ) -> Arrays:
            simulated = self.simulate(
                run, p, [applied for applied in active if applied.effect.channel is None]
            )
            shown = slopes(simulated, active, run, self.setting(run), run.columns)
            responses = motion.pushed(simulated, run, pattern)
            return {name: shown[name][:, None] * column for name, column in responses.items()}

        return Moving(
            integrates=False, sizes=sizes, units=lambda _: motion.units(), way=lambda _: motion.way(),
            position=lambda _: motion.position, states=(), pushed=pushed,
        )  # fmt: skip
