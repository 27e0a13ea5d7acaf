"""Read an answer back: ``diagnosis.json``, or the folder that a diagnosis was written to."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, get_args

from toolkit.diagnosis.answer.answer import (
    Diagnosis,
    FoundEffect,
    FoundLaw,
    FoundParameter,
    HeldOutFit,
    LawCurve,
    Mismatch,
    NominalParameter,
    NotFound,
    Place,
    Recorded,
)
from toolkit.diagnosis.fit.sensor_noise import Evidence, NoiseParts
from toolkit.effects.applied import EffectKey
from toolkit.effects.facts import Second
from toolkit.errors import ConfigError
from toolkit.findings import Finding
from toolkit.inputs import RESULT_FILE, read_input
from toolkit.publication import settle

ANSWER = "diagnosis.json"
_VERDICTS = ("named", "equivalent", "unknown", "nothing", "untestable")
_REMAINING = ("nothing", "unknown")


def read_answer(path: Path) -> tuple[Diagnosis, Path]:
    """Return an answer and its file.

    Raises
    ------
    ConfigError
        there is no such file, it is no JSON, or not an answer of a diagnosis
    """
    file = path / ANSWER if path.is_dir() else path
    settle(file.parent)
    try:
        payload = json.loads(read_input(file, RESULT_FILE))
        return _answer(payload), file
    except (
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
    ) as error:
        reason = f"no key {error}" if isinstance(error, KeyError) else str(error)
        raise ConfigError(
            "this is no answer of a diagnosis",
            where=file,
            got=reason[:200],
            expected=f"the {ANSWER} that 'toolkit diagnose' writes",
            next_step="name that file, or the folder that it is in",
            rule="not-a-diagnosis",
        ) from error


def _answer(entries: dict[str, Any]) -> Diagnosis:
    if entries["schema"] != 1:
        raise ValueError(f"schema {entries['schema']!r}")
    fit = entries["fit"]
    return Diagnosis(
        title=_text(entries["title"]),
        case_sha256=_text(entries["case_sha256"]),
        verdict=_one_of(entries["verdict"], _VERDICTS),
        remaining=_one_of(entries["remaining"], _REMAINING),
        mismatch=tuple(map(_mismatch, entries["mismatch"])),
        effects=tuple(map(_effect, entries["effects"])),
        nominal_parameters=tuple(
            NominalParameter(
                name=_text(parameter["name"]),
                before=_number(parameter["before"]), after=_number(parameter["after"]),
                unit=_text(parameter["unit"]), prior_sd=_or_none(parameter["prior_sd"]),
            )
            for parameter in entries["nominal_parameters"]
        ),
        held_out=tuple(
            HeldOutFit(
                channel=_text(output["channel"]),
                unit=_text(output["unit"]),
                nominal_rmse=_number(output["nominal_rmse"]),
                refitted_rmse=_number(output["refitted_rmse"]),
                augmented_rmse=_number(output["augmented_rmse"]),
                noise_floor=_number(output["noise_floor"]),
                noise=_noise(output.get("noise")),
                with_laws_rmse=_or_none(output.get("with_laws_rmse")),
            )
            for output in fit["held_out"]
        ),
        held_out_by=_text(fit["held_out_by"]),
        depends_on=tuple(
            (_text(structure["channel"]), _texts(structure["variables"]))
            for structure in entries["depends_on"]
        ),
        not_found=tuple(
            NotFound(
                name=_text(effect["name"]), minimum_detectable=_or_none(effect["minimum_detectable"]),
                unit=_text(effect["unit"]), observable=bool(effect["observable"]), why=_text(effect["why"]),
            )
            for effect in entries["not_found"]
        ),
        next_measurements=_texts(entries["next_measurements"]),
        findings=tuple(
            Finding(
                rule=_text(finding["rule"]), where=_text(finding["where"]), message=_text(finding["message"]),
                level=_one_of(finding["level"], ("error", "warning", "note")),
            )
            for finding in entries["findings"]
        ),
        complete=bool(entries["complete"]),
        skipped=_texts(entries["skipped"]),
        recordings=_recordings(entries.get("recordings")),
        laws=tuple(map(_law, entries.get("laws", ()))),
    )  # fmt: skip


def _recordings(entries: Any) -> tuple[Recorded, ...] | None:
    """Return the recordings of an answer; None where it is older than the key."""
    if entries is None:
        return None
    return tuple(
        Recorded(name=_text(entry["name"]), sha256=_text(entry["sha256"]), own=bool(entry["own"]))
        for entry in entries
    )


def _mismatch(mismatch: dict[str, Any]) -> Mismatch:
    return Mismatch(
        channel=_text(mismatch["channel"]),
        p_value=_number(mismatch["p_value"]),
        share_of_variance=_number(mismatch["share_of_variance"]),
        where=tuple(
            Place(
                variable=_text(at["variable"]), start=_end(at["from"]), end=_end(at["to"]),
                unit=_text(at["unit"]), runs=_texts(at["runs"]),
            )
            for at in mismatch["where"]
        ),
    )  # fmt: skip


def _effect(effect: dict[str, Any]) -> FoundEffect:
    return FoundEffect(
        key=_key(effect),
        stage=_text(effect["stage"]),
        statement=_text(effect["statement"]),
        equation=_text(effect["equation"]),
        reference=_text(effect["reference"]),
        parameters=tuple(map(_parameter, effect["parameters"])),
        equivalent_to=_texts(effect["equivalent_to"]),
        rejected=tuple((_text(o["name"]), -_number(o["log_likelihood_less"])) for o in effect["rejected"]),
        held_out_log_score_gain=_number(effect["evidence"]["held_out_log_score_gain"]),
        p_value=_number(effect["evidence"]["p_value"]),
    )


def _parameter(parameter: dict[str, Any]) -> FoundParameter:
    value, ci95 = parameter["value"], parameter["ci95"]
    return FoundParameter(
        name=_text(parameter["name"]),
        value=value if isinstance(value, str) else _number(value),
        unit=_text(parameter["unit"]),
        ci95=None if ci95 is None else (_number(ci95[0]), _number(ci95[1])),
        runs=None if parameter["runs"] is None else _texts(parameter["runs"]),
    )


def _law(law: dict[str, Any]) -> FoundLaw:
    curve, evidence = law["curve"], law["evidence"]
    return FoundLaw(
        kind=_one_of(law["place"]["kind"], ("output", "state")),
        channel=_text(law["place"]["channel"]),
        form=_text(law["form"]),
        acts=_one_of(law["acts"], ("adds", "multiplies")),
        variables=_texts(law["variables"]),
        memory_s=_or_none(law["memory_s"]),
        formula=None if law["formula"] is None else _text(law["formula"]),
        parameters=tuple(map(_parameter, law["parameters"])),
        curve=None if curve is None else LawCurve(
            x=_numbers(curve["x"]), y=_numbers(curve["y"]), low=_numbers(curve["band95"][0]),
            high=_numbers(curve["band95"][1]), unit=_text(curve["unit"]),
        ),
        ranges=tuple(
            (_text(name), _number(ends[0]), _number(ends[1])) for name, ends in law["range"].items()
        ),
        resembles=tuple((_text(one["name"]), _number(one["distance"])) for one in law["resembles"]),
        confounded_with=_texts(law["confounded_with"]),
        held_out_log_score_gain=_or_none(evidence["held_out_log_score_gain"]),
        p_value=_number(evidence["p_value"]),
        share_of_gap=_number(evidence["share_of_gap"]),
    )  # fmt: skip


def _noise(entry: dict[str, Any] | None) -> NoiseParts | None:
    if entry is None:
        return None
    return NoiseParts(
        sensor_sd=_number(entry["sensor_sd"]),
        process_sd=_number(entry["process_sd"]),
        how=_one_of(entry["how"], get_args(Evidence)),
    )


def _key(effect: dict[str, Any]) -> EffectKey:
    """Return an effect's identity; its source and its runs stand among its parameters."""
    parameters = effect["parameters"]
    words = {entry["name"]: entry["value"] for entry in parameters if isinstance(entry["value"], str)}
    runs = next((entry["runs"] for entry in parameters), None)
    return EffectKey(
        name=_text(effect["name"]),
        channel=None if effect["channel"] is None else _text(effect["channel"]),
        source=next((words[word] for word in get_args(Second) if word in words), None),
        runs=None if runs is None else frozenset(_texts(runs)),
    )


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} in the place of a text")
    return value


def _texts(values: Any) -> tuple[str, ...]:
    return tuple(map(_text, values))


def _number(value: Any) -> float:
    """Return a number; null is what is no finite one."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} in the place of a number")
    return float(value)


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(map(_number, values))


def _or_none(value: Any) -> float | None:
    return None if value is None else _number(value)


def _end(value: Any) -> float | str | None:
    return value if value is None or isinstance(value, str) else _number(value)


def _one_of(value: Any, choices: tuple[str, ...]) -> Any:
    if value not in choices:
        raise ValueError(f"{value!r} is none of {', '.join(choices)}")
    return value
