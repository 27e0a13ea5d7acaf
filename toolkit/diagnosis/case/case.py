"""A case: the simulation as declared, the recordings, and nothing that names an effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from toolkit.channels import Axes
from toolkit.declared import Above, Entry, UnitName
from toolkit.machine.default import DEFAULT_MACHINE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.simulation.model_file import FittedEffect
    from toolkit.simulation.plan_file import CaseParameter

Role = Literal["time", "input", "output", "covariate"]
Kind = Literal["machine", "python", "ode", "fmu", "columns"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseChannel:
    """A column that is used: its unit, its role, and its total sensor noise where it is stated."""

    name: str
    unit: Annotated[
        str, UnitName(as_written=True), Entry("of the column", expected='a unit, such as unit = "N"')
    ]
    role: Annotated[Role, Entry("what it is to the simulation")]
    sd: Annotated[float | None, Above(0), Entry("total noise of the sensor, from its certificate")] = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """One continuous recording: columns in the recording's units, shape (n,), NaN where a sample is missing.

    ``t`` is the time [s]; without a time channel the row's number. ``simulated`` has the other program's
    output of a case of kind ``columns``; ``declared`` the run's table as written; ``filled`` how many
    missing samples of which input were interpolated; ``sha256`` is the file's; ``own`` tells that
    the machine's acquisition program wrote it; ``hidden`` are the rows of a worksheet that it hides;
    ``file_rows`` the first and the last row of the file that each row stands for, (n, 2), counted from 0,
    where that is not the row itself: of means, and of readings in another order.
    """

    name: str
    t: Array
    columns: Mapping[str, Array]
    conditions: Mapping[str, str]
    declared: Mapping[str, Any]
    simulated: Mapping[str, Array]
    filled: tuple[tuple[str, int], ...] = ()
    sha256: str = ""
    own: bool = False
    hidden: tuple[int, ...] = ()
    file_rows: NDArray[np.intp] | None = None

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.t)


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """What a case says of its simulation; fields of other kinds are empty."""

    kind: Kind
    machine: str = DEFAULT_MACHINE
    calibration: str = ""
    tire: Path | None = None
    path: Path | None = None
    function: str = "simulate"
    states: tuple[str, ...] = ()
    force_terms: tuple[tuple[str, str], ...] = ()
    simulated: tuple[tuple[str, str], ...] = ()
    fmu_inputs: tuple[tuple[str, str], ...] = ()
    fmu_outputs: tuple[tuple[str, str], ...] = ()
    step_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A case, read whole; ``sha256`` covers the case file and every file that it names.

    ``effects`` are those that its simulation has from the start, of a model file or a corrected machine;
    ``model`` is that file; ``nominal_load_N`` the load to which their parameters are counted, None for that
    of the recordings; ``simulated`` says that these are no recordings of a real machine; ``has_order``
    that their rows follow each other, and are no set of readings; ``sample_rate_Hz`` the highest at which
    they can be recorded, ``longest_run_s`` how long one may take [s], None where nothing is said of it.
    """

    path: Path
    title: str
    simulation: Simulation
    parameters: tuple[CaseParameter, ...]
    axes: Axes
    has_time: bool
    channels: tuple[CaseChannel, ...]
    runs: tuple[Run, ...]
    predict: tuple[Run, ...]
    sha256: str
    effects: tuple[FittedEffect, ...] = ()
    nominal_load_N: float | None = None
    model: Path | None = None
    simulated: bool = False
    sample_rate_Hz: float | None = None
    longest_run_s: float | None = None
    has_order: bool = True

    @property
    def outputs(self) -> tuple[CaseChannel, ...]:
        """Channels that the simulation is judged on."""
        return tuple(channel for channel in self.channels if channel.role == "output")

    @property
    def drivers(self) -> tuple[CaseChannel, ...]:
        """Inputs and covariates."""
        return tuple(channel for channel in self.channels if channel.role in ("input", "covariate"))

    def file(self) -> Path:
        """Return the simulator's file; kinds ``python``, ``ode`` and ``fmu`` always have one."""
        return self.simulation.path or self.path

    def channel(self, name: str) -> CaseChannel:
        """Return a channel by name; KeyError where the case has none."""
        return {channel.name: channel for channel in self.channels}[name]

    def unit(self, name: str) -> str:
        """Return the unit of a channel, or that of the output which a simulated column stands for."""
        return self.channel(name).unit
