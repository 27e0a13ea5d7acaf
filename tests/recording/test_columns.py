"""Headers to channels: any order, case and blanks tolerated; nothing is guessed."""

from __future__ import annotations

import pytest

from tests.recording.format_checks import whole
from tests.recording.workbook_factory import HEADERS
from toolkit.errors import ColumnError
from toolkit.machine import load_machine
from toolkit.recording.columns import assign_columns

M15, VIRTUAL = load_machine("m15"), load_machine("m15-virtual")


def assigned(headers, machine=M15):
    return {one.symbol: one for one in assign_columns(headers, machine, where="file")}


def refused(headers, machine=M15):
    with pytest.raises(ColumnError) as caught:
        assign_columns(headers, machine, where="file")
    assert caught.value.where == "file"
    return whole(caught.value)


def test_the_machines_own_headers():
    found = assigned(HEADERS)
    assert {symbol: one.unit for symbol, one in found.items()} == {
        "FZ": "lbf", "D52": "lbf", "D51": "lbf", "E5": "lbf", "SA": "deg", "FY": "lbf", "MZ": "lbf*ft",
    }  # fmt: skip
    assert [one.index for one in found.values()] == list(range(7))
    assert assigned(HEADERS, VIRTUAL)["E5"].unit == "mV/V"


def test_any_order_case_and_blanks():
    found = assigned([f"  {header.upper().replace(' ', '   ')} " for header in reversed(HEADERS)])
    assert found["FZ"].index == 6
    assert found["MZ"].index == 0


def test_acquired_columns_are_optional_and_the_rest_is_not():
    assert set(assigned(HEADERS[:5])) == {"FZ", "D52", "D51", "E5", "SA"}
    for missing in range(5):
        error = refused([h for i, h in enumerate(HEADERS) if i != missing])
        assert error.rule == "missing-column"
        assert HEADERS[missing] in error.what


def test_doubled_columns_name_both():
    error = refused([*HEADERS, "FZ [N]"])
    assert error.rule == "doubled-column"
    assert "FZ load" in error.got
    assert "FZ [N]" in error.got
    assert refused([*HEADERS, "Fy"]).rule == "doubled-column"
    assert refused([*HEADERS, "TEMP [degC]", "temp [K]"]).rule == "doubled-column"


def test_a_printed_unit_wins():
    found = assigned(["FZ load [kN]", "D52 [N]", *HEADERS[2:4], "SA [rad]", "Mz [N·m]", "fy [N]"])
    assert (found["FZ"].unit, found["D52"].unit, found["D51"].unit) == ("kN", "N", "lbf")
    assert (found["SA"].unit, found["MZ"].unit, found["FY"].unit) == ("rad", "N*m", "N")


@pytest.mark.parametrize("header", ["FZ (kN)", "FZ load / kN", "fz load in kN", "FZ_kN", "FZ load (kN)"])
def test_a_unit_is_read_in_the_forms_of_other_laboratories(header):
    assert assigned([header, *HEADERS[1:]])["FZ"].unit == "kN"


@pytest.mark.parametrize(
    ("header", "place", "rule"),
    [
        ("D51 [mV/V]", 2, "unit-dimension"),
        ("D51 [count]", 2, "unit-dimension"),
        ("SA [N]", 4, "unit-dimension"),
        ("Mz [N]", 6, "unit-dimension"),
        ("FZ [furlongs per]", 0, "unknown-unit"),
        ("FZ", 0, "unknown-unit"),
        ("FZ (load)", 0, "unknown-unit"),
        ("D52 (Filtred)", 1, "unknown-unit"),
        ("D52", 1, "unknown-unit"),
    ],
)
def test_units_are_never_guessed(header, place, rule):
    error = refused([header if i == place else own for i, own in enumerate(HEADERS)])
    assert error.rule == rule
    assert header in error.what


def test_a_misspelt_header_names_the_nearest():
    error = refused([HEADERS[0], "D52 (Filtred)", *HEADERS[2:]])
    assert error.expected == "'D52 (Filtered)'"


def test_counts_are_not_a_bridge_ratio():
    assert (
        refused(["D51 [count]", *(h for h in HEADERS if not h.startswith("D51"))], VIRTUAL).rule
        == "unit-dimension"
    )


def test_extra_columns_need_a_unit():
    found = assigned(
        [
            *HEADERS,
            "t [s]",
            "T [degC]",
            "TIRE_ANGLE [deg]",
            "V [km/h]",
            "IA [deg]",
            "TEMP [degC]",
            "count [1]",
            "",
        ]
    )
    assert {s: found[s].role for s in ("t", "T", "TIRE_ANGLE", "V", "IA", "TEMP", "count")} == {
        "t": "time", "T": "covariate", "TIRE_ANGLE": "angle", "V": "covariate", "IA": "covariate",
        "TEMP": "covariate", "count": "covariate",
    }  # fmt: skip
    assert found["TEMP"].unit == "degC"
    assert assigned([*HEADERS, "Time [ms]"])["t"].unit == "ms"
    assert refused([*HEADERS, "Temperature"]).rule == "unknown-unit"
    assert refused([*HEADERS, "t [km/h]"]).rule == "unit-dimension"
    assert refused([*HEADERS, "[N]"]).rule == "unknown-unit"
    assert refused([*HEADERS, "x" * 10_000]).rule == "unknown-unit"
    assert refused([]).rule == "missing-column"
