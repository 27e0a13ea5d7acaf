"""Every rule that refuses a record, a session or a value has its demonstration, and each can fail."""

from __future__ import annotations

import ast
import functools
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import toolkit
from tests.qualification.demonstrated import demonstrated
from tests.recording.fig4_4 import ROWS, SYMBOLS
from toolkit.calibration.registry import gates, judgement
from toolkit.files import read_toml
from toolkit.qualification.gates import bench, check_gates, demonstrations, virtual_hub
from toolkit.qualification.gates.values import FIGURE
from toolkit.qualification.model import Check
from toolkit.qualification.numbers import FOLDER

ROOT = Path(toolkit.__file__).parent
SOURCES = [
    *sorted((ROOT / "calibration" / "registry").glob("*.py")),
    *sorted((ROOT / "reduction").glob("*.py")),
    ROOT / "lab" / "signatures" / "issuing.py",
]

# Refusals of a command that is misused: no gate between a wrong number and its reader.
NO_GATE = {
    "record-id": "a text that is no id",
    "not-writable": "a folder without write permission",
    "instrument-case": "a name that some file systems take for another's",
    "ledger-moved": "a decision while a document is issued: tests/lab/signatures/test_issuing.py",
    "not-signed": "a decision without a key where people are: tests/calibration/registry/test_signatures.py",
    "not-allowed": "people who may not decide: tests/calibration/registry/test_signatures.py",
    "people-log": "a forged log of people: tests/calibration/registry/test_signatures.py",
    "person": "an issue that names nobody who is enrolled: tests/cli/test_sign.py",
    "request": "a signing request: tests/trust/forgeries",
    "locked": "another writer, or the lock file of one that ended",
    "no-locks": "a file system that keeps no writers apart",
    "usage": "options that exclude each other: tests/cli/test_calibration_results_certificate.py",
    "unknown-machine": "a machine definition of another instrument is named",
    "session": "a file of polarity readings that has none",
    "unit-dimension": "a legacy file's units, refused when it is read",
}


@pytest.fixture(scope="module")
def checks(tmp_path_factory: pytest.TempPathFactory) -> list[Check]:
    return demonstrated(tmp_path_factory)[0]


@functools.cache
def rules_of_source() -> set[str]:
    """Return every rule that blocks in the source: of gates, of departures, of errors of the registry."""
    trees = {path: ast.parse(path.read_text()) for path in SOURCES}
    places = {
        node.name: [one.arg for one in node.args.args + node.args.kwonlyargs].index("rule")
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and "rule" in [a.arg for a in node.args.args + node.args.kwonlyargs]
    }
    found: set[str] = set()
    for path, tree in trees.items():
        names = {
            one.asname: one.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for one in node.names
            if one.asname
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                found |= set(_defaults(node))
            if not isinstance(node, ast.Call):
                continue
            called = getattr(node.func, "id", getattr(node.func, "attr", ""))
            called = names.get(called, called)
            by_name = {one.arg: one.value for one in node.keywords}
            told = _texts(by_name.get("effect")) == ["tells"]
            if called == "Finding" or told or (path.parent.name == "reduction" and called != "Departure"):
                continue
            at = places.get(called)
            value = by_name.get("rule", node.args[at] if at is not None and at < len(node.args) else None)
            found |= set(_texts(value))
    return found


def _defaults(node: ast.FunctionDef) -> Iterator[str]:
    both = [*zip(node.args.args[::-1], node.args.defaults[::-1], strict=False)]
    both += zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
    for argument, default in both:
        if argument.arg == "rule":
            yield from _texts(default)


def _texts(node: ast.expr | None) -> list[str]:
    if node is None:
        return []
    return [
        one.value for one in ast.walk(node) if isinstance(one, ast.Constant) and isinstance(one.value, str)
    ]


def test_the_scan_reads_every_way_of_naming_a_rule() -> None:
    # A keyword, a default, a positional argument under another name, and a departure of values.
    found = rules_of_source()
    assert {"sign", "not-in-force", "time", "hash", "golden", "impossible-cells"} <= found
    assert "layout-changed" not in found  # it only tells


def test_every_refusal_has_its_demonstration() -> None:
    shown = {rule for one in demonstrations(FOLDER) for rule in one.rules}
    lacking = rules_of_source() - shown - NO_GATE.keys()
    assert not lacking, f"no demonstration in toolkit/qualification/gates shows {sorted(lacking)}"


def test_no_exception_stays_that_the_source_has_not() -> None:
    assert NO_GATE.keys() <= rules_of_source()


# What they show


def test_every_demonstration_comes_out_as_it_must(checks: list[Check]) -> None:
    assert [one.name for one in checks if not one.passed] == []
    assert len({one.name for one in checks}) == len(checks) == len(demonstrations(FOLDER))
    assert {one.group for one in checks} == {"gates"}


def test_every_refusal_says_why_and_what_is_right_passes(checks: list[Check]) -> None:
    for one in checks:
        assert bool(one.note) is (one.required != "passes"), one.name
    assert {one.quantity for one in checks if one.required == "passes"} >= {
        "approval", "use in a test", "record read", "values of a test",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("candidate", "nobody has approved"),
        ("candidate that its gates refuse", "failed gate sign"),
        ("withdrawn record", "withdrawn on"),
        ("superseded record", "superseded by rig-r2"),
        ("expired record", "its recall interval of 2 months ended on 2020-05-02"),
        ("record of another machine", "a record of rig, the test is of m15-virtual"),
        ("discarded record as a draft", "discarded on"),
        ("session in the future", "session's date lies in the future"),
        ("decision before its session", "before the session"),
        ("ledger entry before the one before it", "before that of the entry before it"),
        ("scatter within a run halved, every hash computed anew", "scatter"),
        ("covariance divided by four, every hash computed anew", "covariance"),
        ("coefficient negated, every hash computed anew", "term D51"),
        ("Figure 4.4, its ten rows as stored", "10 of 10 values"),
        ("unknown key in [certificate]", "customer"),
    ],
)
def test_a_rule_with_many_reasons_is_shown_by_its_own(checks: list[Check], name: str, words: str) -> None:
    (check,) = [one for one in checks if one.name == name]
    assert words in check.note


