"""An independent tire, whose curves are known, as a reduced test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from toolkit.characteristics.characterise import characteristic_rows
from toolkit.characteristics.groups import DirectionFit, group
from toolkit.characteristics.model import Characteristics, Row
from toolkit.machine import load_machine
from toolkit.recording.model import TestInfo
from toolkit.reduction.model import CalibrationUse, Condition, ReducedTest, Tare
from toolkit.tires.fit import Curve, fit_curves

Key = tuple[str, float, str, float | None]

M15 = load_machine("m15")
LOAD = 4000.0

# An independent tire in SAE axes that follow the travel: stiffness, pull and pneumatic trail by choice.
# The curves are of the form that is fitted, so that what is read off them is exact.
C_FY, C_MZ, PEAK, PEAK_MZ = 60_000.0, 1800.0, 4000.0, 60.0  # N/rad, N·m/rad, N, N·m
SHAPE_FY, SHAPE_MZ = 1.3, 2.4
CONICITY, PLYSTEER, CRAT, PRAT = 40.0, -120.0, 1.5, 6.0  # N, N, N·m, N·m


def curve(SA: np.ndarray | float, stiffness: float, peak: float, shape: float) -> np.ndarray:
    return np.asarray(peak * np.sin(shape * np.arctan(stiffness / (peak * shape) * np.asarray(SA))))


def at_load(load: float) -> tuple[float, float]:
    """How FY and MZ grow with the load, 1 at LOAD: two parabolas."""
    x = load / LOAD
    return x * (1.2 - 0.2 * x), x * (0.4 + 0.6 * x)


def tire(SA: np.ndarray, *, reverse: bool, load: float = LOAD) -> tuple[np.ndarray, np.ndarray]:
    """FY and MZ following the travel: conicity and CRAT change sign with it, plysteer and PRAT stay."""
    sign = -1.0 if reverse else 1.0
    FY = -curve(SA, C_FY, PEAK, SHAPE_FY) + PLYSTEER + sign * CONICITY
    MZ = curve(SA, C_MZ, PEAK_MZ, SHAPE_MZ) + PRAT + sign * CRAT
    force, moment = at_load(load)
    return force * FY, moment * MZ


def reduced_test(
    *,
    directions: tuple[str, ...] = ("forward", "reverse"),
    angles: tuple[float, ...] | None = None,
    offset_deg: float = 0.0,
    zero_rad: float = 0.0,
    stretch: float = 0.0,
    loads: tuple[float, ...] = (LOAD,),
    load_error: float = 0.0,
    cell_shift: tuple[float, float] = (0.0, 0.0),
    u: tuple[float, float] = (0.0, 0.0),
    **info: Any,
) -> ReducedTest:
    """A reduced test of the tire.

    ``offset_deg`` is how far the tire stands from its steps; ``zero_rad`` an error of the slip angle's zero;
    ``stretch`` and ``load_error`` are relative
    errors of the measured slip angle and load; ``cell_shift`` [N, N·m] an error of FY and MZ in the axes of
    the cells; ``u`` the standard uncertainties of FY and MZ of every condition.
    """
    steps = np.degrees(M15.protocol.slip_angles_rad) if angles is None else np.array(angles)
    conditions = []
    for rotation, load in ((r, load) for r in directions for load in loads):
        SA = np.radians(steps + offset_deg)
        FY, MZ = tire(SA, reverse=rotation == "reverse", load=load / (1 + load_error))
        SA = SA * (1 + stretch) + zero_rad
        turned = rotation == "reverse" and info.get("reversal", "drum") == "drum"
        FY, MZ = FY + (-1 if turned else 1) * cell_shift[0], MZ + cell_shift[1]
        first = 100 * loads.index(load)
        conditions += [
            Condition(
                file=f"{rotation}{i}", file_sha256="", rotation=rotation,
                first_row=1 + first, last_row=100 + first,
                step_SA=float(np.radians(steps[i])), step_FZ=load, SA=float(SA[i]), FZ=load, FY=float(FY[i]),
                MZ=float(MZ[i]), sd_SA=0.0, sd_FZ=0.0, u_FY=u[0], u_MZ=u[1], indications=(0.0, 0.0, 0.0),
                FY_file=None, MZ_file=None, FZ_common=load, FY_common=float(FY[i]),
                MZ_common=float(MZ[i]), u_FY_common=u[0], u_MZ_common=u[1], u_FY_zero=0.0, u_MZ_zero=0.0,
                used=True, calibration_sha256="",
            )
            for i in range(len(steps))
        ]  # fmt: skip
    return ReducedTest(
        info=TestInfo(name="t", machine="m15", **info),
        calibration=CalibrationUse(id="x", sha256="", unverified=False),
        conditions=tuple(conditions),
        tare=Tare(source="none", values=(), unit="lbf"),
        averaging="",
        findings=(),
        code_version="0",
    )


def rows_of_many(tests: Sequence[ReducedTest]) -> Iterator[dict[Key, Row]]:
    """The rows of many tests, as `characterise` and `characteristic_rows` give them one by one.

    All curves are fitted in one batch, which takes a third of the time.
    """
    groups = [group(test) for test in tests]
    fits = iter(
        fit_curves([
            Curve(SA=g.SA, y=g.values(channel), channel=channel, load_N=g.load_N, axes="SAE")
            for some in groups for g in some for channel in ("FY", "MZ")
        ])
    )  # fmt: skip
    for test, some in zip(tests, groups, strict=True):
        found = Characteristics(
            fits=tuple(
                DirectionFit(rotation=g.rotation, load_N=g.load_N, FY=next(fits), MZ=next(fits)) for g in some
            ),
            rows=(),
            findings=(),
        )
        yield {
            (row.name, row.load_N, row.rotation, row.SA_rad): row
            for row in characteristic_rows(test, found, machine=M15, record=None)
        }
