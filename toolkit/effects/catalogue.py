"""The catalogue: every effect by its name, one file each."""

from __future__ import annotations

import difflib
import importlib
from functools import cache

from toolkit.effects.effect import Effect
from toolkit.errors import ConfigError

NAMES = tuple(
    """
    unit_error channel_sign channel_swap wrong_calibration channel_delay filter_lag saturation quantisation
    dead_band rectification zero_offset zero_drift thermal_drift creep hysteresis nonlinearity crosstalk
    sensitivity_error steer_offset camber_offset steer_compliance backlash load_lag relaxation
    thermal_friction pressure_change wear plysteer conicity load_friction speed_friction
    viscoelastic_settling nonuniformity turn_slip drum_curvature surface_friction drum_runout
    constant_force coulomb_friction viscous_damping quadratic_drag cubic_stiffness periodic_ripple overflow
    """.split()
)


@cache
def effects() -> dict[str, Effect]:
    """Return every effect of the catalogue by its name, in the catalogue's order."""
    return {name: importlib.import_module(f"toolkit.effects.{name}").EFFECT for name in NAMES}


def effect(name: str, *, where: str = "--effect") -> Effect:
    """Return one effect.

    Raises
    ------
    ConfigError
        no effect has that name
    """
    if name in NAMES:
        return effects()[name]
    near = difflib.get_close_matches(name, NAMES, n=1, cutoff=0.5)
    raise ConfigError(
        f"unknown effect {name!r}", where=where, got=name, expected=", ".join(NAMES),
        next_step=f"did you mean {near[0]!r}?" if near else "use one of those expected",
        rule="unknown-effect",
    )  # fmt: skip
