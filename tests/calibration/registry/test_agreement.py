"""A record is held against the session or source that lies beside it, however well its hashes agree."""

from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.registry.test_candidate_legacy import GOOD, enter
from tests.calibration.registry.test_refit_mutations import forge
from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RecordError
from toolkit.files import sha256_bytes

PROJECT = Path(__file__).resolve().parents[3] / "calibrations"
LOAD = {"method": "wls", "tolerance": 1e6}


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("zero", {"zero": "tared"}), ("date", {"date": "2026-01-06"}), ("entered_by", {"entered_by": "Z"}),
        ("inputs_sha256", {"inputs_sha256": "0" * 64}),
    ],
)  # fmt: skip
def test_settings_of_a_forged_record(registry: Registry, name: str, change: dict[str, str]) -> None:
    refused(registry, dataclasses.replace(registry.load("hub-r1"), **change), name)


@pytest.mark.parametrize("name", sorted(LOAD))
def test_settings_of_a_load(registry: Registry, name: str) -> None:
    record = registry.load("hub-r1")
    one = dataclasses.replace(record.loads[0], **{name: LOAD[name]})
    refused(registry, dataclasses.replace(record, loads=(one, *record.loads[1:])), f"FY, {name}")


def test_serials_terms_and_lists(registry: Registry) -> None:
    record = registry.load("hub-r1")
    cell = dataclasses.replace(record.cells[0], serial="X")
    refused(registry, dataclasses.replace(record, cells=(cell, *record.cells[1:])), "serial")
    refused(registry, dataclasses.replace(record, loads=record.loads[::-1]), "loads")
    refused(registry, dataclasses.replace(record, data=record.data[:1] + record.data[2:]), "files")


@pytest.mark.parametrize(
    ("key", "value"),
    [("operator", "Z"), ("temperature", {"value": 99.0, "unit": "degC"}), ("model", "linear"), ("date", "x"),
     ("reference", {"due": "2030-01-01"}), ("tolerance", {"FY": {"value": 9.0, "unit": "lbf"}})],
)  # fmt: skip
def test_every_setting_is_the_sessions(registry: Registry, key: str, value: object) -> None:
    record = registry.load("hub-r1")
    settings = json.loads(record.settings)
    settings[key] = value
    refused(registry, dataclasses.replace(record, settings=canonical(settings)), f"settings, {key}")


def test_a_session_that_was_exchanged_with_all_hashes(registry: Registry) -> None:
    record = registry.load("hub-r1")
    path = registry.folder / "hub" / "hub-r1.session.toml"
    whole = path.read_text()
    for text, word in (
        (whole.replace('operator = "operator one"', 'operator = "Z"'), "entered_by"),
        (whole + 'model = "polynomial"\ndegree = 2\n', "terms"),
        (whole + "[[[", "its text"),
    ):
        path.write_text(text)
        files = tuple(
            dataclasses.replace(one, sha256=sha256_bytes(text.encode())) if one.role == "session" else one
            for one in record.data
        )
        refused(registry, dataclasses.replace(record, data=files), word)


@pytest.mark.parametrize(
    "change", [{"zero": "tared"}, {"date": "1999-01-02"}, {"entered_by": "Z"}, {"settings": '{"source":{}}'}]
)
def test_a_legacy_record_is_its_source_throughout(tmp_path: Path, change: dict[str, str]) -> None:
    registry = enter(tmp_path, GOOD)
    refused_legacy = dataclasses.replace(registry.load("old-r1"), **change)
    forge(registry, refused_legacy)
    with pytest.raises(RecordError) as caught:
        registry.load("old-r1")
    assert caught.value.rule == "data"
    assert next(iter(change)) in caught.value.what


@pytest.mark.parametrize("role", ["loads.csv", "check.csv", "session.toml"])
def test_the_reason_names_the_file_in_which_a_byte_was_changed(registry: Registry, role: str) -> None:
    path = registry.folder / "hub" / f"hub-r1.{role}"
    whole = path.read_bytes()
    for at in (0, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        (row,) = verify_registry(registry)
        assert not row.ok
        assert row.reason is not None
        assert row.reason.startswith("data:")
        assert path.name in row.reason


def test_sessions_of_every_form_agree_with_themselves(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    forms = [
        {"check": "-"},
        {"check": "-", "tail": '[check]\ntolerance = { FY = { value = 3, unit = "N" } }\n'},
        {"zero": '"tared"', "tail": '[cells.E5]\nserial = 7\n[reference]\ndue = 2027-01-01\n'},
        {"tail": '[[zero]]\nwhen = "before"\nvalues = { D51 = 0.0 }\n'},
        {"drop": '["intercept"]'}, {"model": '"polynomial"', "degree": "2", "phase": '"as_found"'},
    ]  # fmt: skip
    for at, form in enumerate(forms):
        made = calibrate(make_session(name=f"form{at}", **form), registry)
        assert registry.load(made.record.id) == made.record


def test_loading_stays_light() -> None:
    code = (
        "import sys; from pathlib import Path; from toolkit.calibration.registry.registry import Registry; "
        "Registry(Path(sys.argv[1])).load('m15-virtual-r1'); "
        "print([n for n in ('scipy', 'statsmodels', 'pandas') if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(PROJECT)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_the_virtual_machines_record_with_another_zero(tmp_path: Path) -> None:
    # Tared to included: the intercept would cancel, and every load be off by it.
    shutil.copytree(PROJECT / "m15-virtual", tmp_path / "m15-virtual")
    registry = Registry(tmp_path)
    refused(registry, dataclasses.replace(registry.load("m15-virtual-r1"), zero="included"), "zero")


def refused(registry: Registry, record: object, word: str) -> None:
    forge(registry, record)  # type: ignore[arg-type]
    with pytest.raises(RecordError) as caught:
        registry.load(record.id)  # type: ignore[attr-defined]
    assert (caught.value.rule, word in caught.value.what) == ("data", True), str(caught.value)
    assert all(caught.value.as_dict().values())
