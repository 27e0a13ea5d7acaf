"""Creep of a load that came with the first row, and of one that had long been there."""

import numpy as np
import pytest

from tests.effects.rig import setting
from toolkit.effects.catalogue import effects
from toolkit.effects.catalogue.creep import FROM_REST

L, FRACTION, TAU = 700.0, 0.03, 12.0
REGULAR = np.arange(80) * 0.5
IRREGULAR = np.sort(np.random.default_rng(1).uniform(3.0, 50.0, 80))


def crept(t, y, **more):
    values = {"fraction": FRACTION, "time_constant": TAU, **more}
    return effects()["creep"].channel(y, values, setting(t))


@pytest.mark.parametrize("t", [REGULAR, IRREGULAR], ids=["regular", "irregular"])
def test_a_load_that_comes_with_the_first_row_creeps_from_nothing(t):
    made = crept(t, np.full(80, L), **{FROM_REST: 1.0})
    np.testing.assert_allclose(made, L * (1 + FRACTION * (1 - np.exp(-(t - t[0]) / TAU))), rtol=1e-12)
    assert made[0] == L


@pytest.mark.parametrize("before", [{}, {FROM_REST: 0.0}])
@pytest.mark.parametrize("t", [REGULAR, IRREGULAR], ids=["regular", "irregular"])
def test_a_load_that_had_long_been_there_has_crept(t, before):
    np.testing.assert_allclose(crept(t, np.full(80, L), **before), L * (1 + FRACTION), rtol=1e-12)


def test_the_two_histories_differ_by_what_the_first_load_had_left():
    # linear in the load: what remains of the start decays alone, whatever the load does later
    y = L + 300 * np.sin(REGULAR)
    difference = crept(REGULAR, y) - crept(REGULAR, y, **{FROM_REST: 1.0})
    np.testing.assert_allclose(difference, FRACTION * L * np.exp(-REGULAR / TAU), atol=1e-9)


def test_from_rest_one_row_is_the_load_and_no_row_is_none():
    assert crept(REGULAR[:1], np.array([L]), **{FROM_REST: 1.0}) == pytest.approx(L)
    assert crept(REGULAR[:0], np.zeros(0)).size == 0
