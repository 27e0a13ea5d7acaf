"""Sessions: what is fitted, what is found, and every bad input as an error with nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import SENSITIVITY, ZERO, hub_data
from toolkit.calibration.fit.session_fit import fit_session, residual_correlation
from toolkit.calibration.registry.candidate import Candidate, calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.read import read_session
from toolkit.errors import ConfigError, SessionError, ToolkitError, UnitError

Make = Callable[..., Path]


def run(tmp_path: Path, path: Path) -> Candidate:
    return calibrate(path, Registry(tmp_path / "cal"))


def rules(made: Candidate) -> set[str]:
    return {f.rule for f in made.findings if f.level != "note"}


def test_a_clean_session_recovers_the_hub(tmp_path: Path, make_session: Make) -> None:
    made = run(tmp_path, make_session())
    assert rules(made) == set()
    inverse = np.linalg.inv(SENSITIVITY)
    for one, row in zip(made.record.loads, inverse, strict=True):
        expected = [*row, -row @ ZERO]
        z = (np.array(one.coefficients) - expected) / one.standard_errors
        assert np.abs(z).max() < 5
        # The true residual: 2e-5 mV/V of noise in each of three cells.
        assert one.residual_sd == pytest.approx(2e-5 * np.linalg.norm(row), rel=0.4)
        assert one.dof == 56
    assert made.fit.loads[0].llf == pytest.approx(2.4 * (made.record.loads[0].residual_sd or 0))


def test_the_same_session_again_is_the_same_record(tmp_path: Path, make_session: Make) -> None:
    one = run(tmp_path, make_session())
    before = sorted((p.name, p.read_bytes()) for p in (tmp_path / "cal" / "hub").iterdir())
    two = run(tmp_path, make_session(name="copy"))
    assert (two.existing, two.record) == (True, one.record)
    assert sorted((p.name, p.read_bytes()) for p in (tmp_path / "cal" / "hub").iterdir()) == before
    other = run(tmp_path, make_session(name="other", operator='"somebody"'))
    assert (other.existing, other.record.id) == (False, "hub-r2")


def test_a_three_axis_cell_and_a_single_cell(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    forces = rng.uniform(-1000, 1000, (40, 3))
    cross = np.array([[1.0, 0.01, 0.02], [0.02, 1.1, 0.01], [0.0, 0.03, 0.9]]) * 1e-3
    write(tmp_path, "X [mV/V],Y [mV/V],Z [mV/V],FX [N],FY [N],FZ [kN]",
          np.column_stack([forces @ cross.T, forces * [1, 1, 1e-3]]))  # fmt: skip
    (tmp_path / "S.toml").write_text(toml('["X","Y","Z"]', '["FX","FY","FZ"]', "triax"))
    made = run(tmp_path, tmp_path / "S.toml")
    expected = np.linalg.inv(cross)
    assert made.record.load("FX").coefficients[:3] == pytest.approx(expected[0], rel=1e-9)
    assert made.record.load("FZ").coefficients[:3] == pytest.approx(expected[2] * 1e-3, rel=1e-9)

    # NIST Pontius is a single load cell: response on load; here a plain line, counts far from zero.
    counts = -33000 - 10.0 * np.arange(35)
    write(
        tmp_path,
        "S [counts],F [lbf]",
        np.column_stack([counts, 0.5 * np.arange(35) + rng.normal(0, 0.01, 35)]),
    )
    (tmp_path / "S.toml").write_text(toml('["S"]', '["F"]', "cell"))
    made = run(tmp_path, tmp_path / "S.toml")
    assert made.fit.adequacy.condition_number == pytest.approx(1.0)
    assert made.record.load("F").coefficients[0] == pytest.approx(-0.05, rel=1e-2)
    assert Registry(tmp_path / "cal").load("cell-r1") == made.record


@pytest.mark.parametrize(
    ("settings", "terms"),
    [
        ({"model": '"polynomial"', "degree": "3"}, 10),
        ({"model": '"balance"'}, 16),
        ({"model": '"balance"', "drop": '["abs(D51)", "abs(D52)", "abs(E5)"]'}, 13),
        ({"drop": '["intercept"]'}, 3),
    ],
)
def test_other_models_load_again(
    tmp_path: Path, make_session: Make, settings: dict[str, str], terms: int
) -> None:
    made = run(tmp_path, make_session(hub_data(200, 3), **settings))
    assert len(made.record.loads[0].terms) == terms
    assert Registry(tmp_path / "cal").load("hub-r1") == made.record


def outlier(values: np.ndarray) -> None:
    values[7, 3] += 5.0


def few(values: np.ndarray) -> np.ndarray:
    return values[:20]


def doubled(values: np.ndarray) -> np.ndarray:
    return np.vstack([values, values[:10]])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (outlier, {"outlier"}),
        (few, {"few-points"}),
        (doubled, {"duplicates"}),
    ],
)
def test_findings_of_the_data(
    tmp_path: Path, make_session: Make, change: Callable[[np.ndarray], np.ndarray | None], expected: set[str]
) -> None:
    values = hub_data(60, 1)
    changed = change(values)
    assert rules(run(tmp_path, make_session(values if changed is None else changed))) == expected


def test_findings_of_the_check_loads_and_of_the_reference(tmp_path: Path, make_session: Make) -> None:
    values = hub_data(60, 1)
    off = hub_data(9, 2)
    off[4, 3] += 2.0  # 0.1 % of 500 lbf is 0.5 lbf
    made = run(tmp_path, make_session(check_rows=off, name="off"))
    assert [(f.rule, f.where) for f in made.findings] == [("check-load", "FY, check row 5")]
    assert made.fit.loads[0].check_max_percent_fs == pytest.approx(0.4, rel=0.05)
    tail = '[check]\nfile = "check.csv"\ntolerance.FY = { value = 20, unit = "N" }\n'
    wide = make_session(check_rows=off, name="wide", check="-", tail=tail)
    assert rules(run(tmp_path, wide)) == set()
    same = run(tmp_path, make_session(values, check_rows=values[:5], name="same"))
    assert rules(same) == {"check-not-apart"}
    due = make_session(name="due", tail='[reference]\nstandard = "s"\ndue = 2026-01-04\n')
    assert rules(run(tmp_path, due)) == {"reference-due"}


def test_noise_free_data_have_no_findings(tmp_path: Path, make_session: Make) -> None:
    made = run(
        tmp_path, make_session(hub_data(60, 1, noise=0.0), check_rows=hub_data(9, 2, noise=0.0), digits=17)
    )
    assert rules(made) == set()
    assert Registry(tmp_path / "cal").load("hub-r1") == made.record


# what is written into SESSION.toml, the error, and a word of its message
def test_the_residuals_of_loads_are_correlated_as_the_cells_noise_feeds_them(
    make_session: Callable[..., Path],
) -> None:
    # Equal independent noise e of the cells: load errors c_a.e and c_b.e, correlation c_a.c_b / |c_a||c_b|.
    fit = fit_session(read_session(make_session(hub_data(20000, 7, noise=1e-3), digits=9)))
    c = np.array([one.fit.coefficients[:3] for one in fit.loads])
    length = np.linalg.norm(c, axis=1)
    wanted = c @ c.T / np.outer(length, length)
    # 20 000 rows tell a correlation to some 0.007.
    np.testing.assert_allclose(residual_correlation(fit), wanted, atol=0.03)
    assert (np.diag(residual_correlation(fit)) == 1).all()


BAD_SETTINGS = [
    ({"operatr": '"x"'}, ConfigError, "did you mean 'operator'"),
    ({"instrument": '"../x"'}, ConfigError, "instrument"),
    ({"operator": "-"}, ConfigError, "operator"),
    ({"date": '"yesterday"'}, ConfigError, "date"),
    ({"model": '"cubic"'}, ConfigError, "linear, polynomial, balance"),
    ({"degree": "2"}, ConfigError, "degree"),
    ({"model": '"polynomial"'}, ConfigError, "degree"),
    ({"model": '"polynomial"', "degree": '"2"'}, ConfigError, "a whole number"),
    ({"temperature": '{ value = nan, unit = "degC" }'}, ConfigError, "temperature.value"),
    ({"zero": "[{ when = 'before', values = { D51 = inf } }]"}, ConfigError, "zero[1].values.D51"),
    ({"drop": '["D51", "D52", "E5"]'}, SessionError, "no term of an indication"),
    ({"drop": '["D51", "D52", "E5", "intercept"]'}, SessionError, "no term of an indication"),
    ({"reference": '{ standard = ["s"] }'}, ConfigError, "reference.standard"),
    ({"reference": '{ certificate = " " }'}, ConfigError, "reference.certificate"),
    ({"method": '"ridge"'}, ConfigError, "ols, wls"),
    ({"method": '"odr"'}, ConfigError, "uncertainty of FY is missing"),
    ({"method": '"wls"'}, SessionError, "u_FY"),
    ({"data": '"none.csv"'}, SessionError, "none.csv"),
    ({"data": "-"}, ConfigError, "data"),
    ({"check": "7"}, ConfigError, "check"),
    ({"indications": "[]"}, ConfigError, "indications"),
    ({"indications": '["D51", "D51"]'}, ConfigError, "D51\" stands twice"),
    ({"loads": '["FY", "FQ"]'}, SessionError, "FQ"),
    ({"zero": '"none"'}, ConfigError, "included"),
    ({"phase": '"found"'}, ConfigError, "as_found"),
    ({"schema": "2"}, ConfigError, "schema"),
    ({"drop": '["D53"]'}, SessionError, "D53"),
    ({"temperature": '{ value = 20, unit = "N" }'}, UnitError, "temperature"),
    ({"temperature": '{ value = -300, unit = "degC" }'}, ConfigError, "absolute zero"),
    ({"cells": "{ D51 = { resolution = -1e-6 } }"}, ConfigError, "above zero"),
    ({"cells": "{ D51 = { u = 0 } }"}, ConfigError, "above zero"),
    ({"cells": '{ D51 = { excitation = { value = 10, unit = "mm" } } }'}, ConfigError, "voltage"),
    ({"cells": '{ D59 = { serial = "1" } }'}, ConfigError, "D59"),
]  # fmt: skip


@pytest.mark.parametrize(("settings", "kind", "word"), BAD_SETTINGS, ids=lambda v: str(v)[:40])
def test_bad_settings(
    tmp_path: Path, make_session: Make, settings: dict[str, str], kind: type[ToolkitError], word: str
) -> None:
    refused(tmp_path, make_session(**settings), kind, word)


# what is replaced in loads.csv, the error, and a word of its message
BAD_DATA = [
    ("D51 [mV/V]", "D51", SessionError, "no unit"),
    ("D51 [mV/V]", "D51 [mv/q]", UnitError, "mv/q"),
    ("D51 [mV/V]", "D52 [mV/V]", SessionError, "twice"),
    ("D51 [mV/V]", "D53 [mV/V]", SessionError, "D51"),
    ("FY [lbf]", "FY [lbf*ft]", UnitError, "FY"),
    ("MZ [lbf*ft]", "MZ [N]", UnitError, "MZ"),
    ("run,direction", "run,dir", SessionError, "direction"),
    ("run,direction", "run,direction,", SessionError, ""),
    (",1,up", ",1.5,up", SessionError, "row 1, column run"),
    (",1,up", ",1,sideways", SessionError, "row 1, column direction"),
    (",1,up", ",1", SessionError, "row 1"),
    (",1,up\n", ",1,up\nnan,1,1,1,1,1,1,up\n", SessionError, "row 2, column D51"),
    (",1,up\n", ",1,up\n1,1,1,abc,1,1,1,up\n", SessionError, "row 2, column FY"),
    (",1,up\n", ",1,up\n1,1,1,,1,1,1,up\n", SessionError, "row 2, column FY"),
    (",1,up\n", ",1,up\n1,1,1,1_0,1,1,1,up\n", SessionError, "row 2, column FY"),
    (",1,up\n", ",1,up\n1,inf,1,1,1,1,1,up\n", SessionError, "row 2, column D52"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "kind", "word"), BAD_DATA, ids=lambda v: str(v)[:25])
def test_bad_data(
    tmp_path: Path, make_session: Make, old: str, new: str, kind: type[ToolkitError], word: str
) -> None:
    path = make_session()
    data = path.parent / "loads.csv"
    text = data.read_text()
    assert old in text
    data.write_text(text.replace(old, new, 1))
    refused(tmp_path, path, kind, word)


@pytest.mark.parametrize("content", [b"", b"\n\n", b"\xff\xfe\x00", b"PK\x03\x04\x00", b'"', b"D51 [mV/V]\n"])
def test_data_that_are_no_table(tmp_path: Path, make_session: Make, content: bytes) -> None:
    path = make_session()
    (path.parent / "loads.csv").write_bytes(content)
    refused(tmp_path, path, SessionError, "")


def no_mx(values: np.ndarray) -> None:
    values[:, 5] = 0.0


def coupled(values: np.ndarray) -> None:
    values[:, 4] = 0.2 * values[:, 3]


def collinear(values: np.ndarray) -> None:
    values[:, 2] = values[:, 0] - 2 * values[:, 1] + 1e-6 * values[:, 2]


def dead(values: np.ndarray) -> None:
    values[:, 1] = 0.5


@pytest.mark.parametrize(
    ("change", "rule", "word"),
    [(no_mx, "not-spanning", "MX is missing"), (coupled, "not-spanning", "FY, MZ"),
     (collinear, "collinear", "D51"),
     (dead, "not-spanning", "D52")],
)  # fmt: skip
def test_loads_that_do_not_span_and_indications_that_are_collinear(
    tmp_path: Path, make_session: Make, change: Callable[[np.ndarray], None], rule: str, word: str
) -> None:
    values = hub_data(60, 1)
    change(values)
    path = make_session(values)
    error = refused(tmp_path, path, SessionError, word)
    assert error.rule == rule


def test_a_hub_without_its_overturning_moment_is_told_so(tmp_path: Path) -> None:
    # Three cells, and only FY and MZ applied: MX is what is missing.
    rng = np.random.default_rng(4)
    loads = np.column_stack([rng.uniform(-500, 500, 40), rng.uniform(-90, 90, 40), np.zeros(40)])
    cells = loads @ SENSITIVITY.T + rng.normal(0, 1e-6, (40, 3))
    write(
        tmp_path,
        "D51 [mV/V],D52 [mV/V],E5 [mV/V],FY [lbf],MZ [lbf*ft]",
        np.column_stack([cells, loads[:, :2]]),
    )
    (tmp_path / "S.toml").write_text(toml('["D51","D52","E5"]', '["FY","MZ"]', "m15-virtual"))
    error = refused(tmp_path, tmp_path / "S.toml", SessionError, "MX is missing")
    assert error.rule == "not-spanning"


def test_fewer_rows_than_terms(tmp_path: Path, make_session: Make) -> None:
    assert refused(tmp_path, make_session(hub_data(4, 1)), SessionError, "4 rows, 4 terms").rule == "dof"


def test_dependent_terms_are_refused(tmp_path: Path, make_session: Make) -> None:
    values = hub_data(200, 3)
    values[:, :3] += 100.0  # never changes sign: abs(D51) is D51
    assert refused(tmp_path, make_session(values, model='"balance"'), SessionError, "drop").rule == "rank"


def refused(tmp_path: Path, path: Path, kind: type[ToolkitError], word: str) -> ToolkitError:
    folder = tmp_path / "cal"
    with pytest.raises(kind) as caught:
        calibrate(path, Registry(folder))
    assert word in str(caught.value)
    assert caught.value.exit_code == 2
    assert not list(folder.rglob("*"))
    return caught.value


def write(folder: Path, header: str, values: np.ndarray) -> None:
    rows = [",".join(map(repr, row)) + f",{1 + i // 10},up" for i, row in enumerate(values.tolist())]
    (folder / "loads.csv").write_text(header + ",run,direction\n" + "\n".join(rows) + "\n")


def toml(indications: str, loads: str, instrument: str) -> str:
    return (
        f'schema = 1\ninstrument = "{instrument}"\ndate = 2026-01-05\noperator = "A"\n'
        f'indications = {indications}\nloads = {loads}\ndata = "loads.csv"\n'
    )
