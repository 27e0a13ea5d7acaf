"""Compare the acquisition program's own FY and MZ with ours, row by row.

The program's values are never used; where they differ, another calibration computed them, and that is
what the laboratory must know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.apply import apply_record
from toolkit.recording.digits import half_last_place
from toolkit.units import si_scale

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from toolkit.calibration.record import CalibrationRecord
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
    readings = [
        apply_record(record, indications, units=units, tare=offset, issued=issued)
        for offset in ((None, tare) if tare else (None,))
        for issued in (False, True)
    ]
    plain = readings[0]
    moved = [
        apply_record(record, {**indications, name: values + half_last_place(values)}, units=units, tare=None)
        for name, values in indications.items()
    ]
    found = []
    for one in channels:
        bound = sum((np.abs(m[one.symbol] - plain[one.symbol]) for m in moved), np.zeros(recording.rows))
        bound = bound + half_last_place(one.values) * si_scale(one.unit) + 1e-9 * np.abs(one.si)
        misses = [np.abs(reading[one.symbol] - one.si) for reading in readings]
        found.append(
            Difference(
                file=file,
                channel=one.symbol,
                largest=float(np.max(misses[0])),
                explained=any(bool(np.all(miss <= bound)) for miss in misses),
            )
        )
    return tuple(found)


def _computes(record: CalibrationRecord, symbol: str) -> bool:
    return any(fit.load == symbol for fit in record.loads)
