"""A style file: every entry that cannot be used is named at once, with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.errors import ConfigError
from toolkit.report.style import Style, kept, read_style
from toolkit.units import si_scale

BAD = """language = "xx"
decimals = { N = 13 }
missing = " "
[units]
force = "kg"
[laboratorry]
name = "x"
"""


def test_all_faults_are_named_with_their_lines(tmp_path: Path) -> None:
    (tmp_path / "org.toml").write_text(BAD)
    with pytest.raises(ConfigError) as caught:
        read_style(tmp_path / "org.toml")
    for named in (
        "1 | language", "en, de or fr", "2 | decimals", "0 and up to 12", "a visible text", "a unit of force",
        "did you mean 'laboratory'?",
    ):  # fmt: skip
        assert named in str(caught.value)


def test_what_is_not_stated_is_as_without_a_file(tmp_path: Path) -> None:
    (tmp_path / "org.toml").write_text('required = ["tk:report.id"]\n')
    style = read_style(tmp_path / "org.toml")
    assert style.required == ("tk:calibration.hash", "tk:report.id")
    assert style == Style(required=style.required)


@pytest.mark.parametrize("unit", ["N", "daN", "kN", "lbf", "kgf", "MN"])
def test_loads_that_differ_never_print_alike_for_their_unit(unit: str) -> None:
    """What prints apart in newton by ten prints apart in every unit of force."""
    factor = 1 / si_scale(unit)
    printed = {format(load * factor, kept(".0f", factor)) for load in range(800, 2400, 10)}
    assert len(printed) == 160
