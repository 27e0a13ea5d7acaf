"""A test as a page shows it: its results with their curves, its recordings with what computed each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.lab.curves_answer import curves_of_test, row_chart

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.resolve import Resolved


def results_answer(resolved: Resolved) -> dict[str, Any]:
    """Return what `process` answers of a test, its curves, and its characteristics as rows with U."""
    from toolkit.characteristics.catalogue import by_name
    from toolkit.lab.process_answer import process_payload

    catalogue = by_name()
    characteristics = [
        {
            "name": row.name, "title": catalogue[row.name].title, "load_N": row.load_N,
            "rotation": row.rotation, "SA_rad": row.SA_rad,
            "SA_deg": None if row.SA_rad is None else math.degrees(row.SA_rad),
            "value": None if row.estimate is None else row.estimate.value,
            "U": None if row.estimate is None else row.estimate.expanded()[0],
            "k": None if row.estimate is None else row.estimate.expanded()[1],
            "unit": catalogue[row.name].unit, "lacking": row.lacking,
        }
        for row in resolved.result.characteristics.rows
    ]  # fmt: skip
    return {
        "answer": process_payload(resolved),
        "mark": resolved.result.reduced.calibration.mark,
        "curves": curves_of_test(resolved.result),
        "characteristics": characteristics,
    }


def recordings_answer(folder: Path, registry: Registry) -> dict[str, Any]:
    """Return each recording of a test's folder as `audit` answers it, with its loads row by row."""
    from toolkit.audit.context import context_of
    from toolkit.audit.identify import recompute
    from toolkit.audit.model import columns_of
    from toolkit.audit.one_file import Auditor, OwnOutput
    from toolkit.audit.serial import to_plain
    from toolkit.recording.folder import read_test_folder
    from toolkit.recording.read import read_recording

    auditor = Auditor(folder, registry, None)
    files = []
    for path in read_test_folder(folder).files:
        audited = auditor(path.relative_to(folder).as_posix())
        if isinstance(audited, OwnOutput):
            continue
        plain = to_plain(audited)
        charts = {}
        if plain["in_force"] is not None:
            columns = columns_of(recording := read_recording(path, context_of(path).machine))
            new = recompute(columns, registry.load(plain["in_force"]))
            charts = {
                load: row_chart(load, recording[load].si if load in columns.loads else None, values)
                for load, values in new.items()
                if load in ("FY", "MZ")
            }
        files.append((plain, charts))
    files.sort(key=lambda file: _condition(file[0]))
    return {"files": files}


def _condition(plain: Mapping[str, Any]) -> tuple[Any, ...]:
    steps = [block["SA_deg"] for block in plain["conditions"] if block["SA_deg"] is not None]
    return (plain["rotation"], steps[0] if steps else 0.0, plain["path"])
