"""`toolkit qualify`: exit codes, the record as text, as JSON and as a file."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest

from toolkit import __version__
from toolkit.cli.main import run
from toolkit.lab.home import packaged_home
from toolkit.qualification import numbers
from toolkit.qualification import run as qualification
from toolkit.qualification.run import QualificationRecord


def qualify(*arguments: str) -> int:
    with pytest.raises(SystemExit) as caught:
        run(["qualify", *arguments])
    assert isinstance(caught.value.code, int)
    return caught.value.code


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> dict[str, QualificationRecord]:
    """What qualifying finds, and what it finds where one digit of one packaged number is changed."""
    copy = Path(shutil.copytree(numbers.FOLDER, tmp_path_factory.mktemp("spoiled") / "data"))
    path = copy / "pontius.toml"
    path.write_text(path.read_text().replace("2.16844", "2.16845", 1))
    asked = {"calibrations": packaged_home() / "calibrations", "on": datetime.now(tz=UTC).date()}
    whole = qualification.qualify(**asked)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numbers, "FOLDER", copy)
        return {"whole": whole, "spoiled": qualification.qualify(**asked)}


@pytest.fixture
def spoiled(records: dict[str, QualificationRecord], monkeypatch: pytest.MonkeyPatch) -> None:
    """Qualifying finds a changed digit."""
    monkeypatch.setattr(qualification, "qualify", lambda **_: records["spoiled"])


@pytest.fixture
def known(records: dict[str, QualificationRecord], monkeypatch: pytest.MonkeyPatch) -> None:
    """Qualifying was done already: the command is asked what it makes of it."""
    monkeypatch.setattr(qualification, "qualify", lambda **_: records["whole"])


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


def test_the_record_as_json_is_also_the_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "new" / "record.json"
    assert qualify("--json", "--out", str(out)) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == 1
    assert found["passed"] is True
    assert found["software"] == __version__
    assert found["packages"].keys() == {"numpy", "scipy", "statsmodels", "odrpack"}
    assert found["checks"][0].keys() >= {"group", "name", "quantity", "required", "reached", "passed"}
    rows = {one["name"]: one for one in found["checks"] if one["group"] == "gates"}
    sign = rows["E5 negated, against the history"]
    assert (sign["quantity"], sign["required"], sign["reached"]) == ("approval", "sign", "sign")
    assert "the sign changed" in sign["note"]
    assert json.loads(out.read_text()) == found
    assert [path.name for path in out.parent.iterdir()] == ["record.json"]


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
