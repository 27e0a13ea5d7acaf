"""Compare the acquisition program's own FY and MZ with ours, row by row.

The program's values are never used; where they differ, another calibration computed them, and that is
what the laboratory must know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import apply_record
from toolkit.recording.digits import rounding
from toolkit.units import si_scale

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.recording.model import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Largest |acquired - ours| of one channel of one file [SI], and whether rounding explains it."""

    file: str
    channel: str
    largest: float
    explained: bool


def compare(
    recording: Recording,
    record: CalibrationRecord,
    *,
    file: str,
    indications: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str],
    tare: Mapping[str, float] | None,
) -> tuple[Difference, ...]:
    """Return one `Difference` for each acquired channel that the record also computes.

    The program may use the full or the issued coefficients and may or may not have tared: the nearest of
    these readings counts. The bound propagates the printed digits of every value of the row.
    """
    channels = [s for s in recording.series if s.role == "acquired" and _computes(record, s.symbol)]
    if not channels:
        return ()
    symbols = [channel.symbol for channel in channels]

    def reading(offset: Mapping[str, float] | None, *, issued: bool) -> Mapping[str, NDArray[np.float64]]:
        return apply_record(record, indications, units=units, tare=offset, issued=issued, only=symbols)

    readings = [
        reading(offset, issued=issued)
        for offset in ((None, tare) if tare else (None,))
        for issued in (False, True)
    ]
    halves = {name: rounding(recording[name]) for name in indications}
    differences = []
    for channel in channels:
        bound = _moved(record, channel.symbol, indications, units, halves, plain=readings[0][channel.symbol])
        bound = bound + rounding(channel) * si_scale(channel.unit) + 1e-9 * np.abs(channel.si)
        misses = [np.abs(reading[channel.symbol] - channel.si) for reading in readings]
        differences.append(
            Difference(
                file=file,
                channel=channel.symbol,
                largest=float(np.max(misses[0])),
                explained=any(bool(np.all(miss <= bound)) for miss in misses),
            )
        )
    return tuple(differences)


def _moved(
    record: CalibrationRecord,
    load: str,
    indications: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str],
    halves: Mapping[str, NDArray[np.float64]],
    *,
    plain: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how far half a printed digit of every indication may move a load [SI], summed."""
    fit = record.load(load)
    coefficients = dict(zip(fit.terms, fit.coefficients, strict=True))
    if coefficients.keys() <= {*indications, "intercept"}:
        total = np.zeros_like(plain)
        for name, half in halves.items():
            total += abs(coefficients.get(name, 0.0)) * half
        return total * si_scale(fit.unit)
    moved = [
        apply_record(record, {**indications, name: indications[name] + half}, units=units, only=(load,))
        for name, half in halves.items()
    ]
    return np.asarray(np.sum([np.abs(values[load] - plain) for values in moved], axis=0))


def _computes(record: CalibrationRecord, symbol: str) -> bool:
    return any(fit.load == symbol for fit in record.loads)
