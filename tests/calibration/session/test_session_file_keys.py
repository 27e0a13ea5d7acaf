"""Every key of SESSION.toml is judged when the session is read, and all faults are told at once."""

from __future__ import annotations

import datetime as dt
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_session
from toolkit.calibration.session import read
from toolkit.calibration.session.certificate import TEXTS
from toolkit.calibration.session.session_file import SessionFile, session_faults
from toolkit.declared import table_of
from toolkit.errors import ConfigError
from toolkit.report.certificate.collect import collect
from toolkit.report.style import Style

Make = Callable[..., Path]
CERTIFICATE = "[certificate]\n{}\n"


def refused(tmp_path: Path, path: Path) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    assert all(caught.value.as_dict().values()), caught.value.as_dict()
    assert caught.value.exit_code == 2
    assert "othing was written" in str(caught.value.next_step)
    assert not (tmp_path / "cal").exists()
    return caught.value


@pytest.mark.parametrize(
    ("entry", "where", "expected"),
    [
        ('custmer = "x"', "certificate", "customer"),
        ('Number = "x"', "certificate", "number"),
        ("number = true", "certificate.number", "a text"),
        ('customer = " "', "certificate.customer", "a text"),
        ('method = ["a"]', "certificate.method", "a text"),
        ('received = "soon"', "certificate.received", "a date such as 2026-03-31"),
        ("received = 2026-03-01T10:00:00", "certificate.received", "a date such as 2026-03-31"),
        ("due = 20260301", "certificate.due", "a date such as 2026-03-31"),
        ('interval_agreed = "yes"', "certificate.interval_agreed", "true or false"),
        ('decision_rule = "by eye"', "certificate.decision_rule", "simple | guard_band"),
        ('country = "Germany"', "certificate.country", 'an ISO 3166-1 code, such as "US"'),
        ('country = "us"', "certificate.country", 'an ISO 3166-1 code, such as "US"'),
    ],
)
def test_a_certificates_entries_are_judged_before_anything_is_written(
    tmp_path: Path, make_session: Make, entry: str, where: str, expected: str
) -> None:
    path = make_session(tail=CERTIFICATE.format(entry))
    error = refused(tmp_path, path)
    assert error.where == f"{path}: {where}"
    assert error.expected == expected


def test_a_certificate_that_is_no_table(tmp_path: Path, make_session: Make) -> None:
    error = refused(tmp_path, make_session(certificate='"CAL-17"'))
    assert "a table [certificate] with number, laboratory" in str(error.expected)


def test_what_may_be_stated_is_taken(tmp_path: Path, make_session: Make) -> None:
    texts = {key: f'"{key}"' for key in TEXTS} | {"number": "17", "country": '"DE"'}
    texts["decision_rule"] = '"guard band, w = U"'
    lines = [f"{key} = {value}" for key, value in texts.items()]
    lines += [f"{key} = 2026-03-01" for key in ("received", "due")] + ["interval_agreed = true"]
    record = calibrate(
        make_session(tail=CERTIFICATE.format("\n".join(lines))), Registry(tmp_path / "cal")
    ).record
    assert Registry(tmp_path / "cal").load(record.id) == record


