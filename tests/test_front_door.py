"""The front door: what a notebook does with ``import toolkit``, from opening a laboratory to its report."""

from __future__ import annotations

import ast
import dataclasses
import doctest
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pint
import pytest

import toolkit
from toolkit.calibration.records.record import Zero
from toolkit.errors import ColumnError, ConfigError, RecordError, ToolkitError, UnitError

INDICATIONS = {"D51": 0.1, "D52": 0.2, "E5": 0.3}
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


@pytest.fixture(scope="module")
def laboratory() -> toolkit.Laboratory:
    return toolkit.open_laboratory(toolkit.example("home"))


@pytest.fixture(scope="module")
def record(laboratory: toolkit.Laboratory) -> toolkit.Record:
    return laboratory.in_force("m15-virtual")


@pytest.fixture(scope="module")
def simulation(tmp_path_factory: pytest.TempPathFactory) -> toolkit.Simulation:
    folder = tmp_path_factory.mktemp("walk")
    return toolkit.simulate(
        toolkit.example("test_plan"), folder / "test", case=folder / "case", home=toolkit.example("home")
    )


@pytest.fixture(scope="module")
def processed(laboratory: toolkit.Laboratory, simulation: toolkit.Simulation) -> toolkit.ProcessedTest:
    return laboratory.read_test(simulation.folder).process()


# --- the names ---------------------------------------------------------------------------------------------


def test_every_name_is_said_once_in_each_place_that_needs_it() -> None:
    source = ast.parse(Path(toolkit.__file__).read_text())
    (typed,) = [node for node in source.body if isinstance(node, ast.If)]
    imported = {name.name for node in typed.body if isinstance(node, ast.ImportFrom) for name in node.names}
    assert imported == set(toolkit.__all__) == set(toolkit._MODULES)
    assert dir(toolkit) == sorted(["__version__", *toolkit.__all__])
    # A name that is a part of the package too would change its meaning with the first import.
    assert not {part.stem for part in Path(toolkit.__file__).parent.iterdir()} & set(toolkit.__all__)
    with pytest.raises(AttributeError, match="nonsense"):
        toolkit.nonsense  # noqa: B018
    assert Path(toolkit.__file__).with_name("py.typed").is_file()


