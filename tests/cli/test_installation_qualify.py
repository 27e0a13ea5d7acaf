"""`toolkit qualify`: exit codes, the record as text, as JSON and as a file."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.qualification.demonstrated import as_demonstrated, demonstrated
from toolkit import __version__
from toolkit.cli.main import run
from toolkit.qualification import numbers
from toolkit.qualification import run as qualification
from toolkit.qualification.run import QualificationRecord


def qualify(*arguments: str) -> int:
    with pytest.raises(SystemExit) as caught:
        run(["qualify", *arguments])
    assert isinstance(caught.value.code, int)
    return caught.value.code


@dataclass(frozen=True, kw_only=True)
class Qualified:
    """What the command finds, prints and writes, and what it finds where a packaged number is changed."""

    whole: QualificationRecord
    spoiled: QualificationRecord
    printed: str
    out: Path


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Qualified:
    """The command run once, as JSON and into a file; and once with one digit of a packaged number changed."""
    copy = Path(shutil.copytree(numbers.FOLDER, tmp_path_factory.mktemp("spoiled") / "data"))
    path = copy / "pontius.toml"
    path.write_text(path.read_text().replace("2.16844", "2.16845", 1))
    out = tmp_path_factory.mktemp("qualified") / "new" / "record.json"
    qualified, asked_for, printed = qualification.qualify, {}, io.StringIO()
    answered: list[QualificationRecord] = []

    def noted(**asked: Any) -> QualificationRecord:
        asked_for.update(asked)
        answered.append(qualified(**asked))
        return answered[0]

    gates, _ = demonstrated(tmp_path_factory)
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        as_demonstrated(gates, patch)
        patch.setattr(qualification, "qualify", noted)
        assert qualify("--json", "--out", str(out)) == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numbers, "FOLDER", copy)
        # The gates ask nothing of that number: they stand as they were found above.
        patch.setattr(qualification, "check_gates", lambda _folder: gates)
        spoiled = qualified(**asked_for)
    return Qualified(whole=answered[0], spoiled=spoiled, printed=printed.getvalue(), out=out)


@pytest.fixture
def spoiled(records: Qualified, monkeypatch: pytest.MonkeyPatch) -> None:
    """Qualifying finds a changed digit."""
    monkeypatch.setattr(qualification, "qualify", lambda **_: records.spoiled)


@pytest.fixture
def known(records: Qualified, monkeypatch: pytest.MonkeyPatch) -> None:
    """Qualifying was done already: the command is asked what it makes of it."""
    monkeypatch.setattr(qualification, "qualify", lambda **_: records.whole)


@pytest.mark.usefixtures("known")
def test_the_record_as_text(capsys: pytest.CaptureFixture[str]) -> None:
    assert qualify() == 0
    text = capsys.readouterr().out
    for part in (
        f"toolkit {__version__}",
        "numpy ",
        "scipy ",
        "statsmodels ",
        "7.11",
        "not covered:",
        "Pontius",
    ):
        assert part in text
    assert text.rstrip().endswith("all passed")
    (row,) = [line for line in text.splitlines() if "E5 negated, against the history" in line]
    assert row.split()[-3:] == ["approval", "sign", "sign"]
    assert "asked for less" not in text


def test_the_record_as_json_is_also_the_file(records: Qualified) -> None:
    found = json.loads(records.printed)
    assert found["schema"] == 1
    assert found["passed"] is True
    assert found["software"] == __version__
    assert found["packages"].keys() == {"numpy", "scipy", "statsmodels", "odrpack"}
    assert found["checks"][0].keys() >= {"group", "name", "quantity", "required", "reached", "passed"}
    rows = {one["name"]: one for one in found["checks"] if one["group"] == "gates"}
    sign = rows["E5 negated, against the history"]
    assert (sign["quantity"], sign["required"], sign["reached"]) == ("approval", "sign", "sign")
    assert "the sign changed" in sign["note"]
    assert json.loads(records.out.read_text()) == found
    assert [path.name for path in records.out.parent.iterdir()] == ["record.json"]


@pytest.mark.usefixtures("spoiled")
def test_a_corrupted_number_ends_with_1_and_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "record.txt"
    assert qualify("--out", str(out)) == 1
    text = capsys.readouterr().out
    assert "FAIL" in text
    assert "pontius.toml is changed" in text
    assert "NIST StRD linear, Pontius, coefficients" in text
    assert "FAILED" in out.read_text()


@pytest.mark.usefixtures("spoiled")
def test_quiet_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert qualify("--quiet") == 1
    assert capsys.readouterr().out == ""


@pytest.mark.usefixtures("known")
def test_a_record_that_cannot_be_written_is_an_error(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    assert qualify("--quiet", "--out", str(tmp_path / "file" / "record.txt")) == 2
    assert "cannot be written" in capsys.readouterr().err
