"""The sheets of a test's workbook that people read: a first page, conditions, results.

The sheets behind them hold the same and more for programs, in SI and in full; these are never read back.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from toolkit.characteristics.catalogue import summary
from toolkit.characteristics.model import summary_estimates, summary_load
from toolkit.units import from_si, printed

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic
    from toolkit.estimate import Estimate
    from toolkit.pipeline import TestResult
    from toolkit.reduction.model import HubLoad

PAGE, CONDITIONS, RESULTS = "test", "conditions", "results"
_GUIDE = (
    (CONDITIONS, "the means of the load blocks, with expanded uncertainties; filter by direction or load"),
    (RESULTS, "every characteristic with its expanded uncertainty (95 %)"),
    ("findings", "departures from what was expected"),
    ("reduced ... provenance", "the whole test in SI and in full, for programs; change nothing there"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A value as a cell shows it: its number format, its side, a large, bold or warning type."""

    value: Any
    number_format: str = "General"
    size: int | None = None
    bold: bool = False
    warning: bool = False
    side: Literal["left", "right"] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A sheet with a ``head`` row to freeze and to filter by; a page of prose where there is none."""

    name: str
    head: tuple[str, ...]
    rows: tuple[Sequence[Any], ...]
    widths: tuple[float, ...]


def in_unit(value: float | None, unit: str, digits: int) -> Shown:
    """Return a number whose cell shows its unit: the value itself stays a number."""
    place = f"0.{'0' * digits}" if digits else "0"
    shown = printed(unit).replace("deg", "°")
    finite = None if value is None or not math.isfinite(value) else value
    return Shown(value=finite, number_format=f'#,##{place}" {shown}"')


def readable_sheets(result: TestResult) -> tuple[Sheet, ...]:
    """Return the sheets in their order."""
    return (
        Sheet(name=PAGE, head=(), rows=tuple(_page(result)), widths=(30, 22, 22, 44)),
        _conditions(result),
        _results(result),
    )


def _page(result: TestResult) -> Iterator[Sequence[Any]]:
    reduced, info = result.reduced, result.reduced.info
    yield (Shown(value=f"Tire force and moment test {info.tire_size or info.name}", size=16, bold=True),)
    marks = [
        reduced.calibration.mark,
        "SIMULATED DATA: made by simulation, not a measurement of a tire" if info.simulated else None,
        "IMPOSSIBLE VALUES: see the findings" if reduced.impossible else None,
    ]
    yield from ((Shown(value=mark, bold=True, warning=True),) for mark in marks if mark)
    yield ()
    tire = (info.tire_size, info.tire_company, info.tire_series, info.tire_DOT and f"DOT {info.tire_DOT}")
    facts = (
        ("test", info.name),
        ("date", info.date),
        ("tire", ", ".join(part for part in tire if part)),
        ("rim", info.tire_rim),
        ("machine", reduced.machine_title or info.machine),
        ("surface", info.surface),
        ("inflation pressure", _si(info.pressure_Pa, "kPa", 0)),
        ("speed", _si(info.speed_m_s, "km/h", 2)),
        ("rated load", _si(info.rated_load_N, "N", 0)),
        ("operator", info.operator),
        ("requestor", info.requestor),
        ("special", info.special),
        ("axes", "SAE J670" if reduced.axes == "SAE" else reduced.axes),
        ("calibration", f"{reduced.calibration.id}, {reduced.calibration.status}"),
        ("findings", len(reduced.findings) + len(result.characteristics.findings)),
    )
    for name, value in facts:
        if value not in (None, ""):
            fact = value if isinstance(value, Shown) else Shown(value=value)
            yield Shown(value=name, bold=True), replace(fact, side="left")
    yield ()
    yield from _summary(result)
    yield (Shown(value="the sheets", bold=True),)
    yield from ((Shown(value=name, bold=True), text) for name, text in _GUIDE)


def _si(value: float | None, unit: str, digits: int) -> Shown | None:
    return None if value is None else in_unit(float(from_si(value, unit)), unit, digits)


def _summary(result: TestResult) -> Iterator[Sequence[Any]]:
    rated = result.reduced.info.rated_load_N
    load = summary_load(result.characteristics, rated)
    if load is None:
        return
    estimates = summary_estimates(result.characteristics, rated)
    yield (
        Shown(value="results at", bold=True),
        in_unit(load, "N", 0),
        Shown(value="± U (95 %)", bold=True, side="right"),
    )
    for characteristic in summary():
        estimate = estimates[str(characteristic.summary)]
        if estimate is not None:
            yield characteristic.title, *_with_U(estimate, characteristic)
    yield ()


def _with_U(estimate: Estimate, characteristic: Characteristic) -> tuple[Shown, Shown]:
    """Return an estimate and its expanded uncertainty, both in the printed unit already."""
    unit, digits = characteristic.printed_unit, characteristic.digits
    return in_unit(estimate.value, unit, digits), in_unit(estimate.expanded()[0], unit, digits)


def _conditions(result: TestResult) -> Sheet:
    head: tuple[str, ...] = (
        "direction",
        "slip angle",
        "load FZ",
        "FY",
        "± U of FY",
        "MZ",
        "± U of MZ",
        "used",
        "recording",
    )
    points = {(point.file, point.first_row): point for point in result.characteristics.points}
    hub = [entry.load for entry in result.reduced.conditions[0].hub] if result.reduced.conditions else []
    head += tuple(text for load in hub for text in (f"hub {load}", f"± U of hub {load}"))
    rows = []
    for c in result.reduced.conditions:
        point = points.get((c.file, c.first_row))
        U_FY, U_MZ = (None, None) if point is None else (2 * point.u_FY, 2 * point.u_MZ)
        rows.append(
            (
                c.rotation, in_unit(math.degrees(c.SA), "deg", 2), in_unit(c.FZ, "N", 0),
                in_unit(c.FY, "N", 1), in_unit(U_FY, "N", 1), in_unit(c.MZ, "N*m", 2),
                in_unit(U_MZ, "N*m", 2), "yes" if c.used else "no", c.file,
                *(cell for entry in c.hub for cell in _hub_cells(entry)),
            )
        )  # fmt: skip
    return Sheet(
        name=CONDITIONS,
        head=head,
        rows=tuple(rows),
        widths=(11, 12, 12, 14, 12, 14, 13, 8, 34, *(16,) * (2 * len(hub))),
    )


def _hub_cells(entry: HubLoad) -> tuple[Shown, Shown]:
    unit, digits = ("N", 1) if entry.load.startswith("F") else ("N*m", 2)
    return in_unit(entry.value, unit, digits), in_unit(2 * entry.u, unit, digits)


def _results(result: TestResult) -> Sheet:
    head = ("quantity", "direction", "load FZ", "slip angle", "value", "± U (95 %)", "k", "lacks")
    rows: list[Sequence[Any]] = []
    for row in result.characteristics.rows:
        characteristic, estimate = row.characteristic, row.estimate
        angle = None if row.SA_rad is None else in_unit(math.degrees(row.SA_rad), "deg", 0)
        lead = (characteristic.title, row.rotation, in_unit(row.load_N, "N", 0), angle)
        if estimate is None:
            rows.append((*lead, None, None, None, row.lacking))
            continue
        printed = estimate.scaled(characteristic.factor, "")
        k = printed.expanded()[1]
        factor = Shown(value=k if math.isfinite(k) else None, number_format="0.00")
        rows.append((*lead, *_with_U(printed, characteristic), factor, None))
    return Sheet(name=RESULTS, head=head, rows=tuple(rows), widths=(38, 11, 12, 12, 18, 16, 8, 40))
