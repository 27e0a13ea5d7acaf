"""Entries made by hand: characteristics against load with parts of their uncertainty by choice."""

from __future__ import annotations

from typing import Any

from toolkit.characteristics.characteristic import BOTH
from toolkit.characteristics.model import Row
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.comparison.model import Entry

LOADS = (2000.0, 4000.0, 6000.0)


def row(
    name: str, load: float, value: float, *parts: Part, rotation: str = BOTH, SA_rad: float | None = None
) -> Row:
    number = Uncertain(value=value, unit="N", parts=parts)
    return Row.of(name, number, load_N=load, rotation=rotation, SA_rad=SA_rad)


def own(label: str, u: float, where: object = "") -> Part:
    return Part(source="fit", key=f"fit/{label}/{where}", u=u)


def entry(label: str, *rows: Row, **conditions: Any) -> Entry:
    kind = conditions.pop("kind", "test")
    simulated = conditions.pop("simulated", False)
    return Entry(
        label=label,
        kind=kind,
        identity=label,
        source=label,
        rows=rows,
        conditions=tuple({"tire": "one", **conditions}.items()),
        simulated=simulated,
    )


def conicity(
    label: str, *values: float, u: float = 1.0, loads: tuple[float, ...] = LOADS, **more: Any
) -> Entry:
    return entry(
        label,
        *(
            row("conicity", load, value, own(label, u, load))
            for load, value in zip(loads, values, strict=True)
        ),
        **more,
    )
