"""Tire models side by side in a report: the table's cells, the figures, and when they are there at all."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.report.report_factory import COMPARISON, LOADS_N, entry, make_record, make_result
from tests.report.template_factory import FOLDER, make, p, tbl
from toolkit.cli.report import command
from toolkit.errors import FitError, TemplateError
from toolkit.lab.tire_tests import resolve
from toolkit.lab.tire_tests.reports import Options, _compared, _job
from toolkit.lab.tire_tests.resolve import Resolved
from toolkit.report.content import ReportContent
from toolkit.report.deliver import content_hash
from toolkit.report.figures import draw, draw_svg
from toolkit.report.test.content import REPORT, build_content
from toolkit.report.test.models import model_plots, model_rows
from toolkit.report.word.fill import fill, survey
from toolkit.report.word.package import read_template
from toolkit.tires.comparison import Comparison

office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


def content(comparison: Comparison | None) -> ReportContent:
    return build_content(make_result(), make_record(), comparison=comparison)


def test_a_row_a_model_has_both_channels_their_floor_and_the_time() -> None:
    first, second = model_rows(COMPARISON)
    assert (first["model"], first["FY_error"], first["MZ_error"]) == ("magic_formula", 1.33, 7.02)
    assert (first["FY_floor"], first["MZ_floor"]) == (0.9, None)
    assert first["FY_left_out"] is None
    assert first["not_determined"] == "MZ: C E at 2 of 5 loads"
    assert (second["FY_left_out"], second["MZ_left_out"], second["seconds"]) == (2.5, 19.0, 1.5)
    assert (first["converged"], second["converged"]) == ("yes", "no")
    assert second["not_determined"] == "MZ: 6 of 8"


def test_a_model_of_one_channel_leaves_the_other_empty() -> None:
    (row,) = model_rows(Comparison(rows=(entry("brush", "FY", 2.0),), floors=()))
    assert row.get("MZ_error") is None
    assert row["not_determined"] == "-"


def test_figures_have_a_bar_a_model_and_say_it_in_their_text() -> None:
    plots = model_plots(COMPARISON, watermark="SIMULATED DATA", decimal_comma=True)
    assert list(plots) == ["models_fy", "models_mz"]
    lateral = plots["models_fy"]
    assert lateral.names == ("magic_formula", "tmeasy")
    fitted, away, floor = lateral.curves
    assert fitted.y == (1.33, 2.12)
    assert fitted.notes == ("1,33", "2,12")
    assert away.y == (2.5,)
    assert away.x[0] > 0.5  # at the second model: the first predicts no load
    assert floor.y == (0.9, 0.9)
    assert "tmeasy 2,12 %" in lateral.alt
    assert lateral.alt.startswith("SIMULATED DATA")
    assert len(plots["models_mz"].curves) == 2  # no floor is known
    assert draw(lateral).width_px == 945
    assert draw_svg(lateral) == draw_svg(lateral)


def test_one_model_is_no_comparison_to_draw_and_none_is_no_table() -> None:
    alone = Comparison(rows=(entry("brush", "FY", 2.0),), floors=())
    assert model_plots(alone) == {}
    made = content(None)
    assert made.tables["models"].rows == ()
    assert not made.holds("models")
    assert not {"models_fy", "models_mz"} & set(made.plots)


def test_a_report_can_ask_for_them_and_the_catalogue_lists_them() -> None:
    made = content(COMPARISON)
    assert all(made.holds(one) for one in ("models", "models_fy", "figure.models_mz", "table.models"))
    assert made.values["caption.models_fy"].value == made.plots["models_fy"].caption
    listed = {one.path for one in REPORT.vocabulary.entries}
    assert {"table.models", "figure.models_fy", "figure.models_mz", "if.models", "row.FY_left_out"} <= listed


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Resolved(result=make_result(), record=make_record(), findings=())
    monkeypatch.setattr(resolve, "resolve_test", lambda _test, *_basis, **_options: made)


def test_the_default_template_prints_them() -> None:
    opened, made = read_template(FOLDER / "org.docx"), content(COMPARISON)
    shown = survey(opened, made).figures
    assert {"models_fy", "models_mz"} <= set(shown)
    picture = draw(made.plots["models_fy"])  # one for all: what each shows is its own tests' affair
    filled = fill(opened, made, dict.fromkeys(shown, picture), allow_missing=True)
    tags = {one.tag for one in filled.manifest}
    # The time is printed all the same.
    assert {f"tk:table.models.{name}" for name in ("model", "FY_parameters", "seconds")} <= tags


@office_needed
def test_a_report_has_them_and_its_hash_does_not_know_the_clock(
    tmp_path: Path, read: None, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = ("model", "FY_parameters", "seconds")
    required = p("{{tk:report.id}}, {{tk:test.name}}, {{tk:calibration.id}}")
    body = (
        required + p("{{tk:table.models}}") + tbl([*columns], [f"{{{{tk:row.{name}}}}}" for name in columns])
    )
    template = make(tmp_path, body + p("{{tk:figure.models_fy}}") + p("{{tk:figure.models_mz}}"))
    models = ["magic_formula", "brush"]
    assert command(
        [Path("any")], template=template, out=tmp_path / "out", models=models, allow_missing=True, json=True
    ) in (0, 1)  # fmt: skip
    told = json.loads(capsys.readouterr().out)
    cells = [(one["tag"], one["text"]) for one in told["manifest"]]
    assert ("tk:table.models.model", "magic_formula") in cells
    # Six parameters a load, as the fit of each has them.
    assert ("tk:table.models.FY_parameters", str(6 * len(LOADS_N))) in cells
    assert {"tk:figure.models_fy", "tk:figure.models_mz"} <= {one["tag"] for one in told["figures"]}
    assert any(tag == "tk:table.models.seconds" for tag, _ in cells)
    assert told["content_sha256"] == again(template, models)


def again(template: Path, models: list[str]) -> str:
    """Return the hash of the content of another run: fitted, drawn and filled anew, and not printed."""
    opened = read_template(template)
    options = Options(template=opened, resolve=resolve.resolve_test, models=tuple(models))
    one, comparison = _compared(Path("any"), options.resolve(Path("any")), options.models)
    content = _job(Path("any"), one, Path("out"), options, comparison).content
    pictures = {name: draw(content.plots[name]) for name in survey(opened, content).figures}
    return content_hash(fill(opened, content, pictures, allow_missing=True), opened)


@office_needed
def test_without_them_a_template_that_demands_the_table_is_refused(tmp_path: Path, read: None) -> None:
    body = p("{{tk:table.models}}") + tbl(["a", "b"], ["{{tk:row.model}}", "{{tk:row.FY_error}}"])
    template = make(tmp_path, body)
    with pytest.raises(TemplateError, match=r"table\.models"):
        command([Path("any")], template=template, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_unknown_model_is_told_before_anything_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_args: object, **_options: object) -> None:
        raise AssertionError("the test was read")

    monkeypatch.setattr(resolve, "resolve_test", never)
    with pytest.raises(FitError) as caught:
        command([Path("any")], template=make(tmp_path, p("x")), out=tmp_path / "out", models=["brusch"])
    assert caught.value.rule == "unknown-model"
