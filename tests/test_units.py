"""Units: exact factors, spellings, dimensions of their own, and no guesses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.errors import UnitError
from toolkit.units import _EXACT, _parse, from_si, in_both, registry, si_scale, to_si, unit

# NIST SP 811 (2008), appendix B: exact where it prints a bold factor.
PUBLISHED = {
    "lbf": (4.4482216152605, "N"),
    "lbf*ft": (1.3558179483314004, "N*m"),
    "psi": (6894.757293168361, "Pa"),
    "kip": (4448.2216152605, "N"),
    "mph": (0.44704, "m/s"),
    "bar": (1e5, "Pa"),
}


@pytest.mark.parametrize("text", PUBLISHED)
def test_published_factors(text: str) -> None:
    factor, si = PUBLISHED[text]
    assert unit(text).factor == pytest.approx(factor, rel=1e-14)
    assert unit(text).si == si


@pytest.mark.parametrize(
    ("si", "text", "spec", "told"),
    [
        (444.82216152605, "N", ".1f", "444.8 N (100.0 lbf)"),
        (444.82216152605, "lbf", ".1f", "100.0 lbf (444.8 N)"),
        (-13.558179483314, "N*m", ".2f", "-13.56 N·m (-10.00 lbf·ft)"),
        (13.558179483314, "lbf*ft", ".3g", "10 lbf·ft (13.6 N·m)"),
    ],
)
def test_what_is_said_in_one_system_is_said_in_the_other(si: float, text: str, spec: str, told: str) -> None:
    assert in_both(si, text, spec) == told


_PINT = {
    "mV/V": "millivolt/volt",
    "V/V": "volt/volt",
    "count": "dimensionless",
    "lbf*ft": "force_pound*foot",
    "1": "dimensionless",
    "deg": "degree",
    "rad": "radian",
}


@pytest.mark.parametrize("text", sorted(_EXACT))
def test_table_of_exact_units_agrees_with_pint(text: str) -> None:
    ureg = registry()
    spelled = _PINT.get(text, text)
    target = {"V/V": "dimensionless", "count": "dimensionless", "1": "dimensionless", "rad": "radian"}
    factor, offset, si, _ = _EXACT[text]
    zero = ureg.Quantity(0.0, spelled).to(target.get(si, si)).magnitude
    one = ureg.Quantity(1.0, spelled).to(target.get(si, si)).magnitude
    assert one - zero == pytest.approx(factor, rel=1e-12)
    assert zero == pytest.approx(offset, rel=1e-12)


@pytest.mark.parametrize("text", ["lb", "lbs", "lbf", "LBF".lower()])
def test_lb_in_a_file_is_pound_force(text: str) -> None:
    assert unit(text).dimension == "force"
    assert unit(text).text == "lbf"


@pytest.mark.parametrize("text", ["lb-ft", "lbf·ft", "ft-lb", "lb ft", "ft*lbf", "lbf ft"])
def test_spellings_of_the_moment(text: str) -> None:
    assert unit(text).factor == unit("lbf*ft").factor
    assert unit(text).text == "lbf*ft"


LBF = 0.45359237 * 9.80665  # the international pound-force [N]


@pytest.mark.parametrize(
    ("text", "dimension", "factor", "written"),
    [
        ("lb/deg", "force", LBF * 180 / math.pi, "lbf/deg"),
        ("lb-ft/deg", "moment", LBF * 0.3048 * 180 / math.pi, "lbf*ft/deg"),
        ("in-lb", "moment", LBF * 0.0254, "in*lbf"),
        ("lbf-in", "moment", LBF * 0.0254, "lbf*in"),
        ("kgf-m", "moment", 9.80665, "kgf*m"),
        ("kp", "force", 9.80665, "kgf"),
        ("gf", "force", 9.80665e-3, "gf"),
        ("Nm/deg", "moment", 180 / math.pi, "N*m/deg"),
        ("Ncm", "moment", 0.01, "N*cm"),
        ("Nmm", "moment", 1e-3, "N*mm"),
    ],
)
def test_a_word_means_in_a_compound_what_it_means_alone(
    text: str, dimension: str, factor: float, written: str
) -> None:
    read = unit(text)
    assert (read.dimension, read.text) == (dimension, written)
    assert read.factor == pytest.approx(factor, rel=1e-12)


def test_bridge_output_is_no_plain_number_and_no_count() -> None:
    assert {unit(t).dimension for t in ("mV/V", "count", "1")} == {"bridge_ratio", "count", "ratio"}
    with pytest.raises(UnitError, match="not one of ratio"):
        si_scale("mV/V", "ratio")


def test_units_that_only_pint_knows() -> None:
    assert unit("kgf").factor == pytest.approx(9.80665)
    assert unit("inch").factor == pytest.approx(0.0254)
    assert unit("N*mm").si == "N*m"
    assert unit("N/deg").factor == pytest.approx(180 / math.pi)
    assert unit("degF").offset == pytest.approx(459.67 * 5 / 9)


@pytest.mark.parametrize(
    "text",
    [
        "furlongs per lunch",
        "N;drop",
        "??",
        "import os",
        "__class__",
        "N**",
        "9**9**9**9",
        "(9)**9",
        "m" * 60,
        "deg-C",
    ],
)
def test_unknown_unit_is_an_error_that_says_where(text: str) -> None:
    with pytest.raises(UnitError) as caught:
        unit(text, where="file.xlsx, column FZ")
    assert caught.value.got == text
    assert caught.value.where == "file.xlsx, column FZ"
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "text", ["-N", "-1*lbf", "-mV/V", "0*N", "N*0", "N/1e400", "1e400 N", "inf N", "nan N", "nan", "-%"]
)
def test_a_unit_turns_no_sign_and_makes_nothing_of_no_value(text: str) -> None:
    with pytest.raises(UnitError, match="unknown unit"):
        unit(text)


@pytest.mark.parametrize("text", ["2", "60", "0", "1e3", "0.5", "(2)", "1/2", "2*3"])
def test_a_bare_number_is_no_unit(text: str) -> None:
    # "SA (2)" is the second column of its name, and "FY=60" is a number without a unit.
    with pytest.raises(UnitError, match="unknown unit"):
        unit(text)


@pytest.mark.parametrize("text", ["2 degC", "degF*2", "2*degC"])
def test_a_scale_with_a_zero_has_no_multiples(text: str) -> None:
    with pytest.raises(UnitError, match="unknown unit"):
        unit(text)


def test_a_multiple_of_a_unit_is_one() -> None:
    assert (unit("1000 N").factor, unit("2 K").factor, unit("10 mm/s").factor) == (1000.0, 2.0, 0.01)


def test_an_offset_unit_has_no_plain_scale() -> None:
    with pytest.raises(UnitError):
        si_scale("degC")


@given(
    st.sampled_from(sorted(_EXACT)),
    st.lists(st.floats(min_value=-1e9, max_value=1e9), min_size=1, max_size=5),
)
def test_round_trip(text: str, values: list[float]) -> None:
    there = to_si(values, text)
    assert there.shape == (len(values),)
    np.testing.assert_allclose(from_si(there, text), values, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "factor", "dimension"),
    [
        ("1/degC", 1.0, "1 / [temperature]"),
        ("1/degF", 1.8, "1 / [temperature]"),
        ("1/°F", 1.8, "1 / [temperature]"),
        ("%/degC", 0.01, "1 / [temperature]"),
        ("degC/s", 1.0, "[temperature] / [time]"),
        ("1/celsius", 1.0, "1 / [temperature]"),
        ("m/fahrenheit", 1.8, "[length] / [temperature]"),
        ("m/degree_Fahrenheit", 1.8, "[length] / [temperature]"),
    ],
)
def test_in_a_compound_unit_a_temperature_is_a_difference(text: str, factor: float, dimension: str) -> None:
    # SI brochure, 2.3.1: an interval of 1 degC is one of 1 K; an interval of 1 degF is 5/9 K.
    found = unit(text)
    assert found.factor == pytest.approx(factor, rel=1e-12)
    assert (found.offset, found.dimension) == (0.0, dimension)


def test_parsing_is_cached() -> None:
    assert _parse("lbf") is _parse("lbf")


def test_brackets_about_a_scale_leave_its_zero_and_a_space_in_it_is_refused() -> None:
    assert unit("(degC)").offset == pytest.approx(273.15)
    with pytest.raises(UnitError):
        unit("mV/deg C")


@pytest.mark.parametrize("prefix", ["", "m", "c", "da", "h", "k", "M", "µ", "u"])
@pytest.mark.parametrize("length", ["m", "mm", "cm"])
def test_a_newton_metre_in_one_word_is_a_moment_by_any_prefix(prefix: str, length: str) -> None:
    """pint reads Nm as a measure of yarn, [length]/[mass]: mNm of a small cell had been one."""
    assert unit(f"{prefix}N{length}") == unit(f"{prefix}N*{length}")
    assert unit(f"{prefix}N{length}").dimension == "moment"
    assert unit(f"{prefix}N{length}/deg").dimension == unit("N*m/deg").dimension


@pytest.mark.parametrize("text", ["gon", "urad", "arcsecond", "arcmin", "mrad", "turn", "deg", "cycle"])
def test_what_is_a_number_of_radians_is_an_angle(text: str) -> None:
    assert (unit(text).dimension, unit(text).si) == ("angle", "rad")


@pytest.mark.parametrize("text", ["grad", "Grad", "Grad/s", "N*m/grad", "grade"])
def test_a_word_of_two_meanings_is_refused(text: str) -> None:
    """German and French headers say grad of a degree, pint of 0.9 of one."""
    with pytest.raises(UnitError):
        unit(text)


def test_words_of_other_workshops() -> None:
    assert unit("U/min").factor == unit("rpm").factor  # Umdrehungen; pint's U is an enzyme's
    assert unit("PS").factor == pytest.approx(735.49875)  # DIN 66036; pint's a petasiemens
    assert unit("pct").factor == 0.01  # a picocarat
    assert unit("mV / V") == unit("mV/V")
    assert unit("N * m") == unit("N*m")
