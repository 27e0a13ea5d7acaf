"""A law that may be off by a share of what it does leaves its size uncertain, however long the recording."""

import math

import pytest

from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect


def test_the_share_is_a_limit_to_both_sides():
    friction = AppliedEffect(effect=effect("coulomb_friction"), values={"coulomb": 20.0, "presliding": 0.01})
    size, distance = friction.searched
    assert friction.form_uncertainty(size) == pytest.approx(0.03 * 20.0 / math.sqrt(3))
    assert friction.form_uncertainty(distance) == 0.0, "a distance has no size to be off by"


def test_a_factor_counts_from_where_it_does_nothing():
    surface = AppliedEffect(effect=effect("surface_friction"), values={"mu_factor": 0.9})
    (factor,) = surface.searched
    assert surface.form_uncertainty(factor) == pytest.approx(0.03 * 0.1 / math.sqrt(3))


def test_an_exact_law_leaves_nothing_open():
    offset = AppliedEffect(effect=effect("zero_offset"), channel="FY", values={"offset": 5.0})
    assert offset.form_uncertainty(offset.searched[0]) == 0.0


@pytest.mark.parametrize(("name", "uncertain"), [("saturation", 0.0), ("overflow", math.inf)])
def test_a_limit_of_a_sensor_has_no_uncertainty_of_its_form_and_that_of_a_state_has_no_bound(name, uncertain):
    applied = AppliedEffect(effect=effect(name), channel="U", values={"level": 0.7, "share": 0.0})
    assert applied.form_uncertainty(applied.effect.parameter("level")) == uncertain
