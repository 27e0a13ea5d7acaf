"""Sheets of plans with every table and figure."""

from __future__ import annotations

import datetime as dt

from toolkit.findings import Finding
from toolkit.report.content import Curve, Plot
from toolkit.report.plan.content import Expected, PlanSheet, Step


def sheet(**changes: object) -> PlanSheet:
    """Return a sheet that has something in every place of the template."""
    entries = {
        "kind": "session",
        "subject": "hub",
        "basis": "hub-r1, the loads of hub-r1's own session",
        "size": "20 loads in 2 runs, 5 check loads, 90 minutes",
        "summary": "20 loads in place of 100.",
        "issued": dt.date(2026, 11, 21),
        "uncertainties": (
            Expected(
                quantity="FY", at="1393.8", unit="lbf", reference="0.25", asked="0.3", expected="0.27",
                span="< 0.31 in 9 of 10",
            ),
        ),
        "steps": (
            Step(run="1", action="mount: +FY", applied=""),
            Step(run="1", action="100 %, from below", applied="FY 1393.8 lbf"),
        ),
        "pairs": (("conicity", "crosstalk", "+0.1", "0.2", "11.5"),),
        "risks": (("30", "0.1", "12.2", "0.5"), ("365", "4.9", "1", "-")),
        "plots": (
            Plot(
                name="risk", x_label="interval [days]", y_label="beyond the tolerance [%]",
                curves=(Curve(label="allowed", x=(30.0, 365.0), y=(5.0, 5.0), style="line"),),
                caption="Chance to be beyond the tolerance at the interval's end.",
                alt="30 days to 365 days.",
            ),
        ),
        "assumptions": ("nothing breaks at once",),
        "gives_up": ("the ±1 deg secants",),
        "findings": (Finding(rule="plan-order", where="hub-r1, FY", message="read the zeros", level="note"),),
    }  # fmt: skip
    return PlanSheet(**(entries | changes))  # type: ignore[arg-type]
