"""Sessions evaluated by the standards: which rows count, what the class needs, and two real cells."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.calibration.control_factory import enter
from tests.calibration.standards.test_e74 import GOLDEN, LBF, PONTIUS, RUN
from tests.conftest import SHARED_DATA
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.session.read import read_session
from toolkit.calibration.standards.e74 import E74Result
from toolkit.calibration.standards.evaluation import Evaluation, evaluate_source, evaluations, source_of
from toolkit.calibration.standards.iso376 import Iso376Result
from toolkit.errors import ConfigError, SessionError
from toolkit.lab.records.control_answer import evaluate_record

FORCES = tuple(1000.0 * i for i in range(1, 11))
MOUNTINGS = ((1, 0.0), (2, 0.0), (3, 120.0), (4, 240.0))
HEADER = "S [mV/V],FY [N],run,direction,rotation"
STATED = '[cells.S]\nresolution = 0.0000001\n[reference.uncertainty]\nFY = { U = 0.05, k = 2, unit = "N" }\n'


def session(
    folder: Path,
    rows: Sequence[str],
    *,
    header: str = "S [mV/V],FY [N],run,direction,rotation",
    tail: str = STATED,
) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "loads.csv").write_text("\n".join([header, *rows]) + "\n")
    path = folder / "SESSION.toml"
    path.write_text(
        'schema = 1\ninstrument = "cell"\ndate = 2026-02-01\noperator = "A"\nindications = ["S"]\n'
        f'loads = ["FY"]\ndata = "loads.csv"\n{tail}'
    )
    return path


def iso_rows(*, zero: float = 0.0, after: float = 0.0, sense: float = 1.0) -> list[str]:
    """Return ISO 376 runs of a straight cell, 2e-4 mV/V per N; X3 is 0.03 % high, X4' 0.02 % above X3."""
    rows = []
    for run, rotation in MOUNTINGS:
        gain = 2e-4 * (1.0003 if run == 3 else 1.0)
        rows.append(f"{zero},0,{run},up,{rotation}")
        rows += [f"{zero + sense * gain * f!r},{sense * f},{run},up,{rotation}" for f in FORCES]
        if run > 2:
            back = 1.0002 if run == 3 else 1.0
            rows += [
                f"{zero + sense * gain * back * f!r},{sense * f},{run},down,{rotation}"
                for f in FORCES[-2::-1]
            ]
        rows.append(f"{zero + (after if run == 4 else 0.0)},0,{run},up,{rotation}")
    return rows


def evaluated(path: Path, standard: str, **more: Any) -> tuple[Evaluation, ...]:
    source = source_of(fit_session(read_session(path)))
    return evaluate_source(source, standard=standard, load="FY", indication="S", **more)  # type: ignore[arg-type]


def test_iso_376_of_a_session_by_hand(tmp_path: Path) -> None:
    path = session(tmp_path, iso_rows(zero=0.5, after=0.0001))
    (one,) = evaluated(path, "iso376", preloads=3)
    found = one.result
    assert isinstance(found, Iso376Result)
    row = found.forces[4]
    assert row.force == 5000.0
    assert row.deflection == pytest.approx(1.0 * (1 + 0.0001))
    assert row.b == pytest.approx(0.03 / 1.0001)
    assert row.b_same == pytest.approx(0.0, abs=1e-9)
    # The largest force is where the run turns: there v is zero; elsewhere half of 0.02 %, X6' being X5.
    assert row.v == pytest.approx(0.01, rel=1e-6)
    assert found.forces[-1].v == pytest.approx(0.0, abs=1e-9)
    assert found.f0 == pytest.approx(100 * 0.0001 / (2.0 * 1.0001))
    assert found.resolution == pytest.approx(1e-7 / 2e-4, rel=1e-3)
    assert (one.class_name, one.reasons, one.sense) == ("00", (), "positive")


