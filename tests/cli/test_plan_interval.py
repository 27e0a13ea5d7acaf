"""`toolkit plan interval`: a cell that drifts over its sessions is due the sooner the faster; refusals."""

from __future__ import annotations

import datetime as dt
import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.calibration.control_factory import enter, put_in_force
from tests.cli.test_calibrate import run as run_command
from toolkit.calibration.registry.registry import Registry
from toolkit.cli import plan
from toolkit.errors import ToolkitError


def home_of(folder: Path, spans: list[float]) -> Path:
    """Return a home with a session each year, all of which were put in force on their day."""
    registry = Registry(folder / "calibrations")
    for number, span in enumerate(spans):
        day = dt.date(2018 + number, 3, 1)
        made = enter(registry, folder / f"session {number}", day, span=span)
        put_in_force(registry, made, recall="12 months")
    return folder


def run(home: Path, *arguments: object) -> tuple[int, dict[str, Any]]:
    code, said = run_command("cell", "--home", home, "--json", *arguments, of=plan.interval)
    return code, json.loads(said)


@pytest.mark.campaign(
    "two more intervals: the interval of a drift is held in every run (tests/planning/test_interval.py)"
)
def test_a_faster_drift_is_due_sooner(tmp_path: Path) -> None:
    """The span grows by 0.2 and by 0.9 permille a year; the tolerance is one permille at full scale."""
    answers = []
    for name, rate in (("slow", 0.0002), ("fast", 0.0009)):
        code, answer = run(home_of(tmp_path / name, [1 + rate * i for i in range(7)]), "--tests", "100")
        assert code in (0, 1)
        answers.append(answer)
    slow, fast = answers
    # At the check load of 950 N, by the tolerance of 1 N.
    assert slow["trend_per_year"] == pytest.approx(0.0002 * 950, rel=0.05)
    assert fast["trend_per_year"] == pytest.approx(0.0009 * 950, rel=0.05)
    assert fast["limiting"] == "FY at FY 950 N"
    assert 0 < fast["days"] < slow["days"]
    assert fast["chosen"]["beyond"] <= 0.05
    assert fast["chosen"]["recalled_a_year"] == pytest.approx(100 * fast["chosen"]["beyond"])
    assert slow["next"] == (dt.date(2024, 3, 1) + dt.timedelta(days=slow["days"])).isoformat()
    assert slow["in_use"] == "12 months"


@pytest.mark.campaign("the sheet of another plan: that of a test is drawn in every run")
@pytest.mark.skipif(not shutil.which("soffice"), reason="LibreOffice is not installed")
def test_the_sheet_draws_the_risk_over_the_days(tmp_path: Path) -> None:
    home = home_of(tmp_path / "home", [1 + 0.0005 * i for i in range(7)])
    _, answer = run(home, "--out", tmp_path / "out")
    document = answer["document"]
    assert document["warnings"] == []
    assert [figure["tag"] for figure in document["figures"]] == ["tk:figure.plan_figure_1"]
    assert (
        f"{answer['chosen']['days']}: {100 * answer['chosen']['beyond']:.1f} %"
        in (document["figures"][0]["alt"])
    )
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "plan.docx", "plan.json", "plan.pdf"
    }  # fmt: skip


def test_a_reliability_that_no_interval_keeps_names_the_nearest_that_one_does(tmp_path: Path) -> None:
    """Sessions scatter by a tolerance, without a trend: not even 30 days keep 99.9 %."""
    home = home_of(tmp_path / "home", [1.0, 1.001, 1.0, 1.001, 1.0, 1.001, 1.0])
    with pytest.raises(ToolkitError) as refused:
        run(home, "--reliability", "0.999", "--out", tmp_path / "out")
    assert (refused.value.rule, refused.value.exit_code) == ("plan-infeasible", 2)
    assert not (tmp_path / "out").exists()
    nearest = re.search(r"--reliability ([^\s,]+)", str(refused.value.next_step))
    assert nearest is not None
    code, answer = run(home, "--reliability", nearest[1])
    assert answer["days"] >= 30
    # Years after the last session the day of the next one is past, which nothing but the plan says.
    assert code == 1
    assert [finding["rule"] for finding in answer["findings"]] == ["overdue"]
    assert answer["next"] in answer["findings"][0]["message"]


def test_what_cannot_be_planned_is_an_error(tmp_path: Path) -> None:
    home = home_of(tmp_path, [1.0, 1.0002])
    with pytest.raises(ToolkitError) as short:
        run(home)
    assert short.value.rule == "plan-history"
    for arguments in (
        ("--reliability", "1"),
        ("--reliability", "0.2"),
        ("--tests", "-1"),
        ("--tests", "1e50"),
    ):
        with pytest.raises(ToolkitError) as refused:
            run(home, *arguments)
        assert refused.value.rule == "plan-demand"
        assert refused.value.exit_code == 2
    with pytest.raises(ToolkitError) as unknown:
        run(home, "--load", "XX")
    assert (unknown.value.rule, unknown.value.exit_code) == ("load", 2)
