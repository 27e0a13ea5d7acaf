"""Tire property files: units, ranges, what is kept, what is refused, and a maker's own files."""

import math

import numpy as np
import pytest

from tests.conftest import SHARED_DATA
from toolkit.errors import CellError, ConfigError, ToolkitError, UnitError, UnreadableError
from toolkit.tires.tir import parse_tir, read_tir, si_number
from toolkit.tires.tir_evaluate import evaluate_tir
from toolkit.tires.tir_write import file_text, in_si

MAKER = SHARED_DATA / "goodyear_feda_tir"
BODY = """[MODEL]
FITTYP = {fittyp}
TYRESIDE = 'RIGHT'
[DIMENSION]
UNLOADED_RADIUS = {radius}
[VERTICAL]
FNOMIN = {load}
[SLIP_ANGLE_RANGE]
ALPMIN = {low}
ALPMAX = {high}
[SCALING_COEFFICIENTS]
LFZ0 = 1
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = 1
PKY1 = -2.0D+01   $ stiffness
PKY2 = 1.6
QUITE_OWN = 7.25  ! kept
[ALIGNING_COEFFICIENTS]
QCZ1 = 1.1
QBZ1 = 9
QDZ1 = 0.1
"""
SI = {"fittyp": 61, "radius": 0.3, "load": 4000, "low": -0.2, "high": 0.2}


def made(units="", **changed):
    return parse_tir("! head\n" + units + BODY.format(**{**SI, **changed}), where="x.tir")


@pytest.mark.parametrize("fittyp", [5, 6, 21, 52, 60, 61, 62])
def test_kinds(fittyp):
    assert made(fittyp=fittyp).version == ("5.2" if fittyp < 60 else "6.x")


@pytest.mark.parametrize(("fittyp", "version"), [("'61'", "6.x"), ('"6"', "5.2")])
def test_a_kind_in_quotes_is_that_kind(fittyp, version):
    assert made(fittyp=fittyp).version == version


@pytest.mark.parametrize("section", ["REST", "LATERAL", "TYRE_DATA"])
def test_a_number_of_the_magic_formula_is_known_by_its_name_in_any_section(section):
    text = BODY.format(**SI)
    moved = text.replace("[LATERAL_COEFFICIENTS]", f"[{section}]").replace(
        "[SCALING_COEFFICIENTS]", "[SCALES]"
    )
    expected, _ = evaluate_tir(parse_tir(text), SA=0.1, FZ=4000.0)
    forces, _ = evaluate_tir(parse_tir(moved), SA=0.1, FZ=4000.0)
    assert forces.FY == expected.FY
    assert abs(forces.FY) > 1000
    with pytest.raises(CellError):
        parse_tir(moved.replace("PDY1 = 1\n", "PDY1 = one\n"))
    with pytest.raises(CellError):
        parse_tir(moved + "[OTHER]\nPDY1 = 2\n")


def test_units_and_conditions_are_no_scale_factors():
    tir = made(units="[UNITS]\nLENGTH = 'meter'\nFORCE = 'newton'\n[RUN]\nLONGVL = 16.7\nLOADED = 3\n")
    assert "LONGVL" not in tir.coefficients()
    assert si_number(tir, "LONGVL") == 16.7


@pytest.mark.parametrize(
    ("changed", "rule"),
    [
        ({"load": 4.0}, "tir-nominal-load"),
        ({"load": 4e6}, "tir-nominal-load"),
        ({"friction": 3}, "tir-friction"),
    ],
)
def test_what_no_tire_has_is_told(changed, rule):
    def rules(load=4000.0, friction=1):
        text = BODY.format(**SI | {"load": load}).replace("PDY1 = 1\n", f"PDY1 = {friction}\n")
        _, findings = evaluate_tir(parse_tir(text), SA=[0.1, 0.3], FZ=4000.0)
        return {finding.rule for finding in findings}

    assert rule in rules(**changed)
    assert not {"tir-nominal-load", "tir-friction"} & rules()


@pytest.mark.parametrize("fittyp", ["7", "63", "'MF61'", "1 2"])
def test_unknown_kinds_are_refused_with_all_parts(fittyp):
    with pytest.raises(ConfigError) as caught:
        evaluate_tir(made(fittyp=fittyp), SA=0.1, FZ=4000.0)
    error = caught.value
    assert error.rule == "tir-fittyp"
    assert all((error.where, error.got, error.expected, error.next_step))


