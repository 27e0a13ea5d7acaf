"""Read an answer back: ``diagnosis.json``, or the folder that a diagnosis was written to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from toolkit.declared import object_of
from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.errors import ConfigError
from toolkit.inputs import RESULT_FILE, read_input
from toolkit.publication import settle

ANSWER = "diagnosis.json"


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
        return _answer(json.loads(read_input(file, RESULT_FILE))), file
    except (ValueError, RecursionError) as error:
        raise ConfigError(
            "this is no answer of a diagnosis",
            where=file,
            got=str(error)[:200],
            expected=f"the {ANSWER} that 'toolkit diagnose' writes",
            next_step="name that file, or the folder that it is in",
            rule="not-a-diagnosis",
        ) from error


def _answer(document: Any) -> Diagnosis:
    if isinstance(document, dict) and document.get("schema") != 1:
        raise ValueError(f"schema {document.get('schema')!r}")
    return object_of(Diagnosis, document)
