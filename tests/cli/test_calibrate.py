"""`toolkit calibrate` and `calibration report`: the contract's keys, the report, and every bad input."""

from __future__ import annotations

import datetime as dt
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli import one_command
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.registry import Registry
from toolkit.cli import calibrate, calibration
from toolkit.errors import ToolkitError

CONTRACT = (
    "unit indication_units coefficients standard_errors residual_sd dof condition_number llf "
    "check_max_percent_fs"
).split()
TEXT = """schema = 1
instrument = "cell2"
date = 2026-01-05
operator = "operator one"
indications = ["A", "B"]
loads = ["FY", "MZ"]
data = "loads.csv"
check = "check.csv"
"""
DAY = dt.date(2026, 1, 5)
HEADER = "A [mV/V],B [mV/V],FY [lbf],MZ [lbf*ft]"


def run(*words: object, of: Any = calibrate.command) -> tuple[int, str]:
    return one_command.run(of, *words)


def rows(count: int, seed: int, noise: float = 1e-5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    loads = rng.uniform(-1, 1, (count, 2)) * [500.0, 100.0]
    cells = loads @ np.array([[2e-3, 1e-4], [-3e-3, 1e-2]]) + rng.normal(0, noise, (count, 2))
    return np.column_stack([cells, loads])


def csv(values: np.ndarray, *, runs: bool = True, header: str = HEADER, comma: str = ",") -> str:
    lines = [header + (",run,direction" if runs else "")]
    lines += [
        ",".join(f"{v:.8g}" for v in row)
        + (f",{1 + i // 10},{'up' if i % 10 < 5 else 'down'}" if runs else "")
        for i, row in enumerate(values)
    ]
    return "\n".join(lines).replace(",", comma) + "\n"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    folder = tmp_path / "session"
    folder.mkdir()
    (folder / "SESSION.toml").write_text(TEXT)
    (folder / "loads.csv").write_text(csv(rows(40, 1)))
    (folder / "check.csv").write_text(csv(rows(6, 2), runs=False))
    return folder / "SESSION.toml"


def test_json_keeps_the_contract_and_adds_the_report(session: Path, tmp_path: Path) -> None:
    code, out = run(session, "--calibrations", tmp_path / "cal", "--json")
    answer = json.loads(out)
    assert (code, answer["schema"]) == (0, 1)
    assert set(answer["record"]) == {"id", "sha256", "status", "existing", "path"}
    for one in answer["loads"].values():
        assert set(CONTRACT) <= set(one)
        report = one["report"]
        assert set(report["coefficients"]) == set(one["coefficients"])
        assert "rows" not in report
        assert report["r_squared"] > 0.999
        assert len(report["check_percent_fs"]) == 6
        worst = max(map(abs, report["check_percent_fs"]))
        assert worst == pytest.approx(one["check_max_percent_fs"])
        errors = np.sqrt(np.diag(report["covariance"]))
        assert errors == pytest.approx(list(one["standard_errors"].values()))


def test_the_whole_report_has_rows_and_the_text_its_parts(session: Path, tmp_path: Path) -> None:
    _, out = run(session, "--calibrations", tmp_path / "cal", "--json", "--full")
    assert len(json.loads(out)["loads"]["FY"]["report"]["rows"]["cook"]) == 40
    _, plain = run(session, "--calibrations", tmp_path / "cal")
    code, text = run(session, "--calibrations", tmp_path / "cal", "--full")
    assert code == 0
    assert "sign sure" not in plain
    for part in ("sign sure", "correlation", "PRESS", "VIF", "lack of fit", "Shapiro-Wilk", "check loads"):
        assert part in text


AGAIN = pytest.mark.campaign(
    "all figures a second time: a figure is drawn alike by two processes in every run"
)


@pytest.mark.parametrize("runs", [("one",), pytest.param(("one", "two"), marks=AGAIN)])
def test_figures_are_whole_and_the_same_again(session: Path, tmp_path: Path, runs: tuple[str, ...]) -> None:
    made = []
    for name in runs:
        code, out = run(session, "--calibrations", tmp_path / "cal", "--figures", tmp_path / name, "--json")
        assert code == 0
        assert json.loads(out)["figures"] == sorted(p.name for p in (tmp_path / name).iterdir())
        made.append({p.name: p.read_bytes() for p in (tmp_path / name).iterdir()})
    assert made[0] == made[-1]
    assert len(made[0]) == 2 * 6 * 2
    assert all(
        d.startswith(b"\x89PNG") and d.rstrip().endswith(b"\x82") for n, d in made[0].items() if "png" in n
    )
    assert all(d.rstrip().endswith(b"</svg>") for n, d in made[0].items() if n.endswith("svg"))


def test_a_stored_record_is_reported_as_its_session_was(session: Path, tmp_path: Path) -> None:
    _, first = run(session, "--calibrations", tmp_path / "cal", "--json", "--full")
    session.parent.rename(tmp_path / "moved")
    code, out = run("cell2-r1", "--calibrations", tmp_path / "cal", "--json", of=calibration.report)
    assert code == 0
    for name, one in json.loads(first)["loads"].items():
        assert json.loads(out)["loads"][name] == one["report"]
    _, text = run("cell2-r1", "--calibrations", tmp_path / "cal", of=calibration.report)
    assert "cell2-r1" in text
    assert "sign sure" in text


def test_a_legacy_record_has_no_report() -> None:
    registry = Path(__file__).resolve().parents[2] / "calibrations"
    with pytest.raises(ToolkitError) as caught:
        run("m15-r1", "--calibrations", registry, of=calibration.report)
    assert (caught.value.exit_code, caught.value.rule) == (2, "data")
    assert caught.value.next_step


def collinear(values: np.ndarray) -> np.ndarray:
    values[:, 1] = 2 * values[:, 0] + 1e-7 * values[:, 1]
    return values


def coupled(values: np.ndarray) -> np.ndarray:
    values[:, 3] = 0.2 * values[:, 2]
    return values


def still(values: np.ndarray) -> np.ndarray:
    values[:, 3] = 0.0
    return values


CHANGES: dict[str, tuple[Any, str, str]] = {
    "loads do not span": (lambda: csv(still(rows(40, 1))), "not-spanning", "MZ"),
    "loads move together": (lambda: csv(coupled(rows(40, 1))), "not-spanning", "MZ"),
    "collinear": (lambda: csv(collinear(rows(40, 1))), "collinear", "A, B"),
    "fewer points than terms": (lambda: csv(rows(3, 1)), "dof", "3 rows, 3 terms"),
    "one row": (lambda: csv(rows(1, 1)), "dof", "1 rows"),
    "unit of another kind": (
        lambda: csv(rows(40, 1), header=HEADER.replace("FY [lbf]", "FY [lbf*ft]")), "unit-dimension", "FY"),
    "unknown unit": (
        lambda: csv(rows(40, 1), header=HEADER.replace("lbf]", "lbq]", 1)), "unknown-unit", "lbq"),
    "NaN": (lambda: csv(rows(40, 1)).replace("\n", "\nnan,1,1,1,1,up\n", 1), "cell", "row 1, column A"),
    "empty cell": (lambda: csv(rows(40, 1)).replace("\n", "\n1,,1,1,1,up\n", 1), "cell", "row 1, column B"),
    "text": (lambda: csv(rows(40, 1)).replace("\n", "\n1,1,ten,1,1,up\n", 1), "cell", "ten"),
    "overflow": (
        lambda: csv(rows(40, 1)).replace("\n", "\n1,1e999,1,1,1,up\n", 1), "cell", "row 1, column B"),
    "empty file": (lambda: "", "no-data", "loads.csv"),
    "thousands": (
        lambda: "A [mV/V];B [mV/V];FY [N];MZ [N*m];run;direction\n1,234;2;3;4;1;up\n", "ambiguous-text",
        "row 1 (line 2), column A"),
}  # fmt: skip


@pytest.mark.parametrize("name", CHANGES)
def test_bad_data_end_with_two_and_nothing_written(session: Path, tmp_path: Path, name: str) -> None:
    make, rule, word = CHANGES[name]
    (session.parent / "loads.csv").write_text(make())
    error = refused(session, tmp_path)
    assert error.rule == rule
    assert word in str(error)


def test_numbers_too_large_for_the_arithmetic_are_refused(session: Path, tmp_path: Path) -> None:
    values = rows(40, 1)
    values[3, 2] = 1e300
    values[7, 2] = -1e300
    (session.parent / "loads.csv").write_text(csv(values))
    error = refused(session, tmp_path)
    assert error.rule == "cell"
    assert "row 4, column FY" in error.what


def refused(session: Path, tmp_path: Path) -> ToolkitError:
    with pytest.raises(ToolkitError) as caught:
        run(session, "--calibrations", tmp_path / "cal", "--figures", tmp_path / "figures")
    error = caught.value
    assert error.exit_code == 2
    assert all((error.what, error.where, error.got, error.expected, error.next_step, error.rule))
    assert not (tmp_path / "cal").exists() or not list((tmp_path / "cal").rglob("*"))
    assert not (tmp_path / "figures").exists()
    return error


def test_a_byte_order_mark_is_no_fault(session: Path, tmp_path: Path) -> None:
    data = session.parent / "loads.csv"
    data.write_bytes(b"\xef\xbb\xbf" + data.read_bytes())
    assert run(session, "--calibrations", tmp_path / "cal", "--quiet") == (0, "")


def outlier(folder: Path) -> None:
    values = rows(40, 1)
    values[7, 2] += 5.0
    (folder / "loads.csv").write_text(csv(values))


def doubled(folder: Path) -> None:
    values = rows(40, 1)
    (folder / "loads.csv").write_text(csv(np.vstack([values, values[:8]])))


def overdue(folder: Path) -> None:
    (folder / "SESSION.toml").write_text(TEXT + '[reference]\nstandard = "S1"\ndue = 2026-01-04\n')


def same_check(folder: Path) -> None:
    (folder / "check.csv").write_text(csv(rows(40, 1)[:6], runs=False))


@pytest.mark.parametrize(
    ("change", "rule", "where"),
    [(outlier, "outlier", "FY, row 8"), (doubled, "duplicates", "SESSION.toml"),
     (overdue, "reference-due", "SESSION.toml"), (same_check, "check-not-apart", "check row 1")],
)  # fmt: skip
def test_what_a_person_should_see_ends_with_one_and_a_candidate(
    session: Path, tmp_path: Path, change: Any, rule: str, where: str
) -> None:
    change(session.parent)
    code, out = run(session, "--calibrations", tmp_path / "cal", "--json")
    found = [one for one in json.loads(out)["findings"] if one["rule"] == rule]
    assert code == 1
    assert found[0]["where"] == where
    assert Path(json.loads(out)["record"]["path"]).is_file()


def test_figures_that_cannot_be_written_stop_before_the_record(session: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(ToolkitError) as caught:
        run(session, "--calibrations", tmp_path / "cal", "--figures", tmp_path / "file" / "figures")
    assert (caught.value.rule, caught.value.exit_code) == ("not-writable", 2)
    assert not (tmp_path / "cal").exists()


@pytest.mark.parametrize("option", ["--calibrations", "--out"])
def test_a_new_registry_is_made_where_it_was_named(session: Path, tmp_path: Path, option: str) -> None:
    folder = tmp_path / "new" / "lab" / "calibrations"
    code, out = run(session, option, folder, "--json")
    assert (code, Path(json.loads(out)["record"]["path"]).parent) == (0, folder / "cell2")
    assert (folder / "cell2" / "cell2-r1.json").is_file()


def test_a_registry_has_one_name(session: Path, tmp_path: Path) -> None:
    with pytest.raises(ToolkitError) as caught:
        run(session, "--calibrations", tmp_path / "one", "--out", tmp_path / "two")
    assert (caught.value.rule, caught.value.exit_code) == ("usage", 2)
    assert not (tmp_path / "one").exists()
    assert not (tmp_path / "two").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_registry_that_is_not_writable(session: Path, tmp_path: Path) -> None:
    folder = tmp_path / "cal"
    folder.mkdir(mode=0o500)
    with pytest.raises(ToolkitError) as caught:
        run(session, "--calibrations", folder)
    assert caught.value.rule == "not-writable"


def test_a_session_folder_that_is_not_writable_is_enough(session: Path, tmp_path: Path) -> None:
    session.parent.chmod(0o500)
    try:
        assert run(session, "--calibrations", tmp_path / "cal", "--quiet")[0] == 0
    finally:
        session.parent.chmod(0o700)
    assert sorted(p.name for p in session.parent.iterdir()) == ["SESSION.toml", "check.csv", "loads.csv"]


def polarity(sign: float = 1.0) -> str:
    """Return readings of 400 lbf and of 80 lbf*ft by the cells' true sensitivities, times a sign."""
    loads = {"FY": (400.0, "lbf", 0.8, 0.04), "MZ": (80.0, "lbf*ft", -0.24, 0.8)}
    return "".join(
        f'[[polarity]]\nload = "{name}"\nvalue = {{ value = {value}, unit = "{unit}" }}\n'
        f'indications = {{ A = {{ value = {sign * a}, unit = "mV/V" }}, '
        f'B = {{ value = {sign * b}, unit = "mV/V" }} }}\n'
        for name, (value, unit, a, b) in loads.items()
    )


def last_line(*arguments: object) -> str:
    return run(*arguments)[1].strip().splitlines()[-1]


def test_an_approval_is_named_next_only_where_it_can_be_had(session: Path, tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")

    def entered(text: str) -> str:
        session.write_text(TEXT + text)
        return last_line(session, "--calibrations", registry.folder)

    approval = "next: toolkit calibration approve cell2-r{} --in-force-from 2026-01-05 --checked-by NAME"
    assert entered("") == approval.format(1) + " --polarity FILE"
    serials = '[cells.A]\nserial = "{}"\n[cells.B]\nserial = "2"\n'
    assert entered(serials.format("1") + polarity()) == approval.format(2)
    wrong = entered(serials.format("1") + polarity(-1.0))
    assert wrong.startswith("next: settle")
    assert "polarity-reading" in wrong
    assert "approve cell2" not in wrong
    assert not approve(registry, "cell2-r3", in_force_from=DAY, checked_by="second person").done
    assert approve(registry, "cell2-r2", in_force_from=DAY, checked_by="second person").done
    assert entered(serials.format("9") + polarity()) == approval.format(4) + " --reason TEXT"
    # A session that is recorded already is told the same.
    assert last_line(session, "--calibrations", registry.folder) == approval.format(4) + " --reason TEXT"
    assert not approve(registry, "cell2-r4", in_force_from=DAY, checked_by="second person").done
    done = approve(registry, "cell2-r4", in_force_from=DAY, checked_by="second person", reason="A failed")
    assert done.done
