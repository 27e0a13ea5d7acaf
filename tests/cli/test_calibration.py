"""`toolkit calibrate` and `toolkit calibration ...` through the command line: JSON keys and exit codes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from tests import commands
from toolkit.calibration.registry.clock import today
from toolkit.cli import calibrate, calibration

Run = Callable[..., tuple[int, dict[str, Any]]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    (tmp_path / "cal").mkdir()
    return lambda *words: commands.answer(*words, "--calibrations", tmp_path / "cal")


@pytest.fixture
def session(tmp_path: Path) -> Path:
    rng = np.random.default_rng(3)
    for name, rows, tail in (("loads", 40, True), ("check", 6, False)):
        s = rng.uniform(-2, 2, (rows, 2))
        loads = s @ np.array([[100.0, 3.0], [20.0, -50.0]]) + [1.5, -2.0] + rng.normal(0, 0.01, (rows, 2))
        lines = ["A [mV/V],B [mV/V],FY [N],MZ [N*m]" + (",run,direction" if tail else "")]
        for i, row in enumerate(np.column_stack([s, loads]).tolist()):
            lines.append(",".join(map(repr, row)) + (f",{1 + i // 20},down" if tail else ""))
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    path = tmp_path / "SESSION.toml"
    path.write_text(
        'schema = 1\ninstrument = "pair"\ndate = 2026-02-01\noperator = "A"\nindications = ["A", "B"]\n'
        'loads = ["FY", "MZ"]\ndata = "loads.csv"\ncheck = "check.csv"\n'
        # Apart from the rows, read to half a percent: FY = 100 A + 20 B + 1.5, MZ = 3 A - 50 B - 2.
        'polarity = [{ load = "FY", value = { value = 151, unit = "N" }, indications = { '
        'A = { value = 1.3, unit = "mV/V" }, B = { value = 1.0, unit = "mV/V" } } }, '
        '{ load = "MZ", value = { value = -48, unit = "N*m" }, indications = { '
        'A = { value = 1.3, unit = "mV/V" }, B = { value = 1.0, unit = "mV/V" } } }]\n'
    )
    return path


def test_a_misspelt_instrument_is_not_one_without_records(run: Run, session: Path) -> None:
    assert run("calibrate", session)[0] == 0
    code, answer = run("calibration", "list", "pari")
    assert (code, answer["error"]["rule"], answer["error"]["expected"]) == (2, "missing", "pair")
    assert "did you mean 'pair'" in answer["error"]["next_step"]


def test_calibrate_answers_as_the_contract_says(run: Run, session: Path, tmp_path: Path) -> None:
    code, answer = run("calibrate", session)
    # The random check loads of this session reach beyond its random loads, which is a note.
    assert {(f["rule"], f["level"]) for f in answer["findings"]} == {("check-beyond-range", "note")}
    assert (code, answer["schema"]) == (0, 1)
    record = answer["record"]
    assert {"id", "sha256", "status", "existing", "path"} <= set(record)
    assert (record["id"], record["status"], record["existing"]) == ("pair-r1", "candidate", False)
    load = answer["loads"]["FY"]
    assert load["unit"] == "N"
    assert load["indication_units"] == {"A": "mV/V", "B": "mV/V"}
    assert load["coefficients"]["A"] == pytest.approx(100, abs=0.01)
    assert {
        "standard_errors",
        "residual_sd",
        "dof",
        "condition_number",
        "llf",
        "check_max_percent_fs",
    } <= set(load)
    again, same = run("calibrate", session)
    assert (again, same["record"]["existing"], same["record"]["sha256"]) == (0, True, record["sha256"])


def test_the_life_of_a_record(run: Run, session: Path) -> None:
    run("calibrate", session)
    assert (
        run("calibration", "approve", "pair-r1", "--in-force-from", "2026-02-01", "--checked-by", "A")[0] == 2
    )
    code, approved = run(
        "calibration", "approve", "pair-r1", "--in-force-from", "2026-02-01", "--checked-by", "B"
    )
    assert (code, approved["approved"], approved["signature"]) == (0, True, "unsigned")
    code, listed = run("calibration", "list")
    assert (code, listed["records"][0]["status"]) == (0, "approved")
    assert approved["note"].endswith("before the decision")
    assert listed["heads"]["pair"]["sha256"] == approved["head"]
    assert run("calibration", "verify", "--head", approved["head"])[0] == 0
    assert run("calibration", "verify", "--head", "0" * 64)[0] == 1
    withdrawn = run(
        "calibration", "withdraw", "pair-r1", "--on", today().isoformat(), "--from", "2026-03-01",
        "--reason", "dropped", "--by", "B",
    )  # fmt: skip
    assert (withdrawn[0], withdrawn[1]["void_from"]) == (0, "2026-03-01")
    assert (
        run("calibration", "show", "pair-r1", "--known-at", "2026-03-31")[1]["record"]["status"] == "approved"
    )
    assert (
        run("calibration", "show", "pair-r1", "--known-at", today().isoformat())[1]["record"]["status"]
        == "withdrawn"
    )
    events = run("calibration", "history", "pair-r1")[1]["events"]
    assert events[1]["note"] == approved["note"]
    assert [event["event"] for event in events] == ["entered", "approved", "withdrawn"]
    assert run("calibration", "diff", "pair-r1", "pair-r1")[0] == 0


def test_verify_has_the_keys_of_the_contract(run: Run, session: Path, tmp_path: Path) -> None:
    run("calibrate", session)
    code, answer = run("calibration", "verify")
    assert (code, answer["records"]) == (0, [{"id": "pair-r1", "ok": True, "verified": True, "reason": None}])
    path = tmp_path / "cal" / "pair" / "pair-r1.loads.csv"
    path.write_bytes(path.read_bytes().replace(b"down", b"up", 1))
    code, answer = run("calibration", "verify")
    assert code == 1
    assert answer["records"][0]["reason"].startswith("data")
    assert run("calibration", "show", "pair-r1")[0] == 2
    assert run("calibration", "list")[0] == 1


def test_a_finding_ends_with_one_and_a_bad_session_with_two(run: Run, session: Path) -> None:
    text = (session.parent / "loads.csv").read_text()
    (session.parent / "loads.csv").write_text("\n".join(text.splitlines()[:21]) + "\n")
    code, answer = run("calibrate", session)
    warnings = {f["rule"] for f in answer["findings"] if f["level"] != "note"}
    assert (code, warnings) == (1, {"few-points"})
    (session.parent / "loads.csv").write_text(text.replace("mV/V", "mV/Q", 1))
    code, answer = run("calibrate", session)
    assert code == 2
    assert all(answer["error"][key] for key in ("what", "where", "got", "expected", "next_step"))


def test_text_for_people(run: Run, session: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(calibrate.command)
    app(args=[str(session), "--out", str(tmp_path / "cal")], standalone_mode=False)
    text = capsys.readouterr().out
    for word in ("pair-r1", "candidate", "std error", "residual sd", "condition number", "approve pair-r1"):
        assert word in text
    root = typer.Typer()
    root.add_typer(calibration.app, name="calibration")
    words = ["--in-force-from", "2026-02-02", "--checked-by", "B", "--calibrations", str(tmp_path / "cal")]
    root(args=["calibration", "approve", "pair-r1", *words], standalone_mode=False)
    capsys.readouterr()
    root(args=["calibration", "show", "pair-r1", *words[-2:]], standalone_mode=False)
    shown = capsys.readouterr().out
    assert "verified      yes" in shown
    assert "[" not in shown.split("ledger head")[0]
