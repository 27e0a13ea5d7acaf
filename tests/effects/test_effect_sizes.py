"""How likely an effect's size is before a recording speaks: from the range that its own file declares."""

import dataclasses
import math

import numpy as np
import pytest

from toolkit.effects.catalogue import effects
from toolkit.effects.effect import EffectParameter

SIZES = [
    pytest.param(parameter, id=f"{effect.name}.{parameter.name}")
    for effect in effects().values()
    if not effect.discrete
    for parameter in effect.parameters
    if parameter.off is not None
]


def integral(mass):
    """Return the integral over all sizes, by Simpson's rule over their logarithm."""
    from scipy.integrate import simpson

    logarithms = np.linspace(-30, 30, 60_001)
    return simpson([mass(x) for x in logarithms], x=logarithms)


@pytest.mark.parametrize("parameter", SIZES)
def test_a_size_has_a_range_on_one_side_of_nothing_or_around_it(parameter):
    low, high = parameter.typical
    assert low * high > 0 or low < parameter.off < high
    assert math.isfinite(parameter.log_density(high))


def test_the_density_of_a_range_on_one_side_holds_all_sizes_and_95_percent_within():
    gap = EffectParameter(name="gap", unit="deg", text="play", typical=(0.05, 0.5))
    assert integral(lambda x: math.exp(gap.log_density(math.exp(x)))) == pytest.approx(1, abs=1e-6)
    within = integral(lambda x: math.exp(gap.log_density(math.exp(x))) * (0.05 <= math.exp(x) <= 0.5))
    assert within == pytest.approx(0.9545, abs=1e-3)  # two standard deviations of a normal


def test_the_density_of_a_range_around_nothing_holds_all_sizes():
    factor = EffectParameter(name="mu", unit="1", text="grip", typical=(0.8, 1.2), off=1.0)
    assert integral(lambda x: math.exp(factor.log_density(1 + math.exp(x)))) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("typical", [(0.05, 0.5), (-0.5, -0.05)])
def test_a_density_is_the_same_in_every_unit(typical):
    in_degrees = EffectParameter(name="gap", unit="deg", text="play", typical=typical)
    radians = tuple(float(np.deg2rad(end)) for end in typical)
    in_radians = dataclasses.replace(in_degrees, unit="rad", typical=radians)
    for size in (0.01, 0.1, 3.0):
        assert in_radians.log_density(float(np.deg2rad(size))) == pytest.approx(in_degrees.log_density(size))


def test_no_size_at_all_is_never_met():
    assert EffectParameter(name="gap", unit="deg", text="play", typical=(0.1, 1)).log_density(0) == -math.inf
