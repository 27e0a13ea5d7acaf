"""What every effect of the catalogue must keep: metadata, known units, nothing when off, pure, finite."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from tests.effects.rig import driven, setting, tire
from toolkit.effects.catalogue import effect, effects
from toolkit.effects.effect import STAGES, Effect
from toolkit.effects.signals import Drive
from toolkit.errors import ConfigError
from toolkit.machine import load_machine
from toolkit.simulation.effect_text import parse_effect
from toolkit.units import unit

# The names that the contract fixes, with their parameters in order ("" where there is nothing to fit).
CONTRACT = {
    "unit_error": "factor", "channel_sign": "", "channel_swap": "", "wrong_calibration": "",
    "channel_delay": "delay", "filter_lag": "time_constant", "saturation": "level", "quantisation": "step",
    "dead_band": "width", "rectification": "", "zero_offset": "offset", "zero_drift": "rate",
    "thermal_drift": "coefficient", "creep": "fraction time_constant", "hysteresis": "width",
    "nonlinearity": "quadratic cubic", "crosstalk": "coefficient", "sensitivity_error": "gain_error",
    "steer_offset": "offset", "camber_offset": "angle", "steer_compliance": "compliance", "backlash": "gap",
    "load_lag": "time_constant", "relaxation": "relaxation_length",
    "thermal_friction": "peak_per_K stiffness_per_K", "pressure_change": "pressure_error", "wear": "rate",
    "plysteer": "pseudo_slip_angle", "conicity": "force_at_nominal_load", "load_friction": "sensitivity",
    "speed_friction": "sensitivity", "viscoelastic_settling": "fraction time_constant",
    "nonuniformity": "amplitude_1 phase_1", "turn_slip": "force", "drum_curvature": "reduction",
    "surface_friction": "mu_factor", "drum_runout": "amplitude_1 phase_1", "constant_force": "force",
    "coulomb_friction": "coulomb", "viscous_damping": "viscous", "quadratic_drag": "drag",
    "cubic_stiffness": "k3", "periodic_ripple": "amplitude period", "overflow": "level",
}  # fmt: skip
ALL = list(effects().values())
CHANNEL = [one for one in ALL if one.channel is not None]
DRIVE = [one for one in ALL if one.drive is not None]
FORCE = [one for one in ALL if one.term is not None and one.term.force is not None]


def by_name(one: Effect) -> str:
    return one.name


def usual(one: Effect) -> dict[str, float]:
    return {p.name: p.starts[0] if p.starts else sum(p.typical) / 2 for p in one.parameters}


def off(one: Effect) -> dict[str, float]:
    return usual(one) | {p.name: p.off for p in one.parameters if p.off is not None}


def extremes(one: Effect) -> list[dict[str, float]]:
    ends = []
    for side in (0, 1):
        values = {}
        for p in one.parameters:
            bound = p.bounds[side] if math.isfinite(p.bounds[side]) else 10 * p.typical[side]
            values[p.name] = bound
        ends.append(values)
    return [usual(one), *ends]


def test_the_catalogue_holds_every_name_of_the_contract():
    assert set(CONTRACT) <= set(effects())
    for name, parameters in CONTRACT.items():
        assert effects()[name].names[: len(parameters.split())] == tuple(parameters.split()), name


@pytest.mark.parametrize("one", ALL, ids=by_name)
def test_metadata_is_whole(one):
    assert one.stage in STAGES
    assert sum(hook is not None for hook in (one.drive, one.channel, one.term)) == 1
    for text in (one.equation, one.reference, one.signature, one.separates):
        assert len(text) > 3
    assert re.fullmatch(r"[A-Z].*[.]", one.statement)
    assert ". " not in one.statement, "one sentence"
    assert len(set(one.names)) == len(one.names)
    for p in one.parameters:
        assert p.text
        assert p.typical[0] < p.typical[1]
        assert p.bounds[0] <= p.typical[0]
        assert p.bounds[1] >= p.typical[1]
        if p.off is not None and math.isfinite(p.off):
            assert p.bounds[0] <= p.off <= p.bounds[1]
        if not p.relative:
            assert all(p.bounds[0] <= start <= p.bounds[1] for start in p.starts)
    assert one.drive is None or one.stage in ("carriage", "tire", "road")
    assert (one.term is not None) == (one.stage == "dynamics")
    known = {"surface", "pressure", "date", "order", "repeat_of", "phase", "*"}
    # a simulator that does not know of reversal has the wrong sign in some runs: nothing else is so gross
    known |= {"rotation", "mounting"} if one.name == "channel_sign" else set()
    assert set(one.confined_by) <= known


@pytest.mark.parametrize("one", ALL, ids=by_name)
def test_units_are_known(one):
    places = {"channel": "(mV/V)", "from": "N", "force": "N", "velocity": "(m/s)", "position": "m"}
    for p in one.parameters:
        assert unit(p.unit.format_map(places)).factor > 0


def test_the_doc_of_the_file_says_what_it_is():
    import importlib

    for name in effects():
        module = importlib.import_module(f"toolkit.effects.catalogue.{name}")
        assert module.__doc__
        assert module.EFFECT.name == name


@pytest.mark.parametrize("one", DRIVE, ids=by_name)
def test_a_drive_effect_that_is_off_changes_nothing(one):
    d = ramp()
    made = one.drive(d, off(one), setting(d.t), tire)
    before, after = tire(d), tire(made)
    assert np.array_equal(before.FY, after.FY)
    assert np.array_equal(before.MZ, after.MZ)


@pytest.mark.parametrize("one", [e for e in CHANNEL if e.parameters], ids=by_name)
def test_a_channel_effect_that_is_off_changes_nothing(one):
    t = np.linspace(0.0, 5.0, 101)
    y = 3.0 * np.sin(2.0 * t) - 0.5
    assert np.array_equal(one.channel(y, off(one), setting(t)), y)


@pytest.mark.parametrize("one", FORCE, ids=by_name)
def test_a_force_that_is_off_is_none(one):
    assert all(
        one.term.force(x, v, off(one)) == 0.0 for x in (-1.0, 0.0, 2.0) for v in (-3.0, 0.0, 1e-5, 4.0)
    )


@pytest.mark.parametrize("one", [*DRIVE, *CHANNEL], ids=by_name)
def test_a_hook_is_pure(one):
    d = ramp()
    here = setting(d.t)
    frozen = [*(getattr(d, f.name) for f in dataclasses.fields(d)), *here.channels.values()]
    y = np.sin(d.t)
    for array in (*frozen, y):
        array.flags.writeable = False
    copies = [array.copy() for array in (*frozen, y)]
    values = usual(one)
    if one.drive is not None:
        first = tire(one.drive(d, values, here, tire))
        again = tire(one.drive(d, values, here, tire))
        assert np.array_equal(first.FY, again.FY)
    else:
        assert np.array_equal(one.channel(y, values, here), one.channel(y, values, here))
    assert all(np.array_equal(a, b) for a, b in zip((*frozen, y), copies, strict=True))
    assert values == usual(one)


def ramp() -> Drive:
    t = np.linspace(0.0, 6.0, 121)
    return driven(0.08 * np.sin(1.1 * t), 3000.0 + 500.0 * np.sin(0.4 * t), t=t)


def hostile():
    t = np.linspace(0.0, 2.0, 21)
    zero = np.zeros(21)
    yield "no load", driven(0.05, 0.0, t=t)
    yield "lifted", driven(0.05, -50.0, t=t)
    yield "one row", driven(0.05, 4000.0, t=t[:1])
    yield "constant", driven(0.0, 4000.0, t=t)
    yield "standing", driven(0.05, 4000.0, t=t, V=0.0)
    yield "backward", driven(0.05, 4000.0, t=t, V=-2.0)
    yield "huge", driven(1.2, 1e5, t=t)
    yield "step", driven(np.where(t > 1, 0.1, -0.1), np.where(t > 1.5, 6000.0, 0.0), t=t)
    yield "uneven", driven(0.05 * np.sin(t**3), 4000.0 + zero, t=t**3 + 1e-3 * t)


@pytest.mark.parametrize("one", DRIVE, ids=by_name)
@pytest.mark.parametrize(("what", "d"), list(hostile()), ids=[name for name, _ in hostile()])
def test_a_drive_effect_is_finite_on_hostile_signals(one, what, d):
    for values in extremes(one):
        made = tire(one.drive(d, values, setting(d.t), tire))
        assert np.isfinite(made.FY).all(), (what, values)
        assert np.isfinite(made.MZ).all(), (what, values)
        assert made.FY.shape == d.t.shape


@pytest.mark.parametrize("one", CHANNEL, ids=by_name)
@pytest.mark.parametrize("rows", [1, 2, 40])
def test_a_channel_effect_is_finite_on_hostile_signals(one, rows):
    t = np.linspace(0.0, 1.0, rows)
    for y in (np.zeros(rows), np.full(rows, -7.0), np.linspace(-1e6, 1e6, rows)):
        for values in extremes(one):
            for here in (setting(t), setting(t, channels={}, first={})):
                made = one.channel(y, values, here)
                assert np.isfinite(made).all(), values
                assert made.shape == y.shape


@pytest.mark.parametrize("one", FORCE, ids=by_name)
def test_a_force_is_finite(one):
    for values in (usual(one), extremes(one)[2]):
        assert all(
            math.isfinite(one.term.force(x, v, values)) for x in (-1e3, 0.0, 1e3) for v in (-1e3, 0.0, 1e3)
        )


def test_an_unknown_name_is_told_with_the_nearest():
    with pytest.raises(ConfigError) as caught:
        effect("relaxaton")
    assert "did you mean 'relaxation'?" in str(caught.value)
    assert caught.value.rule == "unknown-effect"


@pytest.mark.parametrize("one", [e for e in ALL if e.stage != "dynamics"], ids=by_name)
def test_every_effect_of_the_machine_can_be_written(one):
    paired = one.on_channel is not None and one.on_channel.paired
    place = (".D51.D52" if one.exchanges else ".FZ.FY") if paired else ""
    value = "=m15-r1" if one.replaces_record else "".join(f"={p}" for p in written(one))
    made = parse_effect(f"{one.name}{place}{value}", load_machine("m15-virtual"))
    assert all(each.effect is one for each in made)
    assert all(set(each.values) == set(one.names) for each in made)


def written(one: Effect) -> list[str]:
    if not one.parameters:
        return []
    return [",".join(f"{name}:{value!r}" for name, value in usual(one).items())]
