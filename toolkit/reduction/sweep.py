"""Sweeps: recordings in which the slip angle is steered in time; their rows near zero slip, at one load.

A sweep gives no condition, because nothing of it has settled. ``[sweeps]`` of ``test.toml`` names its file
with the speed of the road. The moves between the rests of a settled recording are none: within 1.5 deg of
zero a tire rolls too little in them to tell its length from what it brings along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.apply import apply_record
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.channels import Rotation, seen_by_cells, signs
from toolkit.findings import Finding
from toolkit.machine import Machine
from toolkit.recording.clock import time_fault
from toolkit.recording.model import Recording, TestInfo
from toolkit.reduction.corrections import corrected
from toolkit.reduction.health import health_findings
from toolkit.reduction.hub import with_load
from toolkit.reduction.model import Tare

SMALL_RAD = float(np.radians(1.5))
"""Slip angles beyond it are not near zero: the curve is a cubic within, and the length hardly falls."""
_FEWEST = 20  # rows of a stretch
_ROLLED_M = 3.0  # within a stretch: a tire of 0.7 m has then forgotten nearly all of what was before
_TURNED_RAD = float(np.radians(0.2))  # within a stretch; what rests for long has nothing to say
LEAST_RAD = float(np.radians(0.5))
"""Steering through less shows no length."""
_WAVES = 2  # harmonics of the turns of tire and drum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweep:
    """The rows of one recording at one load near zero slip, in SI and SAE axes, each array (rows,).

    ``stretches`` follow one another without a gap; ``explained`` (rows, signals) is what FY may follow beside
    the slip angle: the load, and the turns of tire and drum where they are recorded. ``speed_u`` is relative.
    ``first_row`` and ``last_row`` count from 1 at the first data row of the file.
    """

    file: str
    file_sha256: str
    rotation: Rotation
    first_row: int
    last_row: int
    t: Array
    SA: Array
    FY: Array
    FZ: Array
    V: Array
    stretches: tuple[slice, ...]
    explained: Array
    speed_u: float

    @property
    def distance_m(self) -> Array:
        """The distance that was rolled since the first row [m]."""
        steps = (self.V[1:] + self.V[:-1]) / 2 * np.diff(self.t)
        return np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def steer_rate_rad_s(self) -> float:
        """The rate at which the slip angle is steered: the median of what is above half of the largest.

        Noise of the angle counts little over a tenth of a second.
        """
        rates = []
        for rows in self.stretches:
            t, SA = self.t[rows], self.SA[rows]
            apart = max(1, round(0.1 / max(float(np.median(np.diff(t))), 1e-6)))
            if len(t) > apart:
                rates.append(np.abs(SA[apart:] - SA[:-apart]) / (t[apart:] - t[:-apart]))
        measured = np.concatenate(rates) if rates else np.zeros(1)
        return float(np.median(measured[measured >= measured.max() / 2]))


def sweeps_of(
    recordings: Sequence[tuple[str, Recording, Rotation, float]],
    *,
    machine: Machine,
    record: CalibrationRecord,
    info: TestInfo,
    tare: Tare | None,
) -> tuple[tuple[Sweep, ...], tuple[Finding, ...]]:
    """Return the sweeps of recordings, and a finding for each recording that shows none.

    Parameters
    ----------
    recordings : path inside the test, recording, direction, and the declared speed [m/s]
    tare : of the cells; a constant does not move what a sweep says
    """
    sweeps: list[Sweep] = []
    findings: list[Finding] = []
    offsets = None if tare is None or tare.source == "none" else dict(tare.values)
    for name, recording, rotation, speed in recordings:
        t = _times(recording, machine)
        fault = None if t is None else time_fault(t)
        if t is None or fault is not None:
            why = "it has no time: name a column 't [s]', or the machine's rate"
            if fault is not None:
                count, first = len(fault.rows), fault.rows[0]
                why = f"{fault.problem} ({count} rows, the first is row {first}): {fault.remedy}"
            findings.append(_unused(name, why))
            continue
        findings += health_findings(
            recording, name, stretches=[slice(0, recording.rows)], read=record.indications, settled=False
        )
        loaded = with_load(recording, machine=machine, record=record, tare=offsets)
        signals = _signals(loaded, machine, record, rotation, info, offsets)
        signals["V"], speed_u = _speed(recording, machine, speed)
        mine = [
            sweep
            for at_load, nominal in _at_loads(signals["FZ"], machine)
            if (sweep := _sweep(name, loaded, rotation, t, signals, at_load, nominal, speed_u)) is not None
        ]
        if not mine:
            findings.append(
                _unused(
                    name,
                    "at no load is the slip angle steered by a quarter of a degree to either side of "
                    f"zero, while {_ROLLED_M:g} m are rolled within 1.5 deg",
                )
            )
        sweeps += mine
    return tuple(sweeps), tuple(findings)


def _unused(name: str, why: str) -> Finding:
    return Finding(rule="sweep-unused", where=name, message=f"the sweep says nothing: {why}")


def _times(recording: Recording, machine: Machine) -> Array | None:
    if recording.has("t"):
        return recording["t"].si
    rate = machine.sample_rate_Hz or (machine.sweeping.sample_rate_Hz if machine.sweeping else None)
    return None if rate is None else np.arange(recording.rows) / rate


def _signals(
    recording: Recording,
    machine: Machine,
    record: CalibrationRecord,
    rotation: Rotation,
    info: TestInfo,
    offsets: dict[str, float] | None,
) -> dict[str, Array]:
    """Return SA, FZ, FY of every row, corrected, in SAE axes that follow the travel."""
    indications = {name: recording[name].values for name in record.indications}
    units = {name: recording[name].unit for name in record.indications}
    forces = apply_record(record, indications, units=units, tare=offsets, only=("FY", "MZ"))
    measured = {"SA": recording["SA"].si, "FZ": recording["FZ"].si, "FY": forces["FY"], "MZ": forces["MZ"]}
    channels = corrected(machine, measured)
    sign = signs(machine.axes, "SAE", seen_by_cells(rotation, info.reversal))
    return {
        "SA": sign["SA"] * channels["SA"], "FY": sign["FY"] * channels["FY"], "FZ": channels["FZ"],
    }  # fmt: skip


def _at_loads(FZ: Array, machine: Machine) -> list[tuple[NDArray[np.bool_], float]]:
    """Return the rows at each load of the protocol that a recording holds, else those about its median."""
    within = machine.protocol.load_tolerance
    nominal = [load for load in machine.protocol.loads_N if (np.abs(FZ - load) <= within * load).any()]
    levels = nominal or [float(np.median(FZ[FZ > 0]))] if (FZ > 0).any() else []
    return [(np.abs(FZ - load) <= within * load, load) for load in levels]


def _sweep(
    name: str,
    recording: Recording,
    rotation: Rotation,
    t: Array,
    signals: dict[str, Array],
    at_load: NDArray[np.bool_],
    nominal: float,
    speed_u: float,
) -> Sweep | None:
    """Return what a recording shows at a load; None where the steering does not."""
    SA, V = signals["SA"], signals["V"]
    near_zero = np.flatnonzero(at_load & (np.abs(SA) <= SMALL_RAD))
    pieces = [
        piece
        for piece in np.split(near_zero, np.flatnonzero(np.diff(near_zero) > 1) + 1)
        if len(piece) >= _FEWEST
        and float(np.ptp(SA[piece])) >= _TURNED_RAD
        and float(t[piece[-1]] - t[piece[0]]) * float(np.mean(V[piece])) >= _ROLLED_M
    ]
    if not pieces:
        return None
    rows = np.concatenate(pieces)
    if not (SA[rows].max() >= LEAST_RAD / 2 and SA[rows].min() <= -LEAST_RAD / 2):
        return None
    ends = np.cumsum([len(piece) for piece in pieces])
    return Sweep(
        file=name, file_sha256=recording.sha256, rotation=rotation,
        first_row=int(rows[0]) + 1, last_row=int(rows[-1]) + 1,
        t=t[rows], SA=SA[rows], FY=signals["FY"][rows], FZ=signals["FZ"][rows], V=V[rows],
        stretches=tuple(slice(int(end) - len(p), int(end)) for p, end in zip(pieces, ends, strict=True)),
        explained=_explained(recording, rows, signals, nominal), speed_u=speed_u,
    )  # fmt: skip


def _speed(recording: Recording, machine: Machine, stated: float) -> tuple[Array, float]:
    """Return the speed at each row [m/s] and its relative standard uncertainty: recorded, else stated."""
    drum = machine.drum
    # Without a statement of its own a speed lies anywhere within the tolerance (GUM 4.3.7).
    relative_u = drum.speed_tolerance_m_s / drum.speed_m_s / np.sqrt(3.0)
    if machine.sweeping is not None:
        relative_u = machine.sweeping.speed_u
    if recording.has("V"):
        return np.abs(recording["V"].si), float(relative_u)
    return np.full(recording.rows, stated), float(relative_u)


def _explained(
    recording: Recording, rows: NDArray[np.intp], signals: dict[str, Array], nominal: float
) -> Array:
    beside = signals["FZ"][rows] / nominal - 1
    columns = [beside, beside * signals["SA"][rows] / SMALL_RAD]
    for symbol in ("TIRE_ANGLE", "DRUM_ANGLE"):
        if recording.has(symbol):
            angle = recording[symbol].si[rows]
            columns += [wave(n * angle) for n in range(1, _WAVES + 1) for wave in (np.cos, np.sin)]
    return np.column_stack([column - column.mean() for column in columns])
