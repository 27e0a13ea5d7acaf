"""A tire file as a function of slip angle, load, camber and pressure, with some coefficients replaced."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from toolkit.tires import mf52, mf61
from toolkit.tires.slip import state
from toolkit.tires.tir import FOREIGN, TirFile
from toolkit.tires.tir_units import si_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SCALES = tuple(
    "LFZO LCX LMUX LEX LKX LHX LVX LGAX LCY LMUY LEY LKY LHY LVY LGAY LTR LRES LGAZ LXAL LYKA LVYKA LS "
    "LMUV LKYC LKZC".split()
)


class TirTire:
    """Pure lateral and aligning force of a tire file, ISO-W, SI."""

    def __init__(self, tir: TirFile) -> None:
        self._version = tir.version
        self._p = dict(tir.coefficients())
        self.FNOMIN = si_number(tir, "FNOMIN")
        self._radius = si_number(tir, "UNLOADED_RADIUS")
        self._speed = si_number(tir, "LONGVL", 0.0) or None
        self._nominal = si_number(tir, "NOMPRES", 0.0)
        self._inflation = si_number(tir, "INFLPRES", self._nominal)
        self.names = frozenset((*self._p, *_SCALES, *mf61.LATERAL, *mf61.ALIGNING)) - FOREIGN[self._version]
        self.has_pressure = self._version != "5.2" and self._nominal > 0 and any(
            self._p.get(name) for name in ("PPY1", "PPY2", "PPY3", "PPY4", "PPZ1", "PPZ2")
        )  # fmt: skip
        self.has_camber = any(
            self._p.get(name)
            for name in ("PKY6", "PKY7", "PVY3", "PVY4", "PHY3", "PDY3", "QDZ8", "QDZ9", "QHZ3", "QHZ4")
        )

    def __call__(
        self,
        p: Mapping[str, float],
        *,
        SA: NDArray[np.float64],
        FZ: NDArray[np.float64],
        IA: NDArray[np.float64],
        V: NDArray[np.float64],
        P: NDArray[np.float64] | None,
        pressure_error: NDArray[np.float64] | float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return FY [N] and MZ [N·m], each (n,); nothing where there is no load.

        ``p`` replaces coefficients by name; ``P`` [Pa], None for the file's own pressure;
        ``pressure_error`` [Pa] is added to it.
        """
        loaded = FZ > 0
        load = np.where(loaded, FZ, self.FNOMIN)
        change: NDArray[np.float64] | float = 0.0
        if self._version != "5.2" and self._nominal > 0:
            change = ((self._inflation if P is None else P) + pressure_error) / self._nominal - 1
        values = {**self._p, **p}
        with np.errstate(all="ignore"):
            q = state(
                values, SA=SA, FZ=load, FNOMIN=self.FNOMIN, IA=IA, KAPPA=0.0, pressure_change=change,
                V=V, V0=self._speed if self._version == "6.x" else None, angles="star",
            )  # fmt: skip
            responses = (mf52 if self._version == "5.2" else mf61).forces(
                values, q, UNLOADED_RADIUS=self._radius
            )
        return np.where(loaded, responses.FY, 0.0), np.where(loaded, responses.MZ, 0.0)
