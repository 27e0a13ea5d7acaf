"""A machine's corrections: by hand, on the virtual machine's truth, in the budget, in the next version."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import sha256_file
from toolkit.machine import Correction, load_machine
from toolkit.machine.definition import machine_file, machine_of_text, next_version
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.reduction.corrections import corrected, u_SA
from toolkit.simulation.plan import read_plan
from toolkit.simulation.run import simulate
from toolkit.simulation.write import write_test

EXAMPLES = Path(__file__).resolve().parents[2] / "toolkit" / "examples"
BLOCK = """
[[correction]]
effect = "steer_offset"
parameter = "offset"
value = 0.3
unit = "deg"
standard_uncertainty = 0.01
reason = "zero measured at rest"
by = "a tester"
date = "2026-04-01"
answer_sha256 = "aa"
case_sha256 = "bb"
code_version = "0"
"""


def correction(effect="steer_offset", value=0.3, unit="deg", u=0.01, **more):
    parameter = {"steer_offset": "offset", "steer_compliance": "compliance", "crosstalk": "coefficient"}
    told = {
        "effect": effect, "channel": None, "source": None, "parameter": parameter[effect], "value": value,
        "unit": unit, "u": u, "reason": "measured apart", "by": "a tester", "date": "2026-04-01",
        "answer_sha256": "a" * 64, "case_sha256": "b" * 64, "code_version": "0",
    }  # fmt: skip
    return Correction(**(told | more))


def leak(value=0.01, *, to="FY", source="FZ", unit="N/N", u=0.001):
    return correction("crosstalk", value, unit, u, channel=to, source=source)


def with_corrections(*corrections, machine="m15"):
    return dataclasses.replace(load_machine(machine), corrections=corrections)


def test_each_correction_by_hand():
    rows = {
        "SA": np.array([0.02]),
        "FZ": np.array([4000.0]),
        "FY": np.array([-900.0]),
        "MZ": np.array([30.0]),
    }
    # 0.3 deg of zero, 2e-5 rad/(N*m), 1 % of FZ in FY, 0.5 N*m for each kN of FY in MZ
    machine = with_corrections(
        correction(), correction("steer_compliance", 2e-5, "rad/(N*m)", 1e-6),
        leak(), leak(0.5e-3, to="MZ", source="FY", unit="N*m/N"),
    )  # fmt: skip
    made = corrected(machine, rows)
    assert made["FY"][0] == pytest.approx(-900 - 40)
    assert made["MZ"][0] == pytest.approx(30 + 0.45)  # of FY as shown
    assert made["SA"][0] == pytest.approx(0.02 - math.radians(0.3) - 2e-5 * 30.45)
    assert made["FZ"] is rows["FZ"]
    assert rows["FY"][0] == -900.0
    # 0.01 deg, and 1e-6 rad/(N*m) at the largest moment
    assert u_SA(machine, np.array([30.0, -80.0])) == pytest.approx(math.hypot(math.radians(0.01), 80e-6))


def test_what_has_no_correction_is_as_it_was():
    rows = {"SA": np.array([0.1]), "FZ": np.array([1.0]), "FY": np.array([2.0]), "MZ": np.array([3.0])}
    assert corrected(load_machine("m15"), rows) == rows
    assert load_machine("m15").version == 1


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """A virtual test of a carriage with a steering zero of 0.3 deg and a hundredth of FZ in FY."""
    plan = read_plan(EXAMPLES / "virtual" / "test_plan.toml")
    plan = dataclasses.replace(
        plan,
        slip_angles_rad=tuple(math.radians(angle) for angle in (-2, 0, 2)),
        loads_N=plan.loads_N[1:4:2],
        acquisition=dataclasses.replace(plan.acquisition, rows_per_revolution=40),
        carriage=dataclasses.replace(
            plan.carriage, steer_offset_rad=math.radians(0.3), steering_zero_rad=0.0
        ),
        cells=dataclasses.replace(plan.cells, crosstalk_FZ_FY=0.01),
    )
    made, folder = simulate(plan), tmp_path_factory.mktemp("faulty") / "test"
    write_test(made, folder)
    return made, folder


def reduced(folder, record, machine=None):
    toml = folder / "test.toml"
    text = toml.read_text()
    if machine is not None:
        toml.write_text(re.sub(r'machine = "[^"]*"', f'machine = "{machine}"', text))
    try:
        test = read_test_folder(folder)
        return process(test, read_test(test), record).reduced
    finally:
        toml.write_text(text)


def definition(folder, *corrections):
    path = folder.parent / f"corrected-{len(corrections)}.toml"
    base = machine_file("m15-virtual")
    for one in corrections:
        text, _ = next_version(str(base), one, out=path, diagnosed_with=None)
        path.write_text(text)
        base = path
    return path


def test_a_corrected_test_of_the_virtual_machine_is_its_truth(faulty, virtual_record):
    made, folder = faulty
    path = definition(folder, correction(), leak())
    found = {
        (one.rotation, round(math.degrees(one.step_SA)), one.step_FZ): one
        for one in reduced(folder, virtual_record, path).used()
    }
    plain = reduced(folder, virtual_record)
    truth = [block for file in made.files for block in file.truth]
    assert len(found) == len(truth) == len(plain.used())
    for block in truth:
        one = found[block.rotation, round(math.degrees(block.step_SA_rad)), block.step_FZ_N]
        sign = 1 if block.rotation == "forward" else -1
        # noise of one revolution and the printed digits
        assert math.degrees(one.SA - block.SA_rad) == pytest.approx(0, abs=0.01)
        assert sign * one.FY == pytest.approx(block.FY_N, abs=6.0)
    # without the corrections the same rows are off by what was put in
    off = np.median([math.degrees(one.SA) for one in plain.used()])
    assert off - np.median([math.degrees(one.SA) for one in found.values()]) == pytest.approx(0.3, abs=1e-9)


def test_every_result_names_its_corrections(faulty, virtual_record):
    folder = faulty[1]
    path = definition(folder, correction(), leak())
    notes = [one for one in reduced(folder, virtual_record, path).findings if one.rule == "machine-corrected"]
    assert [one.level for one in notes] == ["note", "note"]
    assert {one.where for one in notes} == {"m15-virtual, version 3"}
    assert "0.300 ± 0.010 deg" in notes[0].message
    assert "a" * 16 in notes[0].message
    assert "measured apart" in notes[0].message
    assert "crosstalk FZ to FY" in notes[1].message
    plain = reduced(folder, virtual_record)
    assert not [one for one in plain.findings if one.rule == "machine-corrected"]


def test_the_next_version_keeps_the_old_text_and_says_what_it_was_made_from(tmp_path):
    text, made = next_version("m15", correction(), out=tmp_path / "b.toml", diagnosed_with=None)
    old = machine_file("m15")
    assert (made.name, made.version, made.supersedes) == ("m15", 2, sha256_file(old))
    assert [line for line in old.read_text().splitlines() if line not in text.splitlines()] == []
    assert dataclasses.replace(made, version=1, supersedes=None, corrections=()) == load_machine("m15")
    (tmp_path / "b.toml").write_text(text)
    again, third = next_version(
        str(tmp_path / "b.toml"), leak(), out=tmp_path / "c.toml", diagnosed_with=None
    )
    assert third.version == 3
    assert third.supersedes == sha256_file(tmp_path / "b.toml")
    assert [one.effect for one in third.corrections] == ["steer_offset", "crosstalk"]
    assert again.count("supersedes =") == again.count("version =") - again.count("code_version =") == 1


def test_the_same_correction_twice_needs_an_answer_of_the_corrected_machine(tmp_path):
    path = tmp_path / "b.toml"
    path.write_text(next_version("m15", correction(), out=path, diagnosed_with=None)[0])
    more = correction(value=0.02, answer_sha256="c" * 64)
    with pytest.raises(ConfigError, match="has this correction already") as caught:
        next_version(
            str(path), more, out=tmp_path / "c.toml", diagnosed_with=sha256_file(machine_file("m15"))
        )
    assert caught.value.rule == "machine-correction"
    _, made = next_version(str(path), more, out=tmp_path / "c.toml", diagnosed_with=sha256_file(path))
    rows = {"SA": np.zeros(1), "FZ": np.zeros(1), "FY": np.zeros(1), "MZ": np.zeros(1)}
    assert math.degrees(corrected(made, rows)["SA"][0]) == pytest.approx(-0.32)


@pytest.mark.parametrize(
    "change",
    [
        ('effect = "steer_offset"', 'effect = "backlash"'),
        ('effect = "steer_offset"', 'effect = "crosstalk"'),
        ('parameter = "offset"', 'parameter = "ofset"'),
        ("value = 0.3", "value = nan"),
        ("value = 0.3", "value = true"),
        ("value = 0.3", "value = 1" + "0" * 400),
        ("value = 0.3", 'value = "0.3"'),
        ('unit = "deg"', 'unit = "N"'),
        ('unit = "deg"', 'unit = "furlong"'),
        ('unit = "deg"', ""),
        ("standard_uncertainty = 0.01", "standard_uncertainty = -1"),
        ("standard_uncertainty = 0.01", ""),
        ('reason = "zero measured at rest"', 'reason = " "'),
        ('by = "a tester"', ""),
        ('answer_sha256 = "aa"', ""),
        ('date = "2026-04-01"', "date = 2026-04-01"),
        ('code_version = "0"', 'code_version = "0"\nchannel = "FY"'),
        ('code_version = "0"', 'code_version = "0"\nequivalent_to = "plysteer"'),
        ('code_version = "0"', 'code_version = "0"\nsize = 3'),
        ("[[correction]]", "[correction]"),
    ],
)
def test_a_correction_that_cannot_be_is_refused_with_its_place(tmp_path, change):
    assert change[0] in BLOCK
    text = 'name = "m15-x"\nextends = "m15"\n' + BLOCK.replace(*change)
    path = tmp_path / "bad.toml"
    with pytest.raises(ToolkitError) as caught:
        machine_of_text(text.encode(), path)
    assert "correction" in str(caught.value.where)
    assert caught.value.next_step
