# ruff: noqa: E501  lines of WordprocessingML read best whole
from __future__ import annotations

import datetime as dt
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.report.report_factory import COMPARISON, LOADS_N, formula, make_record, make_result, shape
from toolkit.errors import ConfigError, TemplateError
from toolkit.report.figures import draw
from toolkit.report.style import Style, read_style
from toolkit.report.tags import format_number, format_problem, parse_tag
from toolkit.report.test.content import REPORT, build_content, report_id

DAY = dt.date(2026, 11, 21)


def content(**changes: object):
    style = changes.pop("style", None)
    return build_content(
        make_result(**changes), make_record(), style=style, issued=DAY, comparison=COMPARISON
    )


def test_title_page_values_of_the_source_document() -> None:
    # Figure 5.3 of the thesis: 265/35 ZR 18, Continental, 4MY8-009X-0713, Altimax, "34 psi, 2.34 bar".
    values = {path: one.value for path, one in content().values.items()}
    assert values["test.pressure"] == "34 psi, 2.34 bar"
    assert values["tire.size"] == "265/35 ZR 18"
    assert values["tire.DOT"] == "4MY8-009X-0713"
    assert values["calibration.FY.D51"] == 1.01234567


def test_who_measured_and_who_authorises_are_titled() -> None:
    style = Style(authorised_by="dora")
    values = build_content(
        make_result(), make_record(), style=style, titled=lambda text: f"the {text}"
    ).values
    plain = build_content(make_result(), make_record(), style=style).values
    assert (plain["report.authorised_by"].value, values["report.authorised_by"].value) == ("dora", "the dora")
    assert values["test.operator"].value == f"the {plain['test.operator'].value}"


def test_every_value_and_table_is_in_the_catalogue_and_the_other_way_round() -> None:
    made, listed = content(), {one.path: one for one in REPORT.vocabulary.entries}
    assert all(REPORT.vocabulary.knows(path) for path in made.values)
    assert {path for path, one in listed.items() if one.kind in ("text", "number", "date")} <= set(
        made.values
    )
    assert set(made.tables) == set(REPORT.vocabulary.tables)
    for path, one in made.values.items():
        if path in listed:
            assert one.kind == listed[path].kind, path
    for name, table in made.tables.items():
        assert all(len(row) == len(table.columns) for row in table.rows), name
    assert {path[3:] for path, one in listed.items() if one.kind == "if"} <= set(made.conditions)


def test_stiffness_is_per_degree_with_student_t() -> None:
    # secant = 18 x 1112 - 1e-3 x 1112^2 N/rad; U = t(12, 95 %) x 900 with t = 2.179 (GUM table G.2)
    row = dict(
        zip(
            (c.name for c in REPORT.vocabulary.tables["stiffness"].columns),
            content().tables["stiffness"].rows[0],
            strict=True,
        )
    )
    assert row["cornering_secant"] == pytest.approx((18 * 1112 - 1e-3 * 1112**2) * math.pi / 180)
    assert row["U_cornering_secant"] == pytest.approx(2.179 * 900 * math.pi / 180, rel=1e-3)


def test_units_by_choice() -> None:
    metric, customary = content(), content(style=Style(force="lbf", moment="lbf*ft"))
    for name, column, factor in (("results", "FY", 4.4482216152605), ("results", "MZ", 1.3558179483314)):
        index = [c.name for c in REPORT.vocabulary.tables[name].columns].index(column)
        one, other = metric.tables[name].rows[7][index], customary.tables[name].rows[7][index]
        assert one == pytest.approx(other * factor)
    assert customary.values["unit.force_per_angle"].value == "lbf/deg"
    assert "lateral force FY [lbf]" in customary.plots["fy_vs_slip"].y_label
    assert customary.values["summary.load"].value == pytest.approx(4897 / 4.4482216152605)


def test_a_larger_unit_takes_no_digit_of_a_load_away() -> None:
    kilo = content(style=Style(force="kN", decimal_comma=True))
    assert kilo.plots["fy_vs_slip"].curves[0].label == f"{LOADS_N[0] / 1000:.3f} kN".replace(".", ",")
    assert {c.name: c.spec for c in kilo.tables["stiffness"].columns}["load"] == ".3f"
    assert kilo.values["summary.load"].spec == ".3f"


def test_figures_against_load_read_the_fitted_curves() -> None:
    plot = content().plots["fy_vs_load"]
    curve = next(c for c in plot.curves if c.label == "±4 deg" and not c.open)
    assert curve.y == pytest.approx([formula(shape("FY", load), math.radians(4)) for load in LOADS_N])
    assert curve.x == pytest.approx(LOADS_N)


