"""What a batch had put in: each effect, the families that can conceal it, what never was, how it went."""

from __future__ import annotations

import itertools
from collections import Counter, defaultdict
from typing import Any

import numpy as np

from proof.catalogue import CONFOUNDED, FAMILIES, share_of
from proof.draw import MIX
from proof.intervals import rate
from proof.judge import Judgment
from proof.outside import REASONS

CATALOGUE = tuple(
    """unit_error channel_sign channel_swap wrong_calibration channel_delay filter_lag saturation quantisation
    dead_band rectification zero_offset zero_drift thermal_drift creep hysteresis nonlinearity crosstalk
    sensitivity_error steer_offset camber_offset steer_compliance backlash load_lag relaxation
    thermal_friction pressure_change wear plysteer conicity load_friction speed_friction
    viscoelastic_settling nonuniformity turn_slip drum_curvature surface_friction drum_runout constant_force
    coulomb_friction viscous_damping quadratic_drag cubic_stiffness periodic_ripple overflow""".split()
)
"""The contract's table of names."""
RATIOS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, np.inf)
"""Ends of the bins of a size over the size that the tool says it sees with 80 % power."""


def hosts() -> dict[str, tuple[str, ...]]:
    """Return, for each name of the catalogue, the families that can conceal it, "(class)" where only so."""
    found = {}
    for name in CATALOGUE:
        alone = [family for family, f in FAMILIES.items() if name in f.inside]
        in_class = [f"{c.family} (class)" for c in CONFOUNDED.values() if name in c.present]
        found[name] = tuple(alone + sorted(set(in_class)))
    return found


def mean_share(bucket: float) -> dict[str, float]:
    """Return the mean share of a batch's cases in which each effect stands alone; `bucket`: of singles."""
    total = sum(f.weight for f in FAMILIES.values())
    out = dict.fromkeys(CATALOGUE, 0.0)
    for family in FAMILIES.values():
        share = {name: share_of(name) for name in family.inside}
        for name, s in share.items():
            out[name] += bucket * family.weight / total * s / sum(share.values())
    return out


def inventory(judged: list[Judgment], sealed: dict[str, Any]) -> dict[str, Any]:
    """Return what was put in how often, what never was, and the rates by kind from outside and by class."""
    count = Counter(
        t
        for j in judged
        if j.bucket in ("single", "stirred single", "two", "three", "confounded")
        for t in j.truth
    )
    outside: dict[str, list[Judgment]] = defaultdict(list)
    classes: dict[tuple[str, ...], list[Judgment]] = defaultdict(list)
    for j in judged:
        if j.bucket == "outside":
            outside[j.truth[0]].append(j)
        elif j.bucket == "confounded":
            classes[tuple(sealed[j.case]["class"])].append(j)
    there, share = hosts(), mean_share(MIX["single"])
    reason = {tuple(row["class"]): row.get("reason", "") for row in sealed.values()}
    return {
        "put in": {
            name: {
                "times": count[name], "families": list(there[name]), "share": share[name],
                "right": rate([j.right for j in judged if j.bucket == "single" and j.truth == (name,)]),
            }
            for name in CATALOGUE
        },
        "never put in": [name for name in CATALOGUE if not count[name]],
        "outside": {
            name: {
                "reason": REASONS.get(name, ""),
                "unknown": rate([j.right for j in rows]),
                "misnamed": rate([j.false_name for j in rows]),
                "largest share": max(
                    float((sealed[j.case].get("nearest_inside") or {}).get("share", 0.0)) for j in rows
                ),
            }
            for name, rows in sorted(outside.items())
        },
        "classes": {
            ", ".join(members): {
                "reason": reason[members],
                "right": rate([j.right for j in rows]),
                "one alone": rate([j.overconfident for j in rows]),
                "false": rate([j.false_name for j in rows]),
            }
            for members, rows in sorted(classes.items())
        },
    }  # fmt: skip


def power_by_detectable(
    judged: list[Judgment], sealed: dict[str, Any], answers: dict[str, dict[str, Any] | None]
) -> list[dict[str, Any]]:
    """Return how often an effect was found, over its size by the tool's own predicted detectable size.

    The tool predicts for what it did not find. The prediction for a case is the median of those for the same
    effect in the other cases of its family, so that it does not depend on whether this one was found.
    """
    said: dict[tuple[str, str], list[tuple[str, float]]] = defaultdict(list)
    for name, answer in answers.items():
        for row in (answer or {}).get("not_found") or []:
            if row.get("minimum_detectable") and row.get("observable", True):
                value = abs(float(row["minimum_detectable"]))
                said[sealed[name]["family"], row["name"]].append((name, value))
    rows = []
    for j in judged:
        if j.bucket != "single" or not sealed[j.case]["effects"][0]["parameters"]:
            continue
        size = abs(next(iter(sealed[j.case]["effects"][0]["parameters"].values())))
        others = [v for name, v in said[sealed[j.case]["family"], j.truth[0]] if name != j.case]
        if others:
            rows.append((size / float(np.median(others)), j.right))
    return [
        {"from": low, "to": high, "rate": rate([hit for x, hit in rows if low <= x < high])}
        for low, high in itertools.pairwise(RATIOS)
    ]
