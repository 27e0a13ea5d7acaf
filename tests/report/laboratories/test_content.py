"""The document of an interlaboratory comparison: what it holds, in every language."""

from __future__ import annotations

import dataclasses
import datetime as dt

import pytest

from tests.report.laboratories.laboratories_factory import CONICITY, compared, comparison
from toolkit.comparison.laboratories import compare_laboratories
from toolkit.report.laboratories.content import build_laboratories_content
from toolkit.report.style import Style


def test_every_number_of_the_comparison_is_in_its_tables() -> None:
    tables = build_laboratories_content(compared(), Style()).tables
    answer = comparison()
    for measurand in answer.measurands:
        shown = {row[1]: row for row in tables["laboratory_scores"].rows if row[0] == measurand.name}
        assert len(shown) == len(measurand.scores)
        for score in measurand.scores:
            row = shown[score.laboratory]
            assert float(str(row[3])) == pytest.approx(score.mean, abs=0.06)
            numbers = (score.z_prime, score.zeta, score.En)
            assert [None if cell == "-" else float(str(cell)) for cell in row[5:8]] == [
                None if number is None else pytest.approx(number, abs=0.0051) for number in numbers
            ]
    consistency = tables["laboratory_consistency"].rows
    assert [(row[1], row[4], row[6]) for row in consistency if row[4] or row[6]] == [
        ("D", "outlier", "outlier")
    ]


def test_a_mean_ends_where_its_uncertainty_ends() -> None:
    rows = {row[:2]: row[3:5] for row in build_laboratories_content(compared(), Style()).tables[
        "laboratory_scores"
    ].rows}  # fmt: skip
    assert rows["conicity", "A"] == ("10.00", "0.40")
    assert rows["plysteer", "A"] == ("102.0", "4.0")
    # Without a U: to the last place of the assigned value's.
    assert rows["conicity", "E"] == ("10.00", "-")


def test_what_cannot_be_told_of_one_laboratory_is_no_table() -> None:
    alone = compare_laboratories({"conicity": CONICITY[:2]}, unit="N", reference="A", sigma=None)
    content = build_laboratories_content(compared(comparison=alone), Style())
    for name in ("laboratory_consistency", "laboratory_precision", "laboratory_outliers", "laboratories_h"):
        assert not content.conditions[name], name
    assert content.conditions["laboratories_1"]
    assert content.tables["laboratory_assigned"].rows[0][4:] == ("A", "-", "not stated, too few to tell")


def test_the_same_results_have_the_same_name_on_any_day_and_others_another() -> None:
    document = compared()
    assert document.id == dataclasses.replace(document, issued=dt.date(2027, 1, 1)).id
    assert document.id != dataclasses.replace(document, sha256="cd" * 32).id
    scored = compare_laboratories({"conicity": CONICITY}, unit="N", reference=None, sigma=0.5)
    assert document.id != compared(comparison=scored).id


@pytest.mark.parametrize(
    ("language", "title", "departure", "by", "message"),
    [
        ("de", "Laborvergleich: Konizität, Plysteer", "Ausreißer", "Konsens von 5 (Algorithmus A)",
         "D liegt abseits der übrigen"),
        ("fr", "Comparaison interlaboratoires: conicité, plysteer", "valeur aberrante",
         "consensus de 5 (algorithme A)", "D s’écarte des autres"),
    ],
)  # fmt: skip
def test_it_speaks_the_language_of_its_style(
    language: str, title: str, departure: str, by: str, message: str
) -> None:
    content = build_laboratories_content(compared(), Style(language=language, decimal_comma=True))
    assert content.values["laboratories.title"].value == title
    assert content.untranslated == ()
    scores = content.tables["laboratory_scores"].rows
    assert scores[3][1] == "D"
    assert scores[3][3:5] == ("12,45", "0,50")
    assert content.tables["laboratory_consistency"].rows[3][4] == departure
    assert content.tables["laboratory_assigned"].rows[0][4] == by
    assert str(content.tables["laboratory_findings"].rows[0][3]).startswith(message)
    plots = " ".join(plot.alt + plot.caption + plot.y_label for plot in content.plots.values())
    assert "laborator" not in plots
