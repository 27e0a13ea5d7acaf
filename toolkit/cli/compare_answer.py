"""What `toolkit compare` answers: the JSON document in SI, and tables for people in the units of choice."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.cli.console import finding_lines, table

if TYPE_CHECKING:
    from toolkit.comparison.model import Comparison, Difference, Entry, FactorSpread, Precision, Spread
    from toolkit.estimate import Estimate
    from toolkit.findings import Finding
    from toolkit.report.style import Style


# A table of more rows is for programs; people are shown what is significant.
_ROWS = 90


def unit_choice(units: str) -> Style:
    """Return the units of text and figures: N and N·m, or lbf and lbf·ft."""
    from toolkit.errors import ConfigError
    from toolkit.report.style import Style

    choices = {"SI": Style(), "lbf": Style(force="lbf", moment="lbf*ft")}
    if units not in choices:
        raise ConfigError(
            f"unknown units {units!r}", where="--units", got=units, expected=", ".join(choices),
            next_step="name one of those expected", rule="unknown-units",
        )  # fmt: skip
    return choices[units]


def comparison_payload(found: Comparison) -> dict[str, Any]:
    """Return a comparison as the JSON answer, in SI (angles in rad, stiffness per rad) and SAE axes."""
    return {
        "mode": found.mode,
        "axes": "SAE",
        "level": found.level,
        "reference": found.reference.label,
        "entries": [_entry(one) for one in found.entries],
        "differences": [_difference(one) for one in found.differences],
        "significant": sum(one.significant for one in found.differences),
        "repeats": None if found.repeats is None else _repeats(found),
        "pattern_effect": [
            {
                "quantity": one.name,
                "load_N": one.load_N,
                "regular": _estimate(one.regular),
                "reversed": _estimate(one.reversed),
                "pattern": _estimate(one.pattern),
                "body": _estimate(one.body),
            }
            for one in found.pattern
        ],
        "left_out": list(found.left_out),
    }


def _entry(one: Entry) -> dict[str, Any]:
    return {
        "label": one.label,
        "kind": one.kind,
        "source": one.source,
        "simulated": one.simulated,
        "unverified": one.unverified,
        "conditions": dict(one.conditions),
    }


def _estimate(one: Estimate) -> dict[str, Any]:
    U, k = one.expanded()
    return {
        "value": one.value,
        "standard_uncertainty": one.u,
        "dof": one.dof,
        "expanded_uncertainty": U,
        "k": k,
        "unit": one.unit,
    }


def _difference(one: Difference) -> dict[str, Any]:
    base = one.reference.value
    return {
        "table": one.part,
        "quantity": one.name,
        "rotation": one.rotation,
        "SA_rad": one.SA_rad,
        "load_N": one.load_N,
        "label": one.label,
        "reference": _estimate(one.reference),
        "other": _estimate(one.other),
        "difference": _estimate(one.difference),
        "difference_percent": 100 * one.difference.value / abs(base) if base else None,
        "standard_uncertainty_if_nothing_were_shared": one.u_apart,
        "p": one.p,
        "p_holm": one.p_holm,
        "significant": one.significant,
    }


def _repeats(found: Comparison) -> dict[str, Any]:
    repeats = found.repeats
    assert repeats is not None  # noqa: S101  asked before
    return {
        "factors": [
            {
                "factor": one.name,
                "levels": list(one.levels),
                "varied": one.varied,
                "same_as": list(one.same_as),
                "note": one.note,
            }
            for one in repeats.factors
        ],
        "reproducibility": repeats.reproducibility,
        "reproducibility_note": repeats.reproducibility_note,
        "precision": [
            {
                "quantity": one.name,
                "rotation": one.rotation,
                "load_N": one.load_N,
                "n": one.n,
                "mean": one.mean,
                "s": _spread(one.total),
                "repeatability_s_r": None if one.repeatability is None else _spread(one.repeatability),
                "repeatability_limit_r": one.limit_r,
                "intermediate": [_factor(factor) for factor in one.factors],
            }
            for one in repeats.precisions
        ],
    }


def _spread(one: Spread) -> dict[str, Any]:
    return {"value": one.value, "dof": one.dof, "low": one.low, "high": one.high}


def _factor(one: FactorSpread) -> dict[str, Any]:
    return {
        "factor": one.factor,
        "levels": one.levels,
        "s_I": one.s,
        "s_between": one.s_between,
        "F": one.F,
        "p": one.p,
        "p_holm": one.p_holm,
        "significant": one.significant,
    }


def comparison_text(
    found: Comparison, style: Style, findings: Sequence[Finding], drawn: Mapping[str, Path]
) -> str:
    """Return a comparison for people."""
    simulated = "  SIMULATED" if any(one.simulated for one in found.entries) else ""
    parts = [f"comparison of {found.mode}, reference {found.reference.label}{simulated}", _conditions(found)]
    for part, title in (("characteristics", "characteristics"), ("curves", "FY and MZ at slip angles")):
        mine = [one for one in found.differences if one.part == part]
        if not mine:
            continue
        certain = [one for one in mine if one.significant]
        decided = sum(one.p is not None for one in mine)
        parts.append(
            f"{title}: {len(certain)} of {decided} differences are significant (Holm, {found.level:g} over "
            "the table; * marks them)"
        )
        whole = part == "characteristics" and len(mine) <= _ROWS
        parts.append(_table(mine if whole else certain, style))
        if not whole and len(certain) < len(mine):
            parts.append(f"the other {len(mine) - len(certain)} rows: --json")
    if found.repeats is not None:
        parts += [_factors(found), _precision(found, style), found.repeats.reproducibility_note]
    if found.pattern:
        parts.append(_pattern(found, style))
    if found.left_out:
        parts.append("\n".join(f"not compared: {one}" for one in found.left_out))
    if drawn:
        parts.append("\n".join(str(path) for path in drawn.values()))
    if findings:
        lines = finding_lines(findings)
        parts.append("\n".join([f"findings: {len(findings)} (toolkit explain RULE tells more)", *lines]))
    return "\n\n".join(one for one in parts if one)


def _scale(name: str, style: Style) -> tuple[str, float]:
    from toolkit.comparison.quantities import QUANTITIES

    quantity = QUANTITIES[name]
    unit, factor = style.unit(quantity.unit)
    return str(unit).replace("*", "·"), factor * quantity.factor


def _digits(value: float) -> int:
    return 1 if value >= 100 else 2 if value >= 1 else 3


def _pm(one: Estimate, factor: float) -> str:
    U = one.expanded()[0] * factor
    if not math.isfinite(U):
        return f"{one.value * factor:.4g} ± -"
    digits = _digits(max(U * 10, abs(one.value * factor) / 100))
    return f"{one.value * factor:.{digits}f} ± {U:.{digits}f}"


def _conditions(found: Comparison) -> str:
    """Return what the entries state: what differs as a table, what is the same in one line each."""
    names = dict.fromkeys(name for one in found.entries for name, value in one.conditions if value)
    rows, same = [], []
    for name in names:
        values = [one.condition(name) for one in found.entries]
        if len(set(values)) == 1:
            same.append(f"{name}: {values[0]}")
        else:
            rows.append([name, *(str(value or "-") for value in values)])
    head = table(["", *(one.label for one in found.entries)], rows, align="<" * (len(found.entries) + 1))
    return "\n".join(
        one for one in (head, "the same in all:" if same else "", *(f"  {s}" for s in same)) if one
    )


def _table(rows: Sequence[Difference], style: Style) -> str:
    load_unit, load_factor = style.unit("N")
    shown = []
    for one in rows:
        unit, factor = _scale(one.name, style)
        angle = "" if one.SA_rad is None else f" at {math.degrees(one.SA_rad):+.0f} deg"
        way = "" if one.rotation == "both" else f", {one.rotation}"
        shown.append(
            [
                f"{one.name}{angle}{way}",
                f"{one.load_N * load_factor:.0f}",
                unit,
                _pm(one.reference, factor),
                one.label,
                _pm(one.other, factor),
                _pm(one.difference, factor),
                "-" if one.p_holm is None else "< 0.0001" if one.p_holm < 1e-4 else f"{one.p_holm:.4f}",
                "*" if one.significant else "",
            ]
        )
    head = [
        "quantity",
        f"FZ [{load_unit}]",
        "unit",
        "reference",
        "other",
        "value",
        "difference",
        "p (Holm)",
        "",
    ]
    return table(head, shown, align="<><><>>><")


def _factors(found: Comparison) -> str:
    assert found.repeats is not None  # noqa: S101  asked before
    rows = [
        [one.name, ", ".join(str(level or "-") for level in one.levels), one.note or "told apart"]
        for one in found.repeats.factors
    ]
    return table(["factor", "in the tests", ""], rows, align="<<<")


def _precision(found: Comparison, style: Style) -> str:
    assert found.repeats is not None  # noqa: S101  asked before
    load_unit, load_factor = style.unit("N")
    names = [one.name for one in found.repeats.factors if one.varied]
    rows = []
    for one in found.repeats.precisions:
        unit, factor = _scale(one.name, style)
        way = "" if one.rotation == "both" else f", {one.rotation}"
        rows.append(
            [
                f"{one.name}{way}",
                f"{one.load_N * load_factor:.0f}",
                unit,
                str(one.n),
                f"{one.mean * factor:.4g}",
                f"{one.total.value * factor:.3g}",
                "-" if one.repeatability is None else f"{one.repeatability.value * factor:.3g}",
                "-" if one.limit_r is None else f"{one.limit_r * factor:.3g}",
                *(_factor_cell(one, name, factor) for name in names),
            ]
        )
    head = ["quantity", f"FZ [{load_unit}]", "unit", "n", "mean", "s", "s_r", "limit r"]
    return table([*head, *(f"s_I({name})" for name in names)], rows, align="<><>" + ">" * (4 + len(names)))


def _factor_cell(row: Precision, name: str, factor: float) -> str:
    one = next(f for f in row.factors if f.factor == name)
    return f"{one.s * factor:.3g}" + (" *" if one.significant else "")


def _pattern(found: Comparison, style: Style) -> str:
    load_unit, load_factor = style.unit("N")
    rows = []
    for one in found.pattern:
        unit, factor = _scale(one.name, style)
        rows.append(
            [one.name, f"{one.load_N * load_factor:.0f}", unit]
            + [_pm(e, factor) for e in (one.regular, one.reversed, one.pattern, one.body)]
        )
    head = ["pattern effect", f"FZ [{load_unit}]", "unit", "regular belt", "reversed belt", "pattern", "body"]
    return table(head, rows, align="<><>>>>")
