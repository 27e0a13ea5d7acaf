"""A test as a page shows it: its results, its recordings with what computed each, and curves to be drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.lab.desk.chart import Chart, Condition, Series, row_chart

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.pipeline import TestResult


def results_answer(resolved: Resolved) -> dict[str, Any]:
    """Return what `process` answers of a test, its curves, and its characteristics as rows with U."""
    from toolkit.characteristics.catalogue import by_name
    from toolkit.lab.tire_tests.process_answer import process_payload

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
    from toolkit.declared import json_value
    from toolkit.recording.folder import read_test_folder
    from toolkit.recording.read import read_recording

    auditor = Auditor(folder, registry, None)
    files = []
    for path in read_test_folder(folder).files:
        audited = auditor(path.relative_to(folder).as_posix())
        if isinstance(audited, OwnOutput):
            continue
        plain = json_value(audited)
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


K = 2.0
"""Coverage factor of the U of one condition."""
_POINTS = 121


def curves_of_test(result: TestResult) -> dict[str, Any]:
    """Return the charts of a test with the loads and directions that can be switched."""
    from toolkit.characteristics.groups import directions_of
    from toolkit.tires.evaluate import value_at

    by_row = {(point.file, point.first_row): point for point in result.characteristics.points}
    drawn: dict[str, list[Series]] = {"FY": [], "MZ": [], "gough": []}
    loads: list[float] = []
    rotations: list[str] = []
    for direction in directions_of(result.reduced, result.characteristics.fits):
        group, rotation = direction.group, direction.group.rotation
        if group.load_N not in loads:
            loads.append(group.load_N)
        if rotation not in rotations:
            rotations.append(rotation)
        place = loads.index(group.load_N)
        condition: Condition = {"load": place, "load_N": group.load_N, "rotation": rotation}
        points = [by_row[c.file, c.first_row] for c in group.conditions]
        SA = [math.degrees(c.SA) for c in group.conditions]
        FY, MZ = ([float(v) for v in group.values(channel)] for channel in ("FY", "MZ"))
        U_FY, U_MZ = [K * p.u_FY for p in points], [K * p.u_MZ for p in points]
        drawn["FY"].append(Series(x=SA, y=FY, U=U_FY, condition=condition))
        drawn["MZ"].append(Series(x=SA, y=MZ, U=U_MZ, condition=condition))
        drawn["gough"].append(Series(x=MZ, y=FY, U=U_FY, U_x=U_MZ, condition=condition))
        grid = np.linspace(group.SA[0], group.SA[-1], _POINTS)
        fits = {"FY": direction.fit.FY, "MZ": direction.fit.MZ}
        lines = {name: value_at(fit, grid).tolist() for name, fit in fits.items() if fit is not None}
        for name, values in lines.items():
            drawn[name].append(Series(x=np.degrees(grid).tolist(), y=values, line=True, condition=condition))
        if len(lines) == len(fits):
            drawn["gough"].append(Series(x=lines["MZ"], y=lines["FY"], line=True, condition=condition))
    charts: dict[str, Chart] = {
        "FY": {"x_label": "SA [deg]", "y_label": "FY [N]", "series": drawn["FY"]},
        "MZ": {"x_label": "SA [deg]", "y_label": "MZ [N·m]", "series": drawn["MZ"]},
        "gough": {"x_label": "MZ [N·m]", "y_label": "FY [N]", "series": drawn["gough"]},
    }
    return {"charts": charts, "loads": loads, "rotations": rotations}


def shown_conditions(
    answer: Mapping[str, Any], curves: Mapping[str, Any], loads: Sequence[int], rotations: Sequence[str]
) -> list[dict[str, Any]]:
    """Return the conditions of `process --json` of some loads (by their place) and directions."""
    wanted = [curves["loads"][place] for place in loads]
    return [
        condition
        for condition in answer["conditions"]
        if condition["used"]
        and condition["rotation"] in rotations
        and _nearest(curves["loads"], condition["FZ_common_N"]) in wanted
    ]


def _nearest(loads: Sequence[float], load: float) -> float:
    return min(loads, key=lambda candidate: abs(candidate - load))
