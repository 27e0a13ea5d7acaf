"""What an effect has seen before the first row: which of them remember, and how the past is told them."""

import dataclasses

import numpy as np
import pytest

from tests.effects.rig import SPEED, driven, setting, tire
from toolkit.effects.catalogue import effects
from toolkit.effects.filters import PAST, begun, delayed, filtered, play, plays

T = np.arange(200) * 0.05
CUT = 28  # rows that a shorter recording does not have
ALL = list(effects().values())


def usual(one):
    return {p.name: p.starts[-1] if p.starts else sum(p.typical) / 2 for p in one.parameters} | NUMERICS


NUMERICS = {"_span": 1.0, "_middle": 0.0}
"""Of a whole case, so that they are the same of a shorter recording."""


def shown(one, rows, past=0.0):
    """Return what an effect shows of a motion that began before the first of some rows."""
    t = T[rows]
    # the time since the test began and the slip work before are stated of a run: they are no unknown past
    here = setting(T, slip_work_before_kJ=0.0)
    here = dataclasses.replace(
        here, t=t, elapsed_s=here.elapsed_s[rows],
        channels={name: column[rows] for name, column in here.channels.items()},
    )  # fmt: skip
    values = usual(one) | ({PAST: past} if past else {})
    if one.channel is not None:
        return one.channel(np.sin(1.3 * T)[rows], values, here)
    if one.drive is not None:
        if one.name == "thermal_friction":  # a recorded temperature has no memory
            here = dataclasses.replace(here, channels={})
        d = driven(0.08 * np.sin(1.1 * t), 3000 + 900 * np.sin(0.9 * t), t=t, V=SPEED)
        made = tire(one.drive(d, values, here, tire))
        return np.concatenate([made.FY, made.MZ])
    return one.term.recorded(t, np.cos(2.0 * t), values)


def acts_in_rows(one):
    return one.channel is not None or one.drive is not None or one.term.recorded is not None


@pytest.mark.parametrize("one", [e for e in ALL if acts_in_rows(e)], ids=lambda one: one.name)
def test_an_effect_whose_rows_depend_on_those_before_says_that_it_remembers(one):
    whole, late = shown(one, slice(0, None)), shown(one, slice(CUT, None))
    # but for two rows, of which a rate is taken to one side
    whole, late = (
        made.reshape(-1, rows)[:, skip:]
        for made, rows, skip in ((whole, len(T), CUT + 2), (late, len(T) - CUT, 2))
    )
    same = np.allclose(whole, late, rtol=1e-9, atol=1e-12)
    if one.by_slip_work:  # what came before is stated of a run: `Setting.slip_work_before_kJ`
        assert not one.remembers
    else:
        assert one.remembers is not same


@pytest.mark.parametrize("one", [e for e in ALL if e.remembers], ids=lambda one: one.name)
def test_a_past_shows_in_the_first_rows_and_fades(one):
    rest, moved, twice = (shown(one, slice(0, None), past) for past in (0.0, 1e-4, 2e-4))
    change = np.abs(moved - rest)[: len(T)]
    assert change.max() > 0
    assert np.argmax(change) < len(T) / 4
    assert np.allclose(twice - rest, 2 * (moved - rest), rtol=1e-2, atol=2e-2 * np.abs(moved - rest).max())


def test_a_filter_forgets_where_it_was_by_its_time_constant():
    x = np.sin(T)
    moved = filtered(T, x, 0.3, start=begun(x, {PAST: 0.5})) - filtered(T, x, 0.3)
    assert moved == pytest.approx(0.5 * np.ptp(x) * np.exp(-T / 0.3), abs=1e-9)
    assert begun(x, {}) is None


@pytest.mark.parametrize(("delay", "unseen"), [(0.12, slice(0, 3)), (-0.12, slice(-3, None))])
def test_a_delay_has_no_rows_of_the_time_before_the_first(delay, unseen):
    x = np.sin(T)
    changed = np.zeros(len(T), dtype=bool)
    changed[unseen] = True
    moved = delayed(T, x, delay, past=0.5) != delayed(T, x, delay)
    assert np.array_equal(moved, changed)


def test_a_gap_is_entered_anywhere_within_it():
    x = np.linspace(0.0, 1.0, 50)
    for past in (-1.0, 0.0, 1.0):
        made = play(x, 0.4, past)
        assert made[0] == pytest.approx(0.2 * past)
        assert made[-1] == pytest.approx(0.8)
    halves = np.array([0.1, 0.3])
    assert plays(x, halves, 0.0)[0] == 0.0
    assert plays(x, halves, 1.0)[0] == pytest.approx(0.2)