def test_a_session_that_states_its_preloads_has_its_class(tmp_path: Path) -> None:
    path = session(tmp_path, iso_rows(), tail=STATED + "[standard]\npreloads = 3\n")
    (one,) = evaluated(path, "iso376")
    assert one.class_name == "00"
    assert [e.class_name for e in evaluations(fit_session(read_session(path))) if e.standard == "iso376"] == [
        "00"
    ]
    # An option goes before what was stated; two preloads are too few.
    assert evaluated(path, "iso376", preloads=2)[0].class_name is None
    few = session(tmp_path / "few", iso_rows(), tail=STATED + "[standard]\npreloads = 2\n")
    assert any("2 preloads" in reason for reason in evaluated(few, "iso376")[0].all_reasons)


def test_the_stated_preloads_belong_to_the_record(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    plain = calibrate(session(tmp_path / "a", iso_rows()), registry)
    told = calibrate(
        session(tmp_path / "b", iso_rows(), tail=STATED + "[standard]\npreloads = 3\n"), registry
    )
    assert (plain.existing, told.existing) == (False, False)
    assert registry.load(told.record.id).sha256 != plain.record.sha256
    found = evaluate_record(registry, told.record.id, standard="iso376", load=None, indication=None)
    assert [one.class_name for one in found] == ["00"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[standard]\npreloads = -1\n", "standard.preloads"),
        ("[standard]\npreloads = 3.0\n", "standard.preloads"),
        ("[standard]\npreloads = true\n", "standard.preloads"),
        ('[standard]\npreloads = "three"\n', "standard.preloads"),
        ("[standard]\npreload = 3\n", "unknown key 'preload'"),
        ("[[standard]]\npreloads = 3\n", "standard has a value"),
    ],
)
def test_preloads_that_are_none_are_refused(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_session(session(tmp_path, iso_rows(), tail=STATED + text))
    assert told in f"{caught.value.what} {caught.value.where}"


def test_the_applied_forces_uncertainty_limits_the_class(tmp_path: Path) -> None:
    # U = 0.05 N of 1000 N is 0.005 %; ten times as much is 0.05 %: class 1 at the smallest force.
    tail = STATED.replace("0.05", "0.5")
    (one,) = evaluated(session(tmp_path, iso_rows(), tail=tail), "iso376", preloads=3)
    assert one.class_name == "1"
    assert any("U = 0.05 %" in reason for reason in one.all_reasons)


def test_a_column_of_uncertainties_goes_before_the_stated_one(tmp_path: Path) -> None:
    rows = [f"{row},0.5" for row in iso_rows()]
    path = session(tmp_path, rows, header="S [mV/V],FY [N],run,direction,rotation,u_FY [N]")
    (one,) = evaluated(path, "iso376", preloads=3)
    # u = 0.5 N: U = 1 N is 0.1 % of 1000 N.
    assert one.class_name == "2"


def test_creep_is_read_at_30_and_300_seconds(tmp_path: Path) -> None:
    creep = "".join(
        f"[[creep]]\nload = {{ value = 10000, unit = 'N' }}\nseconds = {s}\nvalue = {{ S = {v} }}\n"
        for s, v in ((30, 2.0), (60, 2.0001), (300, 2.0003))
    )
    (one,) = evaluated(session(tmp_path, iso_rows(), tail=STATED + creep), "iso376", preloads=3)
    assert isinstance(one.result, Iso376Result)
    assert one.result.c == pytest.approx(100 * 0.0003 / 2.0002)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"preloads": None}, "preloads are not stated"),
        ({"tail": ""}, "resolution is not stated"),
        ({"tail": ""}, "uncertainty is not stated"),
        ({"header": "S [mV/V],FY [N],run,direction"}, "rotation of the runs is not stated"),
        ({"drop": ",0,"}, "zero before a run was not read"),
        ({"drop": ",2,up"}, "no repeated run"),
        ({"drop": ",5000.0,4,"}, "run 4 is left out: no increasing force 5000"),
        ({"drop": ",5000.0,4,down"}, "decreasing forces of run 4"),
    ],
)
def test_what_a_session_lacks_costs_the_class_and_is_named(
    tmp_path: Path, change: dict[str, Any], told: str
) -> None:
    rows = [row for row in iso_rows() if "drop" not in change or change["drop"] not in row]
    if "header" in change:
        rows = [row.rsplit(",", 1)[0] for row in rows]
    more = {key: change[key] for key in ("header", "tail") if key in change}
    (one,) = evaluated(
        session(tmp_path, rows, **more),
        "iso376",
        preloads=change.get("preloads", 3) if "preloads" in change else 3,
    )
    assert one.class_name is None
    assert any(told in reason for reason in one.all_reasons), one.all_reasons
    assert one.result is not None


