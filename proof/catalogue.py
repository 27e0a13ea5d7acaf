"""The families of cases: how each is built, what it can conceal, and how often it is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from proof import cell_cases, dynamic_cases, labview_cases, slow_cases, tire_cases
from proof.model import Scenario

Builder = Callable[[np.random.Generator, frozenset[str]], Scenario]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One plant with its plan."""

    build: Builder
    weight: float
    inside: tuple[str, ...]
    """Effects of the contract's catalogue that may stand alone."""
    outside: tuple[str, ...]


_TIRE = tuple(
    """relaxation channel_delay filter_lag zero_offset zero_drift thermal_drift creep hysteresis nonlinearity
    crosstalk sensitivity_error saturation quantisation dead_band rectification unit_error channel_sign
    steer_compliance backlash thermal_friction wear load_friction speed_friction viscoelastic_settling
    nonuniformity drum_runout turn_slip drum_curvature surface_friction""".split()
)
_MACHINE = ("pressure_change", "camber_offset", "conicity", "load_lag")
_TIRE_OUTSIDE = ("hidden_ambient", "hidden_resonance", "hidden_line", "hidden_pulse")
_BEAM = tuple(
    """zero_offset zero_drift saturation quantisation sensitivity_error nonlinearity hysteresis creep
    dead_band
    thermal_drift channel_sign""".split()
)
_BEAM_OUTSIDE = ("hidden_slip", "hidden_ambient")

FAMILIES: dict[str, Family] = {
    "tire-machine": Family(
        build=lambda rng, needs: tire_cases.build(rng, kind="machine", needs=needs),
        weight=4, inside=(*_TIRE, *_MACHINE), outside=_TIRE_OUTSIDE,
    ),
    "tire-cells": Family(
        build=cell_cases.build, weight=2,
        inside=("relaxation", "steer_compliance", "backlash", "thermal_friction", "wear", "nonuniformity",
                "drum_runout", "turn_slip", *(e for e in cell_cases.CELL_EFFECTS if e != "channel_sign")),
        outside=("hidden_ambient", "hidden_line", "hidden_pulse"),
    ),
    "labview": Family(
        build=labview_cases.build, weight=1, inside=("wrong_calibration", "channel_swap", "unit_error"),
        outside=("hidden_tare",),
    ),
    "tire-python": Family(
        build=lambda rng, needs: tire_cases.build(rng, kind="python", needs=needs),
        weight=3, inside=_TIRE, outside=_TIRE_OUTSIDE,
    ),
    "tire-columns": Family(
        build=lambda rng, needs: tire_cases.build(rng, kind="columns", needs=needs),
        weight=2, inside=_TIRE, outside=_TIRE_OUTSIDE,
    ),
    "pendulum": Family(
        build=lambda rng, _: dynamic_cases.pendulum(rng), weight=2,
        inside=tuple("""coulomb_friction viscous_damping quadratic_drag cubic_stiffness constant_force
                     periodic_ripple channel_delay filter_lag quantisation saturation zero_drift
                     channel_sign""".split()),
        outside=("hidden_resonance", "hidden_gust"),
    ),
    "drive": Family(
        build=lambda rng, _: dynamic_cases.drive(rng), weight=2,
        inside=tuple("""coulomb_friction quadratic_drag cubic_stiffness constant_force periodic_ripple
                     quantisation filter_lag channel_delay saturation""".split()),
        outside=("hidden_resonance", "hidden_gust"),
    ),
    "drive-force": Family(
        build=lambda rng, _: dynamic_cases.drive_force(rng), weight=2,
        inside=("coulomb_friction", "quadratic_drag", "quantisation", "dead_band", "filter_lag",
            "zero_drift"),
        outside=("hidden_detent",),
    ),
    "tank": Family(
        build=lambda rng, _: slow_cases.tank(rng), weight=1.5,
        inside=("overflow", "saturation", "zero_drift", "zero_offset",
                "quantisation", "channel_delay", "filter_lag"),
        outside=("hidden_hatch",),
    ),
    "thermal": Family(
        build=lambda rng, _: slow_cases.thermal(rng), weight=1.5,
        inside=("zero_offset", "zero_drift", "channel_delay", "filter_lag",
                "sensitivity_error", "channel_swap"),
        outside=("hidden_radiation", "hidden_mass"),
    ),
    "beam-python": Family(
        build=lambda rng, _: slow_cases.beam(rng, kind="python"), weight=2, inside=_BEAM,
            outside=_BEAM_OUTSIDE,
    ),
    "beam-columns": Family(
        build=lambda rng, _: slow_cases.beam(rng, kind="columns"), weight=1.5, inside=_BEAM,
        outside=_BEAM_OUTSIDE,
    ),
}  # fmt: skip


