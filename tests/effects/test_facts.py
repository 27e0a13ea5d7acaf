"""What an effect must declare beside its equation: a fact that is missing is told by the effect's name."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from typing import get_args

import numpy as np
import pytest

from tests.effects.rig import driven, setting, tire
from tests.effects.test_effect_contract import ALL, by_name, usual
from toolkit.channels import CHANNELS
from toolkit.effects.effect import Effect
from toolkit.effects.facts import Where
from toolkit.effects.surroundings import MotionSizes
from toolkit.units import unit


class Case:
    """A case of every kind at once: each fact that a search asks for has an answer."""

    channel, source = "FY", "FZ"
    drivers = frozenset({"SA", "FZ", "T_AMBIENT"})
    outputs = frozenset({"FY", "MZ"})
    cells = frozenset({"D51", "D52", "E5"})
    nominal_load_N = 4000.0
    rows, row_time, minutes = 500, 0.02, 0.4
    integrates, way = True, (1.0, 0.01)
    motion = MotionSizes(
        force=5.0, speed=0.5, place=0.2, fastest=1.2, farthest=0.6, level=0.4, has_position=True
    )

    def spread(self, name):
        return 1.0 if name is None else 700.0

    def values(self, _name):
        return np.linspace(-700.0, 700.0, 30)

    def origin(self, _name):
        return None

    def widest(self, _name):
        return -700.0, 700.0

    def recorded_range(self, *_names):
        return 3.0

    def unit(self):
        return "N"

    def conditions(self, _key):
        return frozenset({"normal"})


@pytest.mark.parametrize("one", ALL, ids=by_name)
def test_the_kind_of_the_effect_has_its_facts(one):
    assert (one.channel is None) == (one.on_channel is None), "an effect on a channel says on which kinds"
    if one.on_channel is not None:
        assert set(one.on_channel.where) <= set(get_args(Where))
        assert one.on_channel.where or one.replaces_record, "no search would ever put it anywhere"
        assert not one.on_channel.paired or "cell" not in one.on_channel.where
    if one.term is not None:
        hooks = (one.term.force, one.term.limit)
        assert sum(hook is not None for hook in hooks) == 1, "a force, or a limit of the state"
        assert (one.term.limit is not None) == (one.term.of == "state")
        assert one.term.pattern is None or any(p.phase_of for p in one.parameters)
    assert one.discrete or one.parameters, "without a parameter it is there or not"
    assert not one.is_zero or len(one.parameters) == 1
    assert not one.alike or not one.alike.size or one.parameters
    assert not (one.correctable and one.not_correctable)
    assert not one.nuisance, "what is never named stands in no catalogue"


def test_ranks_within_a_stage_differ():
    ranks = Counter((one.stage, one.rank) for one in ALL)
    assert [place for place, count in ranks.items() if count > 1] == []


def test_a_class_has_more_than_one_member_and_at_most_one_that_is_corrected_for():
    groups = {}
    for one in ALL:
        if one.alike is not None:
            groups.setdefault(one.alike.group, []).append(one)
    for members in groups.values():
        assert len(members) > 1
        assert sum(one.correctable is not None for one in members) <= 1
    akin = Counter(one.akin for one in ALL if one.akin)
    assert all(count > 1 for count in akin.values())


@pytest.mark.parametrize("one", [e for e in ALL if e.drive or e.channel], ids=by_name)
def test_an_effect_that_follows_time_says_so(one):
    # The same rows, three times as slow: what sees no time does the same row by row.
    t = np.linspace(0.0, 4.0, 81)
    slow = dataclasses.replace(setting(3 * t), channels=setting(t).channels)
    if one.channel is not None:
        y = 3.0 * np.sin(2.0 * t)
        same = np.allclose(one.channel(y, usual(one), setting(t)), one.channel(y, usual(one), slow))
    else:
        d = driven(0.08 * np.sin(1.1 * t), 3000.0 + 500.0 * np.sin(0.4 * t), t=t)
        bare, slower = (dataclasses.replace(s, channels={}) for s in (setting(t), slow))
        first = tire(one.drive(d, usual(one), bare, tire))
        second = tire(one.drive(dataclasses.replace(d, t=3 * t), usual(one), slower, tire))
        same = np.allclose(first.FY, second.FY)
    assert one.in_time is not same


@pytest.mark.parametrize("one", ALL, ids=by_name)
def test_scales_starts_and_bounds_are_numbers(one):
    case = Case()
    here = one.in_case(case)
    assert here.parameters or one.discrete, "a case takes no effect all its parameters"
    for p in here.parameters:
        scale = 1.0 if p.scale is None else p.scale(case)
        assert math.isfinite(scale)
        assert scale > 0
        assert p.scale is not None or "{" not in p.unit, (
            "a value in the channel's unit needs the channel's scale"
        )
        starts = p.start_values(case) if p.start_values else tuple(scale * start for start in p.starts)
        assert all(math.isfinite(start) for start in starts)
        assert p.bounds[0] < p.bounds[1]
    numerics = {} if one.numerics is None else one.numerics(case)
    assert all(math.isfinite(value) for value in numerics.values())
    assert not set(numerics) & set(one.names)


@pytest.mark.parametrize("one", ALL, ids=by_name)
def test_bounds_of_a_motion_leave_room_for_the_starts(one):
    case = Case()
    for p in one.in_case(case).parameters:
        if p.start_values is not None and p.most is not None:
            assert all(p.bounds[0] <= start <= p.bounds[1] for start in p.start_values(case))


@pytest.mark.parametrize("one", [e for e in ALL if e.on_channel and e.on_channel.inverse], ids=by_name)
def test_an_inverse_takes_the_effect_away(one: Effect):
    t = np.linspace(0.0, 1.0, 20)
    y, values = np.sin(5 * t), usual(one)
    shown = one.channel(y, values, setting(t))
    np.testing.assert_allclose(one.on_channel.inverse(shown, values, setting(t)), y, rtol=1e-14)


@pytest.mark.parametrize("one", [e for e in ALL if e.correctable], ids=by_name)
def test_a_correction_takes_away_what_the_effect_adds(one: Effect):
    way = one.correctable
    rows = {"SA": np.array([0.02]), "FZ": np.array([4e3]), "FY": np.array([-900.0]), "MZ": np.array([30.0])}
    channel, source = (way.channels[0], way.sources[0]) if way.channels else (None, None)
    name, values = way.undo(rows, rows, 0.01, channel, source)
    assert name in rows
    assert values.shape == (1,)
    np.testing.assert_array_equal(way.undo(rows, rows, 0.0, channel, source)[1], rows[name])
    si = {name: CHANNELS[name].si for name in rows}
    text = way.unit.format_map({"channel": si.get(channel, ""), "from": si.get(source, "")})
    assert unit(text).factor > 0
    assert (way.u_slip is not None) == (name == "SA")


@pytest.mark.parametrize("one", ALL, ids=by_name)
def test_signs_in_axes_are_of_known_channels(one):
    for p in one.parameters:
        assert {p.sign_in(axes) for axes in ("SAE", "adapted-SAE", "ISO-W", "machine")} <= {-1, 1}
        assert all(p.sign_between(axes, axes) == 1 for axes in ("SAE", "ISO-W", "machine"))
