"""Drawing a batch: the mix, one case at a time, each from its own seed."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from proof import controls
from proof import size as sizing
from proof.catalogue import CONFOUNDED, FAMILIES, ONE_SIZE, Confounded, share_of
from proof.files import missing
from proof.instruments import DIGITAL, digital
from proof.model import Array, EffectSpec, Params, Scenario
from proof.noise import coloured, converter, spikes
from proof.outside import LARGEST_SHARE, ONE_SIDED, REASONS
from proof.process_noise import stirred

MIX = {
    "single": 0.32, "two": 0.09, "null": 0.28, "outside": 0.12, "confounded": 0.06,
    "three": 0.05, "stirred null": 0.04, "stirred single": 0.04,
}  # fmt: skip
"""Shares of the kinds of case. What is stirred has process noise beside the sensor's."""
STIRRED = ("pendulum", "drive", "tank", "thermal")
"""Families with states, which process noise can move."""
SEVERAL = {"two": 2, "three": 3}
CONTROLS = 0.06
"""Negative controls, beyond the mix."""
LARGEST_MODEL_ERROR = 1.0
"""A null's systematic error over the whole recording, in noise sd: below it no test can see it."""
ALIKE = 4.0
"""Two effects whose responses differ by less than this, in noise sd over the recording, are one class."""
# pairs that a compound may not hold: one shadows the other
_SHADOWS = (
    frozenset("relaxation channel_delay filter_lag backlash hysteresis turn_slip creep".split()),
    frozenset("saturation quantisation dead_band rectification unit_error channel_sign channel_swap".split()),
    frozenset("coulomb_friction viscous_damping quadratic_drag".split()),
    frozenset("zero_offset zero_drift thermal_drift constant_force crosstalk conicity camber_offset".split()),
    frozenset("steer_compliance wear drum_curvature thermal_friction load_friction speed_friction".split()),
)


TURNED_ROUND = frozenset({"conicity", "camber_offset"})
"""Effects that stand alone only where the tire was turned round on the hub."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A case with its answer."""

    scenario: Scenario
    measured: list[dict[str, Array]]
    predicted: list[dict[str, Array]]
    """What the outputs of the files to predict truly do, without noise."""
    answer: dict[str, Any]
    effects: dict[str, dict[str, Any]]
    """What is in it, in the truth's own terms."""


class RedrawError(Exception):
    """The draw does not meet its own conditions; another is drawn."""


def counts_of(n: int) -> dict[str, int]:
    """Return how many of `n` cases are of each kind (shares by largest remainder), and controls beyond
    them."""
    exact = {k: n * v for k, v in MIX.items()}
    count = {k: int(v) for k, v in exact.items()}
    for k in sorted(exact, key=lambda k: count[k] - exact[k])[: n - sum(count.values())]:
        count[k] += 1
    return count | {"control": round(CONTROLS * n)}


def mix(counts: Mapping[str, int], rng: np.random.Generator) -> list[str]:
    """Return the kinds of the cases in drawn order."""
    kinds = [k for k in (*MIX, "control") for _ in range(counts.get(k, 0))]
    return [kinds[i] for i in rng.permutation(len(kinds))]


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _pick(
    rng: np.random.Generator, bucket: str, control: str
) -> tuple[str, Confounded | None, tuple[str, ...]]:
    """Return the family, the class it is drawn for, and the effects to put in."""
    if control:
        family, name = controls.KINDS[control][int(rng.integers(len(controls.KINDS[control])))]
        return family, None, (name,)
    if bucket == "confounded":
        group = CONFOUNDED[str(rng.choice(list(CONFOUNDED)))]
        return group.family, group, (str(rng.choice(group.present)),)
    names = [k for k, f in FAMILIES.items() if bucket != "outside" or f.outside]
    if bucket in SEVERAL:
        names = [k for k in names if k not in ("thermal", "tank", "labview")]
    if bucket.startswith("stirred"):
        names = [k for k in names if k in STIRRED]
    weight = np.array([FAMILIES[k].weight for k in names])
    family = str(rng.choice(names, p=weight / weight.sum()))
    inside = FAMILIES[family].inside
    if bucket in ("null", "stirred null"):
        return family, None, ()
    if bucket == "outside":
        return family, None, (str(rng.choice(FAMILIES[family].outside)),)
    if bucket in ("single", "stirred single"):
        share = np.array([share_of(name) for name in inside])
        return family, None, (str(rng.choice(inside, p=share / share.sum())),)
    graded = [name for name in inside if name not in ONE_SIZE]
    several = tuple(str(x) for x in rng.choice(graded, SEVERAL[bucket], replace=False))
    if any(len(group & {*several}) > 1 for group in _SHADOWS):
        raise RedrawError
    return family, None, several