ONE_SIZE = ("unit_error", "channel_sign", "rectification", "channel_swap", "wrong_calibration")
"""Effects that are there or not: half as often as the others, and never one of two."""


def share_of(name: str) -> float:
    """Return how often an effect is drawn in its family against the others there."""
    if name in ONE_SIZE:
        return 1.0 if name == "wrong_calibration" else 0.5
    return 4.0 if name in _MACHINE else 1.0  # one family alone can show them


@dataclass(frozen=True, slots=True, kw_only=True)
class Confounded:
    """A recording that cannot tell the effects of a class apart; one of them is there."""

    family: str
    build: Builder
    present: tuple[str, ...]
    """Any of these is put in."""
    members: frozenset[str]
    reason: str
    """Why no analysis of this recording can part them."""
    needs: frozenset[str] = frozenset()


CONFOUNDED: dict[str, Confounded] = {
    "steering zero": Confounded(
        family="tire-machine", build=FAMILIES["tire-machine"].build, present=("steer_offset", "plysteer"),
        members=frozenset({"steer_offset", "plysteer"}),
        reason="both turn the slip angle by a constant at every load, speed and direction of the drum",
    ),
    "pull by load": Confounded(
        family="tire-machine", build=FAMILIES["tire-machine"].build,
        present=("conicity", "camber_offset", "crosstalk"),
        members=frozenset({"conicity", "camber_offset", "crosstalk"}), needs=frozenset({"reverse", "pull"}),
        reason="each gives a force that grows with load and keeps its sign on reversal; the tire was not"
        " turned round on the hub, and the tire file's camber response is not taken as proof",
    ),
    "one steering rate": Confounded(
        family="tire-columns",
        build=lambda rng, _: tire_cases.one_rate(rng), present=("relaxation", "channel_delay", "filter_lag"),
        members=frozenset({"relaxation", "channel_delay", "filter_lag"}),
        reason="one frequency of small steering at one speed and load: each is the same phase lag",
    ),
    "one speed": Confounded(
        family="drive-force", build=lambda rng, _: dynamic_cases.drive_force(rng, one_speed=True),
        present=("coulomb_friction", "viscous_damping", "quadratic_drag"),
        # the nominal force is viscous alone here, so that a gain of the channel is the same once more
        members=frozenset({"coulomb_friction", "viscous_damping", "quadratic_drag", "sensitivity_error"}),
        reason="only +v and -v occur: every friction law has the same two values",
    ),
    "steady warming": Confounded(
        family="beam-python", build=lambda rng, _: slow_cases.beam(rng, kind="python", steady_warming=True),
        present=("zero_drift", "thermal_drift"), members=frozenset({"zero_drift", "thermal_drift"}),
        reason="the temperature rises in proportion to time",
    ),
    "sign in the program": Confounded(
        family="labview", build=FAMILIES["labview"].build, present=("channel_sign", "wrong_calibration"),
        members=frozenset({"channel_sign", "wrong_calibration"}), needs=frozenset({"sign"}),
        reason="a cell read with the wrong sign and a record with that sign wrong give the same numbers",
    ),
    "sign of a cell": Confounded(
        family="tire-cells", build=FAMILIES["tire-cells"].build, present=("channel_sign",),
        members=frozenset({"channel_sign", "wrong_calibration"}),
        reason="a cell read with the wrong sign and a record with that sign wrong give the same numbers",
    ),
}  # fmt: skip