def test_compression_and_tension_are_evaluated_apart(tmp_path: Path) -> None:
    rows = iso_rows() + [row.replace(",1,up", ",5,up").replace(",2,up", ",6,up").replace(",3,", ",7,")
                         .replace(",4,", ",8,") for row in iso_rows(sense=-1.0)]  # fmt: skip
    tension, compression = evaluated(session(tmp_path, rows), "iso376", preloads=3)
    assert (tension.sense, compression.sense) == ("positive", "negative")
    assert isinstance(tension.result, Iso376Result)
    assert isinstance(compression.result, Iso376Result)
    assert compression.result.forces[4].b == pytest.approx(tension.result.forces[4].b)
    assert compression.result.forces[4].deflection == pytest.approx(-tension.result.forces[4].deflection)


def pontius(folder: Path) -> Path:
    rows = [f"{d!r},{f},{r},up" for d, f, r in zip(PONTIUS.tolist(), LBF.tolist(), RUN.tolist(), strict=True)]
    tail = '[[zero]]\nwhen = "before"\nvalues = { S = 0 }\n[cells.S]\nresolution = 0.00001\n'
    return session(folder, rows, header="S [mV/V],FY [lbf],run,direction", tail=tail)


@pytest.mark.parametrize("degree", GOLDEN)
def test_the_golden_figures_of_pontius_from_a_session(tmp_path: Path, degree: int) -> None:
    s_m, llf, _ = GOLDEN[degree]
    (one,) = evaluated(pontius(tmp_path), "e74", degree=degree)
    assert isinstance(one.result, E74Result)
    assert one.result.curve.s_m == pytest.approx(s_m, rel=3e-4)
    assert one.result.llf == pytest.approx(llf, abs=0.05)
    assert one.class_name is None
    assert any("2 runs" in reason for reason in one.all_reasons)


def test_e74_fits_increasing_and_decreasing_forces_apart(tmp_path: Path) -> None:
    up, down = evaluated(session(tmp_path, iso_rows()), "e74")
    assert isinstance(up.result, E74Result)
    assert isinstance(down.result, E74Result)
    assert (up.direction, up.result.points, down.direction, down.result.points) == ("up", 40, "down", 18)


def test_a_session_of_one_cell_is_evaluated_by_both_standards(tmp_path: Path) -> None:
    found = evaluations(fit_session(read_session(session(tmp_path, iso_rows()))))
    assert [one.standard for one in found] == ["e74", "e74", "iso376"]
    told = found[0].as_dict()
    assert told["result"]["llf"] > 0
    assert told["class"] in ("AA", "A", None)


def test_the_combined_output_of_several_cells_is_not_the_standard(make_session: Any) -> None:
    fit = fit_session(read_session(make_session()))
    found = evaluations(fit)
    assert {(one.standard, one.load) for one in found} == {
        (standard, load) for standard in ("e74", "iso376") for load in ("FY", "MZ", "MX")
    }
    assert all(one.result is None and "one indication to one force" in one.reasons[0] for one in found)
    # No row of the hub's session has one load alone.
    with pytest.raises(SessionError) as caught:
        evaluate_source(source_of(fit), standard="e74", load="FY", indication="D51")
    assert caught.value.rule == "standard"


