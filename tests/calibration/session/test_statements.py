"""What a session states beside its data: units of another dimension, paths, doubled keys, names of errors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.read import read_session
from toolkit.calibration.session.statements import statements_of
from toolkit.errors import ConfigError, SessionError, ToolkitError

Make = Callable[..., Path]
UNCERTAINTY = "[reference.uncertainty]\nFY = {{ {} }}\n"
CELL = "[cells.D51]\n{}\n"
CHECK = '[check]\nfile = "check.csv"\ntolerance = {{ {} }}\n'


def refused(tmp_path: Path, path: Path, rule: str) -> ToolkitError:
    """Return the error of a session that must be refused, whole in its parts, with nothing written."""
    folder = tmp_path / "cal"
    with pytest.raises(ToolkitError) as caught:
        calibrate(path, Registry(folder))
    error = caught.value
    assert all(error.as_dict().values()), error.as_dict()
    assert (error.exit_code, error.rule) == (2, rule)
    assert not list(folder.rglob("*"))
    return error


@pytest.mark.parametrize(
    ("tail", "rule"),
    [
        (UNCERTAINTY.format('U = 1.0, k = 2, unit = "degC"'), "unit-dimension"),
        (UNCERTAINTY.format('U = 1.0, k = 2, unit = "lbf*ft"'), "unit-dimension"),
        (UNCERTAINTY.format('U = 1.0, k = 2, unit = "zork"'), "unknown-unit"),
        (UNCERTAINTY.format("U = 1.0, k = 2"), "no-unit"),
        (UNCERTAINTY.format('U = "1", k = 2, unit = "N"'), "session"),
        (UNCERTAINTY.format('U = -1.0, k = 2, unit = "N"'), "session"),
        (UNCERTAINTY.format('U = 1.0, k = 0, unit = "N"'), "session"),
        (UNCERTAINTY.format('U = 1.0, unit = "N"'), "session"),
        ("[reference.uncertainty]\nFY = 1.0\n", "session"),
        (CELL.format('resolution = { value = 1e-6, unit = "N" }'), "unit-dimension"),
        (CELL.format('u = { value = 1e-6, unit = "N" }'), "unit-dimension"),
        (CELL.format('u = "small"'), "session"),
        (CELL.format('excitation = { value = 10, unit = "N" }'), "unit-dimension"),
        (CELL.format('shunt_expected = { value = 1, unit = "N" }'), "unit-dimension"),
        (CELL.format('shunt_expected = { value = 1, unit = "zork" }'), "unknown-unit"),
        (CELL.format("excitation = true"), "session"),
        (CELL.format("resolution = { value = 1 }"), "no-unit"),
        (CELL.format("resolution = { value = 1, unit = 5 }"), "no-unit"),
        (CELL.format('resolution = { value = "a", unit = "mV/V" }'), "wrong-value"),
        (CELL.format('scale = { value = 1, unit = "zork" }'), "unknown-unit"),
    ],
)
def test_stated_units_of_another_dimension(tmp_path: Path, make_session: Make, tail: str, rule: str) -> None:
    refused(tmp_path, make_session(tail=tail), rule)


@pytest.mark.parametrize(
    ("tolerance", "rule"),
    [
        ('FY = { value = 1, unit = "lbf*ft" }', "unit-dimension"), ('FY = { value = 1, unit = "K" }',
        "unit-dimension"),
        ("FY = 1.0", "no-unit"), ('FY = { value = 0, unit = "N" }', "session"),
        ('D51 = { value = 1, unit = "mV/V" }', "unknown-key"),
    ],
)  # fmt: skip
def test_tolerances(tmp_path: Path, make_session: Make, tolerance: str, rule: str) -> None:
    refused(tmp_path, make_session(check="-", tail=CHECK.format(tolerance)), rule)


def test_an_uncertainty_column_in_another_dimension(tmp_path: Path, make_session: Make) -> None:
    path = make_session()
    data = path.parent / "loads.csv"
    lines = data.read_text().splitlines()
    rows = [line + ("" if at else ",u_FY [N*m]") + (",0.5" if at else "") for at, line in enumerate(lines)]
    data.write_text("\n".join(rows) + "\n")
    refused(tmp_path, path, "unit-dimension")


def test_what_a_laboratory_states_is_taken(tmp_path: Path, make_session: Make) -> None:
    tail = UNCERTAINTY.format('U = 0.5, k = 2, unit = "N"') + CELL.format(
        'serial = "A1"\nresolution = { value = 1e-9, unit = "V/V" }\nscale = 1.0\n'
        'excitation = { value = 10, unit = "V" }\nshunt_expected = { value = 1.0, unit = "mV/V" }\nu = 1e-5'
    )
    record = calibrate(make_session(tail=tail), Registry(tmp_path / "cal")).record
    assert Registry(tmp_path / "cal").load(record.id) == record


@pytest.mark.parametrize("key", ["data", "check"])
def test_a_data_file_outside_the_session_is_not_read(tmp_path: Path, make_session: Make, key: str) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("hidden words,of another file\n")
    path = make_session()
    (path.parent / "link.csv").symlink_to(secret)
    for name in (str(secret), "../secret.csv", "sub/../../secret.csv", "link.csv"):
        error = refused(tmp_path, make_session(**{key: f'"{name}"'}), "outside")
        assert "hidden" not in str(error)
    (path.parent / "sub").mkdir()
    (path.parent / "sub" / "loads.csv").write_bytes((path.parent / "loads.csv").read_bytes())
    calibrate(make_session(data='"sub/../sub/loads.csv"'), Registry(tmp_path / "cal"))


def test_check_as_a_value_and_as_a_table(tmp_path: Path, make_session: Make) -> None:
    tail = '[check]\ntolerance = { FY = { value = 1, unit = "lbf" } }\n'
    error = refused(tmp_path, make_session(tail=tail), "not-toml")
    assert "[check]" in str(error)
    assert 'file = "' in str(error.next_step)
    # The same without the value is read, and means check.csv beside the session.
    made = calibrate(make_session(check="-", tail=tail), Registry(tmp_path / "cal"))
    assert made.record.data_file("check") is not None
    assert made.record.load("FY").tolerance == 1.0


def test_other_text_that_is_no_toml(tmp_path: Path, make_session: Make) -> None:
    refused(tmp_path, make_session(tail="[[[\n"), "not-toml")
    refused(tmp_path, make_session(tail='operator = "again"\n'), "not-toml")
    refused(tmp_path, tmp_path / "none.toml", "no-file")


def test_loads_that_only_vary_together_are_told_so(tmp_path: Path, make_session: Make) -> None:
    values = hub_data(60, 1)
    values[:, 4] = 0.2 * values[:, 3]
    error = refused(tmp_path, make_session(values), "not-spanning")
    assert "FY, MZ only vary together" in error.what
    assert "missing" not in str(error)
    values = hub_data(60, 1)
    values[:, 4:] = 0.0
    assert "MZ, MX are missing" in refused(tmp_path, make_session(values), "not-spanning").what


def test_a_certificates_number_needs_no_quotes(tmp_path: Path, make_session: Make) -> None:
    tail = "[reference]\nstandard = 7\ncertificate = 2025118\n"
    made = calibrate(make_session(tail=tail), Registry(tmp_path / "cal"))
    told = statements_of(made.record).reference
    assert (told.standard, told.certificate) == ("7", "2025118")


def test_rows_are_weighed_by_their_own_uncertainty_alone(make_session: Make) -> None:
    tail = '\n[reference.uncertainty]\nFY = { U = 0.1, k = 2, unit = "%" }\n'
    with pytest.raises(SessionError, match="u_FY, u_MZ, u_MX are not in the data") as caught:
        read_session(make_session(method='"wls"', tail=tail))
    assert "[reference.uncertainty]" in str(caught.value)
    assert 'method = "ols"' in str(caught.value)


def test_an_instrument_that_no_file_can_be_named_after_is_refused(make_session: Make) -> None:
    assert read_session(make_session(instrument=f'"{"a" * 200}"')).instrument == "a" * 200
    with pytest.raises(ConfigError, match="200 at most"):
        read_session(make_session(instrument=f'"{"a" * 201}"'))
