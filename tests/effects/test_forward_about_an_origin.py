"""Effects on a channel whose scale has a zero by convention: they do the same whatever the zero is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.effects.rig import setting
from tests.effects.test_effect_contract import CHANNEL, by_name, usual
from toolkit.effects.applied import ORIGIN, SOURCE_ORIGIN, AppliedEffect
from toolkit.effects.catalogue import effect
from toolkit.effects.forward import through, undone
from toolkit.units import unit

T = np.linspace(0.0, 5.0, 60)
SHOWN = 4.0 * np.sin(T) + 0.7 * T
SHIFT = 273.15
ONE_CHANNEL = [one for one in CHANNEL if not one.exchanges and not one.replaces_record]


def shown_by(one, y, source, **origins):
    applied = AppliedEffect(
        effect=one, channel="y", source="x" if one.second else None, values=usual(one) | origins
    )
    return through({"y": y}, [applied], setting(T), recorded={"x": source})["y"]


@pytest.mark.parametrize("one", ONE_CHANNEL, ids=by_name)
def test_an_effect_depends_on_the_zero_only_where_it_says_so(one):
    source = np.cos(T)
    plain = shown_by(one, SHOWN, source)
    moved = shown_by(one, SHOWN + SHIFT, source + SHIFT) - SHIFT
    assert np.allclose(plain, moved, atol=1e-9) is not one.on_channel.about_zero


@pytest.mark.parametrize("one", ONE_CHANNEL, ids=by_name)
def test_counted_from_an_origin_an_effect_is_the_same_about_every_zero(one):
    source = np.cos(T)
    plain = shown_by(one, SHOWN, source, **{ORIGIN: 1.5, SOURCE_ORIGIN: 0.5})
    moved = shown_by(one, SHOWN + SHIFT, source + SHIFT, **{ORIGIN: 1.5 + SHIFT, SOURCE_ORIGIN: 0.5 + SHIFT})
    assert moved - SHIFT == pytest.approx(plain, abs=1e-9)


@pytest.mark.parametrize("name", ["sensitivity_error", "nonlinearity"])
def test_what_acts_about_an_origin_is_undone_about_it(name):
    one = effect(name)
    values = {"gain_error": 0.05} if name == "sensitivity_error" else {"quadratic": 0.004, "cubic": 0.0002}
    applied = AppliedEffect(effect=one, channel="y", values=values | {ORIGIN: 20.0})
    y = SHOWN + 20.0
    shown = through({"y": y}, [applied], setting(T))["y"]
    assert undone(shown, applied, setting(T), {}) == pytest.approx(y, abs=1e-7)


def test_temperatures_alone_have_a_zero_by_convention():
    assert [unit(text).is_interval for text in ("degC", "degF", "K")] == [True] * 3
    assert not any(unit(text).is_interval for text in ("N", "deg", "bar", "mm", "V", "1", "K/s"))
    assert not unit("delta_degC").is_interval
    assert dataclasses.replace(unit("K"), text="kelvin").is_interval
