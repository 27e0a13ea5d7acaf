"""Every characteristic declares its facts, and one more is one more file: no list names it."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from tests.characteristics.sweep_factory import swept
from tests.characteristics.tire_factory import LOAD, M15, reduced_test
from tests.commands import said
from tests.recipes import file_of
from toolkit.channels import ROTATIONS
from toolkit.characteristics.catalogue import (
    by_channel,
    characteristics,
    columns,
    compared,
    comparison_figures,
    figures,
    summary,
    tables,
)
from toolkit.characteristics.characterise import Characteristics, characterise
from toolkit.characteristics.characteristic import (
    COLUMNS,
    CORRECTION,
    PRINTED,
    TRANSIENT,
    Characteristic,
)
from toolkit.characteristics.groups import CHANNELS
from toolkit.lab.home import packaged_home
from toolkit.report.test.content import REPORT
from toolkit.units import si_scale
from toolkit.words.phrasebook import languages, phrasebook

EACH = pytest.mark.parametrize("declared", characteristics(), ids=lambda one: one.name)
TEXTS = (
    "name", "symbol", "title", "definition", "formula", "term", "source", "column_text",
)  # fmt: skip


@EACH
def test_every_fact_is_stated(declared: Characteristic) -> None:
    for name in TEXTS:
        text = getattr(declared, name)
        assert text, f"{declared.name} has no {name}"
        assert text == text.strip()
    assert declared.definition.endswith("."), "a definition is a sentence"
    assert declared.channel in CHANNELS
    assert declared.unit in PRINTED
    assert declared.digits >= 0
    assert declared.budget
    assert declared.needs, "what the test must have for it"
    assert bool(declared.summary) == bool(declared.summary_text)
    assert declared.figure is None or declared.figure.text
    assert declared.scope == "load" or declared.figure is None or declared.label
    assert abs(declared.sign) == 1.0


@EACH
def test_the_printed_unit_is_the_si_unit_in_other_words(declared: Characteristic) -> None:
    printed, factor = PRINTED[declared.unit]
    assert factor * si_scale(printed) == pytest.approx(si_scale(declared.unit), rel=1e-12)


@EACH
def test_its_symbols_stand_in_the_definition_of_one_characteristic(declared: Characteristic) -> None:
    for name in ("name", "symbol", "title", "column_name"):
        assert [getattr(one, name) for one in characteristics()].count(getattr(declared, name)) == 1, name
    same_table = [one.order for one in characteristics() if one.scope == declared.scope]
    assert same_table.count(declared.order) == 1


@EACH
def test_it_is_explained(declared: Characteristic, capsys: pytest.CaptureFixture[str]) -> None:
    from toolkit.cli.main import run

    with pytest.raises(SystemExit) as caught:
        run(["explain", declared.name, "--json"])
    assert not caught.value.code
    answer = json.loads(capsys.readouterr().out)["characteristic"]
    assert answer["means"] == declared.definition
    assert all(answer.values())


@functools.cache
def _whole(*, swept_too: bool) -> Characteristics:
    """Return what a whole test gives, with or without recordings in time; once for all characteristics."""
    sweeps = [sweep for rotation in ROTATIONS for sweep in swept(0.5, rotation=rotation)]
    return characterise(
        reduced_test(u=(8.0, 0.3), pressure_Pa=234e3), machine=M15, record=None,
        sweeps=sweeps if swept_too else (),
    )  # fmt: skip


@EACH
def test_its_row_has_no_source_that_its_budget_does_not_name(declared: Characteristic) -> None:
    for row in _whole(swept_too=declared.table == TRANSIENT).of(declared.name):
        assert row.estimate is not None, row.lacking
        assert row.estimate.unit == declared.unit
        assert {source for source, _ in row.sources} <= set(declared.budget)


@functools.cache
def _narrow() -> Characteristics:
    """Return what three slip angles give."""
    return characterise(reduced_test(angles=(-2.0, 0.0, 2.0)), machine=M15, record=None)


@EACH
def test_a_test_that_lacks_its_needs_says_which(declared: Characteristic) -> None:
    for row in _narrow().of(declared.name):
        assert row.estimate is None
        assert row.lacking in {need.text for need in declared.needs}


@pytest.mark.parametrize("language", languages())
def test_every_title_has_its_words_in_each_language(language: str) -> None:
    book = phrasebook(language)
    assert [declared.name for declared in characteristics() if not book.knows(declared.title)] == []


def test_every_table_figure_and_value_of_the_catalogue_is_a_tag() -> None:
    tags = {entry.path for entry in REPORT.vocabulary.entries}
    assert {f"figure.{figure.name}" for figure in figures()} <= tags
    assert {f"summary.{one.summary}" for one in summary()} <= tags
    for table in tables():
        names = [column.name for column in REPORT.vocabulary.tables[table.name].columns]
        for declared in columns(table):
            assert {declared.column_name, f"U_{declared.column_name}"} <= set(names)


def test_every_source_of_a_budget_has_a_column_or_is_a_correction_of_the_machine() -> None:
    shown = {source for column in COLUMNS for source in column.sources}
    assert {source for one in characteristics() for source in one.budget} <= shown | {CORRECTION}


def test_what_is_drawn_in_a_comparison_is_compared() -> None:
    assert set(comparison_figures().values()) <= set(compared())
    assert by_channel(compared())[0].channel == "FY"


def test_the_line_of_a_lacking_row_is_not_the_line_of_another_load() -> None:
    found = characterise(reduced_test(), machine=M15, record=None)
    assert found.at("conicity", LOAD) is not None
    assert found.at("conicity", LOAD + 1.0) is None
    assert found.at("conicity", LOAD, "forward") is None


# The program with a folder of further characteristics, as if they stood in the catalogue.
PROGRAM = """
import sys
import toolkit.characteristics.catalogue as catalogue
catalogue.__path__.append(sys.argv.pop(1))
from toolkit.cli.main import run
run(sys.argv[1:])
"""
CONTENT = """
import json, sys
from pathlib import Path
import toolkit.characteristics.catalogue as catalogue
catalogue.__path__.append(sys.argv[1])
from toolkit.report.test.content import build_content
from toolkit.testfile import read_test_file
content = build_content(read_test_file(Path(sys.argv[2])))
table = content.tables["stiffness"]
print(json.dumps({
    "columns": [column.name for column in table.columns],
    "units": [column.unit for column in table.columns],
    "rows": table.rows,
    "long": [row[0] for row in content.tables["characteristics"].rows],
    "budget": [row[0] for row in content.tables["budget"].rows],
    "summary": content.values["summary.trail"].value,
    "alt": content.plots["trail"].alt,
}))
"""


def program(folder: Path, *words: object, code: str = PROGRAM) -> Any:
    completed = subprocess.run(
        [sys.executable, "-c", code, str(folder), *map(str, words)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert completed.stdout, completed.stderr
    return json.loads(completed.stdout)


@pytest.mark.campaign("the recipe of CONTRIBUTING.md adds one characteristic more in every run")
def test_one_more_characteristic_is_one_file(
    tmp_path: Path, virtual_test: Path, virtual_repeat: Path
) -> None:
    """The answer, the sheets, the report, comparisons, tags and the explanation have it, without a list."""
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "pneumatic_trail.py").write_text(file_of("Add a characteristic"))
    home = ("--calibrations", packaged_home() / "calibrations", "--json")

    whole = tmp_path / "whole.xlsx"
    answer = program(folder, "process", virtual_test, "--out", whole, *home)
    entries = answer["characteristics"]["stiffness"]
    assert len(entries) == 10
    for entry in entries:
        trail = entry["pneumatic_trail"]
        ratio = entry["slope_aligning"]["value"] / entry["slope_cornering"]["value"]
        assert trail["value"] == pytest.approx(ratio, rel=1e-12)
        assert trail["unit"] == "m"
        assert 0 < trail["standard_uncertainty"] < 0.05 * trail["value"]
    budgets = [one for one in answer["characteristics"]["budgets"] if one["name"] == "pneumatic_trail"]
    assert len(budgets) == 10
    assert budgets[0]["unit"] == "m"

    sheet = openpyxl.load_workbook(whole, read_only=True)["characteristics"]
    assert sum(row[2] == "pneumatic_trail" for row in sheet.iter_rows(values_only=True)) == 10

    content = program(folder, whole, code=CONTENT)
    place = content["columns"].index("pneumatic_trail")
    assert content["columns"][place + 1] == "U_pneumatic_trail"
    assert content["units"][place] == "mm"
    assert content["rows"][0][place] == pytest.approx(1e3 * entries[0]["pneumatic_trail"]["value"])
    assert "pneumatic trail at 0 deg" in content["long"]
    assert "pneumatic trail at 0 deg" in content["budget"]
    assert 10.0 < content["summary"] < 60.0
    assert "Pneumatic trail [mm] against load" in content["alt"]

    differences = program(folder, "compare", virtual_test, virtual_repeat, *home)["differences"]
    assert sum(one["quantity"] == "pneumatic_trail" for one in differences) == 10

    tags = {one["tag"] for one in program(folder, "template", "tags", "--json")["tags"]}
    assert {"tk:figure.trail", "tk:summary.trail", "tk:row.pneumatic_trail", "tk:if.trail"} <= tags
    tags = {
        one["tag"] for one in program(folder, "template", "tags", "--kind", "comparison", "--json")["tags"]
    }
    assert "tk:figure.compared_trail" in tags

    facts = program(folder, "explain", "pneumatic_trail", "--json")["characteristic"]
    assert facts["unit"] == "mm (SI: m)"


def test_a_file_from_before_a_characteristic_is_read_and_keeps_its_hash(
    tmp_path: Path, virtual_test: Path
) -> None:
    home = ("--calibrations", packaged_home() / "calibrations", "--json")
    more = tmp_path / "more"
    more.mkdir()
    whole = tmp_path / "whole.xlsx"
    assert said("process", virtual_test, "--out", whole, *home).code in (0, 1)
    (more / "pneumatic_trail.py").write_text(file_of("Add a characteristic"))
    content = program(more, whole, code=CONTENT.replace('content.plots["trail"].alt', "None"))
    place = content["columns"].index("pneumatic_trail")
    assert {row[place] for row in map(tuple, content["rows"])} == {None}
