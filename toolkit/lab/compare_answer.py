"""What `toolkit compare` answers: the JSON document in SI, and tables for people in the units of choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import draft_keys, estimate_keys, finding_lines, mark_words, table

if TYPE_CHECKING:
    from toolkit.comparison.model import Comparison, Difference, Entry, FactorSpread, Spread
    from toolkit.findings import Finding
    from toolkit.report.style import Style


def comparison_payload(found: Comparison) -> dict[str, Any]:
    """Return a comparison as the JSON answer, in SI (angles in rad, stiffness per rad) and SAE axes."""
    return {
        "mode": found.mode,
        "axes": "SAE",
        "level": found.level,
        "reference": found.reference.label,
        **draft_keys(*found.uses),
        "entries": [_entry(one) for one in found.entries],
        "differences": [_difference(one) for one in found.differences],
        "significant": sum(one.significant for one in found.differences),
        "repeats": None if found.repeats is None else _repeats(found),
        "pattern_effect": [
            {
                "quantity": one.name,
                "load_N": one.load_N,
                "regular": estimate_keys(one.regular),
                "reversed": estimate_keys(one.reversed),
                "pattern": estimate_keys(one.pattern),
                "body": estimate_keys(one.body),
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
        "calibration": one.calibration and one.calibration.as_dict(),
        "unverified": one.calibration is not None and one.calibration.unverified,
        "conditions": dict(one.conditions),
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
        "reference": estimate_keys(one.reference),
        "other": estimate_keys(one.other),
        "difference": estimate_keys(one.difference),
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
                "farthest": one.farthest,
                "grubbs_p": one.outlier_p,
                "grubbs_p_holm": one.outlier_p_holm,
                "outlier": one.outlier,
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
    from toolkit.comparison.model import PARTS
    from toolkit.report.comparison.cells import conclusion, shown_rows

    simulated = "  SIMULATED" if any(one.simulated for one in found.entries) else ""
    marks = simulated + mark_words(*found.uses)
    parts = [f"comparison of {found.mode}, reference {found.reference.label}{marks}"]
    parts += [_conditions(found), conclusion(found)]
    for part in PARTS:
        rows, which = shown_rows(found, part)
        if any(one.part == part for one in found.differences):
            parts.append(f"{part}: {which}; * marks what is significant")
            parts.append(_table(rows, style))
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
    from toolkit.report.comparison.cells import named, p_text, shown_unit, with_U

    load_unit, load_factor = style.unit("N")
    shown = []
    for one in rows:
        unit, factor = shown_unit(one.name, style)
        shown.append(
            [
                named(one.name, one.rotation, one.SA_rad),
                f"{one.load_N * load_factor:.0f}",
                unit,
                with_U(one.reference, factor, style),
                one.label,
                with_U(one.other, factor, style),
                with_U(one.difference, factor, style),
                p_text(one.p_holm, style),
                "*" if one.significant else "",
            ]
        )
    head = ["quantity", f"FZ [{load_unit}]", "unit", "reference", "other", "value", "difference", "p (Holm)"]
    return table([*head, ""], shown, align="<><><>>><")


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
    from toolkit.report.comparison.cells import factor_text, named, shown_unit

    names = [one.name for one in found.repeats.factors if one.varied]
    rows = []
    for one in found.repeats.precisions:
        unit, factor = shown_unit(one.name, style)
        rows.append(
            [
                named(one.name, one.rotation),
                f"{one.load_N * load_factor:.0f}",
                unit,
                str(one.n),
                f"{one.mean * factor:.4g}",
                f"{one.total.value * factor:.3g}",
                "-" if one.repeatability is None else f"{one.repeatability.value * factor:.3g}",
                "-" if one.limit_r is None else f"{one.limit_r * factor:.3g}",
                *(
                    factor_text(next(f for f in one.factors if f.factor == name), factor, style)
                    for name in names
                ),
            ]
        )
    head = ["quantity", f"FZ [{load_unit}]", "unit", "n", "mean", "s", "s_r", "limit r"]
    return table([*head, *(f"s_I({name})" for name in names)], rows, align="<><>" + ">" * (4 + len(names)))


def _pattern(found: Comparison, style: Style) -> str:
    from toolkit.report.comparison.cells import shown_unit, with_U

    load_unit, load_factor = style.unit("N")
    rows = []
    for one in found.pattern:
        unit, factor = shown_unit(one.name, style)
        rows.append(
            [one.name, f"{one.load_N * load_factor:.0f}", unit]
            + [with_U(e, factor, style) for e in (one.regular, one.reversed, one.pattern, one.body)]
        )
    head = ["pattern effect", f"FZ [{load_unit}]", "unit", "regular belt", "reversed belt", "pattern", "body"]
    return table(head, rows, align="<><>>>>")
