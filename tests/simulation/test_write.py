"""What the virtual machine writes is what a laboratory can read again without anything else."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from toolkit.machine.definition import load_machine
from toolkit.recording.folder import read_test_folder
from toolkit.simulation.plan import Plan
from toolkit.simulation.run import simulate
from toolkit.simulation.write import write_test


def test_a_machine_that_is_not_packaged_goes_with_its_test(tmp_path: Path, virtual_plan: Plan) -> None:
    machine = dataclasses.replace(virtual_plan.machine, name="belt-1")
    plan = dataclasses.replace(
        virtual_plan, machine=machine, slip_angles_rad=virtual_plan.slip_angles_rad[:2]
    )
    write_test(simulate(plan), tmp_path / "test")
    assert load_machine(str(tmp_path / "test" / "machine.toml")) == machine
    read = read_test_folder(tmp_path / "test")
    assert load_machine(read.info.machine) == machine
    assert not any(path.name == "machine.toml" for path in read.files)


def test_a_packaged_machine_is_named(virtual_test: Path) -> None:
    assert not (virtual_test / "machine.toml").exists()
    assert read_test_folder(virtual_test).info.machine == "m15-virtual"


def test_a_plan_with_loads_of_its_own_takes_its_protocol_with_it(tmp_path: Path, virtual_plan: Plan) -> None:
    loads = (700 * 4.4482216152605, 1000 * 4.4482216152605)
    plan = dataclasses.replace(virtual_plan, loads_N=loads, slip_angles_rad=virtual_plan.slip_angles_rad[:3])
    paths = write_test(simulate(plan), tmp_path / "test")
    assert "protocol.toml" in {path.name for path in paths}
    protocol = read_test_folder(tmp_path / "test").protocol
    assert protocol is not None
    assert protocol.loads_N == pytest.approx(loads)
    assert protocol.slip_angles_rad == pytest.approx(plan.slip_angles_rad)
    assert plan.title in protocol.source


def test_a_plan_with_the_protocol_of_its_machine_needs_none(virtual_test: Path) -> None:
    assert not (virtual_test / "protocol.toml").exists()
