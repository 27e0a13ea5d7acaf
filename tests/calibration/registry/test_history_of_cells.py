"""The history of a cell by its serial, and how many files a session of a long history reads."""

from __future__ import annotations

import datetime as dt
import json
from pathlib import Path

import pytest

from tests.calibration.control_factory import enter, put_in_force, write_session
from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.control.chart import control_chart
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry import registry as registry_module
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import Candidate
from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, Ledger, head_bytes, next_line
from toolkit.calibration.registry.registry import Registry

FIRST = dt.date(2024, 1, 5)


def cell(serial: str) -> str:
    return f'[cells.S]\nserial = "{serial}"\n'


def entered(
    registry: Registry, tmp_path: Path, year: int, serial: str | None, span: float = 1.0
) -> Candidate:
    tail = "" if serial is None else cell(serial)
    return enter(registry, tmp_path / f"s{year}", FIRST.replace(year=year), span=span, tail=tail)


def messages(made: Candidate, rule: str) -> list[str]:
    return [one.message for one in made.findings if one.rule == rule]


@pytest.fixture
def exchanged(tmp_path: Path) -> Registry:
    """Serial A in 2024, serial B, which is 10 % more sensitive, in 2025."""
    registry = Registry(tmp_path / "calibrations")
    put_in_force(registry, entered(registry, tmp_path, 2024, "A"))
    put_in_force(registry, entered(registry, tmp_path, 2025, "B", 1.1))
    return registry


def test_a_serial_that_returns_is_compared_with_its_own_record(exchanged: Registry, tmp_path: Path) -> None:
    made = entered(exchanged, tmp_path, 2026, "A")
    assert messages(made, "sign") == messages(made, "span") == []
    (told,) = messages(made, "serial")
    assert "serial A returns" in told
    assert "from cell-r1" in told
    put_in_force(exchanged, made)


def test_a_serial_that_returns_with_another_span_is_named_and_not_approved(
    exchanged: Registry, tmp_path: Path
) -> None:
    # As sensitive as B was: against B nothing would show.
    made = entered(exchanged, tmp_path, 2026, "A", 1.1)
    (told,) = messages(made, "span")
    assert "in cell-r1" in told
    decision = approve(
        exchanged, made.record.id, in_force_from=dt.date(2026, 2, 1), checked_by="B",
        known_on=dt.date(2026, 2, 1), reason="late",
    )  # fmt: skip
    assert not decision.done
    assert [one.rule for one in decision.failed] == ["span"]


def refusals(registry: Registry, made: Candidate, reason: str | None = None) -> set[str]:
    """Return the rules that keep a candidate from being approved today; none where it is approved."""
    day = dt.date(2026, 2, 1)
    return {
        one.rule
        for one in approve(registry, made.record.id, in_force_from=day, checked_by="B", reason=reason).failed
    }


def test_a_replacement_is_compared_and_needs_a_reason(exchanged: Registry, tmp_path: Path) -> None:
    made = entered(exchanged, tmp_path, 2026, "C", 1.3)
    (told,) = messages(made, "serial")
    assert "a replacement: serial B in cell-r2, now C" in told
    # 1.3 against 1.1 mV/V per N: the response in N/(mV/V) falls by 1 - 1.1/1.3.
    (told,) = messages(made, "span")
    assert "-15.38 %" in told
    assert refusals(exchanged, made) == {"replacement"}
    assert refusals(exchanged, made, "B broke on 5 January") == set()


def test_the_session_may_state_the_reason_itself(exchanged: Registry, tmp_path: Path) -> None:
    tail = cell("C") + 'replacement = "B broke"\n'
    made = enter(exchanged, tmp_path / "s", FIRST.replace(year=2026), span=1.3, tail=tail)
    assert refusals(exchanged, made) == set()
    (entry,) = [e for e in exchanged.ledger("cell").of(made.record.id) if e.event == "approved"]
    assert any("reason: B broke" in text for text in entry.evidence)