def test_kN_mm_and_degrees_are_the_same_tire():
    other = made(
        "[UNITS]\nLENGTH='mm'\nforce='kN'\nANGLE = 'Degrees'\n", radius=300, load=4,
        low=-math.degrees(0.2), high=math.degrees(0.2),
    )  # fmt: skip
    at = {"SA": np.array([-0.1, 0.05]), "FZ": 3000.0, "IA": 0.02}
    (one, findings), (same, also) = evaluate_tir(made(), **at), evaluate_tir(other, **at)
    assert np.allclose(one.FY, same.FY, rtol=1e-14)
    assert np.allclose(one.MZ, same.MZ, rtol=1e-14)
    assert findings == also
    converted, kept = in_si(other)
    assert converted.section("UNITS") == {"LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians"}
    assert (converted.number("UNLOADED_RADIUS"), converted.number("FNOMIN")) == pytest.approx((0.3, 4000.0))
    assert converted.number("ALPMAX") == pytest.approx(0.2)
    assert converted.number("QUITE_OWN") == 7.25
    assert kept == ()


@pytest.mark.parametrize("spelling", ["radian", "radians", "RADIAN"])
def test_both_radians(spelling):
    tir = made(f"[UNITS]\nANGLE = '{spelling}'\n")
    assert si_number(tir, "ALPMAX") == 0.2


def test_unknown_unit_is_refused():
    with pytest.raises(UnitError) as caught:
        evaluate_tir(made("[UNITS]\nFORCE = 'stone'\n"), SA=0.1, FZ=4000.0)
    assert (caught.value.rule, caught.value.got) == ("unknown-unit", "stone")


def test_an_entry_of_unknown_dimension_is_named_on_leaving_its_units():
    _, findings = in_si(
        made("[UNITS]\nLENGTH='mm'\n[BOTTOMING_CURVE]\n{pen fz}\n10.5  0.0\n[OWN]\nHEIGHT=12\n")
    )
    assert [finding.rule for finding in findings] == ["tir-unit-kept"]
    assert "HEIGHT" in findings[0].message
    assert "BOTTOMING_CURVE" in findings[0].message


def test_a_file_comes_back_line_by_line():
    tir = made('[SHAPE]\n{radial width}\n 1.00  0.20 \n$---- bar\n[NAME]\nTEXT = "it\'s"\n')
    again = parse_tir(file_text(tir), where="x.tir")
    assert again == tir
    assert again.number("QUITE_OWN") == 7.25
    assert "$ stiffness" in file_text(tir)
    assert file_text(again) == file_text(tir)


def test_side_is_never_mirrored():
    left = made()
    right = parse_tir(file_text(left).replace("RIGHT", "LEFT"))
    at = {"SA": 0.1, "FZ": 4000.0, "IA": 0.05}
    assert evaluate_tir(left, **at)[0].FY == evaluate_tir(right, **at)[0].FY


def test_known_signs_cornering_and_aligning_stiffness():
    # ISO-W: FY falls and MZ rises with the slip angle; K = PKY1 F0 sin(2 arctan(1 / PKY2)), trail 30 mm.
    forces, _ = evaluate_tir(made(), SA=np.array([-1e-6, 1e-6]), FZ=4000.0)
    K = np.diff(forces.FY)[0] / 2e-6
    assert K == pytest.approx(-20 * 4000 * math.sin(2 * math.atan(1 / 1.6)), rel=1e-6)
    assert np.diff(forces.MZ)[0] / 2e-6 == pytest.approx(-0.03 * K, rel=1e-6)


def test_beyond_the_ranges_is_evaluated_with_a_finding():
    inside, none = evaluate_tir(made(), SA=0.2, FZ=4000.0)
    outside, findings = evaluate_tir(made(), SA=np.array([0.2, 0.3]), FZ=4000.0)
    assert [finding.level for finding in none] == ["note"]  # no longitudinal coefficients
    ranges = [finding for finding in findings if finding.rule == "tir-range"]
    assert len(ranges) == 1
    assert "1 of 2 rows" in ranges[0].message
    assert outside.FY[0] == inside.FY
    assert abs(outside.FY[1]) != abs(outside.FY[0])  # not held at the limit


