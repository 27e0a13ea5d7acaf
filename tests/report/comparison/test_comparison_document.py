"""A comparison as a document: its template, its content, its figures, its marks."""

from __future__ import annotations

import datetime as dt
import math
from pathlib import Path
from typing import Any

import pytest

from toolkit.calibration.records.use import CalibrationUse
from toolkit.characteristics.model import Row
from toolkit.characteristics.uncertain import Part, Uncertain
from toolkit.comparison.compare import compare
from toolkit.comparison.model import Comparison, Entry
from toolkit.estimate import Estimate
from toolkit.findings import Finding
from toolkit.report.comparison.cells import conclusion, named, p_text, shown_rows, with_U
from toolkit.report.comparison.content import COMPARISON, Compared, build_comparison_content, comparison_plots
from toolkit.report.style import Style

CHECKOUT = Path(__file__).resolve().parents[3]
LOADS = (2000.0, 4000.0)
SI = {"conicity": "N", "PRAT": "N*m", "secant_cornering": "N/rad"}


def entry(label: str, shift: float, **more: Any) -> Entry:
    rows = [
        Row.of(
            name,
            Uncertain(
                value=load / 100 + shift,
                unit=unit,
                parts=(Part(source="fit", key=f"{label}{name}{load}", u=2.0),),
            ),
            load_N=load,
            rotation="forward" if name.startswith("secant") else "both",
        )
        for name, unit in SI.items()
        for load in LOADS
    ]
    conditions = tuple({"tire": "one", "day": "2026-01-02", **more.pop("conditions", {})}.items())
    return Entry(
        label=label, kind="test", identity=label, source=label, rows=tuple(rows), conditions=conditions,
        calibration=CalibrationUse(
            **{"id": "m15-r1", "sha256": "ab" * 32, "unverified": False, **more.pop("use", {})}
        ),
        **more,
    )  # fmt: skip


def pair(**more: Any) -> Comparison:
    return compare([entry("first", 0.0), entry("second & <b>", 30.0, **more)])


def content(found: Comparison, style: Style | None = None, findings: tuple[Finding, ...] = ()) -> Any:
    compared = Compared(comparison=found, findings=findings, issued=dt.date(2026, 1, 3))
    return build_comparison_content(compared, style or Style())


def test_every_table_has_the_columns_of_its_vocabulary() -> None:
    made = content(pair(), findings=(Finding(rule="r", where="w", message="m"),))
    for name, table in made.tables.items():
        assert table.columns == COMPARISON.vocabulary.tables[name].columns
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert set(made.tables) == set(COMPARISON.vocabulary.tables)
    assert set(made.conditions) >= set(COMPARISON.vocabulary.asked)


def test_numbers_are_those_of_the_comparison() -> None:
    made = content(pair())
    row = made.tables["differences"].rows[0]
    # 20 and 50 N with u = 2 each: the difference has 2 sqrt 2, and U 1.96 times that.
    assert row[:3] == ("conicity", "2000 N", "N")
    assert row[3] == "20.0 ± 3.9"
    assert row[6] == f"30.0 ± {1.96 * 2 * math.sqrt(2):.1f}"
    assert row[8] == "*"


def test_units_and_decimal_mark_are_the_organisation_s() -> None:
    made = content(pair(), Style(force="lbf", moment="lbf*ft", decimal_comma=True))
    row = made.tables["differences"].rows[0]
    assert row[1:4] == ("450 lbf", "lbf", "4,50 ± 0,88")
    assert "lbf·ft" in {one[2] for one in made.tables["differences"].rows}


