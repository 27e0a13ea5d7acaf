"""Scores by hand, precision by hand and by a mixed model, Cochran's test by the standard's table.

Algorithm A against published figures of Huber's proposal 2, of which it is the form of ISO 13528.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
import statsmodels.api as sm
from scipy import stats
from statsmodels.robust.scale import Huber

from toolkit.comparison.laboratories import (
    Results,
    algorithm_a,
    cochran_p,
    compare_laboratories,
    method_precision,
)
from toolkit.comparison.laboratory_file import read_laboratories
from toolkit.errors import ConfigError, ToolkitError


def test_uneven_numbers_of_results_by_hand() -> None:
    """Means 2, 6, 10 of 2, 3 and 1 results: SS within 10 on 3, MS between 22.667, n_0 = 1.8333."""
    results = [
        Results(laboratory="A", values=(1.0, 3.0)),
        Results(laboratory="B", values=(4.0, 6.0, 8.0)),
        Results(laboratory="C", values=(10.0,)),
    ]
    precision = method_precision(results)
    assert precision.s_r is not None
    assert precision.s_L is not None
    assert precision.s_r.value**2 == pytest.approx(10 / 3)
    assert precision.s_L**2 == pytest.approx((68 / 3 - 10 / 3) / (11 / 6))
    assert precision.s_R**2 == pytest.approx(10 / 3 + (58 / 3) / (11 / 6))
    assert precision.R == pytest.approx(2.8 * precision.s_R)


def test_even_numbers_agree_with_a_mixed_model() -> None:
    """Restricted likelihood of a one-way layout with equal numbers is the analysis of variance."""
    rng = np.random.default_rng(8)
    values = 50 + np.repeat(rng.normal(0, 2, 9), 4) + rng.normal(0, 1, 36)
    groups = np.repeat(np.arange(9), 4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mixed = sm.MixedLM(values, np.ones((36, 1)), groups=groups).fit(reml=True)
    precision = method_precision(
        [Results(laboratory=f"L{g}", values=tuple(values[groups == g].tolist())) for g in range(9)]
    )
    assert precision.s_r is not None
    assert precision.s_r.value**2 == pytest.approx(float(mixed.scale), rel=1e-4)
    assert precision.s_L is not None
    assert precision.s_L**2 == pytest.approx(float(np.asarray(mixed.cov_re)[0, 0]), rel=1e-3)


@pytest.mark.campaign("many drawn comparisons: published ones are recomputed in every run")
def test_uneven_numbers_estimate_without_bias() -> None:
    """Over 2000 drawn comparisons of uneven numbers the variances are the true ones."""
    rng = np.random.default_rng(9)
    sizes = (1, 2, 2, 3, 3, 4, 6, 8, 2, 5)
    within, total = [], []
    for _ in range(2000):
        means = rng.normal(0, 3.0, len(sizes))
        precision = method_precision(
            [
                Results(laboratory=str(i), values=tuple(rng.normal(mean, 1.0, n).tolist()))
                for i, (mean, n) in enumerate(zip(means, sizes, strict=True))
            ]
        )
        assert precision.s_r is not None
        within.append(precision.s_r.value**2)
        total.append(precision.s_R**2)
    assert np.mean(within) == pytest.approx(1.0, rel=0.03)
    assert np.mean(total) == pytest.approx(10.0, rel=0.04)


# Critical values of Cochran's test, ISO 5725-2, table 4: laboratories, results each, C at 1 % and at 5 %.
@pytest.mark.parametrize(
    ("p", "n", "one", "five"),
    [(3, 2, 0.993, 0.967), (5, 2, 0.928, 0.841), (10, 2, 0.718, 0.602), (5, 3, 0.788, 0.684),
     (10, 3, 0.536, 0.445)],
)  # fmt: skip
def test_cochran_has_the_standards_critical_values(p: int, n: int, one: float, five: float) -> None:
    for C, level in ((one, 0.01), (five, 0.05)):
        # p - 1 laboratories of one variance, one of a larger: C = s^2 / (s^2 + p - 1).
        large = math.sqrt(C * (p - 1) / (1 - C))
        unit = np.array([-1.0, 1.0]) / math.sqrt(2) if n == 2 else np.array([-1.0, 0.0, 1.0])
        results = [
            Results(laboratory=str(i), values=tuple((unit * (large if i == 1 else 1.0)).tolist()))
            for i in range(p)
        ]
        found = cochran_p(results)
        assert found is not None
        assert found[0] == "1"
        assert found[1] == pytest.approx(level, rel=0.08)


def test_cochran_of_two_laboratories_is_the_f_test_of_their_variances() -> None:
    """Of two and of six results the larger variance is on 1 and 5 degrees of freedom, whichever has it."""
    unit = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0]) * math.sqrt(5 / 6)  # variance 1
    for ratio, wild, dofs in ((9.0, "few", (1, 5)), (40.0, "many", (5, 1))):
        few, many = (ratio, 1.0) if wild == "few" else (1.0, ratio)
        results = [
            Results(laboratory="few", values=(0.0, math.sqrt(2 * few))),
            Results(laboratory="many", values=tuple((unit * math.sqrt(many)).tolist())),
        ]
        found = cochran_p(results)
        assert found is not None
        assert found[0] == wild
        assert found[1] == pytest.approx(2 * stats.f.sf(ratio, *dofs))


@pytest.mark.parametrize("sizes", [(2, 2, 3, 5, 6, 6, 6, 6, 9), (2, 2, 2, 5, 5, 5, 5), (2, 2, 2, 2, 2, 8, 8)])
def test_cochran_names_one_sound_comparison_of_a_hundred_whatever_its_numbers(sizes: tuple[int, ...]) -> None:
    """Of 1000 sound comparisons 10 are expected; 3 to 20 hold 99.6 % of a binomial with p = 0.01."""
    rng = np.random.default_rng(11)
    named = 0
    for _ in range(1000):
        found = cochran_p(
            [
                Results(laboratory=str(i), values=tuple(rng.normal(size=n).tolist()))
                for i, n in enumerate(sizes)
            ]
        )
        named += found is not None and found[1] < 0.01
    assert 3 <= named <= 20


FIVE = [
    Results(laboratory=name, values=(value,), U=U)
    for name, value, U in (
        ("A", 9.8, 0.2), ("B", 10.1, 0.4), ("C", 10.0, 0.3), ("D", 10.3, 0.2), ("E", 14.0, 0.5)
    )
]  # fmt: skip


def test_scores_against_a_reference_by_hand() -> None:
    reference = Results(laboratory="R", values=(10.0,), U=0.1)
    comparison = compare_laboratories({"x": [*FIVE, reference]}, unit="N", reference="R", sigma=0.5)
    measurand = comparison.measurands[0]
    scores = {score.laboratory: score for score in measurand.scores}
    assert "R" not in scores
    assert scores["D"].z_prime == pytest.approx(0.3 / math.sqrt(0.5**2 + 0.05**2))
    assert scores["D"].zeta == pytest.approx(0.3 / math.sqrt(0.1**2 + 0.05**2))
    assert scores["D"].En == pytest.approx(0.3 / math.sqrt(0.2**2 + 0.1**2))
    assert scores["D"].En_signal
    assert scores["D"].signal is None
    assert scores["E"].signal == "action"
    assert not scores["A"].En_signal
    assert comparison.findings[0].rule == "laboratory-outlier"


def test_a_stated_coverage_factor_counts() -> None:
    reference = Results(laboratory="R", values=(10.0,), U=0.15, k=3.0)
    comparison = compare_laboratories({"x": [*FIVE, reference]}, unit="N", reference="R", sigma=0.5)
    score = next(score for score in comparison.measurands[0].scores if score.laboratory == "D")
    assert score.En == pytest.approx(0.3 / math.sqrt(0.2**2 + 0.1**2))


def test_one_laboratory_against_a_reference_has_its_score() -> None:
    """The comparison of two, with E_n alone: nothing else can be told of one."""
    reference = Results(laboratory="R", values=(10.0,), U=0.3)
    comparison = compare_laboratories({"x": [FIVE[3], reference]}, unit="N", reference="R", sigma=None)
    measurand = comparison.measurands[0]
    assert measurand.precision is None
    assert measurand.sigma_pt is None
    assert measurand.scores[0].z_prime is None
    assert measurand.scores[0].En == pytest.approx(0.3 / math.hypot(0.2, 0.3))


def test_a_consensus_says_that_it_is_one() -> None:
    comparison = compare_laboratories({"x": FIVE}, unit="N", reference=None, sigma=None)
    measurand = comparison.measurands[0]
    assert measurand.u_assigned == pytest.approx(1.25 * measurand.sigma_pt / math.sqrt(5))
    assert {finding.rule for finding in comparison.findings} >= {"few-laboratories", "consensus-scores"}


@pytest.mark.parametrize(
    ("results", "reference", "said"),
    [
        (FIVE[:2], None, "too few"),
        (FIVE, "nobody", "no result"),
        (FIVE[:1], "A", "too few"),
        ([*FIVE, Results(laboratory="R", values=(1.0,))], "R", "without U"),
        ([Results(laboratory=name, values=(1.0,)) for name in "ABCD"], None, "no spread"),
    ],
)
def test_what_cannot_be_compared_is_refused(results: list[Results], reference: str | None, said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        compare_laboratories({"x": results}, unit="N", reference=reference, sigma=None)
    assert said in str(refused.value)


def test_the_file_is_read_with_repeats_units_and_u(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "x.csv"
    path.write_text("laboratory,value [kN],U [kN],k\nA,1.0,0.1,3\nA,1.2,,\nB,1.1,,\n\nC,0.9,0.2,\n")
    reported, unit = read_laboratories(path)
    assert unit == "kN"
    assert reported["result"][0] == Results(laboratory="A", values=(1.0, 1.2), U=0.1, k=3.0)
    assert reported["result"][1].U is None
    assert reported["result"][2].k == 2.0


def test_decimal_commas_and_another_unit_of_u_are_the_same_results(tmp_path) -> None:  # type: ignore[no-untyped-def]
    point, comma = tmp_path / "point.csv", tmp_path / "comma.csv"
    point.write_text("laboratory,value [kN],U [kN],k\nA,1.05,0.125,2.5\nB,1.1,0.05,\n")
    comma.write_text("laboratory;value [kN];U [N];k\nA;1,05;125;2,5\nB;1,1;50;\n")
    by_point, by_comma = read_laboratories(point), read_laboratories(comma)
    assert by_comma[1] == by_point[1] == "kN"
    for a, b in zip(by_comma[0]["result"], by_point[0]["result"], strict=True):
        assert (a.laboratory, a.values, a.k) == (b.laboratory, b.values, b.k)
        assert a.U == pytest.approx(b.U, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("laboratory,value\nA,1\n", "unit"),
        ("laboratory,value [N],value [N]\nA,1,1\n", "twice"),
        ("value [N]\n1\n", "laboratory"),
        ("laboratory,value [N],v [N]\nA,1,1\n", "unknown column"),
        ("laboratory,value [N],U [mm]\nA,1,1\n", "another dimension"),
        ("laboratory;value [N]\nA;1,234\nB;5,678\n", "between thousands"),
        ("laboratory;value [N]\nA;1,5\nB;2.5\n", "'1,5'"),
        ("laboratory,value [N]\nA,1_000\n", "1_000"),
        ("laboratory,value [N]\n", "no results"),
        ("", "laboratory"),
        ("laboratory,value [N]\nA,nan\n", "nan"),
        ("laboratory,value [N]\nA,1,2\n", "2 cells"),
        ("laboratory,value [N]\n,1\n", "laboratory"),
        ("laboratory,value [N],U [N]\nA,1,-1\n", "-1"),
        ("laboratory,value [N],U [N],k\nA,1,1,0\n", "above 0"),
        # no measurement is without uncertainty: a 0 is an empty cell's, and zeta and E_n are then too large
        ("laboratory,value [N],U [N],k\nA,1,0,2\n", "above 0, or an empty cell where none is stated"),
        ("laboratory,value [N],U [N]\nA,1,1\nA,1,2\n", "two uncertainties"),
    ],
)
def test_a_file_that_cannot_be_read_says_where(tmp_path, text: str, said: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(ToolkitError) as refused:
        read_laboratories(path)
    assert said in str(refused.value)
    assert str(path) in str(refused.value)


# Copper in wholemeal flour [ug/g], Analytical Methods Committee, Analyst 114 (1989) 1693; robust figures:
# Venables and Ripley, Modern Applied Statistics with S, 5.5 (hubers, k = 1.5).
COPPER = [
    2.9, 3.1, 3.4, 3.4, 3.7, 3.7, 2.8, 2.5, 2.4, 2.4, 2.7, 2.2, 5.28, 3.37, 3.03, 3.03, 28.95, 3.77, 3.4, 2.2,
    3.5, 3.6, 3.7, 3.7,
]  # fmt: skip
NORMAL = 1.13339
"""The factor without the standard's rounding to 1.134."""