def test_pressure_needs_NOMPRES():
    at = {"SA": 0.1, "FZ": 4000.0, "P": 2.5e5}
    plain, findings = evaluate_tir(made(), **at)
    assert "tir-no-pressure" in {finding.rule for finding in findings}
    own = "[OPERATING_CONDITIONS]\nNOMPRES = 200000\nINFLPRES = 250000\n[LATERAL_COEFFICIENTS]\nPPY3 = 0.4\n"
    high, _ = evaluate_tir(made(own), **at)
    assert abs(high.FY) > abs(plain.FY)
    unsaid, findings = evaluate_tir(made(own), SA=0.1, FZ=4000.0)
    assert unsaid.FY == high.FY
    assert "tir-pressure" in {finding.rule for finding in findings}


@pytest.mark.parametrize(
    ("old", "new", "error", "rule"),
    [
        ("FNOMIN = 4000", "", ConfigError, "tir-missing-key"),
        ("UNLOADED_RADIUS = 0.3", "", ConfigError, "tir-missing-key"),
        ("FNOMIN = 4000", "FNOMIN = 0", ConfigError, "tir-number"),
        ("PCY1 = 1.3", "PCY1 = 1,3", CellError, "tir-number"),
        ("PCY1 = 1.3", "PCY1 =", CellError, "tir-number"),
        ("PCY1 = 1.3", "PCY1 = nan", CellError, "tir-number"),
        ("PCY1 = 1.3", "PCY1 = 1e999", CellError, "tir-number"),
        ("PCY1 = 1.3", "PCY1 = 1.3\nPCY1 = 1.4", CellError, "tir-doubled"),
        ("FNOMIN = 4000", "FNOMIN = inf", CellError, "tir-number"),
        ("LFZ0 = 1", "LFZ0 = 1\nLFZO = 2", CellError, "tir-doubled"),
    ],
)
def test_bad_entries_are_refused_with_all_parts(old, new, error, rule):
    with pytest.raises(error) as caught:
        evaluate_tir(parse_tir(BODY.format(**SI).replace(old, new), where="x.tir"), SA=0.1, FZ=4000.0)
    assert (caught.value.rule, caught.value.exit_code) == (rule, 2)
    assert "x.tir" in caught.value.where
    assert caught.value.expected
    assert caught.value.next_step


def test_a_lacking_coefficient_is_said():
    _, findings = evaluate_tir(parse_tir(BODY.format(**SI).replace("PKY1", "PKYX")), SA=0.1, FZ=4000.0)
    assert [f.message for f in findings if f.level == "warning"] == [
        "the file has no PKY1, which count as zero: FY is doubtful"
    ]


def test_binary_and_missing_files(tmp_path):
    path = tmp_path / "x.tir"
    path.write_bytes(b"[MODEL]\x00\x01")
    for one in (path, tmp_path / "none.tir", tmp_path):
        with pytest.raises(UnreadableError):
            read_tir(one)
    path.write_bytes("[MODEL]\nFITTYP = 61 $ gr\xf6\xdfe\n".encode("latin-1"))
    assert read_tir(path).version == "6.x"


def test_an_overflow_is_an_error_not_a_number():
    text = BODY.format(**SI) + "[LONGITUDINAL_COEFFICIENTS]\nPCX1=1.5\nPDX1=1\nPKX1=20\nPKX3=1e5\n"
    with pytest.raises(ToolkitError) as caught:
        evaluate_tir(parse_tir(text, where="x.tir"), SA=0.0, FZ=9e4, KAPPA=0.1)
    assert caught.value.rule == "not-finite"


@pytest.mark.skipif(not MAKER.exists(), reason="the shared data folder is not here")
@pytest.mark.parametrize("psi", ["40", "60", "70", "95"])
def test_a_makers_file_gives_its_friction_and_stiffness(psi):
    # Limits of the equations at the nominal load, from the coefficients that the maker prints.
    tir = read_tir(MAKER / f"335_65R22_5_G275MSA_{psi}psi.tir")
    p, F0 = tir.coefficients(), tir.number("FNOMIN")
    assert tir.version == "5.2"
    SA = np.radians(np.linspace(-20, 20, 4001))
    forces, _ = evaluate_tir(tir, SA=SA, FZ=F0)
    slope = np.gradient(forces.FY, SA).min()
    # K is the slope at x = 0, that is at SA = -(PHY1); E with a jump of sign there leaves it alone.
    K = p["PKY1"] * F0 * math.sin(2 * math.atan(1 / p["PKY2"]))
    at = np.argmin(np.abs(np.tan(SA) + p["PHY1"]))
    assert np.gradient(forces.FY, np.tan(SA))[at] == pytest.approx(K, rel=2e-3)
    assert slope < 0
    peak = np.abs(forces.FY - p["PVY1"] * F0).max()
    assert peak <= abs(p["PDY1"]) * F0 * (1 + 1e-9)
    assert file_text(parse_tir(file_text(tir))) == file_text(tir)


