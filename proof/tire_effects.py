"""What a case of the tire machine may conceal, at typical sizes."""

from __future__ import annotations

import numpy as np

from proof import specs
from proof.model import EffectSpec


def _touches(rng: np.random.Generator, seconds: float) -> list[float]:
    """Return when something begins to touch the frame: once in each of three runs, for a fifth of it."""
    runs = rng.choice(6, 3, replace=False)
    return sorted(float(i * (seconds + 25.0) + seconds * rng.uniform(0.15, 0.6)) for i in runs)


def effects(
    rng: np.random.Generator, *, peak_N: float, seconds: float, pull: bool, commanded: bool
) -> dict[str, EffectSpec]:
    """Return what a tire case may conceal; `seconds` is a run's length.

    `pull`: crosstalk goes from the load to FY, where it is one class with conicity and camber, else to MZ.
    `commanded`: the lag of the load acts on the tire, else it is seen in the load alone.
    """
    sign = lambda: float(rng.choice([-1.0, 1.0]))  # noqa: E731
    phase = lambda: float(rng.uniform(-180, 180))  # noqa: E731

    spec, same = specs.spec, specs.same
    fy, mz = {"channel": "FY"}, {"channel": "MZ"}
    full = {"channel": "FY", "full_scale": peak_N}
    angle, force = "pseudo_slip_angle", "force_at_nominal_load"
    across = {"channel": "FY", "coefficient": 0.01} if pull else {"channel": "MZ", "coefficient": 4e-4}
    touch = {"force": 60.0 * sign(), "at": _touches(rng, seconds), "seconds": 0.2 * seconds}
    uneven = {"amplitude_1": 25.0, "phase_1": phase(), "amplitude_2": 8.0, "phase_2": phase()}
    warm = {"coefficient": 0.4 * sign(), "from": "T_AMBIENT", "reference": 23.0}
    rows = [
        *specs.on("FY", [
            spec("channel_delay", fy | {"delay": 0.05}, "delay", reported=same("delay")),
            spec("filter_lag", fy | {"time_constant": 0.06}, "time_constant", reported=same("time_constant")),
            spec("zero_offset", fy | {"offset": 30 * sign()}, "offset", reported=same("offset")),
            spec("zero_drift", fy | {"rate": 12 * sign()}, "rate", reported=same("rate")),
            spec("creep", fy | {"fraction": 0.02, "time_constant": 4.0}, "fraction", largest=20,
                 reported=same("fraction", "time_constant")),
            spec("hysteresis", full | {"width": 60.0}, "width", reported=same("width")),
            spec("nonlinearity", full | {"quadratic": 0.01 * sign(), "cubic": 0.0}, "quadratic"),
            spec("sensitivity_error", fy | {"gain_error": 0.02 * sign()}, "gain_error",
                reported=same("gain_error")),
            spec("saturation", fy | {"cut": 0.12, "level": peak_N}, "cut", largest=5, reported=specs.level),
            spec("quantisation", fy | {"step": 60.0}, "step", largest=20, reported=same("step")),
        ]),
        *specs.on("MZ", [
            spec("thermal_drift", mz | warm, "coefficient", reported=same("coefficient")),
            spec("dead_band", mz | {"width": 5.0}, "width", reported=same("width")),
            spec("rectification", mz, ""),
            spec("unit_error", mz | {"factor": 1 / 1.3558179483314004}, "", reported=same("factor")),
            spec("channel_sign", mz, ""),
        ]),
        spec("crosstalk", across | {"coefficient": across["coefficient"] * sign(), "from": "FZ"},
             "coefficient", channel=across["channel"], reported=same("coefficient")),
        spec("camber_offset", {"angle": 0.5 * sign()}, "angle", largest=6, reported=same("angle"),
             either_sign=True),
        spec("load_lag", {"time_constant": 0.3 if commanded else 0.06}, "time_constant", largest=20,
             channel=None if commanded else "FZ", reported=same("time_constant")),
        spec("relaxation", {"relaxation_length": 0.25}, "relaxation_length", largest=4,
             reported=same("relaxation_length")),
        spec("steer_offset", {"offset": 0.12 * sign()}, "offset", reported=same("offset"), either_sign=True),
        spec("plysteer", {angle: 0.12 * sign()}, angle, reported=same(angle), either_sign=True),
        spec("steer_compliance", {"compliance": 4e-5}, "compliance", reported=same("compliance")),
        spec("backlash", {"gap": 0.15}, "gap", reported=same("gap")),
        spec("conicity", {force: 40 * sign()}, force, reported=same(force)),
        spec("thermal_friction", {"peak_per_K": -0.002, "stiffness_per_K": -0.004},
            "peak_per_K stiffness_per_K"),
        spec("wear", {"rate": 0.002}, "rate"),
        spec("load_friction", {"sensitivity": -0.04 * sign()}, "sensitivity", largest=8,
             reported=same("sensitivity")),
        spec("speed_friction", {"sensitivity": 0.15}, "sensitivity"),
        spec("viscoelastic_settling", {"fraction": 0.04, "time_constant": 3.0}, "fraction", largest=8),
        spec("nonuniformity", uneven, "amplitude_1 amplitude_2", reported=same("amplitude_1")),
        spec("drum_runout", {"amplitude_1": 25.0, "phase_1": phase()}, "amplitude_1",
            reported=same("amplitude_1")),
        spec("turn_slip", {"force": 900.0}, "force", reported=same("force"), either_sign=True),
        spec("drum_curvature", {"reduction": 0.04}, "reduction", largest=6, reported=same("reduction")),
        spec("surface_friction", {"change": -0.04}, "change", largest=8,
             reported=lambda p: {"mu_factor": 1 + p["change"]}),
        spec("pressure_change", {"pressure_error": 8.0 * sign()}, "pressure_error", largest=7,
             reported=same("pressure_error"), either_sign=True),
        spec("hidden_ambient", {"bump": 0.04 * sign(), "at": float(rng.uniform(23, 25))}, "bump", largest=8),
        spec("hidden_resonance", {"share": 0.5, "frequency": float(rng.uniform(1.6, 2.4))}, "share",
             largest=40),
        spec("hidden_line", {"amplitude": 25.0, "frequency": float(rng.uniform(1.9, 2.9))}, "amplitude"),
        spec("hidden_pulse", touch, "force"),
    ]  # fmt: skip
    return {row.name: row for row in rows}
