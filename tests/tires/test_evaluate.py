"""Values, slopes and crossings read off a fit; error and scatter floor; the catalogue; load blocks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.errors import FitError
from toolkit.tires.evaluate import estimate_at, slope_at, slope_estimate_at, value_at, zero_crossing
from toolkit.tires.fit import fit_curves
from toolkit.tires.global_data import load_blocks
from toolkit.tires.model import Curve
from toolkit.tires.models import find, model, model_names
from toolkit.tires.models.magic_formula import value
from toolkit.tires.quality import error_percent, scatter_floor_percent

SA = np.radians(np.linspace(-10, 10, 21))
TRUTH = (12.0, 1.4, -4000.0, -1.0, 0.004, 50.0)


@pytest.fixture(scope="module")
def fit():
    noise = np.random.default_rng(1).normal(0, 20, len(SA))
    return fit_curves([Curve(SA=SA, y=value(TRUTH, SA) + noise, channel="FY", load_N=4000.0)])[0]


def test_estimates_agree_with_the_fit_at_zero(fit):
    assert estimate_at(fit, 0.0).value == pytest.approx(fit.value_at_zero.value, rel=1e-9)
    assert estimate_at(fit, 0.0).u == pytest.approx(fit.value_at_zero.u, rel=1e-6)
    assert slope_estimate_at(fit, 0.0).value == pytest.approx(fit.slope_at_zero.value, rel=1e-9)
    assert slope_estimate_at(fit, 0.0).u == pytest.approx(fit.slope_at_zero.u, rel=1e-6)
    assert (estimate_at(fit, 0.0).unit, slope_estimate_at(fit, 0.0).unit) == ("N", "N/rad")


def test_the_crossing_is_a_zero_of_the_curve(fit):
    crossing = zero_crossing(fit)
    assert value_at(fit, crossing.value) == pytest.approx(0.0, abs=1e-6)
    assert crossing.unit == "rad"
    assert crossing.u == pytest.approx(
        estimate_at(fit, crossing.value).u / abs(slope_at(fit, crossing.value))
    )
    # near the truth's own crossing: Sv over BCD, less the shift
    assert crossing.value == pytest.approx(50 / (12 * 1.4 * 4000) - 0.004, abs=5 * crossing.u)


def test_a_curve_without_a_zero_has_no_crossing():
    one = Curve(SA=SA, y=value((12.0, 1.4, -1000.0, -1.0, 0.0, 1100.0), SA), channel="FY", load_N=1.0)
    assert zero_crossing(fit_curves([one])[0]) is None


def test_error_is_the_root_of_the_ratio_of_squares():
    assert error_percent(np.array([1.0, -1.0]), np.array([10.0, 10.0])) == pytest.approx(10.0)


def test_scatter_floor_is_the_scatter_within_bins():
    angles = np.radians(np.repeat([0.0, 1.0, 2.0], 4))
    y = np.array([9.0, 11, 9, 11, 19, 21, 19, 21, 29, 31, 29, 31])
    assert scatter_floor_percent(angles, y) == pytest.approx(100 * np.sqrt(12 / np.sum(y**2)))


def test_thin_bins_have_no_scatter_floor():
    assert scatter_floor_percent(np.radians(np.arange(13.0)), np.arange(13.0) + 1) is None


def test_loads_part_the_bins():
    angles, load = np.zeros(6), np.array([0, 0, 0, 1, 1, 1])
    assert scatter_floor_percent(angles, np.array([1.0, 1, 1, 5, 5, 5]), load) == 0.0


def test_catalogue_finds_the_models_by_their_files():
    # The names that the files contract gives.
    assert set(model_names()) == set(
        "magic_formula pacejka94 mf52 mf61 mf62 tmeasy treadsim lugre brush".split()
    )
    for name in model_names():
        assert find(name).name == name
        assert find(name).reference
    with pytest.raises(FitError, match="not available") as caught:
        find("magic_formla")
    assert "magic_formula" in caught.value.expected
    with pytest.raises(FitError, match="over all loads"):
        model("brush")


# Nominal loads of the machine's protocol [lbf], a spread of 3 % as its simulated tests have it.
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([(250, 567, 833, 1101, 1372), (100, 200, 400, 800, 1600), (900,)]),
)
@settings(max_examples=40, deadline=None)
def test_blocks_are_found_in_the_gaps(seed, nominal):
    rng = np.random.default_rng(seed)
    block = rng.permutation(np.repeat(np.arange(len(nominal)), 13))
    load = np.array(nominal, dtype=float)[block] * (1 + rng.uniform(-0.03, 0.03, len(block)))
    found = load_blocks(load)
    assert [set(block[rows].tolist()) for rows in found] == [{i} for i in range(len(nominal))]
    assert all(np.all(np.diff(rows) > 0) for rows in found)


def test_exact_loads_and_one_load():
    assert len(load_blocks(np.repeat([1000.0, 2000.0, 3000.0], 5))) == 3
    assert len(load_blocks(np.full(7, 1000.0))) == 1
    assert len(load_blocks(np.linspace(1000, 2000, 500))) == 1