def test_rows_with_another_load_are_left_out(make_session: Any) -> None:
    fit = fit_session(read_session(make_session()))
    source = source_of(fit)
    values = source.table.values.copy()
    at = {name: source.table.names.index(name) for name in ("D51", "FY", "MZ", "MX")}
    values[:40, [at["MZ"], at["MX"]]] = 0.0
    values[:40, at["D51"]] = 0.002 * values[:40, at["FY"]]
    changed = replace(source, table=replace(source.table, values=values))
    found = evaluate_source(changed, standard="e74", load="FY", indication="D51")
    assert sum(one.result.points for one in found if isinstance(one.result, E74Result)) == 40
    assert {one.left_out for one in found} == {20}


@pytest.mark.parametrize(("load", "indication"), [("FZ", "S"), ("FY", "T")])
def test_an_unknown_name_is_refused(tmp_path: Path, load: str, indication: str) -> None:
    registry = Registry(tmp_path / "cal")
    made = enter(registry, tmp_path / "s1", dt.date(2024, 1, 10))
    with pytest.raises(SessionError) as caught:
        evaluate_record(registry, made.record.id, standard="e74", load=load, indication=indication)
    assert caught.value.rule == "standard"
    assert evaluate_record(registry, made.record.id, standard="e74")


CELLS = SHARED_DATA / "cie324_loadcell" / "LoadCellCalibrationData.txt"


@pytest.mark.skipif(not CELLS.is_file(), reason="the recording of the two cells in series is not here")
@pytest.mark.parametrize("column", [10, 11])
def test_two_real_cells_loaded_and_unloaded(tmp_path: Path, column: int) -> None:
    # 10 lbf weights put on one by one to 40 lbf and taken off again; nothing was certified. Plateaus are
    # found from the first cell, by its nearness to whole thousands of counts per lbf, and both are read.
    data = np.genfromtxt(CELLS, delimiter=",")
    counts = data[np.abs(data[:, [10, 11]]).max(axis=1) < 1e6]
    level = (counts[:, 10] - np.median(counts[:60, 10])) / 1000.0
    step = np.round(level / 10).astype(int)
    still = np.abs(level - 10 * step) < 0.6
    top = np.flatnonzero(step == 4)
    means: dict[tuple[str, int], float] = {}
    errors = []
    for direction, part in (("up", slice(0, top[0] + 50)), ("down", slice(top[-1] - 50, None))):
        for n in range(5):
            mine = counts[part][(step[part] == n) & still[part], column]
            means[direction, n] = float(mine.mean())
            errors.append(mine.std(ddof=1) / np.sqrt(len(mine)))
    rows = [f"{means['up', n]!r},{10.0 * n},1,up" for n in range(5)]
    rows += [f"{means['down', n]!r},{10.0 * n},1,down" for n in (3, 2, 1, 0)]
    path = session(tmp_path, rows, header="S [count],FY [lbf],run,direction", tail="")
    (one,) = evaluated(path, "iso376", degree=1)
    found = one.result
    assert isinstance(found, Iso376Result)
    # One run at one mounting is no ISO 376: figures, and no class.
    assert one.class_name is None
    zero = means["up", 0]
    for n, row in zip((1, 2, 3), found.forces, strict=False):
        by_hand = 100 * abs(means["down", n] - means["up", n]) / (means["up", n] - zero)
        assert row.v == pytest.approx(by_hand, rel=1e-9)
    # The zero comes back to what the readings' own scatter lets one say.
    assert found.f0 == pytest.approx(100 * (means["down", 0] - zero) / (means["up", 4] - zero))
    assert abs(means["down", 0] - zero) < 6 * max(errors)
    # The author's factor is 1 lbf per 1000 counts; both cells carry the same weights.
    assert found.coefficients[1] == pytest.approx(1000.0, rel=0.01)
