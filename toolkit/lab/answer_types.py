"""What the commands answer with ``--json``: the declaration of each command's keys.

The functions that make an answer return these types, so that the type checker holds them to the declaration;
`docs/answers.md` is printed from it. Every answer begins with ``"schema": 1``. Numbers are in the unit that
the key ends with, in SI and in the axes that the answer names; a number that does not exist is null.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from toolkit.declared.answers import answer_schema
from toolkit.errors import ConfigError
from toolkit.lab.record_answer_types import (
    CalibrateAnswer,
    HistoryAnswer,
    InspectAnswer,
    ListAnswer,
    ShowAnswer,
)
from toolkit.lab.tire_answer_types import CompareAnswer, FitAnswer, ProcessAnswer

ANSWERS: Mapping[str, Any] = {
    "inspect": InspectAnswer,
    "calibrate": CalibrateAnswer,
    "calibration list": ListAnswer,
    "calibration show": ShowAnswer,
    "calibration history": HistoryAnswer,
    "process": ProcessAnswer,
    "fit": FitAnswer,
    "compare": CompareAnswer,
}
"""The declared answers by command."""


def schema_text(command: str) -> str:
    """Return the JSON schema of a command's answer as text.

    Raises
    ------
    ConfigError
        ``usage``: its answer is not declared; those that are are named
    """
    if command not in ANSWERS:
        raise ConfigError(
            "no answer of such a command is declared", where="--answer", got=command,
            expected=" | ".join(ANSWERS), next_step="choose one of them", rule="usage",
        )  # fmt: skip
    return json.dumps(answer_schema(ANSWERS[command]), indent=2, ensure_ascii=False)
