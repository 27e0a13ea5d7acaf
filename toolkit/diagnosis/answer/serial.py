"""The answer as the contract's JSON: what is no finite number is null."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis, FoundEffect, FoundLaw, Mismatch


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the answer as the contract has it, without ``schema`` and ``timing``."""
    answer: dict[str, Any] = _finite({
        "title": diagnosis.title,
        "case_sha256": diagnosis.case_sha256,
        "recordings": None if diagnosis.recordings is None else [
            {"name": recording.name, "sha256": recording.sha256, "own": recording.own}
            for recording in diagnosis.recordings
        ],
        "verdict": diagnosis.verdict,
        "remaining": diagnosis.remaining,
        "complete": diagnosis.complete,
        "skipped": list(diagnosis.skipped),
        "mismatch": [_mismatch(mismatch) for mismatch in diagnosis.mismatch],
        "effects": [_effect(effect) for effect in diagnosis.effects],
        "laws": [_law(law) for law in diagnosis.laws],
        "nominal_parameters": [
            {
                "name": parameter.name, "before": parameter.before, "after": parameter.after,
                "unit": parameter.unit, "prior_sd": parameter.prior_sd, "shift_in_sd": parameter.shift_in_sd,
            }
            for parameter in diagnosis.nominal_parameters
        ],
        "fit": {
            "held_out_by": diagnosis.held_out_by,
            "held_out": [
                {
                    "channel": output.channel, "unit": output.unit, "nominal_rmse": output.nominal_rmse,
                    "refitted_rmse": output.refitted_rmse, "augmented_rmse": output.augmented_rmse,
                    "noise_floor": output.noise_floor,
                    "with_laws_rmse": output.with_laws_rmse,
                    "noise": None if output.noise is None else {
                        "sensor_sd": output.noise.sensor_sd, "process_sd": output.noise.process_sd,
                        "how": output.noise.how,
                    },
                }
                for output in diagnosis.held_out
            ],
        },
        "depends_on": [
            {"channel": channel, "variables": list(names)} for channel, names in diagnosis.depends_on
        ],
        "not_found": [
            {
                "name": effect.name, "minimum_detectable": effect.minimum_detectable, "unit": effect.unit,
                "observable": effect.observable, "why": effect.why,
            }
            for effect in diagnosis.not_found
        ],
        "next_measurements": list(diagnosis.next_measurements),
        "findings": [finding.as_dict() for finding in diagnosis.findings],
    })  # fmt: skip
    return answer


def _mismatch(mismatch: Mismatch) -> dict[str, Any]:
    return {
        "channel": mismatch.channel,
        "p_value": mismatch.p_value,
        "share_of_variance": mismatch.share_of_variance,
        "where": [
            {
                "variable": place.variable,
                "from": place.start,
                "to": place.end,
                "unit": place.unit,
                "runs": list(place.runs),
            }
            for place in mismatch.where
        ],
    }


def _effect(effect: FoundEffect) -> dict[str, Any]:
    return {
        "name": effect.name,
        "stage": effect.stage,
        "channel": effect.channel,
        "statement": effect.statement,
        "equation": effect.equation,
        "reference": effect.reference,
        "parameters": [
            {
                "name": parameter.name,
                "value": parameter.value,
                "unit": parameter.unit,
                "ci95": None if parameter.ci95 is None else list(parameter.ci95),
                "runs": None if parameter.runs is None else list(parameter.runs),
            }
            for parameter in effect.parameters
        ],
        "equivalent_to": list(effect.equivalent_to),
        "rejected": [{"name": name, "log_likelihood_less": -value} for name, value in effect.rejected],
        "evidence": {"held_out_log_score_gain": effect.held_out_log_score_gain, "p_value": effect.p_value},
    }


def _law(law: FoundLaw) -> dict[str, Any]:
    curve = law.curve
    return {
        "place": {"kind": law.kind, "channel": law.channel},
        "form": law.form,
        "acts": law.acts,
        "variables": list(law.variables),
        "memory_s": law.memory_s,
        "formula": law.formula,
        "parameters": [
            {
                "name": parameter.name, "value": parameter.value, "unit": parameter.unit,
                "ci95": None if parameter.ci95 is None else list(parameter.ci95),
                "runs": None if parameter.runs is None else list(parameter.runs),
            }
            for parameter in law.parameters
        ],
        "curve": None if curve is None else {
            "x": list(curve.x), "y": list(curve.y), "band95": [list(curve.low), list(curve.high)],
            "unit": curve.unit,
        },
        "range": {name: [start, end] for name, start, end in law.ranges},
        "resembles": [{"name": name, "distance": distance} for name, distance in law.resembles],
        "confounded_with": list(law.confounded_with),
        "evidence": {
            "held_out_log_score_gain": law.held_out_log_score_gain, "p_value": law.p_value,
            "share_of_gap": law.share_of_gap,
        },
    }  # fmt: skip


def _finite(value: Any) -> Any:
    """Return a JSON value with null in the place of every number that is none."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
