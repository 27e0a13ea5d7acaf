"""Shared errors (gls), errors in both variables (odr): published values, dense algebra, records, errors."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.calibration.calibration_factory import csv_text, hub_data
from tests.calibration.registry.test_refit_mutations import forge, refuse_all
from toolkit.calibration.fit.diagnostics import diagnose
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.odr import fit_odr
from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.calibration.fit.session_fit import fit_gls, fit_session
from toolkit.calibration.records.golden import solve_gls_precisely, solve_odr_precisely
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.known_errors import KnownErrors
from toolkit.calibration.session.read import read_session
from toolkit.calibration.terms import model_terms, term_matrix
from toolkit.errors import ConfigError, RecordError, SessionError, ToolkitError

TERMS = ("A", "B", "intercept")


def shared_case(**changes: object) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64], KnownErrors]:
    rng = np.random.default_rng(11)
    columns = {"A": rng.uniform(-2, 3, 40), "B": rng.uniform(10, 11, 40)}
    load = 7 * columns["A"] - 3 * columns["B"] + rng.normal(0, 0.1, 40)
    told: dict[str, object] = {
        "u": rng.uniform(0.05, 0.2, 40), "group": rng.integers(0, 4, 40), "u_shared": 0.5,
        "proportional": False, "u_cells": np.zeros(0),
    }  # fmt: skip
    return columns, load, KnownErrors(**(told | changes))  # type: ignore[arg-type]


def dense(errors: KnownErrors, u: NDArray[np.float64], acts: NDArray[np.float64]) -> NDArray[np.float64]:
    """The covariance of the docstring, written out."""
    v = errors.u_shared * acts
    same = errors.group[:, None] == errors.group[None, :]
    return np.asarray(np.diag(u**2) + same * np.outer(v, v))


@pytest.mark.parametrize("proportional", [True, False])
@pytest.mark.parametrize("stated", [True, False])
def test_shared_errors_against_statsmodels_with_the_whole_covariance(
    proportional: bool, stated: bool
) -> None:
    from statsmodels.regression.linear_model import GLS

    columns, load, errors = shared_case(proportional=proportional)
    if not stated:
        errors = dataclasses.replace(errors, u=None)
    fit = fit_gls(terms=TERMS, columns=columns, load=load, errors=errors)
    ordinary = fit_terms(terms=TERMS, columns=columns, load=load)
    u = errors.u if errors.u is not None else np.full(40, ordinary.residual_sd)
    acts = (load - ordinary.residuals) / np.abs(load).max() if proportional else np.ones(40)
    v = dense(errors, u, acts)
    peer = GLS(load, term_matrix(TERMS, columns), sigma=v).fit(cov_type="fixed scale")
    assert fit.coefficients == pytest.approx(peer.params, rel=1e-9)
    assert fit.covariance == pytest.approx(peer.cov_params(), rel=1e-8)
    rest = load - term_matrix(TERMS, columns) @ np.asarray(fit.coefficients)
    assert fit.chi2 == pytest.approx(rest @ np.linalg.solve(v, rest), rel=1e-9)


def test_deletion_residuals_are_those_of_the_fit_without_the_row() -> None:
    columns, load, errors = shared_case()
    fit = fit_gls(terms=TERMS, columns=columns, load=load, errors=errors)
    assert fit.weights is not None
    assert errors.u is not None
    row, keep = 7, np.arange(40) != 7
    x, v = term_matrix(TERMS, columns), dense(errors, errors.u, np.ones(40))
    rest = np.linalg.solve(v[np.ix_(keep, keep)], np.column_stack([x[keep], load[keep]]))
    c = np.linalg.solve(x[keep].T @ rest[:, :3], x[keep].T @ rest[:, 3])
    # The row's neighbours tell its share of the group's error: its best prediction includes that.
    told = v[row, keep] @ np.linalg.solve(v[np.ix_(keep, keep)], load[keep] - x[keep] @ c)
    expected = load[row] - x[row] @ c - told
    ours = fit.scaled[row] / np.sqrt(fit.weights[row]) / (1 - fit.leverage[row])
    assert ours == pytest.approx(expected, rel=1e-9)
    assert diagnose(fit, cells=x[:, :2], load=load, up=None).press > 0


def test_a_standard_behind_every_row_moves_no_coefficient_and_widens_the_scale() -> None:
    # e_i = L_i d: the estimate is that of equal weights, and u(c)^2 grows by (c u_rel)^2 exactly.
    columns, load, errors = shared_case(
        u=np.full(40, 0.1), group=np.zeros(40, dtype=np.intp), proportional=True
    )
    fit = fit_gls(terms=TERMS, columns=columns, load=load, errors=errors)
    plain = fit_terms(terms=TERMS, columns=columns, load=load, u=np.full(40, 0.1))
    assert fit.coefficients == pytest.approx(plain.coefficients, rel=1e-10)
    c, share = np.asarray(plain.coefficients), 0.5 / np.abs(load).max()
    assert fit.covariance == pytest.approx(plain.covariance + share**2 * np.outer(c, c), rel=1e-9)


def test_no_shared_error_is_a_weighted_fit() -> None:
    columns, load, errors = shared_case(u_shared=0.0)
    fit = fit_gls(terms=TERMS, columns=columns, load=load, errors=errors)
    plain = fit_terms(terms=TERMS, columns=columns, load=load, u=errors.u)
    assert fit.coefficients == pytest.approx(plain.coefficients, rel=1e-12)
    assert fit.leverage == pytest.approx(plain.leverage, rel=1e-9)
    assert fit.scaled == pytest.approx(plain.scaled, rel=1e-9, abs=1e-12)


def test_the_fit_of_shared_errors_is_the_one_in_sixty_digits() -> None:
    columns, load, errors = shared_case(proportional=True, u=None)
    fit = fit_gls(terms=TERMS, columns=columns, load=load, errors=errors)
    exact = solve_gls_precisely(
        terms=TERMS, columns={k: v.tolist() for k, v in columns.items()}, load=load.tolist(), u=None,
        group=errors.group.tolist(), u_shared=0.5, proportional=True,
    )  # fmt: skip
    assert fit.coefficients == pytest.approx([float(c) for c in exact], rel=1e-13)


X = np.array([1.2, 1.9, 2.9, 4.0, 4.7, 5.9])
Y = np.array([3.4, 4.4, 7.2, 8.5, 10.8, 13.5])
U_Y = np.array([0.2, 0.2, 0.2, 0.4, 0.4, 0.4])


def line() -> TermFit:
    return fit_odr(terms=("x", "intercept"), columns={"x": X}, load=Y, u=U_Y, u_cells=np.array([0.2]))


def test_a_line_with_errors_in_both_variables_has_the_published_values() -> None:
    # ISO/TS 28037:2010, clause 7 example, as quoted with the GUM Tree Calculator (p. 21).
    fit = line()
    assert fit.coefficients == pytest.approx([2.1597, 0.5788], abs=5.1e-5)
    assert fit.standard_errors == pytest.approx([0.1355, 0.4764], abs=5.1e-5)
    assert fit.covariance[0, 1] == pytest.approx(-0.0577, abs=5.1e-5)
    assert fit.chi2 == pytest.approx(2.743, abs=5.1e-4)


def test_the_line_is_stationary_in_its_own_profile_objective() -> None:
    # chi2(a, b) = sum (y - a - b x)^2 / (u_y^2 + b^2 u_x^2): its gradient at the answer, analytically.
    b, a = line().coefficients
    s2, r = U_Y**2 + (b * 0.2) ** 2, Y - a - b * X
    assert np.sum(r / s2) == pytest.approx(0, abs=1e-11)
    assert np.sum(r * X / s2 + r**2 * b * 0.04 / s2**2) == pytest.approx(0, abs=1e-10)


def test_the_covariance_is_odrpacks_unscaled_one() -> None:
    from odrpack import odr_fit

    peer = odr_fit(
        lambda x, b: b[0] * x + b[1], X, Y, np.array([2.0, 0.5]), weight_x=25.0, weight_y=U_Y**-2.0,
        jac_beta=lambda x, _b: np.array([x, np.ones_like(x)]), jac_x=lambda x, b: np.full_like(x, b[0]),
        sstol=1e-15, partol=1e-15,
    )  # fmt: skip
    fit = line()
    assert fit.coefficients == pytest.approx(peer.beta, rel=1e-7)
    assert fit.covariance == pytest.approx(peer.cov_beta, rel=1e-6)
    assert peer.sd_beta != pytest.approx(fit.standard_errors, rel=0.05)


@pytest.mark.parametrize("model", ["linear", "polynomial", "balance"])
def test_errors_in_both_variables_of_any_terms_against_sixty_digits(model: str) -> None:
    rng = np.random.default_rng(3)
    columns = {"A": rng.uniform(-3, 9, 50), "B": rng.uniform(1, 5, 50) * rng.choice([-1, 1], 50)}
    load = 3 * columns["A"] - 2 * columns["B"] + 0.05 * columns["A"] ** 2 + rng.normal(0, 0.05, 50)
    terms, u, u_cells = model_terms(model, ["A", "B"]), rng.uniform(0.02, 0.1, 50), np.array([0.02, 0.05])
    fit = fit_odr(terms=terms, columns=columns, load=load, u=u, u_cells=u_cells)
    exact = solve_odr_precisely(
        terms=terms, columns={k: v.tolist() for k, v in columns.items()}, load=load.tolist(), u=u.tolist(),
        u_cells=u_cells.tolist(),
    )  # fmt: skip
    off = np.abs(np.array(fit.coefficients) - [float(c) for c in exact])
    assert (off * np.abs(term_matrix(terms, columns)).max(axis=0)).max() <= 1e-12 * np.abs(load).max()


@pytest.mark.parametrize("zero", [50.0, -50.0, 5e3, 5e6])
@pytest.mark.parametrize(
    ("model", "degree", "names"),
    [
        ("linear", 1, "S"),
        ("linear", 1, "ST"),
        ("polynomial", 2, "S"),
        ("polynomial", 3, "S"),
        ("polynomial", 2, "ST"),
    ],
)
def test_a_large_zero_of_an_indication_costs_nothing(
    zero: float, model: str, degree: int, names: str
) -> None:
    # Moving the zero of an indication moves nothing else: the fitted loads stay.
    rng = np.random.default_rng(3)
    t = np.linspace(0, 1, 36)
    columns = {
        name: np.round((t if name == "S" else rng.permutation(t)) + rng.normal(0, 1e-3, 36), 6)
        for name in names
    }
    load = np.round(sum(4000 * x for x in columns.values()) + rng.normal(0, 1, 36), 3)
    terms, u, u_cells = model_terms(model, [*names], degree=degree), np.ones(36), np.full(len(names), 1e-3)
    moved = {name: x + zero for name, x in columns.items()}
    near, far = (fit_odr(terms=terms, columns=x, load=load, u=u, u_cells=u_cells) for x in (columns, moved))
    assert far.residual_sd == pytest.approx(near.residual_sd, rel=1e-5)
    assert far.chi2 == pytest.approx(near.chi2, rel=1e-5)
    assert far.leverage == pytest.approx(near.leverage, rel=1e-5)
    exact = solve_odr_precisely(
        terms=terms, columns={k: v.tolist() for k, v in moved.items()}, load=load.tolist(), u=u.tolist(),
        u_cells=u_cells.tolist(),
    )  # fmt: skip
    assert far.coefficients == pytest.approx([float(c) for c in exact], rel=1e-10)


def test_a_session_with_a_large_zero_makes_a_record_that_verifies(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    t = np.tile(np.linspace(0, 1, 12), 3)
    rows = {
        "run": np.repeat([1, 2, 3], 12), "direction": ["up"] * 36,
        "S [mV/V]": np.round(50 + t - 0.02 * t**2 + rng.normal(0, 2e-5, 36), 6),
        "FY [N]": np.round(4000 * t + rng.normal(0, 0.2, 36), 3),
    }  # fmt: skip
    head, lines = ",".join(rows), [",".join(map(str, row)) for row in zip(*rows.values(), strict=True)]
    (tmp_path / "loads.csv").write_text("\n".join([head, *lines]) + "\n")
    (tmp_path / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "rig"\ndate = 2026-03-01\noperator = "operator"\n'
        'temperature = { value = 23, unit = "degC" }\nindications = ["S"]\nloads = ["FY"]\n'
        'data = "loads.csv"\nmodel = "polynomial"\ndegree = 2\nmethod = "odr"\n'
        '[reference]\nstandard = "deadweights"\ncertificate = "c"\n'
        '[reference.uncertainty]\nFY = { U = 0.4, k = 2, unit = "N" }\n'
        '[cells.S]\nserial = "s"\nu = { value = 2e-5, unit = "mV/V" }\n'
    )
    assert load_of(tmp_path, tmp_path / "SESSION.toml").load("FY").method == "odr"


def test_small_errors_of_the_indications_give_the_weighted_fit() -> None:
    fit = fit_odr(terms=("x", "intercept"), columns={"x": X}, load=Y, u=U_Y, u_cells=np.array([1e-9]))
    plain = fit_terms(terms=("x", "intercept"), columns={"x": X}, load=Y, u=U_Y)
    assert fit.coefficients == pytest.approx(plain.coefficients, rel=1e-12)
    assert fit.covariance == pytest.approx(plain.covariance, rel=1e-9)


UNCERTAINTY = "\n[reference.uncertainty]\n" + "".join(
    f'{name} = {{ U = {U}, k = 2, unit = "{text}" }}\n'
    for name, U, text in (("FY", 0.4, "N"), ("MZ", 0.02, "N*m"), ("MX", 0.02, "lbf*ft"))
)
CELLS = "".join(f"[cells.{name}]\n{key} = 1e-5\n" for name, key in
                (("D51", "u"), ("D52", "resolution"), ("E5", "u")))  # fmt: skip
GLS = '[reference]\nshared_group = "run"' + UNCERTAINTY
ODR = UNCERTAINTY + CELLS


OTHER = pytest.mark.campaign("the other model: each method has one in every run, and each model")


@pytest.mark.parametrize(
    ("method", "tail", "model"),
    [
        ("gls", GLS, "linear"),
        *(
            pytest.param(*each, marks=OTHER)
            for each in (("odr", ODR, "polynomial"), ("gls", GLS, "polynomial"), ("odr", ODR, "linear"))
        ),
    ],
)
def test_every_mutated_coefficient_of_such_a_record_is_refused(
    tmp_path: Path, make_session: Callable[..., Path], method: str, tail: str, model: str
) -> None:
    more = {"degree": "2"} if model == "polynomial" else {}
    path = make_session(name=method, method=f'"{method}"', model=f'"{model}"', tail=tail, **more)
    registry = Registry(tmp_path / "cal")
    made = calibrate(path, registry)
    assert {one.method for one in made.record.loads} == {method}
    assert calibrate(path, registry).existing
    forge(registry, made.record)
    assert registry.load(made.record.id) == made.record
    assert refuse_all(registry, made.record) > 30


@pytest.mark.parametrize(("method", "tail"), [("gls", GLS), ("odr", ODR)])
def test_a_records_covariance_and_scatter_belong_to_its_data(
    tmp_path: Path, make_session: Callable[..., Path], method: str, tail: str
) -> None:
    registry = Registry(tmp_path / "cal")
    record = calibrate(make_session(name=method, method=f'"{method}"', tail=tail), registry).record
    one = record.loads[0]
    for change in (
        {"covariance": tuple(tuple(v * 1.001 for v in row) for row in one.covariance)},
        {"residual_sd": (one.residual_sd or 0.0) * 1.001},
        {"method": "ols"},
    ):
        loads = (dataclasses.replace(one, **change), *record.loads[1:])  # type: ignore[arg-type]
        forge(registry, dataclasses.replace(record, loads=loads))
        with pytest.raises(RecordError):
            registry.load(record.id)


def with_column(path: Path, header: str, cells: list[str]) -> Path:
    file = path.parent / "loads.csv"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(f"{a},{b}" for a, b in zip(lines, [header, *cells], strict=True)) + "\n")
    return path


def load_of(tmp_path: Path, path: Path) -> CalibrationRecord:
    registry = Registry(tmp_path / "cal")
    return registry.load(calibrate(path, registry).record.id)


@pytest.mark.parametrize(
    "group", ['"weights"', '{ column = "weights", error = "constant" }', '"FY"', '"direction"',
              '"standard 7"', '{ error = "constant" }']
)  # fmt: skip
def test_what_rows_share_is_named_in_many_ways_and_read_again(
    tmp_path: Path, make_session: Callable[..., Path], group: str
) -> None:
    tail = GLS.replace('"run"', group)
    path = make_session(name="group", method='"gls"', tail=tail)
    if "weights" in group:
        path = with_column(path, "weights [1]", [str(row % 5) for row in range(60)])
    record = load_of(tmp_path, path)
    assert [one.method for one in record.loads] == ["gls"] * 3


def test_groups_may_have_names(tmp_path: Path, make_session: Callable[..., Path]) -> None:
    tail = GLS.replace('"run"', '"stack"')
    groups = [row % 5 for row in range(60)]
    numbered = with_column(
        make_session(name="n", method='"gls"', tail=tail), "stack [1]", list(map(str, groups))
    )
    named = with_column(
        make_session(name="t", method='"gls"', tail=tail), "stack", [f"Stapel {'abcde'[g]}" for g in groups]
    )
    one, other = (fit_session(read_session(path)) for path in (numbered, named))
    for a, b in zip(one.loads, other.loads, strict=True):
        assert a.fit.coefficients == b.fit.coefficients
        np.testing.assert_array_equal(a.fit.covariance, b.fit.covariance)
    # Read again from the registry, and held against its data.
    assert load_of(tmp_path, named).load("FY").method == "gls"


def test_a_name_that_is_missing_in_a_row_is_refused(make_session: Callable[..., Path]) -> None:
    path = make_session(name="t", method='"gls"', tail=GLS.replace('"run"', '"stack"'))
    with pytest.raises(SessionError, match="row 3, column stack"):
        read_session(with_column(path, "stack", ["a", "b", " ", *("a" for _ in range(57))]))


def test_a_load_without_a_unit_is_no_column_of_names(make_session: Callable[..., Path]) -> None:
    path = make_session(name="t", method='"gls"', tail=GLS.replace('"run"', '"FY"'))
    file = path.parent / "loads.csv"
    file.write_text(file.read_text().replace("FY [lbf]", "FY"))
    with pytest.raises(SessionError, match="column FY has no unit"):
        read_session(path)


@pytest.mark.parametrize("slip", ["rn", "rnu", "directon", "Rotation", "FYY"])
def test_a_slip_of_the_pen_is_not_one_standard_behind_every_row(
    make_session: Callable[..., Path], slip: str
) -> None:
    session = read_session(make_session(name="t", method='"gls"', tail=GLS.replace('"run"', f'"{slip}"')))
    with pytest.raises(ConfigError, match="shared_group"):
        fit_session(session)


@pytest.mark.parametrize(
    ("more", "told"),
    [("", 1), ('\nstandard = "stack 7"', 0), ('\ncertificate = "Stack 7 "', 0), ('\nstandard = "other"', 1)],
)
def test_one_standard_is_declared_or_said_to_be_assumed(
    make_session: Callable[..., Path], more: str, told: int
) -> None:
    tail = f'[reference]\nshared_group = "stack 7"{more}' + UNCERTAINTY
    found = session_findings(fit_session(read_session(make_session(name="t", method='"gls"', tail=tail))))
    notes = [one for one in found if one.rule == "shared-group"]
    assert len(notes) == told
    assert all(one.level == "note" and "behind every row" in one.message for one in notes)


def test_a_shared_error_widens_the_scale_of_a_session(make_session: Callable[..., Path]) -> None:
    plain = fit_session(read_session(make_session(name="plain")))
    tail = GLS.replace('"run"', '"one standard"')
    told = fit_session(read_session(make_session(name="told", method='"gls"', tail=tail)))
    other, load = told.loads[0].fit, plain.session.table.column("FY")
    # The runs' scatter as of plain least squares, and the standard that all of them share.
    one = plain.loads[0].fit
    largest = np.abs(load).max()
    share = 0.4 / 2 / 4.4482216152605 / largest
    c = np.asarray(one.coefficients)
    assert other.coefficients == pytest.approx(c, rel=1e-9)
    assert np.diag(other.covariance) == pytest.approx(np.diag(one.covariance) + (share * c) ** 2, rel=1e-6)


BAD = [
    ("gls", UNCERTAINTY, "shared_group"),
    ("gls", '[reference]\nshared_group = "run"\n', "reference.uncertainty.FY"),
    ("gls", GLS.replace('"run"', "3"), "shared_group"),
    ("gls", GLS.replace('"run"', '""'), "shared_group"),
    ("gls", GLS.replace('"run"', '"rotation"'), "shared_group"),
    ("gls", GLS.replace('"run"', '{ column = "stack" }'), "shared_group"),
    ("gls", GLS.replace('"run"', '{ error = "none" }'), "shared_group.error"),
    ("gls", GLS.replace('"run"', '{ colum = "run" }'), "shared_group"),
    ("odr", UNCERTAINTY, "cells.D51.u"),
    ("odr", CELLS, "FY"),
    ("odr", ODR.replace("1e-5", "0.0"), "cells.D51.u"),
    ("odr", ODR.replace("U = 0.4", "U = 0.0"), "FY"),
]


@pytest.mark.parametrize(("method", "tail", "where"), BAD)
def test_what_a_method_needs_and_is_not_told_is_named(
    tmp_path: Path, make_session: Callable[..., Path], method: str, tail: str, where: str
) -> None:
    path = make_session(name="bad", method=f'"{method}"', tail=tail)
    with pytest.raises(ConfigError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    assert where in f"{caught.value.where} {caught.value.got}"
    assert caught.value.next_step
    assert not (tmp_path / "cal").exists()


def test_data_without_scatter_need_a_stated_uncertainty_of_rows(
    tmp_path: Path, make_session: Callable[..., Path]
) -> None:
    path = make_session(hub_data(60, 1, noise=0.0), digits=17, name="quiet", method='"gls"', tail=GLS)
    with pytest.raises(ToolkitError) as caught:
        calibrate(path, Registry(tmp_path / "cal"))
    assert "u_FY" in str(caught.value.expected)


def test_the_independent_part_may_be_a_column(tmp_path: Path, make_session: Callable[..., Path]) -> None:
    tail = '[reference]\nshared_group = "run"\nuncertainty = { FY = { U = 0.4, k = 2, unit = "N" } }\n'
    path = make_session(name="column", method='"gls"', loads='["FY"]', tail=tail)
    values = hub_data(60, 1)
    names = ["D51 [mV/V]", "D52 [mV/V]", "E5 [mV/V]", "FY [lbf]"]
    (path.parent / "loads.csv").write_text(csv_text(names, values[:, :4], runs=True))
    (path.parent / "check.csv").write_text(csv_text(names, hub_data(9, 2)[:, :4], runs=False))
    with_column(path, "u_FY [N]", [str(0.1 + row % 3) for row in range(60)])
    assert load_of(tmp_path, path).loads[0].method == "gls"
