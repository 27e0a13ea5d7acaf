"""One run as effects see it: signals in SI, conditions, and what was there before the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.signals import Setting
from toolkit.errors import UnitError
from toolkit.units import unit

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run

NOMINAL_SPEED = 7.66 / 3.6  # m/s, of the drum of the source document (the thesis, 2.2)
# What tire models call the load to which their coefficients are counted, without case and underlines.
SPEEDS = frozenset({"speed", "frequency"})
"""Dimensions of a velocity and of a turning rate."""
_NOMINAL_LOADS = frozenset({"FZ0", "FZNOM", "FZNOMINAL", "FNOMIN", "FNOM", "NOMINALLOAD"})


def known_names(case: Case) -> dict[str, str]:
    """Return the channels of a case by the names under which effects look for them.

    The one covariate that is a temperature is that of the cells, whatever a user calls it. An input is none:
    it is what the simulation is about.
    """
    names = {channel.name: channel.name for channel in case.drivers}
    warmths = [each.name for each in case.drivers if each.role == "covariate" and _is_warmth(each.unit)]
    return names if len(warmths) != 1 else {"T_CELL": warmths[0]} | names


def _is_warmth(text: str) -> bool:
    return dimension(text) == dimension("K")


def si(case: Case, name: str, values: Array) -> Array:
    """Return a channel's values in SI."""
    stated = unit(case.unit(name))
    return values * stated.factor + stated.offset


def setting(
    case: Case, run: Run, *, nominal_load_N: float, speed_m_s: float = NOMINAL_SPEED, work_kJ: float = 0.0
) -> Setting:
    """Return the setting of a run; its channels are all drivers, in SI."""
    names = known_names(case)
    channels = {
        known: si(case, name, run.columns[name]) for known, name in names.items() if name in run.columns
    }
    first = {}
    for known, name in names.items():
        source = next((r for r in case.runs if name in r.columns), run)
        first[known] = float(si(case, name, source.columns[name])[0]) if source.rows else 0.0
    return Setting(
        t=run.t,
        elapsed_s=elapsed(case, run),
        channels=channels,
        conditions=run.conditions,
        first=first,
        slip_work_before_kJ=work_kJ,
        nominal_load_N=nominal_load_N,
        nominal_speed_m_s=speed_m_s,
        # Forces stand in the machine's axes, which do not follow a reversed drum.
        travel=-1.0 if run.conditions.get("rotation") == "reverse" else 1.0,
        facing=-1.0 if run.conditions.get("mounting") == "turned" else 1.0,
    )


def elapsed(case: Case, run: Run) -> Array:
    """Return the time since the case's first row [s].

    Where the runs' clocks go on from one to the next, they are one clock; where each run begins anew, the
    time is that within the run: what passed between runs is not known.
    """
    starts = [known.t[0] for known in case.runs if known.rows]
    if not starts or pauses(case.runs) is None:
        starts = [run.t[0] if run.rows else 0.0]
    return run.t - float(starts[0])


def pauses(runs: Sequence[Run]) -> Array | None:
    """Return the time between runs whose clocks go on [s]; None where a clock begins anew."""
    spans = np.array([(run.t[0], run.t[-1]) for run in runs if run.rows]).reshape(-1, 2)
    between = spans[1:, 0] - spans[:-1, 1]
    return between if (between >= 0).all() else None


def dimension(text: str) -> str:
    """Return the dimension of a unit's text, the text itself where it is not known."""
    try:
        return unit(text).dimension
    except UnitError:
        return text


def is_speed(text: str) -> bool:
    """Tell whether a unit is that of a velocity or of a turning rate; hertz count what comes again."""
    return dimension(text) in SPEEDS and not text.rstrip().endswith("Hz")


def nominal_load(case: Case) -> float:
    """Return the load [N] to which effects' parameters are counted.

    That of the case's model file, else a parameter of the simulation that is named as a tire's nominal load
    is named (`FZ0`, `FNOMIN`), else the median load of the recordings; 4000 N where none was recorded.
    """
    if case.nominal_load_N is not None:
        return case.nominal_load_N
    for parameter in case.parameters:
        is_nominal = parameter.name.replace("_", "").upper() in _NOMINAL_LOADS
        if is_nominal and dimension(parameter.unit) == dimension("N") and parameter.value > 0:
            return parameter.value * unit(parameter.unit).factor
    loads = [
        si(case, name, run.columns[name])
        for run in case.runs
        for name in ("FZ", "FZ_CMD")
        if name in run.columns and any(channel.name == name for channel in case.channels)
    ]
    if not loads:
        return 4000.0
    values = np.concatenate(loads)
    values = np.abs(values[np.isfinite(values) & (np.abs(values) > 0)])
    return float(np.median(values)) if len(values) else 4000.0
