"""Fits of tire curves: share that reaches an oracle, time beside scipy's, coverage, MF 6.1 per point, a test.

The oracle takes the lowest of fifty random bounded starts and some seconds a curve: `--pairs 7` asks it of
350 curves. Times of single curves are processor time, for machines are shared; coverage is of 4 000 curves.
lmfit is no dependency of the project and is left out.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import pairs, row
from tests.benchmarks.tire_curves import Sample, box, cost, oracle, samples

_COUNT = 1000
_COVERED = 4000
_REACHED = 1.001  # times the oracle's cost

Result = dict[str, object]


def run(folder: Path, count: int) -> list[Result]:
    """Return reach and time of every way to fit, coverage, and the times of MF 6.1 and of a whole table."""
    many = samples(_COUNT)
    return [
        *_reach(many, 50 * count),
        *_coverage(samples(_COVERED, seed=9)),
        _per_point(count),
        _families(folder, count),
    ]


def _share(what: str, value: float, note: str, aim: str = "") -> Result:
    # A share stands in the column of seconds: it is a number all the same.
    return {
        "what": what,
        "ours_s": value,
        "peer": note,
        "peer_s": None,
        "ratio": None,
        "aim": aim,
        "pairs": 1,
    }


def _reach(many: list[Sample], asked: int) -> list[Result]:
    from toolkit.tires.fit import fit_curves

    curves = [one.curve for one in many]
    fit_curves(curves[:20])
    started = time.process_time()
    fits = fit_curves(curves)
    each = (time.process_time() - started) / len(curves)
    part = many[: min(asked, len(many))]
    rng = np.random.default_rng(50)
    lowest = np.array([oracle(one.curve, rng) for one in part])
    ours = np.array([cost(np.array(fit.values), one.curve) for fit, one in zip(fits, part, strict=False)])
    rows = [
        _share(f"reached the oracle's cost, {len(part)} curves", float(np.mean(ours <= lowest * _REACHED)),
               "share; fit_curves without start values", "0.995"),
        _share("said converged", float(np.mean([fit.converged for fit in fits])), "share of a thousand"),
        _share("time a curve, with errors and intervals", each, "s; mean of a batch of a thousand"),
    ]  # fmt: skip
    for name, fit in _peers().items():
        for word, good in (("a good", True), ("a naive", False)):
            times, reached = [], []
            for one, low in zip(part, lowest, strict=True):
                started = time.process_time()
                found = fit(one, _start(one, good=good))
                times.append(time.process_time() - started)
                reached.append(found <= low * _REACHED)
            label = f"{name} from {word} start"
            rows += [
                _share(f"{label}: reached", float(np.mean(reached)), "share"),
                _share(f"{label}: time", float(np.median(times)), "s; median a curve"),
                _share(f"{label}: mean time", float(np.mean(times)), "s; mean a curve"),
            ]
    return rows


def _start(one: Sample, *, good: bool) -> np.ndarray:
    top, channel = np.abs(one.curve.y).max(), one.curve.channel
    sign = -1.0 if channel == "FY" else 1.0
    if good:
        return np.array([10.0, 1.3 if channel == "FY" else 2.3, sign * top, -1.0, 0.0, 0.0])
    return np.array([1.0, 1.0, top, 0.5, 0.0, 0.0])


def _peers() -> dict[str, Callable[[Sample, np.ndarray], float]]:
    from scipy.optimize import curve_fit, least_squares

    from toolkit.tires.models.magic_formula import jacobian, value

    def curve(one: Sample, x: np.ndarray) -> float:
        def model(SA: np.ndarray, *p: float) -> np.ndarray:
            return value(p, SA)

        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                found, _ = curve_fit(model, one.curve.SA, one.curve.y, p0=x)
            except RuntimeError:
                return float("inf")
        low, high = box(one.curve)
        # Beyond the box is another problem: such an end does not count.
        inside = np.all((found >= low - 1e-9) & (found <= high + 1e-9))
        return cost(found, one.curve) if inside else float("inf")

    def bounded(one: Sample, x: np.ndarray, *, with_jacobian: bool = True) -> float:
        low, high = box(one.curve)
        start = np.clip(x, low + 1e-6 * (high - low), high - 1e-6 * (high - low))
        more = {"jac": lambda p: jacobian(p, one.curve.SA).T} if with_jacobian else {}
        found = least_squares(
            lambda p: value(p, one.curve.SA) - one.curve.y, start, bounds=(low, high), x_scale="jac"
            if with_jacobian else 1.0, **more,
        )  # fmt: skip
        return 2 * float(found.cost)

    return {
        "curve_fit": curve,
        "least_squares, bounded, with Jacobian": bounded,
        "least_squares, bounded": lambda one, x: bounded(one, x, with_jacobian=False),
    }


def _coverage(many: list[Sample]) -> list[Result]:
    from toolkit.estimate import coverage_factor
    from toolkit.tires.fit import fit_curves

    fits = fit_curves([one.curve for one in many])
    rows = []
    for noise in ("white", "AR"):
        for sides in ("both signs", "one sign"):
            hits: dict[str, list[bool]] = {"slope": [], "value": [], "parameters": []}
            asked = 0
            for one, fit in zip(many, fits, strict=True):
                if (one.noise, one.one_sided) != (noise, sides == "one sign") or one.theta is None:
                    continue  # a model of another form has its own misfit, which no interval of noise covers
                asked += 1
                known = fit.slope_at_zero or fit.value_at_zero
                factor = coverage_factor(known.dof) if known is not None else 2.0
                for name, estimate, true in (
                    ("slope", fit.slope_at_zero, one.slope), ("value", fit.value_at_zero, one.level),
                ):  # fmt: skip
                    if estimate is not None:
                        hits[name].append(abs(estimate.value - true) <= estimate.expanded()[0])
                for parameter, true in zip(fit.parameters, one.theta, strict=True):
                    if parameter.standard_error is not None:
                        error = factor * parameter.standard_error
                        hits["parameters"].append(abs(parameter.value - true) <= error)
            for name, found in hits.items():
                if not found:
                    rows.append(_share(f"{name}, {noise} noise, {sides}: told", 0.0, f"of {asked} curves"))
                    continue
                share = float(np.mean(found))
                rows.append(
                    _share(
                        f"95 % interval of {name}, {noise} noise, {sides}",
                        share,
                        f"covered, of {len(found)} told in {asked} curves",
                        "0.93-0.97",
                    )
                )
    return rows


def _per_point(count: int) -> Result:
    from toolkit.tires.models.mf61 import forces
    from toolkit.tires.slip import state

    points = 1_000_000
    rng = np.random.default_rng(1)
    SA, FZ = rng.uniform(-0.2, 0.2, points), rng.uniform(1000.0, 6000.0, points)
    names = "PCY1 PDY1 PDY2 PEY1 PKY1 PKY2 QBZ1 QCZ1 QDZ1 QEZ1 QBZ10 PCX1 PDX1 PKX1".split()
    numbers = (1.3, 1.0, -0.1, -0.5, -20.0, 1.6, 9.0, 1.15, 0.1, -2.0, 0.5, 1.6, 1.1, 20.0)
    p = dict(zip(names, numbers, strict=True))

    def ours() -> object:
        # Blocks that stay in the cache, as `evaluate` would be asked for a long grid.
        return [
            forces(p, state(p, SA=SA[i : i + 8192], FZ=FZ[i : i + 8192], FNOMIN=4000.0), UNLOADED_RADIUS=0.3)
            for i in range(0, points, 8192)
        ]

    times = pairs(ours, lambda: np.sin(SA), max(2, count // 2))
    return row("MF 6.1, FX FY MZ at a million points", times[0], "numpy.sin over the same", times[1], "")


def _families(folder: Path, count: int) -> Result:
    from toolkit.channels import signs
    from toolkit.simulation.tire import aligning_moment, lateral_force
    from toolkit.tires.fit import Curve, fit_curves
    from toolkit.tires.global_data import measured
    from toolkit.tires.global_fit import fit_global
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find, model_names

    del folder
    rng, flip = np.random.default_rng(2), signs("adapted-SAE", "SAE")
    angles = np.radians([0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10])
    SA, FZ = (one.ravel() for one in np.meshgrid(angles, [1112.0, 2522.0, 3705.0, 4898.0, 6103.0]))
    FY = lateral_force(slip_angle=flip["SA"] * SA, load=FZ) + rng.normal(0, 15.0, len(SA))
    MZ = aligning_moment(slip_angle=flip["SA"] * SA, load=FZ) + rng.normal(0, 0.5, len(SA))
    data = measured({"SA": SA, "FZ": FZ, "FY": FY, "MZ": MZ}, axes="SAE")
    curves = [
        Curve(SA=SA[data.block == k], y=y[data.block == k], channel=channel, load_N=float(load))
        for k, load in enumerate(data.loads)
        for channel, y in (("FY", FY), ("MZ", MZ))
    ]  # fmt: skip

    def ours() -> None:
        fit_curves([*curves, *curves])  # both directions of a test of 26 files
        for name in model_names():
            model = find(name)
            if isinstance(model, GlobalModel):
                fit_global(model, data)

    times = []
    for _ in range(max(1, count // 3)):
        started = time.perf_counter()
        ours()
        times.append(time.perf_counter() - started)
    return row("a test's 130 conditions, all model families, with predictions", times, "", None, "")
