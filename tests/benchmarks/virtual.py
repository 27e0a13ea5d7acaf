"""The packaged virtual test as files, made once."""

from __future__ import annotations

from pathlib import Path

from toolkit.lab.home import packaged_home


def virtual_test(folder: Path) -> Path:
    """Return the folder of the packaged virtual test, simulated there on the first call."""
    from toolkit import examples
    from toolkit.calibration.registry.registry import Registry
    from toolkit.simulation.plan import read_plan
    from toolkit.simulation.program import program_from
    from toolkit.simulation.run import simulate
    from toolkit.simulation.write import write_test

    test = folder / "virtual-test"
    if not test.exists():
        plan = read_plan(Path(examples.__file__).parent / "virtual" / "test_plan.toml")
        record = Registry(packaged_home() / "calibrations").load("m15-virtual-r1")
        write_test(simulate(plan, program_from(record)), test)
    return test