def test_copper_in_flour() -> None:
    values = np.array(COPPER)
    assert values.mean() == pytest.approx(4.2804, abs=5e-5)  # the published mean: the data are these
    robust = algorithm_a(values, factor=NORMAL)
    assert robust.mean == pytest.approx(3.2055, abs=6e-4)
    assert robust.sd == pytest.approx(0.67365, abs=6e-4)
    assert robust.u == pytest.approx(1.25 * robust.sd / np.sqrt(24))
    # The standard's own factor widens it by less than the 0.3 % that is known of it.
    assert robust.sd < algorithm_a(values).sd < 1.003 * robust.sd


@pytest.mark.parametrize("seed", range(5))
def test_it_is_hubers_proposal_2(seed: int) -> None:
    """statsmodels solves the same equations by another way."""
    rng = np.random.default_rng(seed)
    values = rng.normal(10, 1, 25)
    values[:3] += rng.uniform(5, 50, 3)
    mean, sd = Huber(c=1.5, tol=1e-10, maxiter=1000)(values)
    robust = algorithm_a(values, factor=NORMAL)
    assert robust.mean == pytest.approx(float(mean), rel=1e-5)
    assert robust.sd == pytest.approx(float(sd), rel=2e-4)


def test_unit_and_origin_do_not_matter() -> None:
    values = np.array(COPPER)
    there, here = algorithm_a(values), algorithm_a(1000 * values + 5e4)
    assert here.mean == pytest.approx(1000 * there.mean + 5e4, rel=1e-9)
    assert here.sd == pytest.approx(1000 * there.sd, rel=1e-6)


