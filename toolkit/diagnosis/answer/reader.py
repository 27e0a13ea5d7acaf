"""Read an answer back: ``diagnosis.json``, or the folder that a diagnosis was written to."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, get_args

from toolkit.diagnosis.answer.answer import (
    Diagnosis,
    FoundEffect,
    FoundParameter,
    HeldOutFit,
    Mismatch,
    NominalParameter,
    NotFound,
    Place,
    Recorded,
)
from toolkit.effects.applied import EffectKey
from toolkit.effects.facts import Second
from toolkit.errors import ConfigError
from toolkit.files import read_bytes
from toolkit.findings import Finding

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
    try:
        payload = json.loads(read_bytes(file))
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
        got = f"no key {error}" if isinstance(error, KeyError) else str(error)
        raise ConfigError(
            "this is no answer of a diagnosis",
            where=file,
            got=got[:200],
            expected=f"the {ANSWER} that 'toolkit diagnose' writes",
            next_step="name that file, or the folder that it is in",
            rule="not-a-diagnosis",
        ) from error


def _answer(told: dict[str, Any]) -> Diagnosis:
    if told["schema"] != 1:
        raise ValueError(f"schema {told['schema']!r}")
    fit = told["fit"]
    return Diagnosis(
        title=_text(told["title"]),
        case_sha256=_text(told["case_sha256"]),
        verdict=_one_of(told["verdict"], _VERDICTS),
        remaining=_one_of(told["remaining"], _REMAINING),
        mismatch=tuple(map(_mismatch, told["mismatch"])),
        effects=tuple(map(_effect, told["effects"])),
        nominal_parameters=tuple(
            NominalParameter(
                name=_text(one["name"]), before=_number(one["before"]), after=_number(one["after"]),
                unit=_text(one["unit"]), prior_sd=_or_none(one["prior_sd"]),
            )
            for one in told["nominal_parameters"]
        ),
        held_out=tuple(
            HeldOutFit(
                channel=_text(one["channel"]),
                unit=_text(one["unit"]),
                nominal_rmse=_number(one["nominal_rmse"]),
                refitted_rmse=_number(one["refitted_rmse"]),
                augmented_rmse=_number(one["augmented_rmse"]),
                noise_floor=_number(one["noise_floor"]),
            )
            for one in fit["held_out"]
        ),
        held_out_by=_text(fit["held_out_by"]),
        depends_on=tuple((_text(one["channel"]), _texts(one["variables"])) for one in told["depends_on"]),
        not_found=tuple(
            NotFound(
                name=_text(one["name"]), minimum_detectable=_or_none(one["minimum_detectable"]),
                unit=_text(one["unit"]), observable=bool(one["observable"]), why=_text(one["why"]),
            )
            for one in told["not_found"]
        ),
        next_measurements=_texts(told["next_measurements"]),
        findings=tuple(
            Finding(
                rule=_text(one["rule"]), where=_text(one["where"]), message=_text(one["message"]),
                level=_one_of(one["level"], ("error", "warning", "note")),
            )
            for one in told["findings"]
        ),
        complete=bool(told["complete"]),
        skipped=_texts(told["skipped"]),
        recordings=_recordings(told.get("recordings")),
    )  # fmt: skip


def _recordings(told: Any) -> tuple[Recorded, ...] | None:
    """Return the recordings of an answer; None where it is older than the key."""
    if told is None:
        return None
    return tuple(
        Recorded(name=_text(one["name"]), sha256=_text(one["sha256"]), own=bool(one["own"])) for one in told
    )


def _mismatch(one: dict[str, Any]) -> Mismatch:
    return Mismatch(
        channel=_text(one["channel"]),
        p_value=_number(one["p_value"]),
        share_of_variance=_number(one["share_of_variance"]),
        where=tuple(
            Place(
                variable=_text(at["variable"]), start=_end(at["from"]), end=_end(at["to"]),
                unit=_text(at["unit"]), runs=_texts(at["runs"]),
            )
            for at in one["where"]
        ),
    )  # fmt: skip


def _effect(one: dict[str, Any]) -> FoundEffect:
    return FoundEffect(
        key=_key(one),
        stage=_text(one["stage"]),
        statement=_text(one["statement"]),
        equation=_text(one["equation"]),
        reference=_text(one["reference"]),
        parameters=tuple(
            FoundParameter(
                name=_text(each["name"]),
                value=each["value"] if isinstance(each["value"], str) else _number(each["value"]),
                unit=_text(each["unit"]),
                ci95=None if each["ci95"] is None else (_number(each["ci95"][0]), _number(each["ci95"][1])),
                runs=None if each["runs"] is None else _texts(each["runs"]),
            )
            for each in one["parameters"]
        ),
        equivalent_to=_texts(one["equivalent_to"]),
        rejected=tuple((_text(o["name"]), -_number(o["log_likelihood_less"])) for o in one["rejected"]),
        held_out_log_score_gain=_number(one["evidence"]["held_out_log_score_gain"]),
        p_value=_number(one["evidence"]["p_value"]),
    )


def _key(one: dict[str, Any]) -> EffectKey:
    """Return an effect's identity; its source and its runs stand among its parameters."""
    words = {each["name"]: each["value"] for each in one["parameters"] if isinstance(each["value"], str)}
    runs = next((each["runs"] for each in one["parameters"]), None)
    return EffectKey(
        name=_text(one["name"]),
        channel=None if one["channel"] is None else _text(one["channel"]),
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


def _or_none(value: Any) -> float | None:
    return None if value is None else _number(value)


def _end(value: Any) -> float | str | None:
    return value if value is None or isinstance(value, str) else _number(value)


def _one_of(value: Any, known: tuple[str, ...]) -> Any:
    if value not in known:
        raise ValueError(f"{value!r} is none of {', '.join(known)}")
    return value
