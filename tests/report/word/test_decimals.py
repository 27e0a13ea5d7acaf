"""Decimals by name that were made for newtons are told where the style file chooses another unit."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.lab.home import packaged_home
from toolkit.report.style import Style, read_style
from toolkit.report.test.content import REPORT
from toolkit.report.word.decimals import coarse_decimals


def names(style: Style) -> set[str]:
    return {finding.place for finding in coarse_decimals(style, REPORT.vocabulary)}


def test_whole_newtons_are_no_whole_kilonewtons() -> None:
    decimals = (("load", 0), ("summary.load", 0), ("stiffness.cornering_secant", 4))
    assert names(Style(decimals=decimals, force="kN")) == {"[decimals] load", "[decimals] summary.load"}
    assert names(Style(decimals=decimals, force="lbf")) == set()
    assert names(Style(decimals=(("load", 3), ("kN", 0)), force="kN")) == set()


@pytest.mark.parametrize("unit", ["N", "daN", "kN", "lbf", "MN"])
@pytest.mark.parametrize("template", ["org.toml", "pruefbericht.toml"])
def test_who_changes_the_unit_alone_of_a_shipped_style_loses_no_digits(
    unit: str, template: str, tmp_path: Path
) -> None:
    text = (packaged_home() / "report_templates" / template).read_text("utf-8")
    text = text.replace('force = "N"', f'force = "{unit}"')
    if "[units]" not in text:
        text += f'\n[units]\nforce = "{unit}"\n'
    (tmp_path / "org.toml").write_text(text, "utf-8")
    assert names(read_style(tmp_path / "org.toml")) == set()
