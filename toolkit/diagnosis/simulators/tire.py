"""A tire test of any kind of simulation: what drives the tire, and its forces with effects in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.channels import Axes, Rotation, signs
from toolkit.diagnosis.simulators.setting import NOMINAL_SPEED, si
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.forward import Steady, driven, tire_forces
from toolkit.effects.signals import Drive, Setting, Tire, TireForces, drive

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run


def rotation(run: Run) -> Rotation:
    """Return the drum's direction in a run."""
    return "reverse" if run.conditions.get("rotation") == "reverse" else "forward"


def tire_signs(source: Axes, target: Axes, run: Run) -> dict[str, int]:
    """Return the factor of SA, FY and MZ from one axis system to another in a run."""
    return signs(source, target, rotation(run))


def first_of(case: Case, run: Run, *names: str, outputs: bool = True) -> Array | None:
    """Return the first of these drivers, or of these outputs, in SI; None where the run has none."""
    among = {channel.name for channel in (case.channels if outputs else case.drivers)}
    for name in names:
        if name in run.columns and name in among:
            values = si(case, name, run.columns[name])
            if np.isfinite(values).all():
                return values
    return None


def base_drive(
    case: Case, run: Run, *, load_N: float, speed_m_s: float = NOMINAL_SPEED, outputs: bool = True
) -> Drive:
    """Return what drives the tire in a run: measured columns where recorded, else the commanded ones.

    Without ``outputs`` only what the simulation is given: a simulator of its own never saw an output.
    """
    turn = tire_signs(case.axes, "SAE", run)
    zero = np.zeros(run.rows)
    SA = first_of(case, run, "SA", "SA_CMD", outputs=outputs)
    FZ = first_of(case, run, "FZ", "FZ_CMD", outputs=outputs)
    IA = first_of(case, run, "IA", outputs=outputs)
    V = first_of(case, run, "V", outputs=outputs)
    return drive(
        run.t,
        zero if SA is None else turn["SA"] * SA,
        zero + load_N if FZ is None else FZ,
        IA=0.0 if IA is None else IA,
        V=speed_m_s if V is None else V,
    )


def slip_work_before(
    case: Case,
    run: Run,
    lateral: Callable[[Run, Drive], Array | None],
    *,
    load_N: float,
    speed_m_s: float = NOMINAL_SPEED,
) -> float:
    """Return the slip work [kJ] that the runs before a run put into the tire; of all for one to predict.

    Parameters
    ----------
    lateral : FY [N] of the nominal tire over a run under a drive, None where it is not known
    """
    total = 0.0
    for one in case.runs:
        if one.name == run.name:
            break
        start = base_drive(case, one, load_N=load_N, speed_m_s=speed_m_s)
        FY = lateral(one, start)
        if FY is not None and one.rows > 1:
            power = np.abs(FY * start.V * np.sin(start.SA)) * 1e-3
            total += float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(one.t)))
    return total


def through_tire(
    start: Drive, steady: Steady, active: Sequence[AppliedEffect], run: Run, setting: Setting
) -> TireForces:
    """Return the forces in the machine's axes with every effect on road, carriage and tire."""
    return tire_forces(start, steady, [applied for applied in active if applied.acts_in(run)], setting)


def late(
    start: Drive, active: Sequence[AppliedEffect], run: Run, setting: Setting, tire: Tire
) -> Drive | None:
    """Return the drive with the load as late as the carriage makes it, None where nothing does."""
    lags = [applied for applied in active if delays_load(applied) and applied.acts_in(run)]
    return driven(start, lags, setting, tire) if lags else None


def delays_load(applied: AppliedEffect) -> bool:
    """Tell whether an effect stands between the load's command and the load."""
    return applied.effect.follows_command == "FZ"


def tire_places(
    effect: Effect, *, has_IA: bool, has_P: bool, varies: dict[str, bool]
) -> list[tuple[str | None, str | None]]:
    """Return where an effect on road, carriage or tire could act: nowhere, or in the one machine."""
    if effect.drive is None:
        return []
    if not {"camber": has_IA, "pressure": has_P, None: True}[effect.needs_tire]:
        return []
    if effect.follows_command is not None and not varies.get("load_commanded", False):
        return []
    return [(None, None)]
