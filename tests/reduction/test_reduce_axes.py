"""The axis system of a machine turns signs on the way to SAE and changes nothing else of a test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.reduction.belt_factory import processed, truth, write_belt
from tests.reduction.hub_factory import record
from toolkit.channels import Axes
from toolkit.errors import RecordingError
from toolkit.pipeline import TestResult, read_test
from toolkit.recording.folder import read_test_folder

LOPSIDED = (0.5, 1.0, -1.0, 3.0, 6.0, 9.0)  # in SAE: none of 3, 6 and 9 has a step on the other side


def angles_of(result: TestResult) -> list[tuple[float, float | None]]:
    """Return the slip angle and the step of each condition in degrees, in the order of the protocol."""
    return [
        (round(np.degrees(c.SA), 6) + 0.0, None if c.step_SA is None else round(np.degrees(c.step_SA), 6))
        for c in result.reduced.conditions
    ]


@pytest.mark.parametrize("angles", [(0.0, 1.0, -1.0, 3.0, -3.0, 6.0, -6.0), LOPSIDED])
@pytest.mark.parametrize("axes", ["SAE", "ISO-W", "adapted-SAE"])
def test_a_step_has_the_sign_of_the_angle_that_was_set_for_it(
    axes: Axes, angles: tuple[float, ...], tmp_path: Path
) -> None:
    result = processed(write_belt(tmp_path, axes=axes, angles=angles), record(1e-4))
    assert angles_of(result) == [(angle, angle) for angle in angles for _ in range(2)]
    for condition in result.reduced.conditions:
        assert str(condition.step_SA) != "-0.0"
        expected = truth(round(np.degrees(condition.SA), 6), condition.FZ)
        assert condition.FY == pytest.approx(expected["FY"], abs=0.2)
        assert condition.MZ == pytest.approx(expected["MZ"], abs=0.2)
    departures = {"slip-angle-tolerance", "missing", "doubled"}
    assert not [finding for finding in result.findings if finding.rule in departures]


@pytest.mark.parametrize("axes", ["SAE", "ISO-W", "adapted-SAE"])
def test_a_machine_in_any_axes_has_its_secants(axes: Axes, tmp_path: Path) -> None:
    angles = (0.0, 1.0, -1.0, 2.0, -2.0, 4.0, -4.0, 8.0, -8.0)
    result = processed(write_belt(tmp_path, axes=axes, angles=angles), record(1e-4))
    rows = [row for row in result.characteristics.of("secant_cornering") if row.rotation == "forward"]
    assert len(rows) == 2
    for row in rows:
        secant = (truth(-1.0, row.load_N)["FY"] - truth(1.0, row.load_N)["FY"]) / np.radians(2.0)
        assert row.estimate is not None
        assert row.estimate.value == pytest.approx(secant, abs=0.2 / np.radians(2.0))


@pytest.mark.parametrize("axes", ["SAE", "ISO-W", "adapted-SAE"])
def test_a_departure_from_the_protocol_names_the_angles_that_the_machine_shows(
    axes: Axes, tmp_path: Path
) -> None:
    test = write_belt(tmp_path, axes=axes, angles=LOPSIDED)
    turn = 1 if axes == "SAE" else -1
    (test / "run_5.csv").unlink()  # 9 deg in SAE
    last = test / "run_4.csv"  # 6 deg in SAE, and 6.4 deg now
    last.write_text(last.read_text().replace(f",{turn * 6.0:.4f},", f",{turn * 6.4:.4f},"))
    findings = [
        (finding.where, finding.message.split(":")[0].split(" (")[0])
        for finding in processed(test, record(1e-4)).findings
        if finding.rule in ("slip-angle-tolerance", "missing")
    ]
    assert findings == [
        ("drum forward", f"no file at slip angle {turn * 9} deg"),
        ("run_4.csv", f"slip angle {turn * 6.4:g} deg is out of tolerance of the step {turn * 6} deg"),
    ]


def test_a_vertical_force_that_is_negative_in_SAE_J670_is_the_load(tmp_path: Path) -> None:
    plain = processed(write_belt(tmp_path / "load"), record(1e-4)).reduced
    along_z = processed(write_belt(tmp_path / "force", upward=-1), record(1e-4)).reduced
    assert [c.FZ for c in along_z.conditions] == [c.FZ for c in plain.conditions]
    assert along_z.conditions[0].FZ > 0
    assert [finding.rule for finding in along_z.findings] == [finding.rule for finding in plain.findings]
    recording = read_test(read_test_folder(tmp_path / "force" / "test"))[0]
    assert recording["FZ"].values.max() < 0  # as the file has it
    assert recording["FZ"].si_of(slice(3)).tolist() == recording["FZ"].si[:3].tolist() == [2000.0] * 3


@pytest.mark.parametrize("axes", ["ISO-W", "adapted-SAE"])
def test_elsewhere_a_negative_load_is_a_wrong_channel_and_the_axes_are_named(
    tmp_path: Path, axes: Axes
) -> None:
    with pytest.raises(RecordingError, match="negative") as caught:
        processed(write_belt(tmp_path, axes=axes, upward=-1), record(1e-4))
    assert caught.value.rule == "no-load-block"
    assert "axes = 'SAE'" in str(caught.value.next_step)
