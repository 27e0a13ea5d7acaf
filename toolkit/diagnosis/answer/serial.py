"""The answer as the contract's JSON: what is no finite number is null."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis, FoundEffect, Mismatch


def as_json(made: Diagnosis) -> dict[str, Any]:
    """Return the answer as the contract has it, without ``schema`` and ``timing``."""
    answer: dict[str, Any] = _finite({
        "title": made.title,
        "case_sha256": made.case_sha256,
        "recordings": None if made.recordings is None else [
            {"name": one.name, "sha256": one.sha256, "own": one.own} for one in made.recordings
        ],
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
                "name": one.name, "minimum_detectable": one.minimum_detectable, "unit": one.unit,
                "observable": one.observable, "why": one.why,
            }
            for one in made.not_found
        ],
        "next_measurements": list(made.next_measurements),
        "findings": [one.as_dict() for one in made.findings],
    })  # fmt: skip
    return answer


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
                "value": each.value,
                "unit": each.unit,
                "ci95": None if each.ci95 is None else list(each.ci95),
                "runs": None if each.runs is None else list(each.runs),
            }
            for each in one.parameters
        ],
        "equivalent_to": list(one.equivalent_to),
        "rejected": [{"name": name, "log_likelihood_less": -value} for name, value in one.rejected],
        "evidence": {"held_out_log_score_gain": one.held_out_log_score_gain, "p_value": one.p_value},
    }


def _finite(value: Any) -> Any:
    """Return a JSON value with null in the place of every number that is none."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
