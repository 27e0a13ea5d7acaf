"""What the diagnosis names where inputs are recorded with noise: nothing where nothing is missing.

    python -m tests.campaigns.noisy_inputs [--nulls 60] [--effects 30] [--seed 0]

A mass on a damper is moved by a sine, a sweep or a walk. Its position is recorded with noise; velocity and
acceleration are differences of it, in every other run low-passed as instruments do. The force is exact but
for 2 % of white noise, without anything missing or with dry friction, a quadratic drag or a cubic channel.
Printed are names on nulls, right names (alone or in a class) of effects, names that are none, and how often a
parameter's fitted value lies within a hundredth of the truth on nulls, with exact binomial intervals.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from tests.coverage.rows import exact_interval
from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["mass"] * inputs["a"] + p["c"] * inputs["v"]})
"""
NAMES = {"dry": "coulomb_friction", "drag": "quadratic_drag", "cubic": "nonlinearity"}


def motion(kind: str, t: NDArray[np.float64], rng: np.random.Generator, rate: float) -> NDArray[np.float64]:
    """Return a motion of the size one, (n,)."""
    phase = rng.uniform(0, 2 * np.pi)
    if kind == "sine":
        return np.asarray(np.sin(2 * np.pi * rate * t + phase))
    if kind == "sweep":
        return np.asarray(np.sin(2 * np.pi * rate * (0.3 * t + 0.3 * t**2 / t[-1]) + phase))
    walk = filtfilt(*butter(3, 4 * rate * (t[1] - t[0])), rng.standard_normal(len(t) + 400))[200:-200]
    return np.asarray(walk / walk.std())


def write_case(folder: Path, rng: np.random.Generator, missing: str) -> tuple[Path, dict[str, float]]:
    """Write a drawn case; return it and the true parameters."""
    step, runs, rows = (
        rng.choice([0.001, 0.002, 0.005]),
        int(rng.integers(1, 5)),
        int(rng.integers(800, 2500)),
    )
    true = {"mass": rng.uniform(5, 50), "c": rng.uniform(20, 200)}
    size, rate = rng.uniform(0.02, 0.1), rng.uniform(0.5, 2.5)
    noise, kind = size * 10 ** rng.uniform(-4.5, -3), str(rng.choice(["sine", "sweep", "walk"]))
    lines = ["schema = 1", "[simulation]", 'kind = "python"', 'path = "sim.py"']
    for name, unit in (("mass", "kg"), ("c", "N*s/m")):
        declared = true[name] * (1 + 0.1 * rng.standard_normal())
        lines += [f"[simulation.parameters.{name}]", f"value = {declared:.6g}", f'unit = "{unit}"']
        lines.append(f"sd = {0.1 * true[name]:.6g}")
    lines += ["[recording]", 'time = "t"', "[recording.channels]", 't = { unit = "s", role = "time" }']
    lines += ['v = { unit = "m/s", role = "input" }', 'a = { unit = "m/s^2", role = "input" }']
    lines.append('F = { unit = "N", role = "output" }')
    for run in range(runs):
        t = np.arange(rows) * step
        x = size * (1 + 0.3 * run) * motion(kind, t, rng, rate)
        v = np.gradient(x, step)
        force = true["mass"] * np.gradient(v, step) + true["c"] * v
        spread = force.std()
        force = force + {
            "": 0.0, "dry": 0.3 * spread * np.sign(v), "drag": 0.4 * spread * v * np.abs(v) / np.mean(v**2),
            "cubic": 0.1 * force**3 / spread**2,
        }[missing]  # fmt: skip
        velocity = np.gradient(x + noise * rng.standard_normal(rows), step)
        columns = [velocity, np.gradient(velocity, step)]
        if run % 2:
            columns = [filtfilt(*butter(2, rng.uniform(0.2, 0.6)), column) for column in columns]
        table = {"t": t, "v": columns[0], "a": columns[1]}
        table["F"] = force + 0.02 * spread * rng.standard_normal(rows)
        pd.DataFrame(table).to_csv(folder / f"r{run}.csv", index=False)
        lines += ["[[recording.run]]", f'file = "r{run}.csv"']
    (folder / "sim.py").write_text(SIMULATOR, encoding="utf-8")
    (folder / "CASE.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "CASE.toml", true


def answer_of(seed: int, missing: str) -> tuple[Diagnosis, dict[str, float]]:
    """Return the answer on a drawn case, and the true parameters."""
    with tempfile.TemporaryDirectory() as folder:
        case, true = write_case(Path(folder), np.random.default_rng(seed), missing)
        return diagnose(read_case(case), None, budget_s=120).diagnosis, true


def main() -> None:
    """Run the campaign and print its rates."""
    parser = argparse.ArgumentParser(prog="tests.campaigns.noisy_inputs", description=__doc__)
    parser.add_argument("--nulls", type=int, default=60)
    parser.add_argument("--effects", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    for number in range(given.nulls + given.effects):
        missing = "" if number < given.nulls else list(NAMES)[number % len(NAMES)]
        answer, true = answer_of(given.seed + number, missing)
        named = {name for effect in answer.effects for name in (effect.name, *effect.equivalent_to)}
        if missing:
            counts["right"] += NAMES[missing] in named
            counts["wrong"] += bool(named) and NAMES[missing] not in named
        else:
            fitted = {parameter.name: parameter.after for parameter in answer.nominal_parameters}
            counts["named"] += bool(named)
            counts["near"] += all(abs(fitted[name] / value - 1) < 0.01 for name, value in true.items())
        print(number, missing or "nothing", answer.verdict, *sorted(named), file=sys.stderr, flush=True)  # noqa: T201
    for what, of in (
        ("named", given.nulls),
        ("near", given.nulls),
        ("right", given.effects),
        ("wrong", given.effects),
    ):
        low, high = exact_interval(counts[what], of)
        print(f"{what:6} {counts[what]:3} of {of:3}  95 %: {low:.3f} to {high:.3f}")  # noqa: T201


if __name__ == "__main__":
    main()
