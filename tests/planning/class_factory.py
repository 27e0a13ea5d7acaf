"""A case whose recordings leave a class: a slow sine, in which late and lagging are alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from tests.diagnosis.case_text import case_text
from toolkit.diagnosis.answer.answer import DiagnosedEffect, Diagnosis, EffectEvidence, HeldOutFit
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of

SIMULATOR = """import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["gain"] * inputs["u"]})
"""
CASE = case_text(
    "python", title="a late force", parameters={"gain": (100.0, "N/mm", 5.0)}, inputs={"u": "mm"},
    outputs={"F": ("N", 1.0)}, runs=2,
)  # fmt: skip
DELAY = 0.03
FREQUENCY = 0.2
T = np.arange(500) * 0.02


def late(u: np.ndarray, rng: np.random.Generator, *, t: np.ndarray = T, delay: float = DELAY) -> np.ndarray:
    """The plant: 102 N/mm, late, 1 N of noise."""
    return np.asarray(102 * np.interp(t - delay, t, u) + rng.normal(0, 1.0, len(t)))


def write_case(folder: Path, *, delay: float = DELAY, **more: pd.DataFrame) -> Path:
    """Write the case; ``more`` are further runs by name."""
    folder.mkdir(parents=True, exist_ok=True)
    text = CASE
    for number in range(2):
        # From rest: neither member has to know what was before.
        u = (2.0 - 0.5 * number) * np.sin(2 * np.pi * FREQUENCY * T) * np.minimum(T, 1.0)
        run = pd.DataFrame({"t": T, "u": u, "F": late(u, np.random.default_rng(number), delay=delay)})
        run.to_csv(folder / f"r{number}.csv", index=False)
    for name, run in more.items():
        run.to_csv(folder / f"{name}.csv", index=False)
        text += f'[[recording.run]]\nfile = "{name}.csv"\n'
    (folder / "sim.py").write_text(SIMULATOR, encoding="utf-8")
    case = folder / "CASE.toml"
    case.write_text(text, encoding="utf-8")
    return case


def problem(case: Path) -> Problem:
    """The problem of the case, its code run in this process."""
    read = read_case(case)
    return problem_of(read, model_of(read, None))


def found(name: str, *others: str, channel: str | None = "F") -> DiagnosedEffect:
    """An effect of an answer, with the others of its class."""
    return DiagnosedEffect(
        name=name, channel=channel, stage="acquisition", statement="", equation="", reference="",
        parameters=(), equivalent_to=others, rejected=(),
        evidence=EffectEvidence(held_out_log_score_gain=100.0, p_value=0.0),
    )  # fmt: skip


def answer(case_sha256: str, *effects: DiagnosedEffect) -> Diagnosis:
    """An answer with effects."""
    return Diagnosis(
        title="t", case_sha256=case_sha256, verdict="equivalent", remaining="nothing", mismatch=(),
        effects=effects, nominal_parameters=(), fit=HeldOutFit(held_out_by="runs", held_out=()),
        depends_on=(), not_found=(),
        next_measurements=(), findings=(), complete=True, skipped=(), recordings=(),
    )  # fmt: skip


def with_run(folder: Path, u: np.ndarray, seed: int, *, t: np.ndarray = T, delay: float = DELAY) -> Problem:
    """The problem with one more run, as the plant answers its inputs."""
    more = pd.DataFrame({"t": t, "u": u, "F": late(u, np.random.default_rng(seed), t=t, delay=delay)})
    return problem(write_case(folder, delay=delay, more=more))
