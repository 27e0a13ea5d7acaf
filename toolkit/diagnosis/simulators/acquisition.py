"""Cells as inputs, FY and MZ as outputs: the acquisition program alone, by a calibration record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from toolkit.calibration.apply import apply_record
from toolkit.diagnosis.simulators.channels import through_channels
from toolkit.diagnosis.simulators.setting import nominal_load, setting
from toolkit.diagnosis.simulators.simulator import Capability, Output
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.errors import ConfigError, RecordError
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.diagnosis.case.case import Case, Run

_STAGES = ("acquisition", "load_cells")


class AcquisitionModel:
    """The acquisition program's arithmetic: a record's coefficients on the recorded cells."""

    def __init__(self, case: Case, record: CalibrationRecord, others: Sequence[CalibrationRecord]) -> None:
        declared = {channel.name: channel for channel in case.channels}
        missing = [name for name in record.indications if name not in declared]
        if missing or not all(declared[name].role == "input" for name in record.indications):
            raise ConfigError(
                "the calibration needs a cell that is no input",
                where=f"{case.path}: recording.channels",
                got=", ".join(missing) or "another role",
                expected=f"{', '.join(record.indications)} as inputs",
                next_step="declare the cells as inputs, or name a tire file",
                rule="case",
            )
        if case.parameters:
            raise ConfigError(
                "an acquisition program has no free parameter",
                where=f"{case.path}: simulation.parameters",
                got=", ".join(parameter.name for parameter in case.parameters),
                expected="none: a record's coefficients are known exactly",
                next_step="remove them, or declare the cells as outputs and name the tire",
                rule="case",
            )
        self.case, self.record = case, record
        self.capability = Capability(
            nominal_load_N=None,
            cells=record.indications,
            unsure={},
            findings=(),
            averages=False,
            repeats=None,
            together=None,
            motion=None,
        )
        self._others = {candidate.id: candidate for candidate in others if candidate.id != record.id}
        self.parameters = case.parameters
        self.outputs = tuple(
            Output(name=output.name, unit=output.unit, sd=output.sd)
            for output in case.outputs
            if output.name in ("FY", "MZ")
        )
        if len(self.outputs) != len(case.outputs):
            raise ConfigError(
                "an output is nothing that a calibration gives",
                where=f"{case.path}: recording.channels",
                got=", ".join(output.name for output in case.outputs),
                expected="FY, MZ",
                next_step="change its role",
                rule="case",
            )

    def observed(self, run: Run) -> dict[str, Array]:
        """Return FY and MZ as the program wrote them."""
        return {
            output.name: run.columns[output.name] for output in self.outputs if output.name in run.columns
        }

    def simulate(
        self,
        run: Run,
        p: Mapping[str, float],
        active: Sequence[AppliedEffect],
    ) -> dict[str, Array]:
        """Return FY and MZ by the record on cells with effects in them, then effects on FY and MZ."""
        del p  # a record's coefficients are known exactly
        around = setting(self.case, run, nominal_load_N=nominal_load(self.case))
        record = self.record
        for applied in active:
            if applied.effect.replaces_record and applied.source is not None and applied.acts_in(run):
                record = self._others[applied.source]
        cells = through_channels(
            {name: run.columns[name] for name in self.record.indications}, active, run, around, run.columns
        )
        units = dict(zip(record.indications, record.indication_units, strict=True))
        scaled = {
            name: cells[name] * unit(self.case.unit(name)).factor / unit(units[name]).factor
            for name in record.indications
        }
        loads = apply_record(record, scaled, units=units, only=[output.name for output in self.outputs])
        simulated = {output.name: loads[output.name] / unit(output.unit).factor for output in self.outputs}
        return through_channels(simulated, active, run, around, run.columns)

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return the cells, the loads and the records on which an effect could act."""
        if effect.stage not in _STAGES or effect.on_channel is None:
            return []
        if effect.replaces_record:
            return [(None, name) for name, record in self._others.items() if self._fits(record)]
        cells = list(self.record.indications)
        loads = [output.name for output in self.outputs]
        if effect.exchanges:
            return [(a, b) for group in (cells, loads) for i, a in enumerate(group) for b in group[i + 1 :]]
        made: list[tuple[str | None, str | None]] = []
        if "program_cell" in effect.on_channel.where:
            made += [(name, None) for name in cells]
        if "program_load" in effect.on_channel.where:
            made += [(name, None) for name in loads]
        return made

    def _fits(self, record: CalibrationRecord) -> bool:
        if not set(record.indications) <= set(self.record.indications):
            return False
        if not {output.name for output in self.outputs} <= {load.load for load in record.loads}:
            return False
        try:
            return all(
                unit(self.case.unit(name)).dimension == unit(text).dimension
                for name, text in zip(record.indications, record.indication_units, strict=True)
            )
        except RecordError:
            return False
