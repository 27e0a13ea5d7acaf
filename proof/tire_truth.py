"""The tire machine as it truly is: physical effects on the fine grid, stage by stage.

Relaxation is a carcass spring in series with the contact, backlash a gap with a stiff contact, heat a
network of
thermal resistances: none of them the formula by which the toolkit names the effect.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from proof.instruments import rc, sampled
from proof.model import Array, Effects, Run
from proof.tire_steady import (
    BristleTire,
    MagicFormulaTire,
    Scales,
    cornering_stiffness,
    slope_table,
)

Tire = MagicFormulaTire | BristleTire


def gap_with_contact(sa: Array, gap: float) -> Array:
    """Return the wheel's angle behind a gap: it stays until a flank pushes it (stiff, overdamped contact)."""
    out = np.empty_like(sa)
    half, wheel = gap / 2, float(sa[0])
    for i, rack in enumerate(sa):
        push = rack - wheel
        if abs(push) > half:
            wheel += (push - math.copysign(half, push)) * 0.98  # the flank closes in about one fine step
        out[i] = wheel
    return out


def carcass(slip: Array, load: Array, distance_step: Array, length0: float, tire: Tire) -> Array:
    """Return the contact's slip angle behind a lateral carcass spring.

    k_c dq = k_c ds (tan a - a'),
        F(a') = k_c q: a relaxation length that is the local slope over the spring's rate,
    so it grows with the load's cornering stiffness and falls towards sliding (floor: a twentieth).
    """
    step, table = slope_table(tire)
    loads = np.linspace(300, 9000, 40)
    relative = np.array([cornering_stiffness(tire, x) for x in loads])
    relative = np.interp(load, loads, relative / cornering_stiffness(tire, tire.nominal_load))
    out = np.empty_like(slip)
    a = float(slip[0])
    out[0] = a
    for i in range(1, slip.size):
        k = min(int(abs(a) / step), table.size - 1)
        length = max(length0 * relative[i] * table[k], length0 / 20)
        # Exact for a slip that is linear over the step: its end value alone would answer half a step early.
        behind = length * float(slip[i] - slip[i - 1]) / distance_step[i]
        a = slip[i] - behind + (a - slip[i - 1] + behind) * math.exp(-distance_step[i] / length)
        out[i] = a
    return out


def actuator(t: Array, command: Array, time_constant: float, nominal_load: float) -> Array:
    """Return the force [N] of a screw that is driven at a speed in proportion to the force's error.

    The tire is its spring, 4 % stiffer at twice the nominal load: the time constant is that at nominal load.
    Exact from row to row for a command that is linear between rows and a spring that is constant there.
    """
    out = np.empty_like(command)
    force = out[0] = float(command[0])
    for i in range(1, command.size):
        h = float(t[i] - t[i - 1])
        tau = max(time_constant / (1 + 0.04 * (force / nominal_load - 1)), 1e-9)
        rise = (float(command[i]) - float(command[i - 1])) / h
        lagged = float(command[i - 1]) - tau * rise
        force = float(command[i]) - tau * rise + (force - lagged) * math.exp(-h / tau)
        out[i] = force
    return out


def _scales(base: Scales, run: Run, e: Effects, fz0: float, power: Array) -> Scales:
    """Return the factors on friction, stiffness and trail along the run."""
    f = run.fine
    mu = np.asarray(base.mu) * np.ones_like(f["t"])
    stiff = np.asarray(base.stiffness) * np.ones_like(mu)
    trail = np.asarray(base.trail) * np.ones_like(mu)
    pressure = np.asarray(base.pressure) * np.ones_like(mu)
    if "thermal_friction" in e:
        p, warm = e["thermal_friction"], f["T_TREAD"] - 30.0
        mu, stiff = mu * (1 + p["peak_per_K"] * warm), stiff * (1 + p["stiffness_per_K"] * warm)
    if "wear" in e:
        work = f["work_before_kJ"] + np.cumsum(power) * (f["t"][1] - f["t"][0]) / 1e3
        stiff = stiff * (1 + e["wear"]["rate"] * work)
    if "load_friction" in e:
        mu = mu * (1 + e["load_friction"]["sensitivity"] * (f["FZ"] / fz0 - 1))
    if "speed_friction" in e:
        sliding = f["V"] * np.abs(np.sin(np.radians(f["SA"])))
        mu = mu / (1 + e["speed_friction"]["sensitivity"] * sliding)
    if "surface_friction" in e and run.conditions.get("surface") == "sandpaper":
        mu = mu * (1 + e["surface_friction"]["change"])
    if "drum_curvature" in e:
        k = 1 - e["drum_curvature"]["reduction"]
        stiff, trail = stiff * k, trail * math.sqrt(k)
    if "pressure_change" in e:
        pressure = pressure + e["pressure_change"]["pressure_error"]
    if "hidden_ambient" in e:  # outside the catalogue: a bump of the friction over a covariate
        p = e["hidden_ambient"]
        mu = mu * (1 + p["bump"] * np.exp(-(((f["T_AMBIENT"] - p["at"]) / 0.7) ** 2)))
    lean = 0.0
    if "camber_offset" in e:  # the machine leans, whichever way its drum turns: mirrored with the motion
        turned = -1.0 if run.conditions.get("rotation") == "reverse" else 1.0
        lean = turned * math.radians(e["camber_offset"]["angle"])
    return Scales(mu=mu, stiffness=stiff, trail=trail, pressure=pressure, camber=lean)


