"""Do the stated intervals hold the truth? Tests drawn with every error that the machine definition states."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.characteristics.tire_factory import (
    CONICITY,
    CRAT,
    LOAD,
    M15,
    PLYSTEER,
    PRAT,
    curve,
    reduced_test,
    rows_of_many,
)

LOADS = (2000.0, LOAD, 6000.0)
TRIALS = 160
U_ROWS = (6.0, 0.15)  # N, N·m


@pytest.mark.campaign("160 tests: how often intervals hold; `make coverage` prints the table")
def test_ninety_five_per_cent_of_the_intervals_hold_the_truth() -> None:
    """At the middle load, where three loads give the tire's own slope over the load.

    Drawn anew for each test: the zero and the scale of the slip angle, the scale of the load, and the
    scatter of every condition. Each quantity by itself, so that one that is too wide hides none too narrow.
    """
    rng = np.random.default_rng(1987)
    stated = {name: M15.stated_uncertainty(name) for name in ("SA", "SA_scale", "FZ")}
    one = math.radians(1.0)
    secant = float(curve(one, 60_000.0, 4000.0, 1.3)) / one
    truth = {"conicity": CONICITY, "plysteer": PLYSTEER, "CRAT": CRAT, "PRAT": PRAT,
             "slope_cornering": 60_000.0, "secant_cornering": secant}  # fmt: skip
    inside = dict.fromkeys(truth, 0)
    tests = []
    for _ in range(TRIALS):
        reduced = reduced_test(
            loads=LOADS,
            zero_rad=float(rng.normal(0, stated["SA"].u)),
            stretch=float(rng.normal(0, stated["SA_scale"].relative)),
            load_error=float(rng.normal(0, stated["FZ"].relative)),
            u=U_ROWS,
        )
        noise = rng.normal(size=(len(reduced.conditions), 2)) * U_ROWS
        drawn = tuple(
            dataclasses.replace(c, FY_common=c.FY_common + float(a), MZ_common=c.MZ_common + float(b))
            for c, (a, b) in zip(reduced.conditions, noise, strict=True)
        )
        tests.append(dataclasses.replace(reduced, conditions=drawn))
    for rows in rows_of_many(tests):
        for name, true in truth.items():
            estimate = rows[name, LOAD, "forward" if "cornering" in name else "both", None].number.estimate()
            U, _ = estimate.expanded()
            inside[name] += abs(estimate.value - true) <= U
    # Binomial at 95 %, three and a half standard deviations to each side.
    room = 3.5 * math.sqrt(0.95 * 0.05 / TRIALS)
    for name, count in inside.items():
        assert 0.95 - room <= count / TRIALS <= min(1.0, 0.95 + room), (name, count)
