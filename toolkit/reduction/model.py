"""ReducedTest: one mean a load block, corrected, in SI and SAE J670 axes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.calibration.records.use import CalibrationUse
from toolkit.channels import Rotation
from toolkit.errors import ConfigError
from toolkit.findings import Finding
from toolkit.machine import Machine, TypeB, load_machine
from toolkit.machine.definition import machine_of_text
from toolkit.recording.model import TestInfo
from toolkit.reduction.physics import RULES

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class HubLoad:
    """One calibrated load of the hub in SAE J670 [N, N*m] and its standard uncertainty, every source."""

    load: str
    value: float
    u: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One load block of one file, averaged.

    Forces in N, moments in N·m, angles in rad, in SAE axes that follow the travel (a reversed run is
    turned by half a turn about z). ``u_FY`` and ``u_MZ`` are the standard uncertainties of the mean
    (repeatability over the rows, autocorrelation included). ``*_common`` are carried to the load
    ``FZ_common`` that all blocks of this nominal load share; ``u_*_common`` includes that correction.
    ``u_*_zero`` is what the zero of the cells leaves: that of an untared bridge, or the scatter of the tare.
    ``indications`` are the cells' means minus tare, in the record's order and units.
    ``FY_file`` and ``MZ_file`` are the acquisition program's own values, None where the file has none.
    ``step_SA`` is the step of the protocol, which states what the machine shows, in SAE axes like ``SA``.
    ``first_row`` and ``last_row`` count from 1 at the first data row of the file.
    ``hub`` holds the loads of the hub beside FY and MZ, as measured; empty where the machine has none.
    """

    file: str
    file_sha256: str
    rotation: Rotation
    first_row: int
    last_row: int
    step_SA: float | None
    step_FZ: float | None
    SA: float
    FZ: float
    FY: float
    MZ: float
    sd_SA: float
    sd_FZ: float
    u_FY: float
    u_MZ: float
    indications: tuple[float, ...]
    FY_file: float | None
    MZ_file: float | None
    FZ_common: float
    FY_common: float
    MZ_common: float
    u_FY_common: float
    u_MZ_common: float
    u_FY_zero: float
    u_MZ_zero: float
    used: bool
    calibration_sha256: str
    hub: tuple[HubLoad, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Tare:
    """The tare that was subtracted, each indication in its own unit; source ``none`` where there is none.

    ``u`` holds the standard uncertainty of each cell's zero, in the same unit: what the machine states of an
    untared bridge, or the scatter of a recorded tare, or of as many rows of the recordings where the tare has
    few (``borrowed``). ``rows`` are those of the tare, 0 where it is declared by its value.
    """

    source: str
    values: tuple[tuple[str, float], ...]
    unit: str
    u: tuple[tuple[str, float], ...] = ()
    # A file of a reduced test keeps the u alone.
    rows: int = field(default=0, compare=False)
    borrowed: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedTest:
    """A whole test, reduced. ``conditions`` in the order of the protocol, unused ones last.

    ``protocol`` is the source that the protocol of the test names, ``machine_title`` what the definition of
    its machine calls it; ``stated`` are the standard
    uncertainties that the machine states of what has no calibration record (GUM type B), as far as the test
    uses them. ``definition`` is the text of the machine's definition where it is none of the packaged ones.
    """

    info: TestInfo
    calibration: CalibrationUse
    conditions: tuple[Condition, ...]
    tare: Tare
    averaging: str
    findings: tuple[Finding, ...]
    code_version: str
    axes: str = "SAE"
    protocol: str = ""
    machine_title: str = ""
    stated: tuple[TypeB, ...] = ()
    definition: str = ""

    def machine(self) -> Machine:
        """Return the machine of the test, with its own protocol: the definition that stands in the test.

        A test of before 1.0.0 holds none; its machine is then looked for where it was reduced.

        Raises
        ------
        ConfigError
            ``unknown-machine``: that definition is not there any more
        """
        if self.definition:
            return machine_of_text(self.definition.encode(), Path(self.info.machine))
        try:
            return load_machine(self.info.machine)
        except ConfigError as error:
            if error.rule != "unknown-machine":
                raise
            raise ConfigError(
                "the machine's definition is not where the test was reduced from",
                where=f"the reduced test {self.info.name}",
                got=f"no file {self.info.machine}",
                expected="a reduced test that holds the definition of its machine",
                next_step="process the recordings again, or go on in the folder in which it was reduced",
                rule="unknown-machine",
            ) from error

    @property
    def impossible(self) -> tuple[Finding, ...]:
        """The findings of the gate of physics: corrected values that no tire has, level ``error``."""
        return tuple(finding for finding in self.findings if finding.rule in RULES)

    def used(self, rotation: Rotation | None = None) -> tuple[Condition, ...]:
        """Return the conditions that feed results, optionally of one direction of rotation."""
        return tuple(c for c in self.conditions if c.used and rotation in (None, c.rotation))

    def table(self) -> pd.DataFrame:
        """Return the conditions as a table, one row each, in SI; of the hub ``hub_FX``, ``u_hub_FX``."""
        import dataclasses

        import pandas as pd

        return pd.DataFrame([_row(dataclasses.asdict(c), c.hub) for c in self.conditions])


def _row(fields: dict[str, Any], hub: tuple[HubLoad, ...]) -> dict[str, Any]:
    del fields["hub"]
    return (
        fields
        | {f"hub_{entry.load}": entry.value for entry in hub}
        | {f"u_hub_{entry.load}": entry.u for entry in hub}
    )


__all__ = ["CalibrationUse", "Condition", "HubLoad", "ReducedTest", "Tare"]