def test_all_faults_are_told_at_once(tmp_path: Path, make_session: Make) -> None:
    path = make_session(
        operator="-", temprature="20", data="-", phase='"as_found"',
        tail='[cells.D51]\nserail = "1"\n[cells.D99]\nserial = "2"\n'
        "[reference.uncertainty]\nFY = { U = 1.0 }\n"
        '[certificate]\ncustmer = "x"\ndue = "soon"\n[[creep]]\nload = "FY"\nvalue = 1\n',
    )  # fmt: skip
    error = refused(tmp_path, path)
    assert error.where == str(path)
    told = [line.strip() for line in str(error.got).splitlines()]
    places = [line.split(" | ") for line in told if " | " in line]
    text = path.read_text().splitlines()
    assert [text[int(number) - 1] for number, _ in places] == [line for _, line in places]
    lines = [line for line in told if " | " not in line]
    assert error.what == f"{len(lines)} entries cannot be used"
    assert len(places) == len(lines) - 2  # what is missing at the top has no line
    assert lines == [
        "temprature: unknown key; did you mean 'temperature'?",
        "cells.D51.serail: unknown key; did you mean 'serial'?",
        "cells.D99: unknown key; known are D51, D52, E5",
        "reference.uncertainty.FY.k: missing; expected a positive number",
        "reference.uncertainty.FY.unit: missing; expected a unit of the load such as 'N', or '%' of the "
        "applied load",
        "certificate.custmer: unknown key; did you mean 'customer'?",
        'certificate.due: "soon" cannot be used; expected a date such as 2026-03-31',
        "creep[1].seconds: missing; expected seconds, zero or more",
        'operator: missing; expected a text: operator = "..."',
        'data: missing; expected the name of a file, such as data = "loads.csv" or "loads.xlsx"',
    ]


def test_a_key_that_stands_there_was_not_meant(tmp_path: Path, make_session: Make) -> None:
    # "dat" is as near to date, which is there, as to data.
    error = refused(tmp_path, make_session(data="-", dat='"loads.csv"'))
    assert (error.what, error.expected) == ("unknown key 'dat'", "data")


def test_a_misspelt_key_is_not_missing_too(tmp_path: Path, make_session: Make) -> None:
    error = refused(tmp_path, make_session(operator="-", operatr='"A"'))
    assert (error.what, error.rule) == ("unknown key 'operatr'", "unknown-key")


@pytest.mark.parametrize("key", [key for key in table_of(SessionFile).keys if key != "schema"])
def test_no_key_holds_whatever_is_written(tmp_path: Path, make_session: Make, key: str) -> None:
    # A moment is neither a text, a number, a name nor a table.
    changes = {"check": "-"} if key == "check" else {}
    refused(tmp_path, make_session(**(changes | {key: "2026-03-01T10:00:00"})))


def test_a_record_from_before_these_checks_is_read_and_says_what_it_does_not_print(
    tmp_path: Path, make_session: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    tail = CERTIFICATE.format('custmer = "x"\ndecision_rule = "by eye"\ncountry = "Germany"')
    registry = Registry(tmp_path / "cal")
    with monkeypatch.context() as before:
        before.setattr(read, "session_faults", lambda _: ())
        calibrate(make_session(tail=tail), registry)
    record = registry.load("hub-r1")
    assert fit_session(stored_session(registry.folder, record)).loads
    approve(registry, "hub-r1", in_force_from=dt.date(2026, 1, 5), checked_by="B")
    found = {one.rule: one.message for one in collect(registry, "hub-r1", Style()).findings}
    assert found["certificate-key"] == "'custmer' is not known and is not printed; did you mean 'customer'?"
    assert "by eye" in found["certificate-rule"]
    assert "Germany" in found["certificate-country"]


MISTYPED = """
model = "liner"
model = 1
degree = 2.5
degree = 10
method = "OLS"
drop = 1
drop = [1]
phase = "left"
cells.D51.serial = []
cells.D51.serial = 1.5
cells.D51.serial = true
standard.preloads = 100
reference.standard = "a\\u0000b"
customer.name = "a"
"""


@pytest.mark.parametrize("line", MISTYPED.split("\n")[1:-1])
def test_a_mistyped_entry_is_refused_by_its_key(line: str) -> None:
    text = 'instrument = "hub"\ndate = 2026-03-02\noperator = "a person"\ndata = "loads.csv"\n'
    text += 'indications = ["D51"]\nloads = ["FY"]\n'
    (fault,) = session_faults(tomllib.loads(text + line))
    key = line.partition(" = ")[0].split(".")
    assert list(fault.key)[: len(key)] == key or fault.key == (key[0],)
