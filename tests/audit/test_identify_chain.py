"""From a virtual session to a record, a virtual test by that record, and its own columns identified."""

import datetime as dt
from dataclasses import replace
from pathlib import Path

import pytest

import toolkit
from toolkit.audit.context import context_of
from toolkit.audit.identify import identify_columns
from toolkit.audit.inspection import inspect_file
from toolkit.audit.model import columns_of
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError
from toolkit.recording.read import read_recording
from toolkit.simulation.plan import read_plan
from toolkit.simulation.program import program_from
from toolkit.simulation.run import simulate
from toolkit.simulation.session import simulate_session
from toolkit.simulation.write import write_session, write_test

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chain")
    session = write_session(simulate_session(read_plan(EXAMPLES / "session_plan.toml")), folder / "session")
    (folder / "calibrations").mkdir()
    registry = Registry(folder / "calibrations")
    record = calibrate(session[0], registry).record
    return folder, registry, record


def virtual(chain, name, **acquisition):
    folder, _, record = chain
    plan = read_plan(EXAMPLES / "test_plan.toml")
    plan = replace(
        plan,
        slip_angles_rad=plan.slip_angles_rad[:2],
        rotations=("forward",),
        acquisition=replace(plan.acquisition, **acquisition),
    )
    write_test(simulate(plan, program_from(record)), folder / name)
    path = folder / name / "FM_run_2.xlsx"
    return path, read_recording(path, plan.machine)


def test_the_accident_is_seen_in_the_virtual_files(chain):
    _, recording = virtual(chain, "wrong")
    found = identify_columns(columns_of(recording), (chain[2],), on=dt.date(2026, 3, 17), in_force=chain[2])
    assert (found.grade, found.record, found.variant) == (
        "sign_variant",
        chain[2].id,
        "E5 negative in FY, MZ",
    )
    assert found.issued is True
    # E5 carries a good part of the load, so the accident is hundreds of newtons.
    assert found.repair.FY_max_abs_N > 500


def test_without_the_accident_the_file_is_exact(chain):
    _, recording = virtual(chain, "right", negated=())
    found = identify_columns(columns_of(recording), (chain[2],), on=dt.date(2026, 3, 17), in_force=chain[2])
    assert (found.grade, found.issued) == ("exact", True)
    # The repair goes by the full coefficients, the program by the issued digits.
    assert found.repair.FY_max_abs_N < 0.1


def test_context_by_test_toml_then_by_the_file_then_the_default(chain, tmp_path):
    path, _ = virtual(chain, "context")
    found = context_of(path)
    assert (found.machine.name, found.machine_source, found.date) == (
        "m15-virtual",
        "test.toml",
        dt.date(2026, 3, 17),
    )
    lonely = tmp_path / "lonely"
    lonely.write_bytes(path.read_bytes())
    assert context_of(lonely).machine_source == "file"
    (tmp_path / "plain.csv").write_text("x", encoding="utf-8")
    assert context_of(tmp_path / "plain.csv").machine.name == "m15"
    assert context_of(tmp_path / "plain.csv", machine="m15-virtual").machine_source == "option"
    (tmp_path / "test.toml").write_text("date = 'soon'", encoding="utf-8")
    with pytest.raises(ConfigError, match="no date"):
        context_of(lonely)


def test_inspection_of_a_candidate_alone_corrects_nothing(chain):
    path, recording = virtual(chain, "inspected")
    found = inspect_file(path, chain[1])
    assert [block.last_row for block in found.blocks] == [100, 200, 300, 400, 500]
    assert found.slip_angle_rad == pytest.approx(recording["SA"].si.mean())
    assert found.identification.record == chain[2].id
    assert found.corrected_by is None  # nobody has approved the record
    assert [finding.rule for finding in found.findings] == ["identified-sign_variant", "not-corrected"]


def test_a_damaged_record_is_refused_as_a_candidate(chain, tmp_path):
    import shutil

    path, _ = virtual(chain, "damaged")
    shutil.copytree(chain[0] / "calibrations", tmp_path / "calibrations")
    broken = tmp_path / "calibrations" / "m15-virtual" / f"{chain[2].id}.json"
    broken.write_text(broken.read_text(encoding="utf-8").replace("1486", "1487", 1), encoding="utf-8")
    found = inspect_file(path, Registry(tmp_path / "calibrations"))
    assert found.identification.grade == "unknown"
    assert [one.id for one in found.choice.refused] == [chain[2].id]
    assert {finding.rule for finding in found.findings} == {
        "refused-record", "identified-unknown", "not-corrected",
    }  # fmt: skip
