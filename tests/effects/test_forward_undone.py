"""An effect taken out of a recorded channel: to the last digit, or told where nothing has an inverse."""

import numpy as np
import pytest

from tests.effects.rig import setting
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.effects.forward import undone
from toolkit.errors import FitError

T = np.linspace(0, 10, 101)
CARRIED = 800 * np.sin(T) + 100


def bent(x, quadratic, cubic):
    return x + quadratic * x**2 + cubic * x**3


def out(shown, quadratic, cubic):
    one = AppliedEffect(
        effect=effects()["nonlinearity"], channel="E5", values={"quadratic": quadratic, "cubic": cubic}
    )
    return undone(shown, one, setting(T), {})


@pytest.mark.parametrize(("quadratic", "cubic"), [(0.02, 0.0), (0.0, 0.02), (0.01, -0.01), (0.0, 0.0)])
def test_a_mild_bend_is_taken_out(quadratic, cubic):
    of = (quadratic / 900, cubic / 900**2)  # of the largest value
    np.testing.assert_allclose(out(bent(CARRIED, *of), *of), CARRIED, atol=1e-6 * 900)


@pytest.mark.parametrize("times", [30.0, 1e3, 1e12, 1e200])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_bend_of_many_times_the_value_cannot_be_taken_out(times, sign):
    with pytest.raises(FitError) as caught:
        out(CARRIED, 0.0, sign * times / 900**2)
    assert caught.value.where == "E5"
    assert str(caught.value.got).startswith("nonlinearity: ")
    assert f"cubic = {sign * times / 900**2:.4g}" in str(caught.value.got)
    assert all((caught.value.what, caught.value.expected, caught.value.next_step))
    assert caught.value.rule == "simulator"


def test_what_the_search_keeps_for_itself_is_not_told():
    values = {"quadratic": 0.0, "cubic": 1.0, "_size_cubic": 2.5}
    with pytest.raises(FitError) as caught:
        undone(
            CARRIED,
            AppliedEffect(effect=effects()["nonlinearity"], channel="E5", values=values),
            setting(T),
            {},
        )
    assert "_size" not in str(caught.value.got)


def test_a_lost_row_stays_lost_and_disturbs_no_other():
    shown = bent(CARRIED, 0.0, 0.02 / 900**2)
    whole = out(shown, 0.0, 0.02 / 900**2)
    holed = np.where(np.arange(101) % 25 == 7, np.nan, shown)
    made = out(holed, 0.0, 0.02 / 900**2)
    np.testing.assert_array_equal(np.isnan(made), np.isnan(holed))
    kept = ~np.isnan(holed)
    np.testing.assert_allclose(made[kept], whole[kept], rtol=0, atol=1e-6 * 900)
    np.testing.assert_allclose(made[kept], CARRIED[kept], rtol=0, atol=1e-6 * 900)


def test_a_lost_row_hides_no_runaway():
    holed = CARRIED.copy()
    holed[3] = np.nan
    with pytest.raises(FitError):
        out(holed, 0.0, 1e3 / 900**2)


def test_a_channel_that_was_lost_or_stood_at_nothing_has_nothing_to_take_out():
    assert np.isnan(out(np.full(101, np.nan), 0.0, 1e-8)).all()
    np.testing.assert_array_equal(out(np.zeros(101), 0.0, 1e3), 0.0)


def test_an_offset_is_taken_out_of_a_channel_that_showed_nothing():
    one = AppliedEffect(effect=effects()["zero_offset"], channel="E5", values={"offset": 0.1})
    t = np.arange(5.0)
    np.testing.assert_allclose(undone(np.zeros(5), one, setting(t), {}), -0.1)


def test_what_has_a_memory_is_taken_out_behind_a_lost_row_too():
    one = AppliedEffect(
        effect=effects()["creep"], channel="E5", values={"fraction": 0.1, "time_constant": 4.0}
    )
    t = np.arange(30.0)
    true = np.full(30, 50.0)
    shown = one.effect.channel(true, one.values, setting(t))
    shown[7] = np.nan
    found = undone(shown, one, setting(t), {})
    assert np.isnan(found[7])
    np.testing.assert_allclose(np.delete(found, 7), 50.0, rtol=1e-6)
