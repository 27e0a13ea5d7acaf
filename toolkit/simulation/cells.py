"""Load-cell stage: three cells at the hub share FY, MZ and MX; each answers in mV/V.

The map from cell forces to loads has the magnitudes of the published calibration in its FY and MZ rows
(pounds-force, pound-force feet) and the drawing's levers in its MX row; the cells' forces follow from its
inverse. With that map the weight of the wheel and a lateral force at the tire push D51 and D52 up and E5
down, as in the recording of Figure 4.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.simulation.carriage import HubLoads
from toolkit.units import to_si

CELLS = ("D51", "D52", "E5")
LOADS = ("FY", "MZ", "MX")
_FOOT_M = 0.3048

# Rows FY [N/N], MZ [m], MX [m]; columns D51, D52, E5. Source document, equations of chapter 4.1 (lbf and
# lbf·ft) and the drawing of the hub: cells on a pitch circle of 200 mm, E5 opposite to D51 and D52.
MAP = (
    (0.99719, 0.99718, 1.0228),
    (-0.15688 * _FOOT_M, 0.16197 * _FOOT_M, 0.0026666 * _FOOT_M),
    (0.05, 0.05, -0.10),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTruth:
    """One cell: output [V/V] per force [N], output without force, and what came after the tare.

    ``noise_V_V`` is the standard deviation of one sample before the filter. ``zero_offset_V_V`` is a
    zero that moved after the tare was taken; ``gain_error`` a sensitivity that moved since calibration.
    """

    sensitivity_per_N: float
    zero_V_V: float
    noise_V_V: float = 5e-8
    zero_offset_V_V: float = 0.0
    gain_error: float = 0.0


def _cell(rated_mV_V: float, zero_mV_V: float) -> CellTruth:
    return CellTruth(
        sensitivity_per_N=rated_mV_V * 1e-3 / float(to_si(3000.0, "lbf")), zero_V_V=zero_mV_V * 1e-3
    )


# Three cells of one make differ by a per cent, and none rests at zero.
_D51, _D52, _E5 = _cell(2.0131, 0.0124), _cell(1.9874, -0.0087), _cell(2.0046, 0.0056)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellsTruth:
    """The three cells, and the share of the load FZ that shows as FY (crosstalk)."""

    D51: CellTruth = _D51
    D52: CellTruth = _D52
    E5: CellTruth = _E5
    crosstalk_FZ_FY: float = 0.0

    @property
    def all(self) -> tuple[CellTruth, CellTruth, CellTruth]:
        """The cells in the order of `CELLS`."""
        return self.D51, self.D52, self.E5


def cell_forces(loads: Array) -> Array:
    """Return the forces [N] (rows, 3: D51, D52, E5) in the cells under loads (rows, 3: FY, MZ, MX)."""
    indications: Array = np.linalg.solve(np.array(MAP), np.asarray(loads, dtype=np.float64).T).T
    return indications


def outputs(truth: CellsTruth, *, loads: Array, tared: bool = False) -> Array:
    """Return the outputs [V/V] (rows, 3: D51, D52, E5) without noise.

    ``tared`` leaves out every zero, as an amplifier that was zeroed does.
    """
    forces = cell_forces(loads)
    columns = []
    for index, cell in enumerate(truth.all):
        gain = cell.sensitivity_per_N * (1.0 + cell.gain_error)
        zero = 0.0 if tared else cell.zero_V_V + cell.zero_offset_V_V
        columns.append(gain * forces[:, index] + zero)
    return np.column_stack(columns)


def sense(truth: CellsTruth, *, hub: HubLoads) -> Array:
    """Return the cells' outputs [V/V] (rows, 3) under the loads at the hub."""
    FY = hub.FY + truth.crosstalk_FZ_FY * hub.FZ
    return outputs(truth, loads=np.column_stack([FY, hub.MZ, hub.MX]))


def true_coefficients(truth: CellsTruth) -> dict[str, tuple[float, ...]]:
    """Return the map from outputs [V/V] (D51, D52, E5) to FY [N], MZ [N·m], MX [N·m] as calibrated.

    It is what a perfect reference-load session finds; zeros and later changes of a cell are not in it.
    """
    per_output = [1.0 / cell.sensitivity_per_N for cell in truth.all]
    return {
        load: tuple(c * s for c, s in zip(row, per_output, strict=True))
        for load, row in zip(LOADS, MAP, strict=True)
    }
