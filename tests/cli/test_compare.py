"""`toolkit compare`: what it answers, what it ends with, what it refuses; nothing is written by halves."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import commands
from toolkit.lab.home import packaged_home
from toolkit.lab.tire_tests.resolve import Basis

CALIBRATIONS = packaged_home() / "calibrations"


def toolkit(*words: object) -> tuple[int, Any]:
    return commands.answer(*words, "--calibrations", CALIBRATIONS)


@pytest.fixture(scope="module")
def other_test(tmp_path_factory: pytest.TempPathFactory, virtual_plan: Any) -> Path:
    """A second virtual test on another surface: the tire has 5 % less force."""
    import dataclasses

    from toolkit.simulation.run import simulate
    from toolkit.simulation.write import write_test

    folder = tmp_path_factory.mktemp("other") / "steel"
    tire = dataclasses.replace(virtual_plan.tire, conicity_N=90.0)
    write_test(simulate(dataclasses.replace(virtual_plan, seed=2, tire=tire)), folder)
    toml = folder / "test.toml"
    toml.write_text(toml.read_text().replace("convex drum (simulated)", "steel"))
    return folder


@pytest.fixture(scope="module")
def reader() -> Callable[..., Any]:
    """What reads a test for a comparison, each test once."""
    from toolkit.lab.tire_tests import compare as reading

    read_test, known = reading._test, {}

    def read(path: Path, basis: Basis, step: Callable[[str], None]) -> Any:
        if (path, basis) not in known:
            known[path, basis] = read_test(path, basis, step)
        return known[path, basis]

    return read


@pytest.fixture
def read_once(reader: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading the same test again says nothing new: that two whole runs agree has a test of its own."""
    from toolkit.lab.tire_tests import compare as reading

    monkeypatch.setattr(reading, "_test", reader)


def maker(path: Path) -> Path:
    """A maker's table: a Magic Formula at two loads inside those of the virtual test."""
    lines = ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    for load in (2500.0, 5000.0):
        for degrees in np.linspace(-12, 12, 49).tolist():
            x = math.radians(degrees)
            FY = -0.95 * load * math.sin(1.3 * math.atan(13 * x))
            lines.append(f"{degrees},{load},{FY},{0.012 * load * math.sin(2.3 * math.atan(15 * x))}")
    path.write_text("\n".join(lines))
    return path