def test_alternative_text_has_the_data_and_says_what_it_is() -> None:
    alt = content(simulated=True).plots["conicity"].alt
    assert alt.startswith("SIMULATED DATA.")
    assert "31 ± 13 at 1112" in alt  # 20 + 0.01 x 1112; t(12) x 6
    assert "Axis system: SAE J670." in alt


def test_without_a_reversed_run_there_is_no_pull() -> None:
    made = content(both=False)
    assert "conicity" not in made.plots
    assert made.conditions["no_pull"]
    assert not made.conditions["pull"]
    assert made.values["summary.conicity"].missing


def test_without_fits_the_measured_steps_are_drawn() -> None:
    made = content(fits=False)
    assert made.tables["fits"].rows == ()
    assert {c.style for c in made.plots["fy_vs_slip"].curves} == {"points"}
    assert "fy_vs_load" in made.plots


def test_report_id_follows_the_inputs_only() -> None:
    assert report_id(make_result()) == report_id(make_result())
    assert report_id(make_result()) != report_id(make_result(both=False))
    assert report_id(make_result()).startswith("TR-20190604-")


@pytest.mark.parametrize("name", ["fy_vs_slip", "gough", "prat"])
def test_a_figure_is_a_png_without_alpha(name: str) -> None:
    picture = draw(content(simulated=True).plots[name])
    width, height, depth, colour = struct.unpack(">IIBB", picture.png[16:26])
    assert picture.png[:8] == b"\x89PNG\r\n\x1a\n"
    assert (width, height, depth, colour) == (picture.width_px, picture.height_px, 8, 2)


def test_tags_are_read_with_their_format() -> None:
    assert str(parse_tag(" tk:calibration.Fy.D51|.5g ")) == "tk:calibration.FY.D51|.5g"
    assert parse_tag("tk:figure.gough|width=120mm").family == "figure"
    assert parse_tag("title") is None


@pytest.mark.parametrize(
    ("kind", "spec", "good"),
    [
        ("number", ".5g", True), ("number", "+,.1f", True), ("number", "", False), ("number", "1000000f", False),
        ("number", "{x}", False), ("number", ".1f}{", False), ("number", "s", False), ("text", ".3", False),
        ("date", "%d", False), ("figure", "width=120mm", True), ("figure", "120mm", False), ("number", "0>9.3f", True),
    ],
)  # fmt: skip
def test_formats(kind: str, spec: str, good: bool) -> None:
    assert (format_problem(kind, spec) is None) is good


@given(st.text(max_size=8), st.floats(allow_nan=False, allow_infinity=False))
def test_an_accepted_format_prints_a_short_text_or_says_why_not(spec: str, value: float) -> None:
    if format_problem("number", spec) is None:
        try:
            assert len(format_number(value, spec)) < 600
        except TemplateError as error:
            assert error.rule == "bad-format"  # noqa: PT017


def test_decimal_comma_swaps_both_marks() -> None:
    assert format_number(-12345.678, ",.2f", decimal_comma=True) == "-12.345,68"
    assert format_number(-0.004, ".2f") == "0.00"


def test_style_file(tmp_path) -> None:
    path = tmp_path / "org.toml"
    path.write_text(
        'decimal_comma = true\ndates = "%d.%m.%Y"\nrequired = ["tk:report.id"]\n[decimals]\nN = 0\n'
    )
    style = read_style(path)
    assert style.date("2019-06-04") == "04.06.2019"
    assert style.required == ("tk:calibration.hash", "tk:report.id")
    assert content(style=style).values["summary.conicity"].spec == ".0f"
    path.write_text("decimal_coma = true\n")
    with pytest.raises(ConfigError, match="decimal_coma"):
        read_style(path)
    path.write_text('[units]\nforce = "m"\n')
    with pytest.raises(Exception, match="unit"):
        read_style(path)


def test_a_report_says_that_the_tire_was_turned_and_not_the_drum() -> None:
    drum, tire = content(), content(reversal="tire")
    assert drum.values["test.directions"].value == "forward and reverse"
    assert tire.values["test.directions"].value == "forward and reverse, the tire turned round on the hub"
    assert drum.plots["fy_vs_slip"].caption.endswith("dashed: reversed. SAE J670 axes.")
    assert "reversed by the tire turned round on the hub" in tire.plots["fy_vs_slip"].caption
    one_way = content(reversal="tire", both=False)  # nothing was turned yet
    assert one_way.values["test.directions"].value == "forward"