def test_the_walk_needs_no_command_line() -> None:
    code = (
        "import sys, toolkit\n"
        "heavy = {'numpy', 'pandas', 'scipy', 'matplotlib', 'pint', 'typer'}\n"
        "assert heavy.isdisjoint(sys.modules), 'import'\n"
        "laboratory = toolkit.open_laboratory(toolkit.example('home'))\n"
        "data = {'D51 [mV/V]': [0.1], 'D52 [mV/V]': [0], 'E5 [mV/V]': [0]}\n"
        "laboratory.in_force('m15-virtual').apply(data)\n"
        "repr(laboratory), laboratory.records.to_dataframe()\n"
        "assert {'typer', 'rich', 'matplotlib', 'toolkit.cli'}.isdisjoint(sys.modules), 'walk'\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# --- a laboratory and its records --------------------------------------------------------------------------


def test_a_laboratory_knows_its_records(laboratory: toolkit.Laboratory) -> None:
    assert laboratory.instruments == ("m15", "m15-virtual")
    assert [record.id for record in laboratory.records] == ["m15-r1", "m15-r2", "m15-virtual-r1"]
    assert laboratory.record("m15-r1").status.state == "withdrawn"
    assert laboratory.verify().ok
    assert list(laboratory.to_dataframe()["id"]) == ["m15-r1", "m15-r2", "m15-virtual-r1"]
    assert laboratory.template("org.docx").is_file()
    with pytest.raises(ConfigError) as caught:
        toolkit.open_laboratory("/nonexistent")
    assert caught.value.rule == "no-home"


def test_loads_are_those_of_the_record_each_with_the_budget_of_its_row(record: toolkit.Record) -> None:
    from toolkit.calibration.apply import apply_record
    from toolkit.calibration.registry.stored import stored_check, stored_loads
    from toolkit.calibration.uncertainty.budget import predict

    rows = pd.DataFrame({f"{name} [mV/V]": [value, -value, 0.0] for name, value in INDICATIONS.items()})
    loads = record.apply(rows)
    plain = {name: rows[f"{name} [mV/V]"].to_numpy() for name in INDICATIONS}
    expected = apply_record(record.result, plain, units=dict.fromkeys(INDICATIONS, "mV/V"))
    for name in record.loads:
        assert loads.value[name].tolist() == expected[name].tolist()
    folder = record.registry.folder
    budget = predict(
        record.result, stored_loads(folder, record.result), stored_check(folder, record.result), "FY",
        INDICATIONS,
    ).budget  # fmt: skip
    assert loads.U["FY"][0] == pytest.approx(budget.U * 4.4482216152605, rel=1e-12)
    assert list(loads.to_dataframe().columns[:2]) == ["FY [N]", "U(FY) [N]"]
    assert loads.quantity("MZ").to("lbf*ft").magnitude[0] == pytest.approx(
        expected["MZ"][0] / 1.3558179483314
    )
    assert record.budget("FY", 500.0).U > 0
    assert "FY_residuals" in record.figures
    assert record.plot("MZ_normal").axes[0].get_title(loc="left").startswith("m15-virtual-r1, MZ")


@pytest.mark.parametrize(
    "data",
    [
        {name: ([value], "mV/V") for name, value in INDICATIONS.items()},
        {name: ([value * 1e3], "µV/V") for name, value in INDICATIONS.items()},
    ],
)
def test_units_stand_in_headers_in_quantities_or_beside(record: toolkit.Record, data: dict) -> None:
    registry = pint.UnitRegistry()  # any registry, not the toolkit's own
    ways = [
        record.apply({f"{name} [{unit}]": values for name, (values, unit) in data.items()}),
        record.apply(
            pd.DataFrame({name: values for name, (values, _) in data.items()}),
            units={name: unit for name, (_, unit) in data.items()},
        ),
    ]
    if data["D51"][1] == "mV/V":
        volts = registry.mV / registry.V
        quantities = {name: np.array(values) * volts for name, (values, _) in data.items()}
        ways.append(record.apply(quantities))
        ways.append(record.apply(pd.DataFrame({name: list(values) for name, values in quantities.items()})))
    for loads in ways:
        assert loads.value["FY"] == pytest.approx(record.apply(_plain()).value["FY"], rel=1e-12)


def _plain() -> dict[str, list[float]]:
    return {f"{name} [mV/V]": [value] for name, value in INDICATIONS.items()}


GOOD = {"D51 [mV/V]": [0.1], "D52 [mV/V]": [0.1], "E5 [mV/V]": [0.1]}


@pytest.mark.parametrize(
    ("data", "units", "error", "rule"),
    [
        ({"D51": [0.1], "D52": [0.1], "E5": [0.1]}, None, UnitError, "no-unit"),
        ({**GOOD, "E5 [mV/V]": ["x"]}, None, ColumnError, "data-columns"),
        ({"D51 [mV/V]": [0.1], "D52 [mV/V]": [0.1], "E5 [lbf]": [0.1]}, None, UnitError, "unit-dimension"),
        (GOOD, {"E5": "V/V"}, UnitError, "two-units"),
        ({"D51 [mV/V]": [0.1], "D52 [mV/V]": [0.1]}, None, ColumnError, "data-columns"),
        ({**GOOD, "D51 [mV/V]": [0.1, 0.2]}, None, ColumnError, "data-columns"),
        ({**GOOD, "D51 [V/V]": [1.0]}, None, ColumnError, "data-columns"),
    ],
)
def test_data_that_cannot_be_meant_is_refused(
    record: toolkit.Record, data: dict, units: dict | None, error: type[ToolkitError], rule: str
) -> None:
    with pytest.raises(error) as caught:
        record.apply(data, units=units)
    assert caught.value.rule == rule
    assert caught.value.next_step


def test_a_record_that_is_not_in_force_makes_a_draft_at_most(laboratory: toolkit.Laboratory) -> None:
    data = {f"{name} [lbf]": [value] for name, value in INDICATIONS.items()}
    withdrawn = laboratory.record("m15-r1")
    with pytest.raises(RecordError) as caught:
        withdrawn.apply(data)
    assert caught.value.rule == "not-in-force"
    loads = withdrawn.apply(data, draft=True)
    assert "DRAFT" in repr(loads)
    assert np.isnan(loads.U["FY"]).all()  # a legacy import has no covariance
    with pytest.raises(ToolkitError, match="no data"):
        withdrawn.budget("FY")


def test_a_tare_is_taken_off_and_rows_beyond_the_range_are_told(record: toolkit.Record) -> None:
    tare = {"D51": 0.05, "D52": 0.01, "E5": -0.02}
    shifted = {f"{name} [mV/V]": [value + tare[name]] for name, value in INDICATIONS.items()}
    untared = record.apply(_plain()).value["FY"]
    assert record.apply(shifted, tare=tare).value["FY"] == pytest.approx(untared)
    registry = pint.UnitRegistry()
    stated = {name: value * registry.mV / registry.V for name, value in tare.items()}
    assert record.apply(shifted, tare=stated).value["FY"] == pytest.approx(untared)
    with pytest.raises(ColumnError, match="tare"):
        record.apply(shifted, tare={"D51": 0.05})
    far = record.apply({f"{name} [mV/V]": [value, 9.0] for name, value in INDICATIONS.items()}, tare=tare)
    assert {finding.rule for finding in far.findings} == {"beyond-range"}
    assert record.apply(_plain(), uncertainty=False).U == {}


@pytest.mark.parametrize(("zero", "level"), [("tared", "warning"), ("run", "warning"), ("included", "note")])
def test_indications_without_a_tare_are_told_as_a_test_without_one(
    zero: Zero, level: str, record: toolkit.Record
) -> None:
    """A bridge that stands at 0.5 mV/V makes hundreds of newtons out of nothing, beside a U of one."""
    fitted = dataclasses.replace(record, result=dataclasses.replace(record.result, zero=zero))
    (found,) = fitted.apply(_plain(), uncertainty=False).findings
    assert (found.rule, found.level) == ("no-tare", level)
    assert ("fitted on tared indications" in found.message) == (zero != "included")
    assert not fitted.apply(_plain(), tare=dict.fromkeys(INDICATIONS, 0.0), uncertainty=False).findings


def test_the_budgets_of_all_rows_of_a_load_are_made_together(
    record: toolkit.Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    from toolkit.calibration.uncertainty import budget

    computed = []
    combine = budget.combine
    monkeypatch.setattr(budget, "combine", lambda *args, **kw: computed.append(1) or combine(*args, **kw))
    rows = {f"{name} [mV/V]": [value, 2 * value] * 5 for name, value in INDICATIONS.items()}
    U = record.apply(rows).U
    assert len(computed) == len(record.loads)
    assert U["FY"].tolist() == U["FY"][:2].tolist() * 5
    assert U["FY"][0] != U["FY"][1]


# --- a test ------------------------------------------------------------------------------------------------


def test_a_recording_is_read_in_the_units_of_its_file() -> None:
    recording = toolkit.read_recording(toolkit.example("fig4_4"))
    assert recording.to_dataframe()["FZ [lbf]"][0] == 248.8146
    assert recording.to_dataframe(si=True)["FZ [N]"][0] == pytest.approx(248.8146 * 4.4482216152605)
    assert recording.figures[:2] == ("FZ", "D52")
    assert recording.plot("D52").axes


def test_a_test_is_processed_as_the_command_does(processed: toolkit.ProcessedTest) -> None:
    from toolkit.lab.tire_tests.process_answer import process_payload

    conditions = process_payload(processed.result)["conditions"]
    assert processed.to_dataframe()["FY_N"].tolist() == [condition["FY_N"] for condition in conditions]
    tidy = processed.characteristics()
    assert {"conicity", "plysteer", "secant_cornering", "FY", "MZ"} <= set(tidy["name"])
    assert (tidy["U"] > 0).all()
    assert "SIMULATED" in repr(processed)
    figure = processed.plot(processed.figures[0])
    assert figure.axes[0].get_xlabel()


def test_a_reduced_test_is_a_test(
    laboratory: toolkit.Laboratory, processed: toolkit.ProcessedTest, tmp_path: Path
) -> None:
    processed.save(tmp_path / "whole.xlsx")
    again = laboratory.read_test(tmp_path / "whole.xlsx").process()
    assert again.to_dataframe()["FY_N"].tolist() == processed.to_dataframe()["FY_N"].tolist()
    with pytest.raises(ToolkitError):
        processed.save(tmp_path / "whole.csv")


def test_tire_models_of_a_test_and_of_a_table(processed: toolkit.ProcessedTest, tmp_path: Path) -> None:
    fit = processed.fit("mf61")
    assert set(fit.to_dataframe()["model"]) == {"mf61"}
    assert fit.plot("mf61_FY_curves").axes
    tire = toolkit.read_tire(fit.write_tir(tmp_path / "own.tir"))
    grid = pd.DataFrame({"SA [deg]": [0.0, 2.0], "FZ [kN]": [3.0, 3.0]})
    forces = tire.evaluate(grid)
    assert list(forces.columns) == ["FX [N]", "FY [N]", "MZ [N*m]"]
    same = tire.evaluate({"SA": [0.0, 2.0], "FZ": [3000.0, 3000.0]}, units={"SA": "deg", "FZ": "N"})
    assert forces["FY [N]"].tolist() == pytest.approx(same["FY [N]"].tolist(), rel=1e-14)
    assert tire.plot("MZ").axes

    table = processed.to_dataframe()
    table = table[table["used"] & (table["rotation"] == "forward")]
    names = {"SA_rad": "SA [rad]", "FZ_N": "FZ [N]", "FY_N": "FY [N]"}
    per_load = toolkit.fit_tire(table.rename(columns=names)[list(names.values())])
    assert set(per_load.to_dataframe()["channel"]) == {"FY"}
    assert len(per_load.comparison()) >= 1
    with pytest.raises(ToolkitError, match="not available"):
        toolkit.fit_tire(table, "nonsense")


# --- archives, cases, reports ------------------------------------------------------------------------------


def test_an_archive_is_audited(
    laboratory: toolkit.Laboratory, simulation: toolkit.Simulation, tmp_path: Path
) -> None:
    for name in ("test.toml", "FM_run_1.xlsx", "FM_run_2.xlsx"):
        shutil.copy(simulation.folder / name, tmp_path)
    audit = laboratory.audit_archive(tmp_path)
    assert audit.grades["sign_variant"] == len(audit.to_dataframe())
    assert not audit.clean
    assert audit.written == ()
    assert audit.plot().axes


def test_a_case_is_diagnosed(simulation: toolkit.Simulation, tmp_path: Path) -> None:
    case = simulation.folder.with_name("case") / "CASE.toml"
    diagnosis = toolkit.diagnose(case, home=toolkit.example("home"), budget_s=0.5)
    assert diagnosis.verdict in {"named", "equivalent", "unknown", "nothing", "untestable"}
    assert diagnosis.verdict in repr(diagnosis)
    assert "effect" in diagnosis.to_dataframe().columns
    assert (diagnosis.save(tmp_path / "answer") / "diagnosis.json").is_file()
    assert diagnosis.figures == () or diagnosis.plot().axes


@office_needed
def test_the_walk_ends_with_a_verified_report(
    laboratory: toolkit.Laboratory, processed: toolkit.ProcessedTest, tmp_path: Path
) -> None:
    report = laboratory.write_report(processed, tmp_path / "report", hand_over=True)
    assert report.pdf.is_file()
    assert len(report.to_dataframe()) > 20
    assert {"test.xlsx", "test.tdx", "tire.tir"} <= {path.name for path in (tmp_path / "report").iterdir()}


# --- faces -------------------------------------------------------------------------------------------------


def test_a_face_says_itself_in_a_line_and_escapes_what_it_shows(
    laboratory: toolkit.Laboratory, processed: toolkit.ProcessedTest, simulation: toolkit.Simulation
) -> None:
    import dataclasses

    faces = [laboratory, laboratory.records, laboratory.verify(), processed, simulation,
             laboratory.record("m15-r2"), laboratory.read_test(simulation.folder)]  # fmt: skip
    for face in faces:
        assert re.fullmatch(r"<\w+ [^\n]+>", repr(face)), repr(face)
        assert len(repr(face)) < 300
        assert face._repr_html_().startswith("<table>")
        assert len(face.to_dataframe())
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(face, dataclasses.fields(face)[0].name, None)
    hostile = toolkit.Simulation(
        plan=simulation.plan, folder=Path("<script>"), answer=dict(simulation.answer)
    )
    assert "<script>" not in hostile._repr_html_()
    with pytest.raises(ConfigError) as caught:
        hostile.plot()
    assert caught.value.rule == "no-figure"


def test_the_guide_does_what_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    guide = Path(toolkit.__file__).parents[1] / "docs" / "library.md"
    monkeypatch.chdir(tmp_path)
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    failed, run = doctest.testfile(str(guide), module_relative=False, optionflags=flags)
    assert run > 20
    assert failed == 0
