"""The report's budget: at the summary's load, each row to the place that its own uncertainty reaches."""

from __future__ import annotations

import dataclasses
import math

import pytest

from tests.report.report_factory import make_result
from toolkit.characteristics.model import Row
from toolkit.estimate import Estimate
from toolkit.machine import TypeB
from toolkit.pipeline import TestResult
from toolkit.report.style import Style
from toolkit.report.test.characteristics import summary_load
from toolkit.report.test.content import build_content


def with_budget(load: float, name: str, **sources: float) -> TestResult:
    result = make_result()
    named = tuple((key.replace("_", " "), u) for key, u in sources.items())
    unit = "N/rad" if name.startswith("slope") else "N"
    estimate = Estimate(value=1.0, u=math.hypot(*sources.values()), unit=unit)
    rotation = "forward" if name.startswith("slope") else "both"
    row = Row(name=name, load_N=load, rotation=rotation, estimate=estimate, sources=named)
    # The load of the summary is that of the whole test, whatever else it has.
    rest = tuple(dataclasses.replace(one, estimate=None) for one in result.characteristics.rows)
    chars = dataclasses.replace(result.characteristics, rows=(*rest, row))
    return dataclasses.replace(result, characteristics=chars)


def rows(result: TestResult, style: Style | None = None) -> list[dict[str, object]]:
    table = build_content(result, style=style or Style()).tables["budget"]
    return [dict(zip([c.name for c in table.columns], row, strict=True)) for row in table.rows]


def test_parts_end_where_their_sum_does() -> None:
    load = summary_load(make_result())
    assert load is not None
    (row,) = rows(with_budget(load, "conicity", calibration=0.3, tare=0.4, fit=1.2, pressure=0.004))
    # sqrt(0.09 + 0.16 + 1.44) = 1.3: one place after the point.
    assert row["quantity"] == "conicity"
    assert (row["calibration"], row["zero"], row["fit"], row["u"]) == ("0.3", "0.4", "1.2", "1.3")
    assert (row["pressure"], row["SA_zero"]) == ("-", "-")


def test_sources_of_one_column_add_in_quadrature() -> None:
    load = summary_load(make_result())
    assert load is not None
    (row,) = rows(with_budget(load, "conicity", repeatability=3.0, slip_angle_scatter=4.0))
    assert (row["repeatability"], row["u"]) == ("5.0", "5.0")


def test_stiffness_is_per_degree_in_the_unit_of_choice() -> None:
    load = summary_load(make_result())
    assert load is not None
    style = Style(force="lbf", moment="lbf*ft", decimal_comma=True)
    (row,) = rows(with_budget(load, "slope_cornering", fit=1000.0), style)
    assert row["unit"] == "lbf/deg"
    assert float(str(row["u"]).replace(",", ".")) == pytest.approx(1000 * 0.0174533 / 4.44822, abs=0.05)
    assert "," in str(row["u"])


def test_other_loads_are_left_to_the_whole_test_file() -> None:
    assert rows(with_budget(17.0, "conicity", fit=1.0)) == []


def test_values_at_slip_angles_have_their_uncertainty() -> None:
    result = make_result()
    at = Row(
        name="FY", load_N=4000.0, rotation="forward", SA_rad=-0.0349065850398866,
        estimate=Estimate(value=2000.0, u=10.0, unit="N"),
    )  # fmt: skip
    lacking = dataclasses.replace(at, name="MZ", estimate=None, lacking="no fitted curve of MZ")
    chars = dataclasses.replace(result.characteristics, rows=(at, lacking))
    made = build_content(dataclasses.replace(result, characteristics=chars)).tables["at_angles"]
    row = dict(zip([c.name for c in made.columns], made.rows[0], strict=True))
    assert row["SA"] == pytest.approx(-2.0)
    assert (row["FY"], row["MZ"]) == (2000.0, None)
    assert row["U_FY"] == pytest.approx(19.6, abs=0.01)


STATED = (
    TypeB(symbol="FZ", u=15.0, relative=0.001, source="certificate LC-7", common="machine"),
    TypeB(symbol="SA", u=math.radians(0.05), relative=0.0, source="rack"),
    TypeB(symbol="P", u=3500.0, relative=0.0, source="=gauge", effect=0.5),
)


def stated(style: Style, *given: TypeB) -> list[tuple[object, ...]]:
    result = make_result()
    result = dataclasses.replace(result, reduced=dataclasses.replace(result.reduced, stated=given))
    return list(build_content(result, style=style).tables["stated"].rows)


def test_what_the_machine_states_is_told_with_its_source() -> None:
    assert stated(Style(), *STATED) == [
        ("load", "15 N and 0.1 %", "all tests of the machine", "certificate LC-7"),
        ("zero of the slip angle", "0.05 deg", "this test", "rack"),
        ("inflation pressure", "3.5 kPa, of which a force follows 50 %", "this test", "=gauge"),
    ]
    assert stated(Style()) == []


def test_what_is_stated_is_told_in_the_unit_of_choice() -> None:
    # 15 N are 15 / 4.4482 = 3.37 lbf.
    ((_, u, _, _),) = stated(Style(force="lbf", decimal_comma=True), STATED[0])
    assert u == "3,37 lbf and 0,1 %"
