"""The tests between the last good as-found and the failing one, with the interpolated effect."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests import commands
from tests.audit.archive_made import FY, MZ, dated, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.audit.since_good import drift_since, drifted_files, drifted_tests
from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.registry import Registry
from toolkit.declared import json_value
from toolkit.errors import ConfigError

LBF = 4.4482216152605
GROWTH = 0.01  # of FY: what the failing session finds


def session(folder, day, *, growth=0.0, phase=None):
    """A session of the machine's three cells whose FY follows the published equation times 1 + growth."""
    folder.mkdir()
    rng = np.random.default_rng(day.toordinal())

    def rows(n, runs):
        x = rng.uniform(-500, 500, (n, 3)).round(3)
        y = np.column_stack([(x @ FY[:3] + FY[3]) * (1 + growth), x @ MZ[:3] + MZ[3]])
        y += 1e-4 * (-1.0) ** np.arange(n)[:, None]
        lines = []
        for i, values in enumerate(np.column_stack([x, y]).tolist()):
            tail = [str(i // 10 + 1), "up"] if runs else []
            lines.append(",".join([*map(repr, values), *tail]))
        return lines

    head = "D51 [lbf],D52 [lbf],E5 [lbf],FY [lbf],MZ [lbf*ft]"
    (folder / "loads.csv").write_text("\n".join([head + ",run,direction", *rows(30, True)]) + "\n")
    (folder / "check.csv").write_text("\n".join([head, *rows(9, False)]) + "\n")
    (folder / "SESSION.toml").write_text(
        f'schema = 1\ninstrument = "m15"\ndate = {day}\noperator = "A"\nzero = "included"\n'
        'indications = ["D51", "D52", "E5"]\nloads = ["FY", "MZ"]\ndata = "loads.csv"\n'
        + (f'phase = "{phase}"\n' if phase else "")
        + '[check]\nfile = "check.csv"\n'
    )
    return folder / "SESSION.toml"


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    root = tmp_path_factory.mktemp("drift")
    registry = Registry(root / "calibrations")
    first = calibrate(session(root / "s1", dt.date(2018, 1, 1)), registry).record
    day = dt.date(2018, 1, 1)
    assert approve(registry, first.id, in_force_from=day, checked_by="B", known_on=day, reason="late").done
    calibrate(session(root / "s2", dt.date(2019, 1, 1), phase="as_found"), registry)
    calibrate(session(root / "s3", dt.date(2021, 1, 1), phase="as_found", growth=GROWTH), registry)
    for number, date in enumerate(("2018-06-01", "2019-01-01", "2020-01-01", "2021-01-01", "2021-02-01")):
        dated(root / "archive" / date, date)
        write(root / "archive" / date / "run", recording(seed=number))
    return root, registry


def test_the_stretch_is_that_between_the_two_sessions(home):
    drift = drift_since(home[1], "m15-r2")
    assert (drift.good_date, drift.failed.session_record) == (dt.date(2019, 1, 1), "m15-r3")
    assert (drift.failed.date, drift.failed.record) == (dt.date(2021, 1, 1), "m15-r1")
    assert drift.later_good == ()
    assert {one.load for one in drift.failed.loads} == {"FY", "MZ"}


def test_it_tells_what_the_failing_session_found(home):
    # One percent of the largest FY that the session applied, against a tenth of a percent of it.
    drift = drift_since(home[1], "m15-r2")
    FY_off = next(one for one in drift.failed.loads if one.load == "FY")
    assert abs(FY_off.max_error) > FY_off.tolerance
    assert drift.statement.startswith("on 2021-01-01, m15-r3 found m15-r1: FY off by ")
    assert f"(tolerance {FY_off.tolerance:.4g} lbf)" in drift.statement
    assert "MZ" not in drift.statement


@pytest.fixture(scope="module")
def made(home):
    root, registry = home
    return audit_archive(root / "archive", registry, known_at=dt.date(2022, 1, 1))


@pytest.mark.parametrize("workers", [1, 2])
def test_each_test_has_the_share_of_its_days(home, made, workers):
    _, registry = home
    drift = drift_since(registry, "m15-r2")
    files = {one.path: one for one in drifted_files(made, registry, drift, workers=workers)}
    # The day of the good session is still good, the day of the failing one has all of it.
    assert sorted(files) == ["2020-01-01/run", "2021-01-01/run"]
    days = (dt.date(2021, 1, 1) - dt.date(2019, 1, 1)).days
    share = (dt.date(2020, 1, 1) - dt.date(2019, 1, 1)).days / days
    one = files["2020-01-01/run"]
    assert one.share == share == pytest.approx(0.5, abs=0.01)
    FY_N = recording(seed=2)["FY"] * LBF
    # Both records are fits of data with 1e-4 lbf of scatter.
    assert one.FY_N == pytest.approx(share * GROWTH * np.abs(FY_N).max(), rel=1e-4)
    assert one.MZ_Nm == pytest.approx(0.0, abs=1e-3)
    means = FY_N.reshape(5, 10).mean(axis=1)
    np.testing.assert_allclose([c.FY_N for c in one.conditions], share * GROWTH * means, rtol=1e-3)
    assert files["2021-01-01/run"].share == 1.0


def test_a_test_has_the_largest_of_its_files(home, made):
    drift = drift_since(home[1], "m15-r2")
    files = tuple(drifted_files(made, home[1], drift))
    tests = drifted_tests(made, files)
    assert [(one.test, one.files, one.left_out) for one in tests] == [
        ("2020-01-01", 1, 0),
        ("2021-01-01", 1, 0),
    ]
    # Two more recordings of the first test: one that changes more, and one that could not be computed.
    more = replace(files[0], path="2020-01-01/more", FY_N=1e6, MZ_Nm=0.0)
    none = replace(files[0], path="2020-01-01/none", FY_N=None, MZ_Nm=None, reason="no record was in force")
    plain = [{"path": one.path, "test": one.path.split("/")[0]} for one in (*files, more, none)]
    view = SimpleNamespace(files=SimpleNamespace(plain=lambda: iter(plain)))
    first = drifted_tests(view, (*files, more, none))[0]
    assert (first.files, first.left_out, first.FY_N, first.MZ_Nm) == (3, 1, 1e6, files[0].MZ_Nm)
    alone = drifted_tests(view, (none,))[0]
    assert json_value(alone) == {
        "test": "2020-01-01", "date": "2020-01-01", "share": none.share, "files": 1, "left_out": 1,
        "FY_max_abs_N": None, "MZ_max_abs_Nm": None,
    }  # fmt: skip


def test_the_first_record_may_be_named_too(home):
    drift = drift_since(home[1], "m15-r1")
    assert drift.good_date == dt.date(2018, 1, 1)
    assert drift.later_good == ("m15-r2",)


@pytest.mark.parametrize(
    ("record", "said"), [("m15-r3", "out of tolerance itself"), ("m15-r2", "none of them")]
)
def test_without_such_a_stretch_it_is_refused(home, tmp_path, record, said):
    root, registry = home
    if record == "m15-r2":  # a registry that ends with the good one
        registry = Registry(tmp_path / "calibrations")
        calibrate(root / "s1" / "SESSION.toml", registry)
        record = "m15-r1"
    with pytest.raises(ConfigError) as caught:
        drift_since(registry, record)
    assert caught.value.rule == "since-good"
    assert said in str(caught.value)


def test_the_command_tells_each_test_and_its_page_too(home, tmp_path):
    root, registry = home
    given = ("audit", root / "archive", "--calibrations", registry.folder,
             "--known-at", "2022-01-01", "--since-good", "m15-r2", "--out", tmp_path)  # fmt: skip
    text, told = commands.said(*given).out, commands.answer(*given)[1]["since_good"]
    assert [one["test"] for one in told["tests"]] == ["2020-01-01", "2021-01-01"]
    assert [one["path"] for one in told["files"]] == ["2020-01-01/run", "2021-01-01/run"]
    page = (tmp_path / "audit.html").read_text()
    for one in told["tests"]:
        line = next(row for row in text.splitlines() if row.startswith(one["test"]) and "%" in row)
        assert line.split()[-2:] == [f"{one['FY_max_abs_N']:.2f}", f"{one['MZ_max_abs_Nm']:.3f}"]
        assert f'<tr><td>{one["test"]}</td><td class="d">{one["date"]}</td>' in page
        assert f'<td class="n">{one["FY_max_abs_N"]:.2f}</td>' in page
