"""A tare under load is none, and one of few rows is as sure as the rows of the recordings say."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.errors import RecordingError
from toolkit.machine import load_machine
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import TestFolder, read_test_folder
from toolkit.recording.model import Recording
from toolkit.recording.read import read_recording
from toolkit.reduction.corrections import ENOUGH_ROWS, tare_of_file
from toolkit.reduction.model import ReducedTest, Tare

pytestmark = pytest.mark.usefixtures("reduced_alone")

MACHINE = load_machine("m15-virtual")
Recorded = tuple[TestFolder, tuple[Recording, ...]]


def test_a_tare_that_was_recorded_under_load_is_refused(virtual_test: Path) -> None:
    recording = read_recording(read_test_folder(virtual_test).files[0], MACHINE)
    with pytest.raises(RecordingError) as refused:
        tare_of_file(recording, MACHINE)
    assert refused.value.rule == "tare-under-load"
    assert "FZ is" in str(refused.value.got)


@pytest.fixture(scope="module")
def recorded(virtual_test: Path) -> Recorded:
    """The files of the virtual test, read once."""
    folder = read_test_folder(virtual_test)
    return folder, tuple(read_test(folder))


def reduced_with(
    recorded: Recorded, record: CalibrationRecord, monkeypatch: pytest.MonkeyPatch, tare: Tare
) -> ReducedTest:
    monkeypatch.setattr("toolkit.pipeline.declared_tare", lambda *_: tare)
    return process(*recorded, record).reduced


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_a_tare_of_few_rows_is_as_sure_as_rows_of_the_recordings(
    recorded: Recorded, virtual_record: CalibrationRecord, monkeypatch: pytest.MonkeyPatch, rows: int
) -> None:
    cells = virtual_record.indications
    bare = Tare(source="file t", values=tuple((c, 0.01) for c in cells), unit="mV/V", rows=rows)
    reduced = reduced_with(recorded, virtual_record, monkeypatch, bare)
    assert [(f.rule, f.level) for f in reduced.findings if f.rule == "tare-rows"] == [("tare-rows", "note")]
    # A mean of n rows scatters by no less than white noise of the same rows, and by no more than one row.
    scatter = {cell: np.median([np.std(r[cell].values[:20], ddof=1) for r in recorded[1]]) for cell in cells}
    for cell, u in reduced.tare.u:
        assert 0.2 * scatter[cell] / np.sqrt(max(rows, 1)) < u < 3 * scatter[cell]
    assert all(c.u_FY_zero > 0 for c in reduced.conditions)


def test_enough_rows_speak_for_themselves(
    recorded: Recorded, virtual_record: CalibrationRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tuple((cell, 1e-5) for cell in virtual_record.indications)
    tare = Tare(source="file t", values=own, unit="mV/V", u=own, rows=ENOUGH_ROWS)
    reduced = reduced_with(recorded, virtual_record, monkeypatch, tare)
    assert reduced.tare == dataclasses.replace(tare)
    assert "tare-rows" not in {finding.rule for finding in reduced.findings}
