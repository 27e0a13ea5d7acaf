"""What `process` says of a test: the JSON of the files contract in SI and SAE axes, and tables for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from toolkit.channels import CHANNELS
from toolkit.estimate import plus_minus
from toolkit.lab.answers import draft_keys, estimate_keys, finding_lines, mark_words, table

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.estimate import Estimate
    from toolkit.lab.resolve import Resolved
    from toolkit.report.style import Style


def process_payload(resolved: Resolved) -> dict[str, Any]:
    """Return a reduced test as the JSON answer: SI units, SAE axes; names carry the units.

    ``u_FY_N`` and ``u_MZ_Nm`` of a condition hold every source of its budget, null where it is not used.
    """
    reduced, characteristics = resolved.result.reduced, resolved.result.characteristics
    points = {(p.file, p.first_row): p for p in characteristics.points}
    return {
        "test": reduced.info.name,
        "machine": reduced.info.machine,
        "simulated": reduced.info.simulated,
        "axes": reduced.axes,
        "averaging": reduced.averaging,
        "protocol": reduced.protocol,
        "reversal": reduced.info.reversal,
        "calibration": reduced.calibration.as_dict(),
        **draft_keys(reduced.calibration),
        "tare": {
            "source": reduced.tare.source,
            "values": dict(reduced.tare.values),
            "unit": reduced.tare.unit,
        },
        "stated": [
            {
                "symbol": one.symbol,
                "u": one.u,
                "unit": CHANNELS[one.symbol].si if one.symbol in CHANNELS else "1",
                "relative": one.relative,
                "effect": one.effect,
                "common": one.common,
                "source": one.source,
            }
            for one in reduced.stated
        ],
        "conditions": [
            {
                "file": c.file,
                "rotation": c.rotation,
                "rows": [c.first_row, c.last_row],
                "step_SA_rad": c.step_SA,
                "step_FZ_N": c.step_FZ,
                "SA_rad": c.SA,
                "FZ_N": c.FZ,
                "FY_N": c.FY,
                "MZ_Nm": c.MZ,
                "u_FY_N": points[c.file, c.first_row].u_FY if c.used else None,
                "u_FY_repeatability_N": c.u_FY,
                "u_MZ_Nm": points[c.file, c.first_row].u_MZ if c.used else None,
                "u_MZ_repeatability_Nm": c.u_MZ,
                "FY_file_N": c.FY_file,
                "MZ_file_Nm": c.MZ_file,
                "FZ_common_N": c.FZ_common,
                "FY_common_N": c.FY_common,
                "MZ_common_Nm": c.MZ_common,
                "u_FY_common_N": math.hypot(c.u_FY_common, c.u_FY_zero),
                "u_MZ_common_Nm": math.hypot(c.u_MZ_common, c.u_MZ_zero),
                "used": c.used,
                "calibration_sha256": c.calibration_sha256,
            }
            for c in reduced.conditions
        ],
        "characteristics": {
            "stiffness": [_characteristic(s) for s in characteristics.stiffness],
            "pull": [_characteristic(p) for p in characteristics.pull],
            "at_angles": [_characteristic(a) for a in characteristics.at_angles],
            "budgets": [
                {
                    "load_N": b.load_N,
                    "rotation": b.rotation,
                    "name": b.name,
                    "unit": b.unit,
                    "standard_uncertainty": dict(b.sources),
                }
                for b in characteristics.budgets
            ],
        },
        "impossible": [finding.as_dict() for finding in reduced.impossible],
        "findings": [finding.as_dict() for finding in resolved.findings],
    }


def _characteristic(one: Any) -> dict[str, Any]:
    import dataclasses

    from toolkit.estimate import Estimate

    found: dict[str, Any] = {}
    for field in dataclasses.fields(one):
        value = getattr(one, field.name)
        found[field.name] = estimate_keys(value) if isinstance(value, Estimate) else value
    return found


def process_text(resolved: Resolved, out: Path | None, style: Style) -> str:
    """Return a reduced test for people: conditions, marks, the characteristics of each load, findings."""
    reduced = resolved.result.reduced
    mark = "  SIMULATED" if reduced.info.simulated else ""
    used = sum(c.used for c in reduced.conditions)
    lines = [
        f"{reduced.info.name}: {used} conditions of {len({c.file for c in reduced.conditions})} files{mark}",
        f"calibration {reduced.calibration.id} ({reduced.calibration.sha256[:12]}...)"
        + mark_words(reduced.calibration),
        *(["IMPOSSIBLE VALUES: no tire has them, see the findings"] if reduced.impossible else []),
        f"averaging: {reduced.averaging}",
        f"tare: {reduced.tare.source}",
        *(["reversed runs: the tire turned round on the hub"] if reduced.info.reversal == "tire" else []),
        "",
        _pull_table(resolved, style),
    ]
    if resolved.findings:
        lines += ["", f"findings: {len(resolved.findings)} (toolkit explain RULE tells more)"]
        lines += finding_lines(resolved.findings)
    lines.append("")
    lines.append(
        f"written: {out}" if out else "nothing written; --out test.xlsx keeps the whole test in one file"
    )
    return "\n".join(lines)


def _pull_table(resolved: Resolved, style: Style) -> str:
    from toolkit.units import from_si

    (force, per_N), (moment, per_Nm) = style.unit("N"), style.unit("N*m")
    moment = str(moment).replace("*", "·")
    stiffness = {(s.load_N, s.rotation): s for s in resolved.result.characteristics.stiffness}
    per_degree = math.pi / 180
    rows = []
    for pull in resolved.result.characteristics.pull:
        one = stiffness.get((pull.load_N, "forward")) or stiffness.get((pull.load_N, "reverse"))
        rows.append(
            [
                f"{pull.load_N:.0f}",
                f"{float(from_si(pull.load_N, 'lbf')):.0f}",
                _shown(one.slope_cornering if one else None, per_degree * per_N, 1),
                _shown(one.slope_aligning if one else None, per_degree * per_Nm, 2),
                _shown(pull.conicity, per_N, 1),
                _shown(pull.plysteer, per_N, 1),
                _shown(pull.CRAT, per_Nm, 2),
                _shown(pull.PRAT, per_Nm, 2),
                _shown(pull.PRAT_at_FY_zero, per_Nm, 2),
            ]
        )
    head = [
        "FZ [N]",
        "FZ [lbf]",
        f"slope C_FY [{force}/deg]",
        f"slope C_MZ [{moment}/deg]",
        f"conicity [{force}]",
        f"plysteer [{force}]",
        f"CRAT [{moment}]",
        f"PRAT [{moment}]",
        f"PRAT at FY = 0 [{moment}]",
    ]
    return table(head, rows, align=">" * 9)


def _shown(estimate: Estimate | None, factor: float, digits: int) -> str:
    if estimate is None:
        return "-"
    shown = estimate.scaled(factor, "")
    return plus_minus(shown.value, shown.expanded()[0], spec=f".{digits}f")