def test_ten_times_the_output_is_no_replacement(exchanged: Registry, tmp_path: Path) -> None:
    made = entered(exchanged, tmp_path, 2026, "C", 12.0)
    # And no bridge of foil gauges gives it.
    assert refusals(exchanged, made, "B broke") == {"span", "bridge-range"}


def test_a_serial_that_is_no_longer_stated_is_a_replacement(exchanged: Registry, tmp_path: Path) -> None:
    made = entered(exchanged, tmp_path, 2026, None, 1.3)
    (told,) = messages(made, "serial")
    assert "serial B in cell-r2, now not stated" in told
    assert refusals(exchanged, made) == {"replacement"}


def test_a_withdrawn_record_is_no_history(exchanged: Registry, tmp_path: Path) -> None:
    from toolkit.calibration.registry.approval import withdraw

    withdraw(exchanged, "cell-r1", on=dt.date(2025, 6, 1), reason="the standard was wrong", by="B")
    (told,) = messages(entered(exchanged, tmp_path, 2026, "A", 1.3), "serial")
    assert "a replacement" in told


def test_a_session_is_found_again_by_its_ledger_line_without_reading_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry = Registry(tmp_path / "calibrations")
    paths = [
        write_session(tmp_path / f"s{i}", FIRST + dt.timedelta(days=i), span=1 + 1e-4 * i) for i in range(6)
    ]
    for path in paths:
        calibrate(path, registry)
    entries = [json.loads(line) for line in (registry.folder / "cell" / LEDGER).read_text().splitlines()]
    records = [
        json.loads((registry.folder / "cell" / f"cell-r{i}.json").read_text())["content"] for i in range(1, 7)
    ]
    assert [one["inputs"] for one in entries] == [one["inputs_sha256"] for one in records]
    read: list[str] = []
    kept = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: (read.append(self.name), kept(self))[1])
    from toolkit.calibration.registry.candidate import recorded
    from toolkit.calibration.session.read import read_session

    session = read_session(paths[3])
    read.clear()
    found = recorded(
        registry.folder / "cell",
        registry.ledger("cell"),
        session.inputs_sha256,
        what="it",
        where=session.path,
    )
    assert found is not None
    assert found.id == "cell-r4"
    assert {name.split(".")[0] for name in read} <= {"cell-r4", "ledger", "head"}


def test_a_ledger_of_before_finds_its_sessions_too(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "calibrations")
    path = write_session(tmp_path / "s", FIRST)
    calibrate(path, registry)
    folder = registry.folder / "cell"
    (line,) = (folder / LEDGER).read_text().splitlines()
    body = {k: v for k, v in json.loads(line).items() if k not in ("inputs", "seq", "prev", "sha256")}
    old, digest = next_line(1, START, body)
    (folder / LEDGER).write_bytes(old)
    (folder / HEAD).write_bytes(head_bytes(1, digest))
    assert calibrate(path, registry).existing


def test_another_session_is_another_record(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "calibrations")
    one = write_session(tmp_path / "one", FIRST)
    two = write_session(tmp_path / "two", FIRST, span=1.01)
    calibrate(one, registry)
    assert not calibrate(two, registry).existing
    assert registry.load("cell-r2").inputs_sha256 != registry.load("cell-r1").inputs_sha256


def test_a_chart_reads_each_record_and_the_ledger_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry = Registry(tmp_path / "calibrations")
    for i in range(5):
        put_in_force(registry, enter(registry, tmp_path / f"s{i}", FIRST + dt.timedelta(days=30 * i)))
    started: list[str] = []
    load = registry_module.load_checked

    def counted(folder: Path, name: str, ledger: Ledger) -> CalibrationRecord:
        started.append(name)
        return load(folder, name, ledger)

    monkeypatch.setattr(registry_module, "load_checked", counted)
    ledgers: list[str] = []
    ledger = Registry.ledger
    monkeypatch.setattr(Registry, "ledger", lambda self, name: (ledgers.append(name), ledger(self, name))[1])
    chart = control_chart(registry, "cell")
    assert all(len(one.points) == 4 for one in chart.series)
    assert sorted(started) == [f"cell-r{i}" for i in range(1, 6)]
    assert ledgers == ["cell"]
