"""NIST Statistical Reference Datasets (linear least squares): certified values, agreement in digits.

Sources: itl.nist.gov/div898/strd/lls/lls.shtml, sets Norris, Pontius, Longley, NoInt1.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.records.golden import golden_inputs, predict_exactly, solve_exactly
from toolkit.calibration.terms import model_terms, parse_term, term_matrix
from toolkit.errors import SessionError

NORRIS = np.array([
    (0.1, 0.2), (338.8, 337.4), (118.1, 118.2), (888.0, 884.6), (9.2, 10.1), (228.1, 226.5),
    (668.5, 666.3), (998.5, 996.3), (449.1, 448.6), (778.9, 777.0), (559.2, 558.2), (0.3, 0.4),
    (0.1, 0.6), (778.1, 775.5), (668.8, 666.9), (339.3, 338.0), (448.9, 447.5), (10.8, 11.6),
    (557.7, 556.0), (228.3, 228.1), (998.0, 995.8), (888.8, 887.6), (119.6, 120.2), (0.3, 0.3),
    (0.6, 0.3), (557.6, 556.8), (339.3, 339.1), (888.0, 887.2), (998.5, 999.0), (778.9, 779.0),
    (10.2, 11.1), (117.6, 118.3), (228.9, 229.2), (668.4, 669.1), (449.2, 448.9), (0.2, 0.5),
])  # fmt: skip
PONTIUS_Y = [
    .11019, .21956, .32949, .43899, .54803, .65694, .76562, .87487, .98292, 1.09146,
    1.20001, 1.30822, 1.41599, 1.52399, 1.63194, 1.73947, 1.84646, 1.95392, 2.06128, 2.16844,
    .11052, .22018, .32939, .43886, .54798, .65739, .76596, .87474, .98300, 1.09150,
    1.20004, 1.30818, 1.41613, 1.52408, 1.63159, 1.73965, 1.84696, 1.95445, 2.06177, 2.16829,
]  # fmt: skip
PONTIUS_X = [150000.0 * (1 + i % 20) for i in range(40)]
LONGLEY = np.array([
    (60323, 83.0, 234289, 2356, 1590, 107608, 1947), (61122, 88.5, 259426, 2325, 1456, 108632, 1948),
    (60171, 88.2, 258054, 3682, 1616, 109773, 1949), (61187, 89.5, 284599, 3351, 1650, 110929, 1950),
    (63221, 96.2, 328975, 2099, 3099, 112075, 1951), (63639, 98.1, 346999, 1932, 3594, 113270, 1952),
    (64989, 99.0, 365385, 1870, 3547, 115094, 1953), (63761, 100.0, 363112, 3578, 3350, 116219, 1954),
    (66019, 101.2, 397469, 2904, 3048, 117388, 1955), (67857, 104.6, 419180, 2822, 2857, 118734, 1956),
    (68169, 108.4, 442769, 2936, 2798, 120445, 1957), (66513, 110.8, 444546, 4681, 2637, 121950, 1958),
    (68655, 112.6, 482704, 3813, 2552, 123366, 1959), (69564, 114.2, 502601, 3931, 2514, 125368, 1960),
    (69331, 115.7, 518173, 4806, 2572, 127852, 1961), (70551, 116.9, 554894, 4007, 2827, 130081, 1962),
])  # fmt: skip

# name: (terms, columns, y, [(coefficient, standard error)], residual sd, digits of coefficients required)
CERTIFIED = {
    "Norris": (
        ("x", "intercept"), {"x": NORRIS[:, 1]}, NORRIS[:, 0],
        [(1.00211681802045, 0.429796848199937e-03), (-0.262323073774029, 0.232818234301152)],
        0.884796396144373, 12,
    ),
    "Pontius": (
        ("x", "x^2", "intercept"), {"x": np.array(PONTIUS_X)}, np.array(PONTIUS_Y),
        [(0.732059160401003e-06, 0.157817399981659e-09), (-0.316081871345029e-14, 0.486652849992036e-16),
         (0.673565789473684e-03, 0.107938612033077e-03)],
        0.205177424076185e-03, 11,
    ),
    "Longley": (
        (*(f"x{i}" for i in range(1, 7)), "intercept"),
        {f"x{i}": LONGLEY[:, i] for i in range(1, 7)}, LONGLEY[:, 0],
        [(15.0618722713733, 84.9149257747669), (-0.358191792925910e-01, 0.334910077722432e-01),
         (-2.02022980381683, 0.488399681651699), (-1.03322686717359, 0.214274163161675),
         (-0.511041056535807e-01, 0.226073200069370), (1829.15146461355, 455.478499142212),
         (-3482258.63459582, 890420.383607373)],
        304.854073561965, 12,
    ),
    "NoInt1": (
        ("x",), {"x": np.arange(60.0, 71.0)}, np.arange(130.0, 141.0),
        [(2.07438016528926, 0.165289256198347e-01)], 3.56753034006338, 13,
    ),
}  # fmt: skip


def digits(value: float, certified: float) -> float:
    return 15.0 if value == certified else -math.log10(abs(value - certified) / abs(certified))


@pytest.mark.parametrize("name", CERTIFIED)
def test_certified_values(name: str) -> None:
    terms, columns, y, certified, sd, required = CERTIFIED[name]
    fit = fit_terms(terms=terms, columns=columns, load=y)
    for value, error, (c, u) in zip(fit.coefficients, fit.standard_errors, certified, strict=True):
        assert digits(value, c) >= required
        assert digits(float(error), u) >= required - 1
    assert digits(fit.residual_sd, sd) >= required


@pytest.mark.parametrize("name", CERTIFIED)
def test_the_exact_solution_has_the_certified_digits(name: str) -> None:
    terms, columns, y, certified, _, _ = CERTIFIED[name]
    exact = solve_exactly(terms=terms, columns={k: v.tolist() for k, v in columns.items()}, load=y.tolist())
    # Certified values have 15 digits; data such as 338.8 are not exact in binary, hence 13.
    assert all(digits(float(c), certain) >= 12.5 for c, (certain, _) in zip(exact, certified, strict=True))


@pytest.mark.parametrize("model", ["linear", "polynomial", "balance"])
def test_coefficients_in_the_raw_variables_against_rational_arithmetic(model: str) -> None:
    rng = np.random.default_rng(5)
    columns = {"A": rng.uniform(-3, 40, 60), "B": rng.uniform(900, 1000, 60) * rng.choice([-1, 1], 60)}
    y = 3 * columns["A"] - 0.2 * columns["B"] + 1e-3 * columns["A"] ** 2 + rng.normal(0, 1, 60)
    terms = model_terms(model, ["A", "B"], degree=3)
    fit = fit_terms(terms=terms, columns=columns, load=y)
    exact = solve_exactly(terms=terms, columns={k: v.tolist() for k, v in columns.items()}, load=y.tolist())
    matrix = term_matrix(terms, columns)
    off = np.abs(np.asarray(fit.coefficients) - [float(c) for c in exact]) * np.abs(matrix).max(axis=0)
    assert off.max() <= 1e-9 * np.abs(y).max()
    # The covariance by its definition, inverted in rationals.
    assert fit.covariance == pytest.approx(_covariance(matrix, fit.residual_sd), rel=1e-6)


def _covariance(matrix: np.ndarray, sd: float) -> np.ndarray:
    size = matrix.shape[1]
    exact = [[Fraction(float(v)) for v in row] for row in matrix]
    normal = [[sum(r[i] * r[j] for r in exact) for j in range(size)] for i in range(size)]
    rows = [row + [Fraction(int(i == j)) for j in range(size)] for i, row in enumerate(normal)]
    for i in range(size):
        rows[i] = [v / rows[i][i] for v in rows[i]]
        for r in range(size):
            if r != i:
                rows[r] = [a - rows[r][i] * b for a, b in zip(rows[r], rows[i], strict=True)]
    return np.array([[float(v) for v in row[size:]] for row in rows]) * sd**2


def test_weighted_fit_takes_its_errors_from_the_stated_uncertainties() -> None:
    # Weighted mean of 1 and 2 with u = 1 and 2: (1 + 2/4) / (1 + 1/4) = 1.2, u^2 = 1 / (1 + 1/4).
    fit = fit_terms(
        terms=("x",), columns={"x": np.ones(2)}, load=np.array([1.0, 2.0]), u=np.array([1.0, 2.0])
    )
    assert fit.coefficients[0] == pytest.approx(1.2, rel=1e-14)
    assert fit.covariance[0, 0] == pytest.approx(0.8, rel=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.floats(1e-4, 1e4), st.integers(0, 2))
def test_a_change_of_an_indications_unit_scales_its_coefficient_inversely(factor: float, which: int) -> None:
    rng = np.random.default_rng(7)
    names = ["A", "B", "C"]
    columns = {name: rng.uniform(-1, 3, 40) for name in names}
    y = rng.uniform(-5, 5, 40)
    terms = ("A", "B", "C", "intercept")
    before = fit_terms(terms=terms, columns=columns, load=y)
    scaled = {**columns, names[which]: columns[names[which]] * factor}
    after = fit_terms(terms=terms, columns=scaled, load=y)
    expected = [c / (factor if i == which else 1) for i, c in enumerate(before.coefficients)]
    assert after.coefficients == pytest.approx(expected, rel=1e-9)
    assert after.residual_sd == pytest.approx(before.residual_sd, rel=1e-9)


def test_golden_points_reach_both_ends_of_every_indication() -> None:
    points = np.array(golden_inputs([(0.0, 2.0), (-4.0, 4.0)]))
    assert points.min(axis=0).tolist() == [0.0, -4.0]
    assert points.max(axis=0).tolist() == [2.0, 4.0]
    value = predict_exactly(
        terms=("A", "A*B", "intercept"), names=["A", "B"],
        coefficients=[Fraction(1), Fraction(2), Fraction(3)],
        point=(1.0, 4.0),
    )  # fmt: skip
    assert value == 12.0


@pytest.mark.parametrize("text", ["", "D51^", "D51**2", "sin(D51)", "2*D51", "D51^0"])
def test_a_term_that_cannot_be_read_is_an_error(text: str) -> None:
    with pytest.raises(SessionError):
        parse_term(text)


def test_balance_terms_have_the_names_of_the_contract() -> None:
    terms = model_terms("balance", ["D51", "E5"], drop=["D51*abs(D51)"])
    assert terms == (
        "D51", "E5", "abs(D51)", "abs(E5)", "D51^2", "E5^2", "E5*abs(E5)", "D51*E5", "intercept",
    )  # fmt: skip