def test_a_file_without_its_kind_says_so():
    text = "[MODEL]\nPROPERTY_FILE_FORMAT = 'MF_61'\n"
    with pytest.raises(ConfigError) as caught:
        _ = parse_tir(text, where="x.tir").version
    assert caught.value.got == "no FITTYP, and PROPERTY_FILE_FORMAT = MF_61"


PRESSED = "[UNITS]\nLENGTH='{length}'\nFORCE='{force}'\n{more}[OPERATING_CONDITIONS]\nNOMPRES = {pressure}\n"


@pytest.mark.parametrize(
    ("length", "force", "more", "pressure", "expected"),
    [
        ("meter", "newton", "", 220e3, 220e3),
        ("mm", "newton", "", 0.22, 220e3),
        ("inch", "pound_force", "", 31.908302, 220e3),
        ("inches", "lbf", "", 31.908302, 220e3),
        ("feet", "lbf", "", 4594.7956, 220e3),
        ("mm", "newton", "PRESSURE='bar'\n", 2.2, 220e3),
        ("meter", "newton", "PRESSURE='kPa'\n", 220, 220e3),
    ],
)
def test_a_pressure_without_a_unit_of_its_own_counts_in_force_over_area(
    length, force, more, pressure, expected
):
    """1 lbf/in^2 = 6894.757 Pa, 1 lbf/ft^2 = 47.88026 Pa (NIST SP 811, appendix B.8)."""
    size = {"meter": 1.0, "mm": 1e3, "inch": 1 / 0.0254, "inches": 1 / 0.0254, "feet": 1 / 0.3048}[length]
    load = 4000 / (1.0 if force == "newton" else 4.4482216)
    units = PRESSED.format(length=length, force=force, more=more, pressure=pressure)
    tir = made(units, radius=0.3 * size, load=load)
    assert si_number(tir, "NOMPRES") == pytest.approx(expected, rel=1e-6)
    converted, _ = in_si(tir)
    assert si_number(converted, "NOMPRES") == pytest.approx(expected, rel=1e-6)
    _, findings = evaluate_tir(tir, SA=0.1, FZ=4000.0)
    rules = [finding.rule for finding in findings]
    assert "tir-nominal-pressure" not in rules
    assert ("tir-pressure-unit" in rules) == (not more and (length, force) != ("meter", "newton"))


@pytest.mark.parametrize("pressure", [2.2, 220, 31.9, 2.2e8])
@pytest.mark.parametrize("key", ["NOMPRES", "INFLPRES"])
def test_a_pressure_of_no_tire_is_told_where_the_file_is_evaluated_and_converted(tmp_path, key, pressure):
    from toolkit.lab.tire_tests.convert import convert

    text = PRESSED.format(length="meter", force="newton", more="", pressure=pressure).replace("NOMPRES", key)
    _, findings = evaluate_tir(made(text), SA=0.1, FZ=4000.0)
    assert "tir-nominal-pressure" in [finding.rule for finding in findings]
    source = tmp_path / "x.tir"
    source.write_text(file_text(made(text)))
    converted = convert(source, tmp_path / "y.tir", axes="ISO-W", resolve=lambda _path: None)
    (finding,) = converted.findings
    assert finding.rule == "tir-nominal-pressure"
    assert key in finding.message


def test_masses_and_inertias_leave_their_units():
    units = "[UNITS]\nLENGTH='mm'\nFORCE='newton'\nMASS='tonne'\n"
    inertia = "[INERTIA]\nMASS = 0.0093\nBELT_MASS = 0.007\nIXX = 0.4\nIYY = 0.8\nGRAVITY = -9810\n"
    converted, kept = in_si(made(units + inertia, radius=300))
    assert kept == ()
    numbers = list(converted.section("INERTIA").values())
    assert numbers == pytest.approx([9.3, 7.0, 4e-4, 8e-4, -9.81])


def test_a_file_in_utf_16_is_read(tmp_path):
    path = tmp_path / "x.tir"
    path.write_bytes(file_text(made()).encode("utf-16"))
    assert read_tir(path).sections == made().sections
