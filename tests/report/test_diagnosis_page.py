"""The page of a diagnosis: what is read in ten seconds stands first, and is true of this search."""

import dataclasses
import re

import numpy as np
import pytest

from tests.diagnosis.cases import carriage, write_case
from toolkit.diagnosis.case_read import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.report.diagnosis import figures
from toolkit.report.diagnosis.chance import chance
from toolkit.report.diagnosis.page import HEADLINES, headline, page


@pytest.fixture(scope="module")
def dragged(tmp_path_factory):
    files = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    return diagnose(read_case(write_case(tmp_path_factory.mktemp("case"), **files)), None)


def test_the_chart_comes_before_every_table_and_heading(dragged):
    html = page(dragged)
    assert html.index('class="verdict"') < html.index("<img") < html.index("<h2>") < html.index("<table")


def test_a_table_scrolls_by_itself_and_a_narrow_window_is_as_wide_as_it_is(dragged):
    html = page(dragged)
    assert html.count('<div class="wide"><table>') == html.count("<table>") > 0
    assert 'name="viewport"' in html
    assert "overflow-x:auto" in html
    assert "background:#fff" in html  # a browser in the dark keeps the ink and would take the paper away
    assert "@media print" in html


def test_the_map_of_runs_is_over_the_noise_of_the_first_chart(dragged, monkeypatch):
    seen = []
    monkeypatch.setattr(figures, "_write_cells", lambda _axes, values, _most: seen.append(values))
    figures.run_map(dragged.search, dragged.diagnosis, after=False)
    (row,) = seen[0]
    (one,) = dragged.diagnosis.held_out
    residual = dragged.search.refitted.residual["F"]
    # Runs of equal length: their mean square over the noise is that of all rows.
    assert np.sqrt(np.mean(row**2)) == pytest.approx(
        np.sqrt(np.mean(residual**2)) / one.noise_floor, rel=0.02
    )


def test_a_search_that_was_cut_off_does_not_say_that_no_effect_explains(dragged):
    screening = ("step 2: screening 150 candidates",)
    cut = dataclasses.replace(
        dragged.diagnosis, verdict="unknown", effects=(), complete=False, skipped=screening
    )
    assert "before every known effect was tried" in headline(cut)
    assert "no known effect explains" in headline(dataclasses.replace(cut, skipped=("predictions",)))
    assert headline(dataclasses.replace(cut, complete=True, skipped=())) == HEADLINES["unknown"]


def test_no_chance_is_zero(dragged):
    assert chance(0.0) == "p < 1e-300"
    assert chance(float("nan")) == "p unknown"
    assert chance(0.0312, decimal_comma=True) == "p = 0,031"
    assert not re.search(r"(p =|is) 0[.)]", page(dragged))
