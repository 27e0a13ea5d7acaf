"""The laws of a search as the answer tells them: parameters with intervals, curves with bands."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import (
    DiagnosedLaw,
    EffectEstimate,
    LawCurve,
    LawEvidence,
    LawPlace,
    ResembledEffect,
)
from toolkit.diagnosis.law.trial import amplitudes
from toolkit.diagnosis.policy import LAWS, VERDICT
from toolkit.effects.formula import formula
from toolkit.effects.law import SCALED

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.law.learn import Law, Laws
    from toolkit.diagnosis.law.trial import Signal, Trial
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect


def with_laws(search: Search, laws: Laws) -> Search:
    """Return a search whose augmented simulation has its laws in it."""
    return replace(search, augmented=laws.fit, held_augmented=laws.held_out)


def found_laws(search: Search, laws: Laws) -> tuple[DiagnosedLaw, ...]:
    """Return the laws for the answer.

    Parameters
    ----------
    search : as it was before them
    """
    whole = with_laws(search, laws)
    return tuple(_found(whole, law) for law in laws.listed)


def _found(search: Search, law: Law) -> DiagnosedLaw:
    trial = law.trial
    same = (applied for applied in search.augmented.active if applied.key == law.applied.key)
    fitted = next(same, law.applied)
    covariance = _covariance(search, law, fitted)
    reach = _quantile(search) * np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    # In an equation a law stands as what resists; an answer has what is added to the rate.
    turned = amplitudes(fitted) if trial.acts == "enters" else ()
    signs = [-1.0 if name in turned else 1.0 for name in fitted.effect.names]
    values = [sign * fitted.values[name] for sign, name in zip(signs, fitted.effect.names, strict=True)]
    runs = None if fitted.runs is None else tuple(sorted(fitted.runs))
    shaped = trial.shape.text.startswith("spline(")
    plain = formula(fitted.effect.name.split(": ", 1)[1]).plain(fitted.channel)
    for signal in trial.signals:
        plain = plain.replace(signal.written.strip("[]"), signal.name) if trial.acts == "enters" else plain
    return DiagnosedLaw(
        place=_place(trial),
        form=trial.form,
        acts="adds" if trial.acts in ("adds", "enters") else "multiplies",
        variables=tuple(signal.name for signal in trial.signals),
        memory_s=_memory(fitted),
        formula=None if shaped else plain,
        parameters=tuple(
            EffectEstimate(
                name=name, value=value, unit=fitted.units[name], runs=runs,
                ci95=_interval(value, half, positive=parameter.bounds[0] >= 0),
            )
            for parameter, name, value, half in zip(
                fitted.effect.parameters, fitted.effect.names, values, reach.tolist(), strict=True
            )
        ),
        curve=_curve(law, fitted, covariance, _quantile(search)),
        ranges=tuple((signal.name, _range(search, signal)) for signal in trial.signals),
        resembles=tuple(ResembledEffect(name=name, distance=distance) for name, distance in law.resembles),
        confounded_with=law.confounded,
        evidence=LawEvidence(
            held_out_log_score_gain=law.held_out_gain, p_value=law.p_value,
            share_of_gap=min(max(law.share, 0.0), 1.0),
        ),
    )  # fmt: skip


def _range(search: Search, signal: Signal) -> tuple[float, float]:
    """Return from where to where a signal went; a law of a motion is tried as far to either side."""
    motion = search.problem.model.capability.motion
    states = () if motion is None or not motion.integrates else motion.states
    values = next((np.array(state.quantiles) for state in states if state.name == signal.name), signal.values)
    return float(values.min()), float(values.max())


def _place(trial: Trial) -> LawPlace:
    """Return where a law acts: on an output, in the equation of a state, or on what drives the tire."""
    if trial.acts in SCALED:
        return LawPlace(kind="input", channel=SCALED[trial.acts])
    return LawPlace(kind="state" if trial.acts == "enters" else "output", channel=str(trial.applied.channel))


def _interval(value: float, half: float, *, positive: bool) -> tuple[float, float] | None:
    """Return an interval about a value, None where the data leave it open.

    That of a positive quantity, a time constant or a width, is one of its logarithm: none is below zero.
    """
    if not half < VERDICT.open_interval * max(abs(value), 1e-300):  # nor is one without a number
        return None
    if not positive:
        return value - half, value + half
    if not 0 < half < value * math.log(VERDICT.open_interval):
        return None if half else (value, value)
    factor = math.exp(half / value)
    return value / factor, value * factor


def _memory(fitted: AppliedEffect) -> float | None:
    """Return how long a law remembers [s]: its time constant, or that of a vibration's decay."""
    values = fitted.values
    if "tau" in values:
        return values["tau"]
    if "damping" in values and values["damping"] > 0:
        return 1 / (2 * math.pi * values["frequency"] * values["damping"])
    return None


def _covariance(search: Search, law: Law, fitted: AppliedEffect) -> Array:
    """Return the covariance of a law's parameters, in their units."""
    augmented, at = search.augmented, len(search.problem.free)
    if fitted.sized_as is not None:
        fitted = next(applied for applied in augmented.active if applied.key == fitted.sized_as)
    if all(applied.key != fitted.key for applied in augmented.active):  # it explains, and is in no fit
        return np.diag([law.trial.sds.get(parameter.name, math.nan) ** 2 for parameter in fitted.searched])
    for applied in augmented.active:
        if applied.key == fitted.key:
            break
        at += len(applied.searched)
    own = slice(at, at + len(fitted.searched))
    return np.asarray(augmented.covariance[own, own]) / search.screen.trust(augmented.noise)


def _quantile(search: Search) -> float:
    from scipy.stats import t as student

    n = sum(int(counted.sum()) for counted in search.problem.kept.values())
    degrees = max(n - len(search.augmented.covariance), 1)
    return float(student.ppf((1 + VERDICT.interval) / 2, degrees))


def _curve(law: Law, fitted: AppliedEffect, covariance: Array, quantile: float) -> LawCurve | None:
    """Return a law of one signal without memory over what was recorded; its band is linear in the errors."""
    trial = law.trial
    if len(trial.signals) != 1 or trial.form != "static":
        return None
    signal = trial.signals[0]
    curve = formula(trial.shape.text.replace(signal.written, "{x}").format(x="[x]"))
    low, high = float(signal.values.min()), float(signal.values.max())
    x = np.linspace(low, high, LAWS.points)

    counted = replace(signal, values=x).values_in(trial.shape)

    def at(values: dict[str, float]) -> Array:
        with np.errstate(all="ignore"):
            return np.broadcast_to(curve({"x": counted}, values), LAWS.points).astype(float)

    sign = -1.0 if trial.acts == "enters" else 1.0
    values = dict(fitted.values)
    y, slopes = at(values), []
    for name, sd in zip(fitted.effect.names, np.sqrt(np.clip(np.diag(covariance), 0, None)), strict=True):
        step = LAWS.step * (abs(values[name]) or float(sd) or 1.0)
        slopes.append((at({**values, name: values[name] + step}) - y) / step)
    J = np.stack(slopes, axis=1)
    half = quantile * np.sqrt(np.clip(np.einsum("ij,jk,ik->i", J, covariance, J), 0.0, None))
    y = sign * y
    return LawCurve(
        x=tuple(x.tolist()), y=tuple(y.tolist()),
        band95=(tuple((y - half).tolist()), tuple((y + half).tolist())), unit=trial.unit,
    )  # fmt: skip
