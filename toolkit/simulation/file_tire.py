"""A tire of a plan that is a property file (.tir): pure lateral force and aligning moment on the machine.

The file's equations are those of `toolkit.tires` (MF 5.2 and 6.x, ISO-W, alpha* and gamma*). A turned drum
shows the same tire rolling the other way: FY changes its sign in the machine's axes and MZ does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Rotation
from toolkit.effects.signals import TireForces
from toolkit.errors import ConfigError
from toolkit.tires.models import mf52, mf61
from toolkit.tires.slip import state
from toolkit.tires.tir import TirFile, read_tir, si_number

_PRESSURE = ("PPY1", "PPY2", "PPY3", "PPY4", "PPZ1", "PPZ2")
_CAMBER = (
    "PKY6", "PKY7", "PVY3", "PVY4", "PHY3", "PDY3", "QDZ8", "QDZ9", "QHZ3", "QHZ4"
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileTire:
    """A tire file, read and checked: its version, nominal load [N], free radius [m], pressures [Pa]."""

    path: Path
    tir: TirFile
    version: str
    FNOMIN: float
    UNLOADED_RADIUS: float
    NOMPRES: float
    INFLPRES: float
    LONGVL: float | None

    @property
    def has_pressure(self) -> bool:
        """Tell whether its forces depend on the pressure."""
        p = self.tir.coefficients()
        return self.version != "5.2" and self.NOMPRES > 0 and any(p.get(name) for name in _PRESSURE)

    @property
    def has_camber(self) -> bool:
        """Tell whether its forces depend on the camber angle."""
        p = self.tir.coefficients()
        return any(p.get(name) for name in _CAMBER)


def read_file_tire(path: Path) -> FileTire:
    """Read a tire file for the virtual machine.

    Raises
    ------
    ConfigError
        FITTYP is not known, FNOMIN or UNLOADED_RADIUS are missing or not positive, no lateral force;
        UnreadableError, CellError: as `toolkit.tires.tir.read_tir`
    """
    tir = read_tir(path)
    sizes = {name: si_number(tir, name) for name in ("FNOMIN", "UNLOADED_RADIUS")}
    for name, value in sizes.items():
        if not value > 0:
            raise ConfigError(
                f"the tire file's {name} is not positive", where=path, got=value, expected=f"{name} > 0",
                next_step="correct the entry", rule="tir-number",
            )  # fmt: skip
    if not all(tir.coefficients().get(name) for name in ("PCY1", "PDY1", "PKY1")):
        raise ConfigError(
            "the tire file has no lateral force", where=path, got="no PCY1, PDY1, PKY1",
            expected="coefficients of FY (and of MZ)", next_step="name another tire file",
            rule="tir-missing-key",
        )  # fmt: skip
    nominal = si_number(tir, "NOMPRES", 0.0)
    return FileTire(
        path=path,
        tir=tir,
        version=tir.version,
        NOMPRES=nominal,
        INFLPRES=si_number(tir, "INFLPRES", nominal),
        LONGVL=si_number(tir, "LONGVL", 0.0) or None,
        **sizes,
    )


def file_forces(
    tire: FileTire, *, SA: Array, FZ: Array, IA: Array, V: Array, pressure_Pa: Array, rotation: Rotation
) -> TireForces:
    """Return FY [N] and MZ [N·m] in the machine's axes, each (n,); nothing where there is no load.

    Parameters
    ----------
    SA, IA : slip angle and camber error [rad], machine axes, camber as it acts with the drum forward
    FZ, V, pressure_Pa : load [N], speed [m/s], true pressure [Pa]
    """
    reverse = rotation == "reverse"
    loaded = FZ > 0
    change = pressure_Pa / tire.NOMPRES - 1 if tire.version != "5.2" and tire.NOMPRES > 0 else 0.0
    p = tire.tir.coefficients()
    q = state(
        p, SA=-SA, FZ=np.where(loaded, FZ, tire.FNOMIN), FNOMIN=tire.FNOMIN, IA=-IA if reverse else IA,
        KAPPA=0.0, pressure_change=change, V=V, V0=tire.LONGVL if tire.version == "6.x" else None,
        angles="star",
    )  # fmt: skip
    responses = (mf52 if tire.version == "5.2" else mf61).forces(p, q, UNLOADED_RADIUS=tire.UNLOADED_RADIUS)
    FY, MZ = np.where(loaded, responses.FY, 0.0), np.where(loaded, responses.MZ, 0.0)
    return TireForces(FY=FY if reverse else -FY, MZ=-MZ)
