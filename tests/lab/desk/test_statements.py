"""The statements of a session as fields: every declared entry, and a change of one that changes no other."""

from __future__ import annotations

import tomllib

import pytest

from toolkit.calibration.session.session_file import SessionFile
from toolkit.errors import ConfigError
from toolkit.lab.desk.statements import Statement, statement_groups, with_statement

SESSION = """# of the hub
schema = 1
instrument = "hub"  # the left one
date = 2026-03-02
operator = "A"
indications = ["S1", "S2"]
loads = ["FY"]
data = "loads.csv"
degree = 3

[cells.S1]
serial = "77"   # on its plate
resolution = { value = 0.001, unit = "mV/V" }
[reference]
standard = "R"

[[polarity]]
load = "FY"
value = { value = 500, unit = "N" }
indications = { S1 = { value = 1, unit = "mV/V" }, S2 = { value = 2, unit = "mV/V" } }
"""


def statements(session: str = SESSION) -> dict[str, Statement]:
    return {each.name: each for group in statement_groups(session, SessionFile) for each in group.statements}


def test_every_entry_is_a_field_with_what_the_declaration_says() -> None:
    found = statements()
    assert {name: found[name].text for name in ("instrument", "date", "indications", "degree", "method")} == {
        "instrument": "hub", "date": "2026-03-02", "indications": "S1, S2", "degree": "3", "method": "",
    }  # fmt: skip
    assert (found["degree"].form, found["degree"].low, found["degree"].high) == ("number", 1, 9)
    assert found["method"].choices == ("ols", "wls", "gls", "odr")
    assert (found["date"].form, found["date"].required) == ("date", True)
    assert found["cells.S1.serial"].text == "77"
    assert found["cells.S1.resolution"].text == '{ value = 0.001, unit = "mV/V" }'
    assert found["cells.S2.serial"].text == ""
    assert found["reference.uncertainty.FY.k"].help == "coverage factor"
    assert found["polarity.0.load"].text == "FY"
    assert [group.title for group in statement_groups(SESSION, SessionFile)][-4:] == [
        "polarity 1", "polarity 2", "certificate", "standard",
    ]  # fmt: skip
    assert found["certificate.country"].expected == 'an ISO 3166-1 code, such as "US"'


@pytest.mark.parametrize(
    ("name", "typed", "line"),
    [
        ("operator", "B \"C\"", 'operator = "B \\"C\\""'), ("date", "2026-04-01", "date = 2026-04-01"),
        ("degree", "4", "degree = 4"), ("loads", "FY, MZ", 'loads = ["FY", "MZ"]'),
        ("method", "wls", 'method = "wls"'), ("cells.S1.serial", "78", 'serial = "78"'),
        ("cells.S1.excitation", "2,5", "excitation = 2.5"),
        ("certificate.interval_agreed", "true", "interval_agreed = true"),
        ("cells.S2.resolution", '{ value = 1, unit = "mV" }', 'resolution = { value = 1, unit = "mV" }'),
        ("reference.uncertainty.FY.U", "1.5", "U = 1.5"), ("polarity.0.tolerance", "0.1", "tolerance = 0.1"),
        ("polarity.1.load", "FY", 'load = "FY"'), ("creep.0.seconds", "30", "seconds = 30"),
        ("degree", "three", 'degree = "three"'),
    ],
)  # fmt: skip
def test_a_change_is_in_its_own_line_and_nothing_else_changes(name: str, typed: str, line: str) -> None:
    after = with_statement(SESSION, SessionFile, name, typed)
    assert line in after.splitlines()
    before_lines, after_lines = set(SESSION.splitlines()), set(after.splitlines())
    assert len(before_lines - after_lines) <= 1
    assert len(after_lines - before_lines - {line}) <= 1  # the header of a table that was not there
    assert statements(after)[name].text == typed.replace("2,5", "2.5")
    rest = {key: each.text for key, each in statements(after).items() if key != name}
    known = {key: each.text for key, each in statements().items() if key != name}
    assert {key: rest[key] for key in known} == known


def test_an_empty_field_leaves_the_entry_out() -> None:
    after = with_statement(SESSION, SessionFile, "degree", " ")
    assert after == SESSION.replace("degree = 3\n", "")
    assert with_statement(after, SessionFile, "degree", "") == after


def test_an_entry_of_several_lines_is_changed_as_a_whole() -> None:
    text = SESSION.replace('["S1", "S2"]', '[\n  "S1",\n  "S2",\n]')
    after = with_statement(text, SessionFile, "indications", "S1, S2, S3")
    assert tomllib.loads(after) == tomllib.loads(SESSION) | {"indications": ["S1", "S2", "S3"]}


def test_a_session_that_is_no_toml_has_no_fields_and_none_is_changed() -> None:
    assert statement_groups("a = [", SessionFile) == ()
    for session, name in (("a = [", "operator"), (SESSION, "cells.S9.serial"), (SESSION, "__class__")):
        with pytest.raises(ConfigError) as caught:
            with_statement(session, SessionFile, name, "x")
        assert caught.value.where == name


@pytest.mark.parametrize("typed", ['"', "'''", "x\n[cells]", "{ a = ", "\\", "\x00", "1e999", "nan"])
def test_whatever_is_typed_stays_in_its_entry(typed: str) -> None:
    for name in ("operator", "degree", "cells.S1.resolution", "loads"):
        after = tomllib.loads(with_statement(SESSION, SessionFile, name, typed))
        known = tomllib.loads(SESSION)
        key = name.partition(".")[0]
        assert {k: v for k, v in after.items() if k != key} == {k: v for k, v in known.items() if k != key}
