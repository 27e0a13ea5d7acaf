"""What an inspection shows of a file, and what it says where it shows nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.audit.archive_made import dated, recording, write
from toolkit.audit.inspection import inspect_file
from toolkit.calibration.registry.registry import Registry

CALIBRATIONS = Path(__file__).resolve().parents[2] / "calibrations"


@pytest.mark.parametrize(
    ("date", "registry", "why"),
    [
        ("2019-06-01", "empty", "no record of m15 is in force on the test's date, 2019-06-01, or today"),
        (None, "empty", "no record of m15 is in force today"),
        ("2190-01-01", "empty", "no record of m15 is in force today"),
        ("2019-06-01", "own", None),
    ],
)
def test_a_file_without_corrected_values_says_why(
    tmp_path: Path, date: str | None, registry: str, why: str | None
) -> None:
    test = tmp_path / "test"
    test.mkdir()
    if date is not None:
        dated(test, date)
    write(test / "a.xlsx", recording())
    calibrations = Registry(tmp_path / "none" if registry == "empty" else CALIBRATIONS)
    seen = inspect_file(test / "a.xlsx", calibrations)
    found = {one.rule: one.message for one in seen.findings}
    assert (seen.corrected_by is None) == (why is not None)
    assert ("not-corrected" in found) == (why is not None)
    assert (why or "") in found.get("not-corrected", "")
    assert ("test-toml" in found) == (date == "2190-01-01")