def _alike(
    s: Scenario,
    name: str,
    there: sizing.Signals,
    without: sizing.Signals,
    slopes: list[sizing.Signals],
    distance: float,
) -> dict[str, float]:
    """Return the effects of the family that this recording can hardly tell from `name`, with their
    distance."""
    near = {}
    a = sizing.projected(s, sizing.difference(there, without), slopes)
    p = s.true_parameters()
    for other, spec in s.effects.items():
        if other == name or other not in FAMILIES[s.family].inside or not spec.scaled:
            continue
        b = sizing.projected(s, sizing.change(s, p, {other: spec.at(1.0)}, without), slopes)
        length = float(np.linalg.norm(b))
        if length < 1e-6:
            continue
        cosine = float(a @ b) / (float(np.linalg.norm(a)) * length)
        apart = distance * float(np.sqrt(max(1 - cosine**2, 0.0)))
        if apart < ALIKE:
            near[other] = round(apart, 2)
    return near


def _by_run(s: Scenario, effect: sizing.Signals, slopes: list[sizing.Signals]) -> list[Array]:
    """Return what the parameters leave of a difference as innovations, a vector for each run."""
    whole = sizing.projected(s, effect, slopes)
    ends = np.cumsum([sum(row[k].size for k in s.outputs) for row in effect])
    return np.split(whole, ends[:-1])


def nearest_inside(
    s: Scenario, effect: sizing.Signals, without: sizing.Signals, slopes: list[sizing.Signals]
) -> tuple[str, float]:
    """Return the catalogue effect that can take most of an effect from outside, and its share of the energy.

    Every catalogue effect of the scenario with a size of its own in each run, of its own sign where it has
    one: more than any effect of one size, or confined to some of the runs, can take. Small and large ones
    where the truth is cheap.
    """
    a = _by_run(s, effect, slopes)
    total = float(sum(x @ x for x in a))
    p, best = s.true_parameters(), ("", 0.0)
    for other, spec in s.effects.items():
        if other.startswith("hidden") or not spec.scaled:
            continue
        for factor in (1.0,) if s.kind == "ode" else (0.5, min(3.0, spec.largest)):
            b = _by_run(s, sizing.change(s, p, {other: spec.at(factor)}, without), slopes)
            least = 0.0 if other in ONE_SIDED else -np.inf
            taken = sum(
                max(float(x @ y), least) ** 2 / float(y @ y)
                for x, y in zip(a, b, strict=True)
                if y @ y > 1e-12
            )
            if taken > best[1] * total:
                best = (other, taken / total)
    return best


def _before_converter(
    s: Scenario, p: Params, effects: dict[str, dict[str, Any]], truth: sizing.Signals
) -> sizing.Signals:
    """Return the outputs before noise, without what an output's converter does to the noisy value."""
    later = {k for k, v in effects.items() if k in DIGITAL and v["channel"] in s.outputs and not s.timeless}
    if not later:
        return truth
    return sizing.truth_of(s, s.runs, p, {k: v for k, v in effects.items() if k not in later})


