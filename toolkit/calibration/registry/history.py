"""What a new record says against the instrument's last approved one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.calibration.registry.gates import new_history, sign_and_span
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord


def history_findings(record: CalibrationRecord, last: CalibrationRecord | None) -> tuple[Finding, ...]:
    """Return the findings against the instrument's last approved record."""
    if last is None:
        return ()
    found = [
        Finding(rule=one.rule, where=one.where, message=one.message) for one in sign_and_span(record, last)
    ]
    before = {cell.name: cell for cell in last.cells}
    for name in new_history(record, last):
        cell = next(c for c in record.cells if c.name == name)
        old = before.get(name)
        told = "it has no history" if old is None else (
            f"serial {old.serial or 'not stated'} [{old.unit}] in {last.id}, "
            f"now {cell.serial or 'not stated'} [{cell.unit}]"
        )  # fmt: skip
        message = f"a new sign and span history begins: {told}"
        found.append(Finding(rule="serial", where=name, message=message))
    return tuple(found)