def test_marks_follow_the_tests() -> None:
    plain = content(pair())
    assert plain.marks == ()
    marked = content(pair(simulated=True, use={"unverified": True}))
    assert [name for name, _ in marked.marks] == ["simulated", "unverified"]
    assert "second & <b>" in dict(marked.marks)["unverified"]
    assert all(plot.watermark == "UNVERIFIED - SIMULATED" for plot in marked.plots.values())
    assert marked.page_mark == "UNVERIFIED CALIBRATION: m15-r1"
    assert "UNVERIFIED" in marked.values["comparison.calibrations"].value
    assert [one.unverified for one in marked.calibrations] == [False, True]
    draft = content(pair(use={"draft_reasons": ("withdrawn",)}))
    assert draft.draft_reasons == ("m15-r1: withdrawn",)
    assert "not approved: withdrawn" in draft.values["comparison.calibrations"].value
    assert dict(draft.marks)["draft"].endswith("not approved: withdrawn.")
    assert draft.page_mark == "DRAFT, NOT APPROVED: m15-r1: withdrawn"


def test_the_same_comparison_has_the_same_id_on_any_day() -> None:
    one = content(pair())
    compared = Compared(comparison=pair(), findings=(), issued=dt.date(2027, 7, 7))
    other = build_comparison_content(compared, Style())
    assert one.identity == other.identity
    assert one.identity != content(compare([entry("second & <b>", 30.0), entry("first", 0.0)])).identity


def test_figures_are_against_load_with_expanded_uncertainty() -> None:
    plots = comparison_plots(pair(), Style())
    assert set(plots) == {"conicity", "prat", "cornering_stiffness"}
    first, second = plots["conicity"].curves
    assert first.x == LOADS
    assert second.y == (50.0, 70.0)
    assert first.error == pytest.approx([1.96 * 2] * 2, abs=1e-3)
    stiffness = plots["cornering_stiffness"].curves[0]
    assert stiffness.y[0] == pytest.approx(20 * math.pi / 180)
    assert "first: " in plots["conicity"].alt


def test_a_figure_of_one_series_compares_nothing() -> None:
    from dataclasses import replace

    first = entry("first", 0.0)
    bare = replace(first, label="b", identity="b", rows=tuple(r for r in first.rows if r.name != "PRAT"))
    assert "prat" not in comparison_plots(compare([first, bare]), Style())


def test_the_conclusion_counts() -> None:
    text = conclusion(pair())
    assert text.startswith("6 of 6 differences in characteristics are significant (conicity: 2 of 2;")
    assert text.endswith("at most 5 % (Holm).")
    same = compare([entry("a", 0.0), entry("b", 0.0)])
    assert conclusion(same).startswith("0 of 6 differences in characteristics are significant.")


def test_of_long_tables_people_see_what_is_significant() -> None:
    many = [entry("first", 0.0)] + [entry(f"t{i}", 30.0 if i == 3 else 0.0) for i in range(16)]
    rows, which = shown_rows(compare(many), "characteristics")
    assert {one.label for one in rows} == {"t3"}
    assert which == "the 6 significant of 96 rows; the JSON answer holds all"
    rows, which = shown_rows(compare([entry(f"t{i}", 0.0) for i in range(17)]), "characteristics")
    assert (rows, which) == ((), "none is significant of 96 rows; the JSON answer holds all")


@pytest.mark.parametrize(
    ("value", "u", "text"),
    [
        (123.456, 6.17, "123 ± 12"),
        (-0.2, 60.0, "0 ± 120"),
        (0.123456, 0.0123, "0.123 ± 0.024"),
        (4.5, 0.0, "4.5"),
    ],
)
def test_a_value_ends_where_its_uncertainty_does(value: float, u: float, text: str) -> None:
    assert with_U(Estimate(value=value, u=u, unit="N"), 1.0, Style()) == text


def test_small_words() -> None:
    assert named("FY", "forward", math.radians(0.0)) == "FY at 0 deg, forward"
    assert named("MZ", "reverse", math.radians(10.0)) == "MZ at +10 deg, reverse"
    assert (p_text(None, Style()), p_text(1e-9, Style())) == ("-", "< 0.0001")
    assert p_text(0.25, Style(decimal_comma=True)) == "0,2500"
