"""A turned cell by command: every route that makes a number says that the values are impossible."""

from __future__ import annotations

import inspect
import json
from pathlib import Path

import pytest

from tests.campaigns import physics_gate as campaign
from toolkit import pipeline
from toolkit.cli.main import run
from toolkit.lab.home import packaged_home
from toolkit.reduction.physics import RULES
from toolkit.simulation.plan import with_effects
from toolkit.simulation.run import simulate
from toolkit.simulation.write import write_test


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole virtual test in which E5 was turned after the calibration, its tare too."""
    folder = tmp_path_factory.mktemp("turned") / "test"
    write_test(simulate(with_effects(campaign.base_plan(rows=4), ["channel_sign.E5"])), folder)
    return folder


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sound") / "test"
    write_test(simulate(campaign.base_plan(rows=4)), folder)
    return folder


def answer(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, dict[str, object]]:
    home = ("--home", str(packaged_home()))
    with pytest.raises(SystemExit) as ended:
        run([*map(str, words), *home, "--json"])
    return int(ended.value.code or 0), json.loads(capsys.readouterr().out)


def errors(document: dict[str, object]) -> set[str]:
    listed: list[dict[str, str]] = document["findings"]  # type: ignore[assignment]
    return {one["rule"] for one in listed if one["level"] == "error"}


def test_process_tells_it_first_and_a_reduced_test_keeps_it(
    turned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reduced = tmp_path / "test.xlsx"
    code, document = answer(capsys, "process", turned, "--out", reduced)
    assert code == 1
    assert document["findings"][0]["rule"] == "impossible-force"  # type: ignore[index]
    assert document["findings"][0]["message"].endswith("all is possible with E5 turned round")  # type: ignore[index]
    assert errors(document) == {"impossible-force", "impossible-slope", "impossible-cells"}
    assert {one["rule"] for one in document["impossible"]} == errors(document)  # type: ignore[attr-defined, index]
    code, again = answer(capsys, "process", reduced)
    assert (code, again["impossible"]) == (1, document["impossible"])


def test_a_sound_test_has_nothing_impossible(sound: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, document = answer(capsys, "process", sound)
    assert document["impossible"] == []


def test_a_reduced_test_of_before_the_gate_is_held_against_it(
    turned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as before:
        before.setattr("toolkit.reduction.reduce.physics_findings", lambda *_, **__: [])
        # Not what was remembered of the test with its gate.
        before.setattr(pipeline, "process", inspect.unwrap(pipeline.process))
        _, document = answer(capsys, "process", turned, "--out", tmp_path / "old.xlsx")
    assert document["impossible"] == []
    code, document = answer(capsys, "process", tmp_path / "old.xlsx")
    # Without the machine and the record, the cells' pattern is left to the reduction.
    assert code == 1
    assert {one["rule"] for one in document["impossible"]} == {"impossible-force", "impossible-slope"}  # type: ignore[attr-defined, index]


def test_compare_and_fit_tell_it(turned: Path, sound: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("compare", turned, sound), ("fit", turned)):
        code, document = answer(capsys, *words)
        assert code == 1
        assert "impossible-force" in errors(document)


def test_audit_names_the_files_though_their_calibration_was_in_force(
    turned: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, document = answer(capsys, "audit", turned)
    assert code == 1
    files = {one["where"] for one in document["findings"] if one["rule"] in RULES}  # type: ignore[attr-defined]
    # Near zero slip the side force stays within what a pull could be.
    assert len(files) >= 20


def test_the_report_says_it_on_its_first_page(turned: Path) -> None:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.pipeline import process, read_test
    from toolkit.recording.folder import read_test_folder
    from toolkit.report.test.content import build_content

    folder = read_test_folder(turned)
    record = Registry(packaged_home() / "calibrations").load("m15-virtual-r1")
    content = build_content(process(folder, read_test(folder), record), record)
    marks = dict(content.marks)
    assert "they must not be used" in marks["impossible"]
    assert content.conditions["impossible"]


def test_a_table_in_other_units_is_told_by_its_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    # Loads in pounds under a header of newtons: 0.9 of the load becomes 4.
    for load in (250, 567, 833):
        lines += [
            f"{a},{load},{-0.9 * 4.448 * load * a / (2 + abs(a))},{load * a / 90}" for a in range(-10, 11)
        ]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    with pytest.raises(SystemExit) as ended:
        run(["fit", str(tmp_path / "t.csv"), "--json"])
    document = json.loads(capsys.readouterr().out)
    assert ended.value.code == 1
    found = [one for one in document["findings"] if one["rule"] == "impossible-force"]
    assert [one["level"] for one in found] == ["warning"]
    assert found[0]["message"].endswith("is a column in another unit than its header says?")
