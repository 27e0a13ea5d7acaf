"""`toolkit calibration diff`: what changes from one record to another, and by how much load."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer, table
from toolkit.cli.home import calibrations_folder

Id = Annotated[str, typer.Argument(help="Record id, such as m15-r2.")]


def command(
    one: Id,
    other: Id,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Compare two records term by term; exit code 1 where they differ.

    Example: toolkit calibration diff m15-r1 m15-r2
    """
    from toolkit.calibration.registry.difference import differences
    from toolkit.calibration.registry.registry import Registry

    registry = Registry(calibrations_folder(calibrations, home))
    found = differences(registry.load(one), registry.load(other))
    rows: list[dict[str, Any]] = []
    for term in found:
        row = dataclasses.asdict(term)
        rows.append(
            {**{k: v for k, v in row.items() if k not in ("one", "other")}, one: term.one, other: term.other}
        )
    text = table(
        ["load", "term", one, other, "change", "change %", "moves at most", "% of full scale"],
        [
            [
                t.load, t.term, _digits(t.one), _digits(t.other), _digits(t.change),
                "-" if t.change_percent is None else f"{t.change_percent:+.3g}",
                "-" if t.effect is None else f"{t.effect:.4g} {t.unit}",
                "-" if t.effect_percent_fs is None else f"{t.effect_percent_fs:.3g}",
            ]
            for t in found
        ],
        align="<<>>>>>>",
    )  # fmt: skip
    notes = [f"{t.load}, {t.term}: {t.note}" for t in found if t.note]
    text += "".join(f"\n{note}" for note in ("", *notes)) if notes else ""
    if any("then in" in note for note in notes):
        text += f"\n\nwhere a unit changed, the change is in the units of {one}"
    if any(t.change and t.effect is None for t in found):
        text += "\n\nno effect is given where neither record holds a range: a legacy import has none"
    answer({"records": [one, other], "terms": rows}, text, as_json=as_json, quiet=quiet)
    return 1 if any(t.differs for t in found) else 0


def _digits(value: float | None) -> str:
    return "-" if value is None else f"{value:.10g}"
