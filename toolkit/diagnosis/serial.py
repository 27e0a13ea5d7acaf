"""The answer as the contract's JSON, and predictions as CSV."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.answer import Diagnosis, FoundEffect, Mismatch

if TYPE_CHECKING:
    from toolkit.diagnosis.case import Run
    from toolkit.diagnosis.search import Search


def as_json(made: Diagnosis) -> dict[str, Any]:
    """Return the answer as the contract has it, without ``schema`` and ``timing``."""
    return {
        "title": made.title,
        "case_sha256": made.case_sha256,
        "verdict": made.verdict,
        "remaining": made.remaining,
        "complete": made.complete,
        "skipped": list(made.skipped),
        "mismatch": [_mismatch(one) for one in made.mismatch],
        "effects": [_effect(one) for one in made.effects],
        "nominal_parameters": [
            {
                "name": one.name, "before": one.before, "after": one.after, "unit": one.unit,
                "prior_sd": one.prior_sd, "shift_in_sd": one.shift_in_sd,
            }
            for one in made.nominal_parameters
        ],
        "fit": {
            "held_out_by": made.held_out_by,
            "held_out": [
                {
                    "channel": one.channel, "unit": one.unit, "nominal_rmse": one.nominal_rmse,
                    "refitted_rmse": one.refitted_rmse, "augmented_rmse": one.augmented_rmse,
                    "noise_floor": one.noise_floor,
                }
                for one in made.held_out
            ],
        },
        "depends_on": [{"channel": channel, "variables": list(names)} for channel, names in made.depends_on],
        "not_found": [
            {
                "name": one.name, "minimum_detectable": _finite(one.minimum_detectable), "unit": one.unit,
                "observable": one.observable, "why": one.why,
            }
            for one in made.not_found
        ],
        "next_measurements": list(made.next_measurements),
        "findings": [one.as_dict() for one in made.findings],
    }  # fmt: skip


def _mismatch(one: Mismatch) -> dict[str, Any]:
    return {
        "channel": one.channel,
        "p_value": one.p_value,
        "share_of_variance": one.share_of_variance,
        "where": [
            {"variable": at.variable, "from": at.start, "to": at.end, "unit": at.unit, "runs": list(at.runs)}
            for at in one.where
        ],
    }


def _effect(one: FoundEffect) -> dict[str, Any]:
    return {
        "name": one.name,
        "stage": one.stage,
        "channel": one.channel,
        "statement": one.statement,
        "equation": one.equation,
        "reference": one.reference,
        "parameters": [
            {
                "name": each.name,
                "value": each.value if isinstance(each.value, str) else _finite(each.value),
                "unit": each.unit,
                "ci95": None if each.ci95 is None else [_finite(end) for end in each.ci95],
                "runs": None if each.runs is None else list(each.runs),
            }
            for each in one.parameters
        ],
        "equivalent_to": list(one.equivalent_to),
        "rejected": [{"name": name, "log_likelihood_less": -value} for name, value in one.rejected],
        "evidence": {"held_out_log_score_gain": one.held_out_log_score_gain, "p_value": one.p_value},
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def prediction_csv(found: Search, run: Run, *, unknown: bool) -> str:
    """Return a run's outputs as declared, refitted and augmented, under the recording's time."""
    problem = found.problem
    fits = {"nominal": found.nominal, "refitted": found.refitted}
    fits["augmented"] = found.refitted if unknown else found.augmented
    columns: dict[str, np.ndarray[Any, np.dtype[np.float64]]] = {"t": run.t}
    for output in problem.model.outputs:
        for name, made in fits.items():
            values = dict(problem.known)
            values.update(zip((one.name for one in problem.free), made.p, strict=True))
            simulated = problem.model.simulate(run, values, made.active)
            columns[f"{output.name}_{name}"] = simulated[output.name]
    lines = [",".join(columns)]
    lines += [",".join(repr(float(v)) for v in row) for row in np.stack(list(columns.values()), axis=1)]
    return "\n".join(lines) + "\n"