def test_results_that_are_nearly_all_the_same_have_no_spread() -> None:
    assert algorithm_a(np.array([5.0] * 9 + [6.0])).sd == 0
    assert algorithm_a(np.array([5.0] * 5)).sd == 0


@pytest.mark.parametrize("wild", [1e2, 1e4, 1e5, 1e6, 1e9, 1e15])
def test_one_wild_result_of_any_size_leaves_algorithm_a_where_it_was(wild: float) -> None:
    """Expected from an iteration that was written apart: 0.17647."""
    robust = algorithm_a(np.array([5.05, 4.95, 5.025, 5.15, 4.9, wild]))
    assert robust.sd == pytest.approx(0.17647, abs=5e-6)


@pytest.mark.parametrize("wild", [6.0, 1e6, 1e12])
def test_no_robust_spread_is_where_most_results_are_equal(wild: float) -> None:
    assert algorithm_a(np.array([5.1, 5.1, 5.1, 5.1, 5.1, wild])).sd == 0
    assert algorithm_a(np.array([5.1, 5.1, 5.1, 5.2, 5.0, wild])).sd > 0.01
    values = [5.1] * 4 + [wild]
    results = [Results(laboratory=name, values=(v,)) for name, v in zip("ABCDE", values, strict=True)]
    with pytest.raises(ConfigError, match="more than half of the results are equal"):
        compare_laboratories({"F": results}, unit="N", reference=None, sigma=None)


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e9])
def test_equal_repeats_have_no_scatter(size: float) -> None:
    """The mean of three times 5.4 is not 5.4 in binary: what is left is no scatter."""
    levels = (5.0, 5.1, 5.2, 5.3, 5.4, 5.5)
    results = [
        Results(laboratory=name, values=(level * size,) * 3)
        for name, level in zip("ABCDEF", levels, strict=True)
    ]
    compared = compare_laboratories({"F": results}, unit="N", reference=None, sigma=None)
    assert "laboratory-outlier" not in {finding.rule for finding in compared.findings}
    precision = compared.measurands[0].precision
    assert precision is not None
    assert precision.s_r is not None
    assert precision.s_r.value == 0
    assert precision.cochran_p is None
    assert {score.k for score in compared.measurands[0].scores} == {None}