# That they would fail


@pytest.fixture(scope="module")
def stock(tmp_path_factory: pytest.TempPathFactory) -> bench.Bench:
    return bench.Bench(tmp_path_factory.mktemp("stock")).fill()


def shown(stock: bench.Bench, folder: Path, name: str) -> Check:
    (found,) = [one for one in demonstrations(FOLDER) if one.name == name]
    return found.check(stock.copy(folder))


@pytest.mark.parametrize(
    ("module", "gate", "instead", "name"),
    [
        ("judgement", "compared", (), "E5 negated, against the history"),
        ("judgement", "unconfirmed", (), "first session of a rig without polarity readings"),
        ("judgement", "plausible", (), "indications in mV/V headed V/V"),
        ("judgement", "tare_claim", (), 'zero = "tared" with 0.7 mV/V left on D51'),
        ("judgement", "check_loads", (), "check loads 1 % off"),
        ("candidate", "check_begun", None, "session in the future"),
        ("store", "check_after", None, "ledger entry before the one before it"),
        ("standing", "_reasons", (), "candidate"),
        ("conformity", "check_reproduces", None, "coefficient negated, every hash computed anew"),
        ("conformity", "check_agrees", None, "date changed, every hash computed anew"),
    ],
)
def test_a_gate_that_is_switched_off_fails_its_row(
    stock: bench.Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, gate: str,
    instead: object, name: str,
) -> None:  # fmt: skip
    assert shown(stock, tmp_path / "on", name).passed
    monkeypatch.setattr(f"toolkit.calibration.registry.{module}.{gate}", lambda *_, **__: instead)
    check = shown(stock, tmp_path / "off", name)
    assert not check.passed
    assert check.reached != check.required


def test_a_refusal_that_writes_is_no_refusal(stock: bench.Bench, tmp_path: Path) -> None:
    def prepare(at: bench.Bench) -> bench.Act:
        def act() -> bench.Refusals:
            (at.registry.folder / "left.txt").write_text("x")
            return [("sign", "refused too late")]

        return act

    one = bench.Demonstration(name="late", stage="approval", rules=("sign",), prepare=prepare)
    assert one.check(stock.copy(tmp_path)).reached == "sign, written"


def test_an_error_of_the_software_is_a_failed_check(stock: bench.Bench, tmp_path: Path) -> None:
    def prepare(at: bench.Bench) -> bench.Act:
        raise ZeroDivisionError("division by zero")

    one = bench.Demonstration(name="broken", stage="approval", rules=("sign",), prepare=prepare)
    check = one.check(stock.copy(tmp_path))
    assert (check.passed, check.reached) == (False, "not shown")
    assert "ZeroDivisionError" in check.note


def test_without_a_record_in_force_there_is_a_failed_check(monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = gates.GateResult(rule="sign", where="x", message="always")
    judged = judgement.Judgement(results=(blocked,), evidence=())
    monkeypatch.setattr("toolkit.calibration.registry.approval.judge_stored", lambda *_, **__: judged)
    (check,) = check_gates(FOLDER)
    assert not check.passed
    assert "should have been approved" in check.note


# What they need


def test_they_are_offline_and_leave_nothing(tmp_path_factory: pytest.TempPathFactory) -> None:
    checks, alone = demonstrated(tmp_path_factory)
    assert all(one.passed for one in checks)  # none was ended by a connection
    assert [path.name for path in alone.rglob("*")] == ["tmp"]


def test_the_virtual_hub_is_that_of_the_drawing() -> None:
    from toolkit.machine import load_machine

    machine = load_machine(virtual_hub.HUB)
    per_FY, per_MZ, per_MX = virtual_hub.PER_INDICATION
    levers = dict(machine.layout.overturning_lever_m)
    assert (per_MX / per_FY).tolist() == pytest.approx([levers[name] for name in virtual_hub.CELLS])
    for load, row in (("FY", per_FY), ("MZ", per_MZ), ("MX", per_MX)):
        for name, value in zip(virtual_hub.CELLS, row, strict=True):
            sign = machine.cell(name).sign(load)  # type: ignore[union-attr]
            assert sign in (None, np.sign(value))


def test_two_writings_of_a_session_are_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        virtual_hub.Session(reading=1).write(tmp_path / name)
    first, second = (
        {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("a", "b")
    )
    assert first == second


def test_the_packaged_rows_are_those_of_the_figure() -> None:
    data = read_toml(FOLDER / FIGURE)["data"]
    for symbol, column in zip(SYMBOLS, np.array(ROWS).T.tolist(), strict=True):
        assert data[symbol] == column


@pytest.mark.parametrize("text", ["schema = ", "schema = 1\n[data]\nFZ = [1.0]\n"])
def test_rows_that_cannot_be_read_are_failed_checks(stock: bench.Bench, tmp_path: Path, text: str) -> None:
    (tmp_path / FIGURE).write_text(text)
    found = [one for one in demonstrations(tmp_path) if one.name.startswith("Figure 4.4")]
    results = [one.check(stock.copy(tmp_path / str(at))) for at, one in enumerate(found)]
    assert [one.passed for one in results] == [False, False]


def test_without_a_folder_for_them_there_is_a_failed_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    (check,) = check_gates(FOLDER)
    assert not check.passed
    assert "FileNotFoundError" in check.note
