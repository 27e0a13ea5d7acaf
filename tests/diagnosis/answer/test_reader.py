"""An answer that was written is read back as it was, and nothing else is taken for one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.declared import json_value
from toolkit.diagnosis.answer.reader import read_answer
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.errors import ConfigError, ToolkitError


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    seen = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    case = read_case(write_case(tmp_path_factory.mktemp("drag"), HEAD + TWO, **seen))
    return {
        "schema": 1,
        **json_value(diagnose(case, None).diagnosis),
        "model": None,
        "timing": {"seconds": 1.0},
    }


def test_an_answer_is_read_back_as_it_was_written(told: dict[str, Any], tmp_path: Path) -> None:
    assert told["effects"]
    assert told["not_found"]
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps(told))
    for given in (file, tmp_path):
        answer, found = read_answer(given)
        assert found == file
        assert json_value(answer) == {key: told[key] for key in json_value(answer)}


def test_an_answer_names_its_recordings_and_an_older_one_does_not(
    told: dict[str, Any], tmp_path: Path
) -> None:
    assert told["recordings"]
    for one in told["recordings"]:
        assert len(one["sha256"]) == 64
        assert one["own"] is False  # a table, not a file of the machine
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps({key: one for key, one in told.items() if key != "recordings"}))
    assert read_answer(file)[0].recordings is None


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("schema", 2), ("verdict", "guilty"), ("remaining", None), ("title", 5), ("effects", [{}]),
        ("effects", None), ("mismatch", [7]), ("fit", {"held_out_by": "run", "held_out": [{"channel": "F"}]}),
        ("findings", [{"rule": "x", "where": "y", "message": "z", "level": "fatal"}]), ("case_sha256", ...),
    ],
)  # fmt: skip
def test_what_is_no_answer_is_refused(told: dict[str, Any], tmp_path: Path, key: str, value: object) -> None:
    changed = {name: one for name, one in (told | {key: value}).items() if one is not ...}
    (tmp_path / "diagnosis.json").write_text(json.dumps(changed))
    with pytest.raises(ConfigError) as caught:
        read_answer(tmp_path)
    assert caught.value.rule == "not-a-diagnosis"


@pytest.mark.parametrize("data", [b"", b"[]", b"{", b"\xff\xfe", b"null", b"[" * 100_000])
def test_a_hostile_file_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.json").write_bytes(data)
    with pytest.raises(ConfigError):
        read_answer(tmp_path / "a.json")


def test_a_folder_without_an_answer_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ToolkitError):
        read_answer(tmp_path)
