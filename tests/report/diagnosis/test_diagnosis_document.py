"""A diagnosis as a document: template, results and opinion apart, figures, tables, marks."""

from __future__ import annotations

import dataclasses
import datetime as dt
from pathlib import Path
from typing import Any

import pytest

from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.calibration.records.use import CalibrationUse
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.report.diagnosis.answer import DIAGNOSIS
from toolkit.report.diagnosis.content import build_diagnosis_content
from toolkit.report.diagnosis.page import page
from toolkit.report.style import Style
from toolkit.report.word.fill import fill
from toolkit.report.word.package import read_template

CHECKOUT = Path(__file__).resolve().parents[3]
DAY = dt.date(2026, 4, 1)


def made_of(folder: Path, *, drag: float) -> tuple[Any, Any]:
    seen = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=drag) for i in range(2)}
    case = read_case(write_case(folder, HEAD + TWO, **seen))
    return case, diagnose(case, None, limits=None)


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    return made_of(tmp_path_factory.mktemp("drag"), drag=800.0)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    return made_of(tmp_path_factory.mktemp("clean"), drag=0.0)


def content(made: tuple[Any, Any], style: Style | None = None, **more: Any) -> Any:
    return build_diagnosis_content(*made, style or Style(), issued=DAY, **more)


def test_every_table_has_the_columns_of_its_vocabulary(dragged: Any) -> None:
    found = content(dragged)
    assert set(found.tables) == set(DIAGNOSIS.vocabulary.tables)
    for name, table in found.tables.items():
        assert table.columns == DIAGNOSIS.vocabulary.tables[name].columns
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert set(found.conditions) >= set(DIAGNOSIS.vocabulary.asked)


def test_the_cause_is_an_opinion_and_the_numbers_are_results(dragged: Any) -> None:
    found = content(dragged, by="second person", model_sha256="ab" * 32)
    told = {name: value.value for name, value in found.values.items()}
    # 2 N of noise; drag of 800 N/(m/s)^2 left out
    assert "quadratic_drag" in told["diagnosis.opinion"]
    assert "quadratic_drag" not in told["diagnosis.summary"]
    assert "F from " in told["diagnosis.summary"]
    assert told["diagnosis.opinion_by"] == "released by second person"
    assert "not excluded" in told["diagnosis.basis"]
    assert "ab" * 32 in told["diagnosis.model"]
    assert dragged[0].sha256 in told["diagnosis.case"]
    draft = content(dragged).values["diagnosis.opinion_by"].value
    assert "nobody authorised" in draft


def test_the_tables_hold_the_answer_s_numbers(dragged: Any) -> None:
    found, answer = content(dragged), dragged[1].diagnosis
    (row,) = found.tables["found_parameters"].rows
    drag = answer.effects[0].parameters[0]
    assert row[:4] == ("quadratic_drag", "drag", f"{drag.value:.4g}", "N/(m/s)^2")
    # An interval of 57 is known to its second digit: to whole units.
    assert 10 <= drag.ci95[1] - drag.ci95[0] < 100
    assert row[4] == f"{drag.ci95[0]:.0f} to {drag.ci95[1]:.0f}"
    (errors,) = found.tables["errors"].rows
    assert float(errors[4]) == pytest.approx(answer.fit.held_out[0].augmented_rmse, rel=5e-3)
    assert [row[0] for row in found.tables["recorded"].rows] == ["r0.csv", "r1.csv"]
    shown = {row[0] for row in found.tables["not_found"].rows}
    said = found.values["diagnosis.not_observable"].value
    names = {one.name for one in answer.not_found}
    assert shown
    assert all((name in shown) != (f" {name}" in said) for name in names)


def test_nothing_found_has_no_opinion_and_no_bar_of_effects(clean: Any) -> None:
    found = content(clean, by="second person")
    assert clean[1].diagnosis.verdict == "nothing"
    assert found.conditions["no_effects"]
    for name in ("opinion", "opinion_by", "basis", "model"):
        assert found.values[f"diagnosis.{name}"].missing
    labels = [one.label for one in found.plots["diagnosis_errors"].curves]
    assert labels == ["as declared", "refitted", "noise"]
    assert found.tables["found"].rows == ()


def test_the_chart_of_ten_seconds_is_error_over_noise(dragged: Any) -> None:
    plots = content(dragged).plots
    assert set(plots) == {"diagnosis_errors", "diagnosis_where_1", "diagnosis_run"}
    (one,) = dragged[1].diagnosis.fit.held_out
    bars = [curve.y[0] for curve in plots["diagnosis_errors"].curves[:3]]
    errors = (one.nominal_rmse, one.refitted_rmse, one.augmented_rmse)
    assert bars == pytest.approx([value / one.noise_floor for value in errors])
    assert plots["diagnosis_errors"].curves[3].y == (1.0, 1.0)
    assert "refitted" in plots["diagnosis_errors"].alt


def test_the_decimal_mark_is_the_organisation_s(dragged: Any) -> None:
    (row,) = content(dragged, Style(decimal_comma=True)).tables["errors"].rows
    assert "," in row[4]
    assert "." not in row[4]


def test_the_same_case_has_the_same_id_on_any_day(dragged: Any, clean: Any) -> None:
    other = build_diagnosis_content(*dragged, Style(), issued=dt.date(2027, 1, 1))
    assert other.identity == content(dragged).identity != content(clean).identity


def test_a_partial_answer_says_so(dragged: Any) -> None:
    case, result = dragged
    cut = dataclasses.replace(result.diagnosis, complete=False, skipped=("swaps",))
    found = content((case, dataclasses.replace(result, diagnosis=cut)))
    assert found.conditions["incomplete"]
    assert "swaps" in found.values["diagnosis.complete"].value
    nothing = dataclasses.replace(result, diagnosis=cut, search=None)
    assert content((case, nothing)).plots == {}


@pytest.mark.parametrize("which", ["dragged", "clean"])
def test_the_template_is_filled_without_a_gap(which: str, request: pytest.FixtureRequest) -> None:
    from toolkit.report.figures import draw

    found = content(request.getfixturevalue(which))
    pictures = {name: draw(plot) for name, plot in found.plots.items()}
    made = fill(read_template(CHECKOUT / "report_templates" / "diagnosis.docx"), found, pictures)
    assert made.missing == ()
    assert {tag for tag, _ in made.figures} <= {f"tk:figure.{name}" for name in found.plots}


def test_a_candidate_is_accepted_and_every_page_says_so(dragged: Any) -> None:
    use = CalibrationUse(id="m15-r3", sha256="ab" * 32, unverified=False, draft_reasons=("a candidate",))
    found = content(dragged, use=use)
    assert found.page_mark == "DRAFT, NOT APPROVED: m15-r3: a candidate"
    assert found.conditions["draft"]
    assert "not approved: a candidate" in found.values["diagnosis.calibrations"].value
    assert "DRAFT, NOT APPROVED: m15-r3" in page(dragged[1], use)
    assert "NOT APPROVED" not in page(dragged[1])
