"""Acquisition stage: first-order filter, noise, the program's own Fy and Mz, and the digits of its files.

Cells and slip angle pass the filter (their columns say so), the load does not. The acquisition program
writes its own Fy and Mz from the filtered cells by the coefficients that it was given. A plan may turn the
signs of some, as the real machine had those of E5 for years: the packaged example does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from toolkit.arrays import Array
from toolkit.declared import AtLeast, Entry, Unit
from toolkit.simulation.cells import CELLS, CellsTruth
from toolkit.units import from_si

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.machine import Machine

# Figure 4.4 shows these places: significant digits, for the slip angle decimals.
SIGNIFICANT = {"FZ": 7, "D52": 7, "D51": 7, "E5": 6, "FY": 7, "MZ": 6}
SA_DECIMALS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class AcquisitionTruth:
    """The virtual data acquisition; noise is the standard deviation of one sample.

    ``negated`` names the channels whose terms the program has with the wrong sign.
    """

    filter_time_constant_s: Annotated[
        float, Unit("s"), Entry("of cells and slip angle", key="filter_time_constant")
    ] = 0.05
    rows_per_revolution: Annotated[int, AtLeast(1), Entry("of the tire")] = 100
    FZ_noise_N: Annotated[float, Unit("N"), Entry("1 sd of a sample", key="FZ_noise")] = 2.5
    SA_noise_rad: Annotated[float, Unit("deg"), Entry("1 sd of a sample", key="SA_noise")] = math.radians(
        0.003
    )
    negated: Annotated[
        tuple[Literal["D51", "D52", "E5"], ...],
        Entry("cells whose terms the program has with the wrong sign", example=["E5"]),
    ] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnProgram:
    """What the acquisition program was given: coefficients [N or N·m per V/V] in the order of `CELLS`.

    ``record`` is the registry id they come from, None for the true map of the virtual cells.
    """

    record: str | None
    FY: tuple[float, ...]
    MZ: tuple[float, ...]
    FY_constant: float = 0.0
    MZ_constant: float = 0.0

    def with_negated(self, names: tuple[str, ...]) -> OwnProgram:
        """Return the program with the signs of the named channels' terms turned."""
        turn = [-1.0 if name in names else 1.0 for name in CELLS]
        return OwnProgram(
            record=self.record,
            FY=tuple(c * s for c, s in zip(self.FY, turn, strict=True)),
            MZ=tuple(c * s for c, s in zip(self.MZ, turn, strict=True)),
            FY_constant=self.FY_constant,
            MZ_constant=self.MZ_constant,
        )


def true_program(cells: CellsTruth) -> OwnProgram:
    """Return the program of a laboratory that knows its cells perfectly."""
    from toolkit.simulation.cells import true_coefficients

    truth = true_coefficients(cells)
    return OwnProgram(record=None, FY=truth["FY"], MZ=truth["MZ"])


def low_pass(signal: Array, *, time_constant: float, dt: float) -> Array:
    """Return a signal (rows, ...) behind a first-order filter that had settled on its first row.

    >>> import numpy as np
    >>> step = np.r_[0.0, np.ones(1000)]
    >>> round(float(low_pass(step, time_constant=0.1, dt=1e-3)[100]), 3)  # 1 - 1/e after one time constant
    0.632
    """
    if time_constant <= 0:
        return np.asarray(signal, dtype=np.float64)
    from scipy.signal import lfilter

    pole = math.exp(-dt / time_constant)
    first = np.asarray(signal[:1], dtype=np.float64)
    filtered, _ = lfilter([1.0 - pole], [1.0, -pole], signal, axis=0, zi=pole * first)
    return np.asarray(filtered, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Noise:
    """Noise of every sample before the filter: cells [V/V] (rows, 3), SA [rad] and FZ [N] (rows,)."""

    cells: Array
    SA: Array
    FZ: Array


def draw_noise(truth: AcquisitionTruth, cells: CellsTruth, rows: int, rng: np.random.Generator) -> Noise:
    """Draw the noise of so many rows."""
    sd = np.asarray([cell.noise_V_V for cell in cells.all])
    return Noise(
        cells=rng.standard_normal((rows, len(CELLS))) * sd,
        SA=rng.standard_normal(rows) * truth.SA_noise_rad,
        FZ=rng.standard_normal(rows) * truth.FZ_noise_N,
    )


def joined(parts: Sequence[Noise]) -> Noise:
    """Return the noise of parts one after another."""
    return Noise(
        cells=np.concatenate([part.cells for part in parts]),
        SA=np.concatenate([part.SA for part in parts]),
        FZ=np.concatenate([part.FZ for part in parts]),
    )


def digitise(
    truth: AcquisitionTruth, *, cells: Array, FZ: Array, SA: Array, noise: Noise, dt: float
) -> dict[str, Array]:
    """Return the recorded channels in SI, symbol to (rows,): noise, then the filter of cells and angle."""
    smooth = low_pass(cells + noise.cells, time_constant=truth.filter_time_constant_s, dt=dt)
    angle = low_pass(SA + noise.SA, time_constant=truth.filter_time_constant_s, dt=dt)
    channels = {name: smooth[:, index] for index, name in enumerate(CELLS)}
    return {"FZ": FZ + noise.FZ, "SA": angle, **channels}


def own_columns(program: OwnProgram, channels: dict[str, Array]) -> dict[str, Array]:
    """Return the program's FY [N] and MZ [N·m] from the recorded cells, zeros included."""
    cells = np.column_stack([channels[name] for name in CELLS])
    return {
        "FY": cells @ np.array(program.FY) + program.FY_constant,
        "MZ": cells @ np.array(program.MZ) + program.MZ_constant,
    }


def printed(machine: Machine, channels: dict[str, Array]) -> dict[str, Array]:
    """Return the columns as the machine's files have them: their units, their order, their digits."""
    columns: dict[str, Array] = {}
    for column in machine.columns:
        if column.symbol in channels:
            values = from_si(channels[column.symbol], column.unit)
            columns[column.symbol] = round_printed(column.symbol, values)
    return columns


def round_printed(symbol: str, values: Array) -> Array:
    """Return values with the digits that the machine's files show for a channel.

    >>> import numpy as np
    >>> round_printed("E5", np.array([-182.41498])).tolist()
    [-182.415]
    """
    if symbol == "SA":
        return np.array([round(value, SA_DECIMALS) for value in values.tolist()], dtype=np.float64)
    digits = SIGNIFICANT[symbol]
    return np.array([float(f"{value:.{digits}g}") for value in values.tolist()], dtype=np.float64)