def _revolving(angle_deg: Array, p: Mapping[str, Any]) -> Array:
    x = np.radians(angle_deg)
    second = p.get("amplitude_2", 0.0) * np.cos(2 * x + math.radians(p.get("phase_2", 0.0)))
    return p["amplitude_1"] * np.cos(x + math.radians(p["phase_1"])) + second


def _resonance(t: Array, y: Array, frequency: float) -> Array:
    """Return what a lightly damped oscillator driven by `y` adds to it: its motion over the static one.

    Symplectic Euler. Slow changes are followed, so that nothing is left of them but the ringing.
    """
    w, h = 2 * math.pi * frequency, float(t[1] - t[0])
    q, v = float(y[0]), 0.0
    out = np.empty_like(y)
    for i, force in enumerate(y):
        v += h * (w * w * (force - q) - 2 * 0.03 * w * v)
        q += h * v
        out[i] = q - force
    return out


def lateral(run: Run, tire: Tire, base: Scales, e: Effects) -> dict[str, Array]:
    """Return FY and MZ in machine axes on the fine grid, before any instrument."""
    f = run.fine
    sign = -1.0 if run.conditions.get("rotation") == "reverse" else 1.0
    sa = f["SA"]
    if "steer_offset" in e:
        sa = sa - e["steer_offset"]["offset"]
    if "backlash" in e:
        sa = gap_with_contact(sa, e["backlash"]["gap"])
    if "plysteer" in e:
        sa = sa + e["plysteer"]["pseudo_slip_angle"]
    slip = np.radians(sa)
    fz = f["FZ"]
    power = np.zeros_like(sa)
    if "wear" in e:
        power = np.abs(tire.forces(slip, fz, base)[0] * f["V"] * np.sin(slip))
    s = _scales(base, run, e, tire.nominal_load, power)
    if "viscoelastic_settling" in e:
        p = e["viscoelastic_settling"]
        fz = fz + p["fraction"] * (fz - rc(f["t"], fz, p["time_constant"]))
    if "steer_compliance" in e:
        turned = slip
        for _ in range(8):  # the wheel turns until rack and moment agree
            turned = slip - e["steer_compliance"]["compliance"] * sign**2 * tire.forces(turned, fz, s)[1]
        slip = turned
    if "relaxation" in e:
        step = f["V"] * np.gradient(f["t"])
        slip = carcass(slip, fz, step, e["relaxation"]["relaxation_length"], tire)
    fy, mz = tire.forces(slip, fz, s)
    fy = sign * fy
    if "conicity" in e:
        side = -1.0 if run.conditions.get("mounting") == "turned" else 1.0
        fy = fy + side * e["conicity"]["force_at_nominal_load"] * fz / tire.nominal_load
    if "nonuniformity" in e:
        fy = fy + _revolving(f["TIRE_ANGLE"], e["nonuniformity"])
    if "drum_runout" in e:
        fy = fy + _revolving(f["DRUM_ANGLE"], e["drum_runout"])
    if "turn_slip" in e:
        turning = np.radians(np.gradient(f["SA"], f["t"])) / f["V"]
        fy = fy - sign * e["turn_slip"]["force"] * turning
    if "hidden_resonance" in e:
        fy = fy + e["hidden_resonance"]["share"] * _resonance(f["t"], fy, e["hidden_resonance"]["frequency"])
    if "hidden_line" in e:  # locked to time, not to any revolution, and slowly detuned
        p = e["hidden_line"]
        fy = fy + p["amplitude"] * np.sin(2 * math.pi * p["frequency"] * f["t"] + 0.4 * np.sin(f["t"] / 7))
    if "hidden_pulse" in e:  # something touched the frame, now and then
        p = e["hidden_pulse"]
        inside = sum((f["t"] > at) & (f["t"] < at + p["seconds"]) for at in p["at"])
        fy = fy + p["force"] * inside
    return {"FY": fy, "MZ": mz}


def measured(run: Run, tire: Tire, base: Scales, e: Effects, cutoff_Hz: float) -> dict[str, Array]:
    """Return FY and MZ at the sampling instants, as the acquisition gives them."""
    return sampled(run, lateral(run, tire, base, e), e, cutoff_Hz=cutoff_Hz, compensated=False)
