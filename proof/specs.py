"""What the families may conceal, at typical sizes: motions and channels."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from proof.model import EffectSpec


def same(*names: str) -> Callable[[Mapping[str, Any]], dict[str, float]]:
    """Return a reader of parameters that the contract calls by the same names."""
    return lambda p: {name: float(p[name]) for name in names}


def spec(name: str, base: Mapping[str, Any], scaled: str, **more: Any) -> EffectSpec:
    """Return a specification; `scaled` names the parameters that grow, separated by blanks."""
    return EffectSpec(name=name, base=base, scaled=tuple(scaled.split()), **more)


def table(rows: list[EffectSpec]) -> dict[str, EffectSpec]:
    """Return the rows by name."""
    return {row.name: row for row in rows}


def level(p: Mapping[str, Any]) -> dict[str, float]:
    """Return the level at which a range ends, from the cut of its peak."""
    return {"level": float(p["level"]) * (1 - float(p["cut"]))}


def on(name: str, rows: list[EffectSpec]) -> list[EffectSpec]:
    """Return the rows with the channel on which they act."""
    return [dataclasses.replace(row, channel=name) for row in rows]


def motion(
    rng: np.random.Generator, *, coulomb: float, viscous: float, drag: float, cubic: float, constant: float,
    ripple: tuple[float, float],
) -> dict[str, EffectSpec]:  # fmt: skip
    """Return the forces that a mechanical model can leave out, in the units of its force terms."""
    sign = float(rng.choice([-1.0, 1.0]))
    wave = {"amplitude": ripple[0], "period": ripple[1], "phase": float(rng.uniform(0, 6.28))}
    return table([
        spec("coulomb_friction", {"coulomb": coulomb}, "coulomb", reported=same("coulomb")),
        spec("viscous_damping", {"viscous": viscous}, "viscous", reported=same("viscous")),
        spec("quadratic_drag", {"drag": drag}, "drag", reported=same("drag")),
        spec("cubic_stiffness", {"k3": cubic}, "k3", reported=same("k3"), either_sign=True),
        spec("constant_force", {"force": constant * sign}, "force", reported=same("force"), either_sign=True),
        spec("periodic_ripple", wave, "amplitude", reported=same("amplitude", "period")),
        spec("hidden_resonance", {"share": 0.1, "frequency": float(rng.uniform(1.5, 2.5))}, "share",
            largest=5),
    ])  # fmt: skip


def channel(
    rng: np.random.Generator, name: str, full_scale: float, *, second: float = 1.0, temperature: str
        | None = None,
    delay: bool = True, cell: bool = True,
) -> dict[str, EffectSpec]:  # fmt: skip
    """Return what the channel's instrument can do; `full_scale` in the channel's unit, `second` a typical
    time."""
    sign = lambda: float(rng.choice([-1.0, 1.0]))  # noqa: E731
    c: dict[str, Any] = {"channel": name}
    full = c | {"full_scale": full_scale}
    rows = [
        spec("zero_offset", c | {"offset": 0.01 * full_scale * sign()}, "offset", reported=same("offset")),
        spec("zero_drift", c | {"rate": 0.01 * full_scale * sign() / second}, "rate", reported=same("rate")),
        spec("saturation", c | {"cut": 0.1, "level": full_scale}, "cut", largest=6,
             reported=level),
        spec("quantisation", c | {"step": 0.04 * full_scale}, "step", reported=same("step")),
        spec("channel_sign", c, ""),
    ]  # fmt: skip
    if delay:
        rows += [
            spec("channel_delay", c | {"delay": 0.03 * second}, "delay", reported=same("delay")),
            spec("filter_lag", c | {"time_constant": 0.05 * second}, "time_constant",
                 reported=same("time_constant")),
        ]  # fmt: skip
    if cell:
        rows += [
            spec("sensitivity_error", c | {"gain_error": 0.02 * sign()}, "gain_error",
                reported=same("gain_error")),
            spec("nonlinearity", full | {"quadratic": 0.01 * sign(), "cubic": 0.0}, "quadratic"),
            spec("hysteresis", full | {"width": 0.02 * full_scale}, "width", reported=same("width")),
            spec("creep", c | {"fraction": 0.02, "time_constant": 20 * second}, "fraction", largest=20,
                 reported=same("fraction", "time_constant")),
            spec("dead_band", c | {"width": 0.05 * full_scale}, "width", largest=10, reported=same("width")),
        ]  # fmt: skip
    if temperature:
        base = c | {"coefficient": 0.004 * full_scale * sign(), "from": temperature, "reference": 22.0}
        rows.append(spec("thermal_drift", base, "coefficient", reported=same("coefficient")))
    return table(on(name, rows))
