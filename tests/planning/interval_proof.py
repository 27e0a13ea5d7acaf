"""The proof of intervals: ``python -m tests.planning.interval_proof --histories 500``.

Instruments whose trend, random walk and reading noise are drawn are calibrated six times, once a year, each
time with a new record. From that history alone the next interval is set; then the instrument goes on, day by
day. Caught means that it is calibrated before its error is beyond the tolerance on any day. Beside it: fixed
intervals, and ILAC-G24's method 2 as `toolkit calibration due` has it.
"""

from __future__ import annotations

import argparse
import datetime as dt

import numpy as np

from tests.planning.__main__ import interval
from toolkit.planning.interval import STEP, YEAR, path_of, plan_interval

SESSIONS = 6
FIXED = (183, 365, 548)
METHODS = ("plan, 95 %", "plan, 90 %", "ILAC-G24 method 2", *(f"every {days} days" for days in FIXED))


def of_history(seed: int) -> dict[str, tuple[int, bool]]:
    """Return the interval of each method and whether it was caught in time."""
    rng = np.random.default_rng([31, seed])
    walk, noise, trend = rng.uniform(0, 0.35), rng.uniform(0.03, 0.12), rng.normal(0, 0.35)
    t = np.arange(float(SESSIONS))
    level = trend * t + np.append(0.0, np.cumsum(rng.normal(0, walk, SESSIONS - 1)))
    read = level + rng.normal(0, noise, SESSIONS)
    begin = dt.date(2019, 1, 1)
    readings = [
        (begin + dt.timedelta(days=round(year * YEAR)), float(value), 0)
        for year, value in zip(t, read, strict=True)
    ]
    path = path_of("FY", "check load", readings)
    assert path is not None
    plans = {name: plan_interval([path], reliability=r) for name, r in (("95", 0.95), ("90", 0.9))}
    growth = np.abs(np.diff(read))  # an error of each record at the next session, as a share of the tolerance
    method_2 = int(np.clip(0.8 / growth.max(), 0.5, STEP) * YEAR)
    days = {
        "plan, 95 %": plans["95"].days, "plan, 90 %": plans["90"].days, "ILAC-G24 method 2": method_2,
        **{f"every {fixed} days": fixed for fixed in FIXED},
    }  # fmt: skip
    most = max(days.values()) + 1
    walked = np.cumsum(rng.normal(0, walk / np.sqrt(YEAR), most)) + trend * np.arange(1, most + 1) / YEAR
    error = np.abs(walked - (read[-1] - level[-1]))  # the new record holds its own reading's noise
    beyond = int(np.argmax(error > 1)) if (error > 1).any() else most
    return {name: (length, beyond >= length) for name, length in days.items()}


def main() -> None:
    """Run the histories and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--histories", type=int, default=500)
    options = parser.parse_args()
    results = [of_history(seed) for seed in range(options.histories)]
    print("| interval | caught before it is beyond, % | sessions a year | median days |")  # noqa: T201
    print("|---|---|---|---|")  # noqa: T201
    for name in METHODS:
        lengths = np.array([max(result[name][0], 30) for result in results])
        caught = sum(result[name][1] for result in results)
        print(  # noqa: T201
            f"| {name} | {interval(caught, len(results))} | {np.mean(YEAR / lengths):.2f} | "
            f"{np.median(lengths):.0f} |"
        )


if __name__ == "__main__":
    main()