def _check(
    s: Scenario, measured: sizing.Signals, truth: sizing.Signals, effects: dict[str, dict[str, Any]]
) -> None:
    """Raise where a recording is not its truth within its noise: the answer would not be what was sealed."""
    step = effects.get("quantisation", {}).get("step", 0.0)
    for k in s.outputs:
        off = np.concatenate([m[k] - t[k] for m, t in zip(measured, truth, strict=True)])
        if np.nanmedian(np.abs(off)) > 2.0 * s.noise[k].sd + step:
            raise RuntimeError(f"{s.family}: {k} is not recorded as it truly was, with {sorted(effects)}")


def _recorded(
    s: Scenario,
    row: dict[str, Array],
    effects: dict[str, dict[str, Any]],
    lost: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    """Return the outputs of one run with noise, spikes and the converter; digital effects act on the noisy
    value."""
    if s.timeless:
        return row
    out = {}
    for k, y in row.items():
        noise = s.noise[k]
        y = y + coloured(noise, y.size, rng) + spikes(noise, y.size, rng)
        stages = [(name, q) for name, q in effects.items() if name in DIGITAL and q["channel"] == k]
        if not stages:
            y = converter(y, noise.sd / 12)
        for name, q in stages:
            y = digital(name, q, y)
        out[k] = missing(y, lost, rng)
    return out


def _as_recorded(spec: EffectSpec, p: Mapping[str, Any], without: sizing.Signals) -> dict[str, float] | None:
    """Return an effect's parameters as the recording has them; None where none is compared.

    The full height of a loop is that of the largest cycle in the recording: a field of relays with uniform
    thresholds makes it width * (half range / full scale)^2.
    """
    if not spec.reported:
        return None
    if spec.name == "hysteresis":
        full = p["full_scale"]
        half = max(0.5 * float(np.ptp(np.clip(one[p["channel"]], -full, full))) for one in without)
        p = {**p, "width": p["width"] * (half / full) ** 2}
    return spec.reported(p)


def _as_control(drawn: Drawn, control: str, rng: np.random.Generator) -> Drawn:
    """Return the case with its trace destroyed; its answer holds no effect."""
    s, measured = drawn.scenario, drawn.measured
    if control == "permuted metadata":
        s = controls.permuted(s, drawn.answer["effects"][0]["name"])
    elif control == "swapped labels":
        s = controls.swapped(s)
    else:
        p = s.true_parameters()
        there = sizing.truth_of(s, s.runs, p, drawn.effects)
        without = sizing.without_of(s, s.runs, p, drawn.effects)
        measured = []
        for row, bare in zip(there, without, strict=True):
            noise = {k: coloured(s.noise[k], y.size, rng) for k, y in row.items()}
            measured.append({
                k: bare[k] + controls.phase_randomised(y - bare[k], rng) + noise[k] for k, y in row.items()
            })  # fmt: skip
    was = drawn.answer["effects"]
    answer = drawn.answer | {"control": control, "was": was, "effects": []}
    return Drawn(scenario=s, measured=measured, predicted=drawn.predicted, answer=answer, effects={})


def draw_case(
    seed: int,
    index: int,
    bucket: str,
    *,
    compare: bool = True,
    picked: tuple[str, tuple[str, ...]] | None = None,
) -> Drawn:
    """Return the case; the same seed, index and kind give the same bytes.

    `compare` False leaves out the list of effects alike, which costs most of the time; `picked` sets the
    family (for a confounded case the class) and the effects, which a batch leaves to the seed.
    """
    for attempt in range(60):
        rng = np.random.default_rng([seed, index, attempt])
        try:
            return _draw(rng, bucket, compare, picked)
        except RedrawError:
            continue
    raise RuntimeError(f"no draw of kind {bucket} met its conditions (case {index})")


def _draw(
    rng: np.random.Generator, bucket: str, compare: bool, picked: tuple[str, tuple[str, ...]] | None
) -> Drawn:
    control = str(rng.choice(list(controls.KINDS))) if bucket == "control" else ""
    if picked:
        group = CONFOUNDED.get(picked[0])
        family, names = group.family if group else picked[0], picked[1]
    else:
        family, group, names = _pick(rng, bucket, control)
    needs = frozenset(names) | (group.needs if group else frozenset())
    if bucket == "single" and needs & TURNED_ROUND:
        needs |= {"turned"}
    s = (group or FAMILIES[family]).build(rng, needs)
    p = s.true_parameters()
    slopes = sizing.jacobian(s, s.runs)
    without = sizing.truth_of(s, s.runs, p, {})
    error = sizing.size_of(s, sizing.difference(without, sizing.nominal_of(s, s.runs, p)), slopes)
    # where the printed digits are the only noise, the difference from the nominal is that noise
    if error.over_noise > 1.2 if s.timeless else error.distance > LARGEST_MODEL_ERROR:
        raise RedrawError
    low, high = {
        "outside": (0.5, 8.0),
        "confounded": (1.0, 8.0),
        "two": (0.7, 6.0),
        "three": (0.7, 6.0),
        "stirred single": (1.0, 8.0),
        "control": (1.5, 6.0),
    }.get(bucket, (0.1, 8.0))
    effects, rows = {}, []
    for name in names:
        wanted = _log_uniform(rng, low, high)
        factor, found = sizing.scaled_to(s, name, wanted, slopes, without)
        spec = s.effects[name]
        if spec.scaled and not 0.6 < found.over_noise / wanted < 1.6:
            raise RedrawError
        effects[name] = spec.at(factor)
        rows.append({
            "name": name,
            "channel": spec.channel,
            "parameters": _as_recorded(spec, effects[name], without),
            "either_sign": spec.either_sign,
            "size": round(found.over_noise, 4),
            "distance": round(found.distance, 3),
        })  # fmt: skip
    truth = sizing.truth_of(s, s.runs, p, effects)
    if s.driven:
        without = sizing.without_of(s, s.runs, p, effects)
    total = sizing.size_of(s, sizing.difference(truth, without), slopes)
    near: dict[str, float] = {}
    nearest: tuple[str, float] = ("", 0.0)
    if bucket == "outside" and not s.timeless:
        nearest = nearest_inside(s, sizing.difference(truth, without), without, slopes)
        if nearest[1] > LARGEST_SHARE:
            raise RedrawError
    if compare and bucket == "single" and rows[0]["name"] not in ONE_SIZE:
        near = _alike(s, names[0], truth, without, slopes, total.distance)
    s = dataclasses.replace(s, runs=sizing.driven_of(s, s.runs, effects))
    lost = 0.01 if rng.random() < 0.2 else 0.0
    more = {}
    if bucket.startswith("stirred"):
        wanted = _log_uniform(rng, 0.3, 1.0)
        s, added, truth = stirred(s, p, effects, wanted, rng, truth)
        if not 0.7 < added / wanted < 1.4:
            raise RedrawError
        more["process_noise"] = round(added, 4)
    analogue = _before_converter(s, p, effects, truth)
    measured = [_recorded(s, row, effects, lost, rng) for row in analogue]
    _check(s, measured, truth, effects)
    answer = {
        "bucket": bucket,
        "family": s.family,
        "kind": s.kind,
        "effects": rows,
        "class": sorted(group.members) if group else [],
        "alike": near,
        "outside": bucket == "outside",
        "reason": group.reason if group else REASONS.get(names[0], "") if names else "",
        "nearest_inside": {"name": nearest[0], "share": round(nearest[1], 3)} if nearest[0] else None,
        "size": round(total.over_noise, 4),
        "distance": round(total.distance, 3),
        "by_output": {k: round(v, 4) for k, v in total.by_output.items()},
        "model_error_distance": round(error.distance, 3),
        "noise": {k: {"sd": v.sd, "ar": list(v.ar), "outliers": v.outliers} for k, v in s.noise.items()},
        "parameters": {q.name: q.true for q in s.free()},
        "lost": lost,
        **more,
    }
    predicted = sizing.truth_of(s, s.predict, p, effects)
    drawn = Drawn(scenario=s, measured=measured, predicted=predicted, answer=answer, effects=effects)
    return _as_control(drawn, control, rng) if bucket == "control" else drawn
