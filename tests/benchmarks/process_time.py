"""26 files to a characterised test; the peer reads the same files with python-calamine."""

from __future__ import annotations

from pathlib import Path

from tests.benchmarks.timing import pairs, row


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time the pipeline on the packaged virtual test, imports excluded."""
    import python_calamine

    from tests.benchmarks.virtual import virtual_test
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.home import packaged_home
    from toolkit.pipeline import process, read_test
    from toolkit.recording.folder import read_test_folder

    test = virtual_test(folder)
    record = Registry(packaged_home() / "calibrations").load("m15-virtual-r1")

    def ours() -> object:
        told = read_test_folder(test)
        return process(told, read_test(told), record)

    def peer() -> object:
        files = sorted(test.glob("*.xlsx"))
        return [python_calamine.load_workbook(path).get_sheet_by_index(0).to_python() for path in files]

    times = pairs(ours, peer, 3 * count)
    return [row("26 files to characteristics", times[0], "python-calamine reads them", times[1], "3")]
