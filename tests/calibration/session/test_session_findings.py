"""Rows that repeat, check loads beyond the fit, and uncertainties of the reference as they are stated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.fit.session_fit import session_statements
from toolkit.calibration.registry.candidate import Candidate, calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.known_errors import known_errors
from toolkit.calibration.session.read import Session, read_session
from toolkit.calibration.session.statements import Reference, statements_of
from toolkit.errors import ToolkitError
from toolkit.findings import Finding
from toolkit.report.certificate.content import traceability

Make = Callable[..., Path]
UNCERTAINTY = "[reference.uncertainty]\nFY = {{ {} }}\n"


def made(tmp_path: Path, path: Path) -> Candidate:
    return calibrate(path, Registry(tmp_path / "cal"))


def of(candidate: Candidate, rule: str) -> list[Finding]:
    return [one for one in candidate.findings if one.rule == rule]


def test_repeated_rows_are_named_and_few_of_them_are_a_note(tmp_path: Path, make_session: Make) -> None:
    values = hub_data(60, 1)
    values[[20, 40]] = values[[4, 4]]
    (one,) = of(made(tmp_path, make_session(values)), "duplicates")
    assert one.level == "note"
    assert "2 of 60 rows" in one.message
    assert "rows 21 = 5, 41 = 5" in one.message
    many = np.vstack([hub_data(60, 1), hub_data(60, 1)[:20]])
    (one,) = of(made(tmp_path, make_session(many, name="many")), "duplicates")
    assert one.level == "warning"
    assert "20 of 80 rows (25 %)" in one.message
    assert "61 = 1, 62 = 2" in one.message
    assert "70 = 10 and 10 more" in one.message
    check = hub_data(20, 2)
    check[8] = check[0]
    (one,) = of(made(tmp_path, make_session(check_rows=check, name="check")), "duplicates")
    assert (one.level, one.where) == ("note", "SESSION.toml, check loads")
    assert "rows 9 = 1" in one.message


def test_check_loads_beyond_what_was_fitted_say_so(tmp_path: Path, make_session: Make) -> None:
    rows, check = hub_data(60, 1, noise=0.0), hub_data(60, 1, noise=0.0)[:4]
    largest = int(np.abs(rows[:, 3]).argmax())
    # Twice the largest load, and the largest load but for half its tolerance of 0.1 %.
    check[1] = 2 * rows[largest] - rows[[largest]] * 0
    check[1, :3] = 2 * (rows[largest, :3] - [0.012, -0.008, 0.02]) + [0.012, -0.008, 0.02]
    check[3] = rows[largest]
    check[3, 3] *= 1.0005
    found = of(made(tmp_path, make_session(rows, check_rows=check)), "check-beyond-range")
    assert [one.where for one in found] == ["check row 2"]
    assert f"FY = {check[1, 3]:.6g} lbf (fitted: " in found[0].message
    assert found[0].level == "note"


def reference(make_session: Make, entry: str) -> tuple[Session, Reference]:
    session = read_session(make_session(tail=UNCERTAINTY.format(entry)))
    return session, session_statements(session).reference


def test_a_relative_uncertainty_is_that_share_of_each_load(tmp_path: Path, make_session: Make) -> None:
    session, stated = reference(make_session, 'U = 0.05, k = 2, unit = "%"')
    largest = float(np.abs(session.table.column("FY")).max())
    # U/k of 0.05 % with k = 2 is 0.025 % of the load, whatever its sign.
    np.testing.assert_allclose(stated.u_at("FY", [-200.0, 0.0, 400.0]), [0.05, 0.0, 0.1], rtol=1e-14, atol=0)
    assert stated.u("FY") == pytest.approx(2.5e-4 * largest, rel=1e-14)
    assert stated.uncertainties[0].relative == pytest.approx(5e-4, rel=1e-14)
    assert stated.u_at("MZ", 10.0) is None
    record = made(tmp_path, make_session(tail=UNCERTAINTY.format('U = 500, k = 2, unit = "ppm"'))).record
    again = statements_of(record).reference
    assert again.u("FY") == pytest.approx(stated.u("FY"), rel=1e-14)
    assert Registry(tmp_path / "cal").load(record.id) == record


def test_a_constant_uncertainty_is_the_same_at_every_load(make_session: Make) -> None:
    _, stated = reference(make_session, 'U = 1.0, k = 2, unit = "N"')
    u = 0.5 / 4.4482216152605  # one pound-force is 0.45359237 kg times 9.80665 m/s2
    np.testing.assert_allclose(stated.u_at("FY", [-200.0, 0.0]), [u, u], rtol=1e-14)
    assert stated.uncertainties[0].relative is None


def test_methods_take_a_relative_uncertainty_row_by_row(make_session: Make) -> None:
    cells = "".join(f"[cells.{name}]\nu = 1e-5\n" for name in ("D51", "D52", "E5"))
    tail = UNCERTAINTY.format('U = 0.05, k = 2, unit = "%"')
    session = read_session(make_session(tail=cells + tail))
    errors = known_errors("odr", session_statements(session), session.table, "FY", "S")
    assert errors.u is not None
    np.testing.assert_allclose(errors.u, 2.5e-4 * np.abs(session.table.column("FY")), rtol=1e-14)
    values = hub_data(60, 1)
    values[3, 3] = 0.0
    zero = read_session(make_session(values, tail=cells + tail, name="zero"))
    with pytest.raises(ToolkitError, match=r"reference\.uncertainty\.FY") as caught:
        known_errors("odr", session_statements(zero), zero.table, "FY", "S")
    assert "0 in row 4" in str(caught.value.got)
    assert "u_FY" in str(caught.value.expected)
    constant = '[reference]\nshared_group = { error = "constant" }\n' + tail
    shared = read_session(make_session(tail=constant, name="shared"))
    with pytest.raises(ToolkitError, match=r"reference\.uncertainty\.FY"):
        known_errors("gls", session_statements(shared), shared.table, "FY", "S")


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('U = 0.05, k = 2, unit = "lbf*ft"', ("a unit of force", "'lbf'", "'%'")),
        ('U = 0.05, k = 2, unit = "%/K"', ("a unit of force", "'%'")),
        ("U = 0.05, k = 2", ("a unit of the load", "'%'")),
        ('u = 0.05, k = 2, unit = "%"', ("U",)),
    ],
)
def test_what_is_allowed_is_named(make_session: Make, entry: str, words: tuple[str, ...]) -> None:
    with pytest.raises(ToolkitError) as caught:
        read_session(make_session(tail=UNCERTAINTY.format(entry)))
    for word in words:
        assert word in str(caught.value.expected)
    assert all(caught.value.as_dict().values())


def test_an_uncertainty_column_names_what_is_allowed(make_session: Make) -> None:
    path = make_session()
    lines = (path.parent / "loads.csv").read_text().splitlines()
    for header, word in (("u_FY [%]", "[reference.uncertainty] FY"), ("u_FY [N*m]", "'lbf'")):
        rows = [f"{line},{header if at == 0 else 0.5}" for at, line in enumerate(lines)]
        (path.parent / "loads.csv").write_text("\n".join(rows))
        with pytest.raises(ToolkitError) as caught:
            read_session(path)
        assert word in str(caught.value.expected)


def test_a_certificate_prints_a_relative_uncertainty_as_it_was_stated(
    tmp_path: Path, make_session: Make
) -> None:
    import datetime as dt

    from toolkit.calibration.registry.approval import approve
    from toolkit.report.certificate.collect import collect
    from toolkit.report.style import Style

    tail = '[reference]\nstandard = "s"\ncertificate = "c"\n' + UNCERTAINTY.format(
        'U = 0.05, k = 2, unit = "%"'
    )
    registry = Registry(tmp_path / "cal")
    calibrate(make_session(tail=tail), registry)
    approve(registry, "hub-r1", in_force_from=dt.date(2026, 1, 5), checked_by="B")
    paper = collect(registry, "hub-r1", Style(), issued=None, draft=False, replaces=None, amendment=None)
    assert "Its uncertainty for FY: U = 0.05 % of the applied load, k = 2." in traceability(paper)
