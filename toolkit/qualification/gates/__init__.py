"""Every refusal, shown once: what is wrong on purpose must be refused, by the gate that is meant for it."""

from __future__ import annotations

import tempfile
from pathlib import Path

from toolkit.qualification.gates import records, times, uses, values
from toolkit.qualification.gates.bench import FAULTS, GROUP, Bench, Demonstration
from toolkit.qualification.model import Check, not_run


def demonstrations(folder: Path) -> tuple[Demonstration, ...]:
    """Return every demonstration; ``folder`` has the packaged numbers."""
    return (
        *uses.APPROVALS,
        *times.DEMONSTRATIONS,
        *uses.DEMONSTRATIONS,
        *records.DEMONSTRATIONS,
        *values.demonstrations(folder),
    )


def check_gates(folder: Path) -> list[Check]:
    """Show every refusal once, and that what is right passes; one check each."""
    try:
        with tempfile.TemporaryDirectory(prefix="toolkit-qualify-") as place:
            stock = Bench(Path(place) / "stock").fill()
            return [
                demonstration.check(stock.copy(Path(place) / str(number)))
                for number, demonstration in enumerate(demonstrations(folder))
            ]
    except FAULTS as error:
        # Without a folder or a record in force nothing can be shown.
        return [not_run(GROUP, "record to begin with", f"{type(error).__name__}: {error}")]
