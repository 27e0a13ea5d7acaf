"""The hub's load cells in a case: FY and MZ from them by a record, and effects on single cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import apply_record
from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.registry import Registry
from toolkit.diagnosis.simulators.channels import channel_places
from toolkit.diagnosis.simulators.simulator import Output
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.forward import undone
from toolkit.effects.signals import Setting
from toolkit.errors import ConfigError
from toolkit.inputs import NAMED_FILE, is_regular, read_input
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run

_LEAST_ROWS = 20  # of a run: fewer do not tell what its cells carried from its loads


class CaseCells:
    """Recorded cells and the record that turns them into loads, with the tare of the case's tare runs."""

    def __init__(self, case: Case, record: CalibrationRecord) -> None:
        declared = {channel.name: channel for channel in case.channels}
        missing = [name for name in record.indications if name not in declared]
        if missing:
            raise ConfigError(
                "the calibration needs a cell that the recording has not",
                where=f"{case.path}: recording.channels",
                got=", ".join(missing),
                expected=", ".join(record.indications),
                next_step="add the channels, or judge FY and MZ directly",
                rule="case",
            )
        self.case, self.record = case, record
        self.names = record.indications
        self.loads = tuple(load.load for load in record.loads if load.load in ("FY", "MZ"))
        self._units = {name: declared[name].unit for name in self.names}
        self._noise = {name: declared[name].sd for name in self.names}
        self._recorded_unit = dict(zip(record.indications, record.indication_units, strict=True))
        tares = [run for run in case.runs if run.conditions.get("phase") == "tare"]
        self._tare = (
            None
            if not tares
            else {
                name: float(np.nanmean(np.concatenate([self._cell(run, name) for run in tares])))
                for name in self.names
            }
        )

    def _cell(self, run: Run, name: str) -> Array:
        cell_unit, there = unit(self._units[name]), unit(self._recorded_unit[name])
        if cell_unit.dimension != there.dimension:
            raise ConfigError(
                "a cell's unit is not the calibration's",
                where=f"{self.case.path}: {name}",
                got=cell_unit.text,
                expected=there.text,
                next_step="correct the unit, or name the right calibration",
                rule="case",
            )
        return run.columns[name] * (cell_unit.factor / there.factor)

    def load(self, run: Run, name: str) -> Array:
        """Return FY [N] or MZ [N·m] from the recorded cells, (n,)."""
        return self.loads_of({cell: self._cell(run, cell) for cell in self.names})[name]

    def loads_of(self, cells: dict[str, Array]) -> dict[str, Array]:
        """Return FY and MZ [SI] of cells in the record's units."""
        return self._loads(cells, self._tare)

    def _loads(self, cells: dict[str, Array], tare: dict[str, float] | None) -> dict[str, Array]:
        return apply_record(self.record, cells, units=self._recorded_unit, tare=tare, only=self.loads)

    def noise(self, load: str) -> float | None:
        """Return a load's noise from the cells' stated noise, None where a cell has none."""
        fit = self.record.load(load)
        coefficients = dict(zip(fit.terms, fit.coefficients, strict=True))
        total = 0.0
        for name in self.names:
            sd = self._noise[name]
            if sd is None or name not in coefficients:
                return None
            factor = unit(self._units[name]).factor / unit(self._recorded_unit[name]).factor
            total += (coefficients[name] * sd * factor) ** 2
        return float(np.sqrt(total)) * unit(fit.unit).factor

    def _carried(
        self,
        run: Run,
        shown: Array,
        values: dict[str, Array],
        outputs: Sequence[Output],
    ) -> Array:
        """Return what a cell showed as far as simulated loads and recorded FZ account for it, noise-free.

        The cell's noise is in FY and MZ as well: an effect in proportion to what was recorded would explain
        that noise, and be found where nothing is wrong.
        """
        columns = [values[output.name] for output in outputs if output.name in self.loads]
        columns += [run.columns[name] for name in ("FZ",) if np.isfinite(run.columns.get(name, np.nan)).all()]
        there = np.column_stack([*columns, np.ones(len(shown))])
        good = np.isfinite(there).all(axis=1) & np.isfinite(shown)
        if int(good.sum()) < _LEAST_ROWS:
            return shown
        return np.asarray(there @ np.linalg.lstsq(there[good], shown[good], rcond=None)[0])

    def _foretold(self, values: dict[str, Array], outputs: Sequence[Output]) -> dict[str, Array]:
        """Return cells of inputs that were not recorded: as they went with the loads in the recordings.

        Three cells carry more than two loads say; least squares over the case's runs give what went with
        FY and MZ there, a constant included.
        """
        recorded = [output for output in outputs if output.name in self.loads]
        runs = [run for run in self.case.runs if all(name in run.columns for name in self.names)]
        if not runs:
            raise ConfigError(
                "an effect acts on cells that the inputs do not have",
                where=self.case.path,
                got="no cells",
                expected=", ".join(self.names),
                next_step="add the cells' columns to the inputs",
                rule="model-place",
            )
        shown = {name: np.concatenate([self._cell(run, name) for run in runs]) for name in self.names}
        loads = self.loads_of(shown)
        there = np.column_stack(
            [loads[output.name] for output in recorded] + [np.ones(len(shown[self.names[0]]))]
        )
        good = np.isfinite(there).all(axis=1) & np.isfinite(np.stack(list(shown.values()))).all(axis=0)
        shifted = np.column_stack(
            [values[output.name] * unit(output.unit).factor for output in recorded]
            + [np.ones(len(next(iter(values.values()))))]
        )
        return {
            name: shifted @ np.linalg.lstsq(there[good], column[good], rcond=None)[0]
            for name, column in shown.items()
        }

    def places(self, effect: Effect, drivers: set[str]) -> list[tuple[str | None, str | None]]:
        """Return the cells on which an effect could act: a force at the tire or the drum reaches them all."""
        if effect.on_channel is None or "cell" not in effect.on_channel.where:
            return []
        return channel_places(effect, [(name, self._units[name]) for name in self.names], (), drivers)

    def disturbed(
        self,
        values: dict[str, Array],
        active: Sequence[AppliedEffect],
        run: Run,
        setting: Setting,
        outputs: Sequence[Output],
    ) -> dict[str, Array]:
        """Return the loads that the record makes of disturbed cells.

        What the cells truly carried is the recording with the effect undone; the difference to what they
        showed, by the record, is what the effect adds to the simulation.
        """
        acting = [
            (applied, applied.effect.on_channel)
            for applied in active
            if applied.effect.on_channel is not None
            and applied.channel in self.names
            and applied.acts_in(run)
        ]
        if not acting:
            return values
        if all(name in run.columns for name in self.names):
            recorded = {name: self._cell(run, name) for name in self.names}
            for name in {str(applied.channel) for applied, facts in acting if facts.by_value}:
                recorded[name] = self._carried(run, recorded[name], values, outputs)
        else:
            recorded = self._foretold(values, outputs)
        true = dict(recorded)
        tare = None if self._tare is None else dict(self._tare)
        for applied, facts in reversed(acting):
            name = str(applied.channel)
            true[name] = undone(true[name], applied, setting, true)
            if tare is not None and facts.tare == "alike":
                # The tare was read through the same fault; what came later (creep, drift) is not in it.
                tare[name] = float(undone(np.array([tare[name]]), applied, setting, true)[0])
        shown, without = self.loads_of(recorded), self._loads(true, tare)
        shown_values = dict(values)
        for output in outputs:
            if output.name in self.loads:
                shown_values[output.name] = (
                    shown_values[output.name]
                    + (shown[output.name] - without[output.name]) / unit(output.unit).factor
                )
        return shown_values


def record_of(case: Case, calibrations: Path | None) -> CalibrationRecord:
    """Return the calibration that a case names: a path beside the case file, or a registry's id."""
    record_id = case.simulation.calibration
    path = case.path.parent / record_id
    if is_regular(path):
        return from_bytes(read_input(path, NAMED_FILE), where=path)
    if calibrations is None:
        raise ConfigError(
            "the case names a calibration and there is no registry",
            where=f"{case.path}: simulation.calibration",
            got=record_id,
            expected="the path of a record beside the case, or a home with calibrations/",
            next_step="give --calibrations DIR",
            rule="case",
        )
    return Registry(calibrations).load(record_id)
