"""One file that does not belong to its test, among the 26 of the virtual machine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.findings import Finding
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import TestFolder, read_test_folder
from toolkit.recording.model import Recording

pytestmark = pytest.mark.usefixtures("reduced_alone")

Values = NDArray[np.float64]
Recorded = tuple[TestFolder, tuple[Recording, ...]]
RULES = ("stray-file", "stray-row", "repeated-readings")


def with_values(recording: Recording, changed: Mapping[str, Values]) -> Recording:
    return dataclasses.replace(
        recording,
        series=tuple(
            dataclasses.replace(channel, values=changed.get(channel.symbol, channel.values))
            for channel in recording.series
        ),
    )


def cells(recording: Recording, factor: float = 1.0) -> dict[str, Values]:
    return {c.symbol: factor * c.values for c in recording.series if c.role == "indication"}


@pytest.fixture(scope="module")
def recorded(virtual_test: Path) -> Recorded:
    """The files of the virtual test, read once; what is changed is a copy."""
    test = read_test_folder(virtual_test)
    return test, tuple(read_test(test))


def findings(
    recorded: Recorded, record: CalibrationRecord, change: Callable[[list[Recording]], None]
) -> list[Finding]:
    test, recordings = recorded[0], list(recorded[1])
    change(recordings)
    reduced = process(test, tuple(recordings), record).reduced
    return [finding for finding in reduced.findings if finding.rule in RULES]


def test_a_sound_test_has_no_stray(recorded: Recorded, virtual_record: CalibrationRecord) -> None:
    assert findings(recorded, virtual_record, lambda _: None) == []


OTHER = pytest.mark.campaign("further files: the first, one between and the last hold in every run")


@pytest.mark.parametrize(
    "index",
    [index if index in (0, 12, 24) else pytest.param(index, marks=OTHER) for index in range(0, 26, 3)],
)
def test_a_file_with_its_cells_turned_is_named(
    recorded: Recorded, virtual_record: CalibrationRecord, index: int
) -> None:
    names: list[str] = []

    def turn(recordings: list[Recording]) -> None:
        names.append(recordings[index].name)
        recordings[index] = with_values(recordings[index], cells(recordings[index], -1.0))

    found = findings(recorded, virtual_record, turn)
    assert {(one.rule, one.level, one.where) for one in found} == {("stray-file", "error", names[0])}


@pytest.mark.parametrize(
    ("one", "other"), [(3, 4), (0, 7), (10, 22)]
)  # neighbours, two others, one angle's two directions
def test_the_cells_of_two_files_exchanged(
    recorded: Recorded, virtual_record: CalibrationRecord, one: int, other: int
) -> None:
    names: set[str] = set()

    def exchange(recordings: list[Recording]) -> None:
        first, second = recordings[one], recordings[other]
        names.update((first.name, second.name))
        recordings[one] = with_values(first, cells(second))
        recordings[other] = with_values(second, cells(first))

    found = findings(recorded, virtual_record, exchange)
    assert {finding.where for finding in found if finding.rule == "stray-file"} == names


def test_readings_that_were_pasted_from_another_file(
    recorded: Recorded, virtual_record: CalibrationRecord
) -> None:
    names: list[str] = []

    def paste(recordings: list[Recording]) -> None:
        source, target = recordings[5], recordings[8]
        names.extend((source.name, target.name))
        recordings[8] = with_values(target, cells(source) | {"FZ": source["FZ"].values})

    found = findings(recorded, virtual_record, paste)
    repeated = [one for one in found if one.rule == "repeated-readings"]
    assert [(one.where, one.level) for one in repeated] == [(names[1], "error")]
    assert names[0] in repeated[0].message


def test_one_row_far_off_its_block(recorded: Recorded, virtual_record: CalibrationRecord) -> None:
    def glitch(recordings: list[Recording]) -> None:
        values = recordings[0]["D51"].values.copy()
        values[10] += 1000 * float(np.std(values[:20]))
        recordings[0] = with_values(recordings[0], {"D51": values})

    rows = [one for one in findings(recorded, virtual_record, glitch) if one.rule == "stray-row"]
    assert len(rows) == 1
    assert "row 11" in rows[0].message