@pytest.mark.usefixtures("read_once")
def test_two_surfaces(virtual_test: Path, other_test: Path, tmp_path: Path) -> None:
    code, answer = toolkit("compare", virtual_test, other_test, "--figures", tmp_path / "figures")
    # The acquisition program of the virtual machine computed its own columns wrongly: a finding of the data.
    assert code == 1
    assert {one["rule"] for one in answer["findings"]} == {"acquired-differs"}
    assert (answer["mode"], answer["axes"], answer["reference"]) == ("surfaces", "SAE", "test")
    assert [one["label"] for one in answer["entries"]] == ["test", "steel"]
    assert answer["entries"][1]["conditions"]["surface"] == "steel"
    assert all(one["simulated"] for one in answer["entries"])
    conicity = [one for one in answer["differences"] if one["quantity"] == "conicity"]
    assert len(conicity) == 5
    for one in conicity:
        assert one["significant"]
        assert one["p_holm"] >= one["p"]
        # Twice the conicity of the tire is twice the value, by the virtual machine's own model.
        assert one["difference_percent"] == pytest.approx(100, abs=8)
        U = one["difference"]["expanded_uncertainty"]
        assert U == pytest.approx(one["difference"]["k"] * one["difference"]["standard_uncertainty"])
    assert answer["significant"] == sum(one["significant"] for one in answer["differences"])
    assert answer["repeats"] is None
    assert sorted(answer["figures"]) == sorted(
        "conicity plysteer crat prat prat_at_fy_zero cornering_stiffness aligning_stiffness".split()
    )
    for path in answer["figures"].values():
        assert Path(path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("read_once")
def test_a_reduced_test_compares_as_its_folder_does(
    virtual_test: Path, other_test: Path, tmp_path: Path
) -> None:
    reduced = tmp_path / "steel.xlsx"
    toolkit("process", other_test, "--out", reduced)
    _, from_folder = toolkit("compare", virtual_test, other_test)
    _, from_file = toolkit("compare", virtual_test, reduced)
    assert from_file["differences"] == from_folder["differences"]


@pytest.mark.campaign(
    "a second reading of the same tests: that two documents of them agree holds in every run"
)
def test_two_runs_answer_the_same(
    virtual_test: Path,
    other_test: Path,
    reader: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By what the other tests have read, and by a reading of its own."""
    from toolkit.lab.tire_tests import compare as reading

    with monkeypatch.context() as patch:
        patch.setattr(reading, "_test", reader)
        answers = [toolkit("compare", virtual_test, other_test)[1]]
    answers.append(toolkit("compare", virtual_test, other_test)[1])
    for one in answers:
        one.pop("timing")
    assert answers[0] == answers[1]


@pytest.mark.usefixtures("read_once")
def test_against_a_maker_s_table(virtual_test: Path, tmp_path: Path) -> None:
    path = maker(tmp_path / "maker.csv")
    _, answer = toolkit("compare", path, virtual_test)
    assert answer["mode"] == "table"
    assert {round(one["load_N"]) for one in answer["differences"]} == {2500, 5000}
    names = {one["quantity"] for one in answer["differences"]}
    assert names == {"FY", "MZ", "secant_cornering", "slope_cornering", "secant_aligning", "slope_aligning"}
    slope = next(
        one for one in answer["differences"] if one["quantity"] == "slope_cornering" and one["load_N"] < 3000
    )
    assert slope["reference"]["value"] == pytest.approx(0.95 * 2500 * 1.3 * 13, rel=1e-4)
    # The test's loads are met by its neighbours: the other way round gives the same difference with its sign.
    _, turned = toolkit("compare", virtual_test, path)
    assert any("does not reach the load" in one for one in turned["left_out"])
    assert any("has no conicity" in one for one in turned["left_out"])


@pytest.mark.usefixtures("read_once")
def test_against_a_maker_s_characteristics(virtual_test: Path, tmp_path: Path) -> None:
    path = tmp_path / "company.csv"
    path.write_text("FZ [N],conicity [N],U_conicity [N]\n2500,40,6\n5000,80,6\n")
    _, answer = toolkit("compare", path, virtual_test)
    assert answer["entries"][0]["kind"] == "characteristics"
    assert [one["reference"]["standard_uncertainty"] for one in answer["differences"]] == [3.0, 3.0]


@pytest.mark.usefixtures("read_once")
def test_repeats_have_their_precision(virtual_test: Path, virtual_repeat: Path, tmp_path: Path) -> None:
    again = Path(shutil.copytree(virtual_repeat, tmp_path / "again"))
    toml = again / "test.toml"
    toml.write_text(
        toml.read_text()
        .replace("virtual operator", "another one")
        .replace("[tire]", 'mounting = "2"\n[tire]')
    )
    _, answer = toolkit("compare", virtual_test, again)
    assert answer["mode"] == "repeats"
    factors = {one["factor"]: one for one in answer["repeats"]["factors"]}
    assert factors["operator"]["varied"]
    assert not factors["day"]["varied"]
    assert factors["mounting"]["note"] == "not stated by 1 of 2 tests"
    row = answer["repeats"]["precision"][0]
    assert row["repeatability_s_r"] is None
    assert row["s"]["dof"] == 1
    assert row["intermediate"][0]["factor"] == "operator"
    assert answer["repeats"]["reproducibility"] is None
    assert "another laboratory" in answer["repeats"]["reproducibility_note"]
    code, refused = toolkit("compare", virtual_test, again, "--reproducibility")
    assert (code, refused["error"]["rule"]) == (2, "no-other-laboratory")


@pytest.mark.usefixtures("read_once")
def test_people_read_it_in_their_units(virtual_test: Path, other_test: Path) -> None:
    si = commands.said("compare", virtual_test, other_test, "--calibrations", CALIBRATIONS).out
    units = ("--units", "lbf", "--calibrations", CALIBRATIONS)
    lbf = commands.said("compare", virtual_test, other_test, *units).out
    assert "SIMULATED" in si
    assert "N·m/deg" in si
    assert "lbf·ft/deg" in lbf
    assert " lbf  " in lbf

    def first(text: str) -> float:
        line = next(one for one in text.splitlines() if one.startswith("conicity"))
        return float(line.split()[4])

    assert first(si) / first(lbf) == pytest.approx(4.448, rel=0.02)


AGAIN = pytest.mark.campaign("a second document: the hash of a report is the same twice in every run")


@pytest.mark.usefixtures("read_once")
@pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")), reason="LibreOffice and poppler make the PDF"
)
@pytest.mark.parametrize("runs", [("one",), pytest.param(("one", "two"), marks=AGAIN)])
def test_the_document_is_verified_and_two_runs_agree(
    virtual_test: Path, other_test: Path, tmp_path: Path, runs: tuple[str, ...]
) -> None:
    made = []
    for name in runs:
        _, answer = toolkit(
            "compare", virtual_test, other_test, "--out", tmp_path / name, "--known-at", "2026-04-01"
        )
        made.append(answer["document"])
        assert sorted(path.name for path in (tmp_path / name).iterdir()) == [
            "comparison.docx", "comparison.pdf",
        ]  # fmt: skip
    assert made[0]["verified"]
    assert made[0]["warnings"] == []
    assert len(made[0]["figures"]) == 7
    assert made[0]["content_sha256"] == made[-1]["content_sha256"]


@pytest.mark.usefixtures("read_once")
def test_the_document_takes_the_units_that_were_asked_for(
    virtual_test: Path, other_test: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    """By the command line, else by the style file beside the template."""
    from toolkit.errors import RenderError
    from toolkit.report import deliver as delivery

    loads = []

    def instead(_template: object, content: Any, *_: object, **__: object) -> None:
        loads.append(content.tables["differences"].rows[0][1].split()[1])
        raise RenderError("not made here", rule="render-failed")

    monkeypatch.setattr(delivery, "deliver", instead)
    template = tmp_path / "ours.docx"
    shutil.copy(packaged_home() / "report_templates" / "comparison.docx", template)
    words = ("compare", virtual_test, other_test, "--out", tmp_path / "out", "--template", template)
    for style in ('force = "N"', 'force = "lbf"'):
        template.with_suffix(".toml").write_text(f"schema = 1\n[units]\n{style}\n")
        for units in ((), ("--units", "lbf"), ("--units", "SI")):
            assert toolkit(*words, *units)[0] == 2
    assert loads == ["N", "lbf", "N", "lbf", "lbf", "N"]


@pytest.mark.usefixtures("read_once")
@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (("{test}",), "too-few-entries"),
        (("{test}", "{test}"), "same-test"),
        (("{test}", "{none}"), "no-test"),
        (("{test}", "{none}.csv"), "no-file"),
        (("{test}", "{maker}", "--axes", "SEA"), "unknown-axes"),
        (("{test}", "{maker}", "--level", "2"), "wrong-value"),
        (("{test}", "{maker}", "--mode", "table?"), "unknown-mode"),
        (("{test}", "{maker}", "--mode", "repeats"), "mode"),
        (("{test}", "{maker}", "--units", "kgf"), "unknown-units"),
        (("{test}", "{maker}", "--template", "{none}.docx"), "template-without-out"),
        (("{test}", "{maker}", "--out", "{none}", "--template", "{none}.docx"), "no-template"),
        (("{test}", "{maker}", "--protocol", "{none}.toml"), "no-file"),
    ],
)
def test_bad_input_ends_with_2_and_writes_nothing(
    words: tuple[str, ...],
    rule: str,
    virtual_test: Path,
    tmp_path: Path,
) -> None:
    maker(tmp_path / "maker.csv")
    places = {"test": virtual_test, "none": tmp_path / "none", "maker": tmp_path / "maker.csv"}
    figures = tmp_path / "figures"
    code, answer = toolkit("compare", *(one.format(**places) for one in words), "--figures", figures)
    assert (code, answer["error"]["rule"]) == (2, rule)
    assert all(answer["error"][key] for key in ("what", "where", "got", "expected", "next_step"))
    assert not figures.exists()


@pytest.mark.usefixtures("read_once")
def test_a_protocol_for_a_test_that_is_reduced_already(virtual_test: Path, tmp_path: Path) -> None:
    reduced = tmp_path / "t.xlsx"
    toolkit("process", virtual_test, "--out", reduced)
    protocol = tmp_path / "p.toml"
    protocol.write_text(
        'source = "other"\nslip_angles = { value = [0, 1, -1], unit = "deg" }\n'
        'loads = { value = [250, 567], unit = "lbf" }\nslip_angle_tolerance = { value = 0.5, unit = "deg" }\n'
        "load_tolerance = 0.05\nsettle_revolutions = 2.5\naverage_revolutions = 1\n"
        'acquisition = "after_settling"\n'
    )
    code, answer = toolkit("process", reduced, "--protocol", protocol)
    assert (code, answer["error"]["rule"]) == (2, "protocol-of-reduced")
    code, answer = toolkit("compare", virtual_test, reduced, "--protocol", protocol)
    assert (code, answer["error"]["rule"]) == (2, "protocol-of-reduced")
    copy = tmp_path / "copy"
    shutil.copytree(virtual_test, copy)
    code, answer = toolkit("process", copy, "--protocol", protocol)
    assert answer["protocol"] == "other"
    assert {"slip-angle-tolerance", "unplanned-load"} <= {one["rule"] for one in answer["findings"]}


def test_the_tags_of_a_comparison_are_listed() -> None:
    code, answer = toolkit("template", "tags", "--kind", "comparison")
    assert code == 0
    listed = {one["tag"] for one in answer["tags"]}
    assert {"tk:comparison.conclusion", "tk:table.differences", "tk:figure.compared_conicity"} <= listed
