"""How often a clean session has an outlier named in it: once in a hundred, however many loads it has."""

from __future__ import annotations

import numpy as np

from tests.calibration.fit.test_odr_and_gls import TERMS
from toolkit.calibration.fit.diagnostics import diagnose
from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.terms import term_matrix


def test_one_clean_session_in_a_hundred_has_an_outlier_however_many_loads_it_has() -> None:
    """Each load judged as if it were alone named a row in 6 of 100 sessions of six loads."""
    rng, named = np.random.default_rng(24), []
    columns = {name: rng.uniform(-1, 1, 60) for name in TERMS[:2]}
    x = term_matrix(TERMS, columns)
    for _ in range(300):
        session = []
        for load in rng.standard_normal((6, 60)):
            fit = fit_terms(terms=TERMS, columns=columns, load=load)
            session.append(bool(diagnose(fit, cells=x, load=load, up=None, loads=6).outliers))
        named.append(any(session))
    # Three standard deviations of a share of three hundred about 1 %.
    assert np.mean(named) < 0.028
