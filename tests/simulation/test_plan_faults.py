"""Malformed plans: each ends as an error with the key, its line, and what was expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.errors import ConfigError
from toolkit.simulation.plan import read_plan

N, DEG = '{ value = 1, unit = "N" }', '{ value = 1, unit = "deg" }'


@pytest.mark.parametrize(
    ("lines", "key", "expected", "rule"),
    [
        # the top of the file
        ('kind = "trial"', "kind", "test, session, table", "wrong-value"),
        ("kind = 3", "kind", "test, session, table", "wrong-value"),
        ("kind = [1]", "kind", "test, session, table", "wrong-value"),
        ('knd = "test"', "knd", "kind", "unknown-key"),
        ("schema = 2", "schema", "1", "wrong-value"),
        ('title = ["x"]', "title", "a text", "wrong-value"),
        ("machine = 3", "machine", "a text", "wrong-value"),
        ('machine = "m15"', "machine", 'kind = "simulated"', "wrong-value"),
        ("seed = -1", "seed", "a whole number from 0", "wrong-value"),
        ("seed = true", "seed", "a whole number from 0", "wrong-value"),
        ("seed = 1.5", "seed", "a whole number from 0", "wrong-value"),
        ("label = 3", "label", "size", "wrong-value"),
        ('label = { sice = "x" }', "label", "size", "unknown-key"),
        ("label = { size = [1] }", "label.size", "a text", "wrong-value"),
        ("rotations = []", "rotations", "at least one", "wrong-value"),
        ('rotations = "forward"', "rotations", "a list", "wrong-value"),
        ('rotations = ["sideways"]', "rotations[1]", "forward or reverse", "wrong-value"),
        ("slip_angles = [0, 1]", "slip_angles", 'unit = "deg"', "wrong-value"),
        ("slip_angles = { value = [0, 1] }", "slip_angles", 'unit = "deg"', "no-unit"),
        ('slip_angles = { value = [], unit = "deg" }', "slip_angles", "at least one", "wrong-value"),
        ('slip_angles = { value = [nan], unit = "deg" }', "slip_angles.value[1]", "a finite", "wrong-value"),
        ('slip_angles = { value = ["1"], unit = "deg" }', "slip_angles.value[1]", "a finite", "wrong-value"),
        ('loads = { value = [1], unit = "deg" }', "loads", "force", "unit-dimension"),
        ('loads = { value = [1], unit = "Nn" }', "loads", "N", "unknown-unit"),
        ("pressure = 200", "pressure", 'unit = "kPa"', "no-unit"),
        ('pressure = { value = inf, unit = "kPa" }', "pressure", "a finite number", "wrong-value"),
        ('file_name = "run.xlsx"', "file_name", "{number}", "wrong-value"),
        ('file_name = "a/run_{number}.xlsx"', "file_name", "a plain file name", "wrong-value"),
        ('effects = "plysteer=1deg"', "effects", '["NAME=VALUE"]', "wrong-value"),
        ("effects = [1]", "effects[1]", "a text", "wrong-value"),
        # stages
        ("tire = 3", "tire", "a table [tire]", "wrong-value"),
        ("[tire]\nplystear = 1", "tire", "plysteer", "unknown-key"),
        ("[tire]\nplysteer = 0.1", "tire.plysteer", 'unit = "deg"', "no-unit"),
        (f"[tire]\nplysteer = {N}", "tire.plysteer", "angle", "unit-dimension"),
        ('[tire]\nplysteer = { value = "1", unit = "deg" }', "tire.plysteer", "a finite", "wrong-value"),
        ('[tire]\nfree_radius = { value = nan, unit = "m" }', "tire.free_radius", "a finite", "wrong-value"),
        ('[tire]\nfree_radius = { value = 0, unit = "m" }', "tire.free_radius", "above 0", "wrong-value"),
        ("[tire]\nfile = 5", "tire.file", 'file = "tire.tir"', "wrong-value"),
        (f'[tire]\nfile = "t.tir"\nconicity = {N}', "tire.conicity", "no such entry", "unknown-key"),
        ('[road]\ndrum_runout_1 = { value = inf, unit = "N" }', "road.drum_runout_1", "a finite",
         "wrong-value"),
        ("[road]\ndrum_runout_3 = 1", "road", "drum_runout_", "unknown-key"),
        ("[[carriage]]\n", "carriage", "a table [carriage]", "wrong-value"),
        (f"[carriage]\nload_spread = {N}", "carriage.load_spread", "ratio", "unit-dimension"),
        ("[cells]\nD51 = 3", "cells.D51", "rated_output", "wrong-value"),
        ("[cells]\nD53 = {}", "cells", "D52", "unknown-key"),
        (f"[cells.D51]\ncapacity = {N}", "cells.D51.rated_output", "both or none", "missing-key"),
        ('[cells.D51]\nrated_output = { value = 2, unit = "V" }', "cells.D51.rated_output", "bridge_ratio",
         "unit-dimension"),
        (f'[cells.E5]\nrated_output = {{ value = 0, unit = "mV/V" }}\ncapacity = {N}',
         "cells.E5.rated_output", "above 0", "wrong-value"),
        ('[acquisition]\nnegated = "E5"', "acquisition.negated", "a list", "wrong-value"),
        ('[acquisition]\nnegated = ["D53"]', "acquisition.negated[1]", "D51, D52, E5", "wrong-value"),
        ("[acquisition]\nrows_per_revolution = 0", "acquisition.rows_per_revolution", "from 1",
         "wrong-value"),
        ('[acquisition]\nrecord = "all"', "acquisition.record", "dwell or continuous", "wrong-value"),
        ('[session]\nreadings = "yes"', "session.readings", "true or false", "wrong-value"),
        ('[session]\noutput = "V"', "session.output", "mV/V, mV, count", "wrong-value"),
        ('[session]\nscale = { value = 0, unit = "V/V" }', "session.scale", "above 0", "wrong-value"),
        ('[session]\nexcitation = { value = -5, unit = "V" }', "session.excitation", "above 0",
         "wrong-value"),
        ("[session]\nruns = 2.5", "session.runs", "a whole number from 1", "wrong-value"),
        ("motion = []", "motion", "a table [motion]", "wrong-value"),
        ('[motion]\nsteer_rate = { value = 0, unit = "deg/s" }', "motion.steer_rate", "above 0",
         "wrong-value"),
        (f"[motion]\nsteer_rate = {DEG}", "motion.steer_rate", "deg/s", "unit-dimension"),
        ("[motion]\nambient = 20", "motion.ambient", 'unit = "degC"', "no-unit"),
        # runs
        ("run = []", "run", "at least one", "wrong-value"),
        ("run = 3", "run", "a list of tables", "wrong-value"),
        ("run = [3]", "run", "a list of tables", "wrong-value"),
        ('[[run]]\nrotation = "left"', "run[1].rotation", "forward or reverse", "wrong-value"),
        ("[[run]]\n[[run]]\ntimes = 0", "run[2].times", "from 1", "wrong-value"),
        ("[[run]]\ntimes = 1001", "run[1].times", "up to 1000", "wrong-value"),
        ("[[run]]\nspeed = 15", "run[1].speed", 'unit = "km/h"', "no-unit"),
        ('[[run]]\nspeed = { value = 0, unit = "km/h" }', "run[1].speed", "above 0", "wrong-value"),
        ("[[run]]\nsped = 1", "run[1]", "speed", "unknown-key"),
        ('[[run]]\nmounting = "upside"', "run[1].mounting", "normal or turned", "wrong-value"),
        ("[[run]]\nconditions = { surface = 1.5 }", "run[1].conditions.surface", "a text", "wrong-value"),
        ("[[run]]\nconditions = 3", "run[1].conditions", "a table", "wrong-value"),
        ("[[run]]\nconditions = { wet = true }", "run[1].conditions.wet", "a text", "wrong-value"),
        ('[[run]]\nconditions = { file = "x" }', "run[1].conditions.file", "of the run itself",
         "wrong-value"),
        # the case
        ("case = 1", "case", "a table [case]", "wrong-value"),
        ('[case]\noutputs = "all"', "case.outputs", "forces or cells", "wrong-value"),
        ('[case]\nload = "guessed"', "case.load", "measured, judged, commanded", "wrong-value"),
        ('[case]\ncolumns = "V"', "case.columns", "a list", "wrong-value"),
        ('[case]\ncolumns = ["W"]', "case.columns[1]", "DRUM_ANGLE", "wrong-value"),
        ("[case]\nparameters = [1]", "case.parameters", "a table", "wrong-value"),
        ("[case.parameters]\nLMUY = 1", "case.parameters.LMUY", "value, unit", "wrong-value"),
        ("[case.parameters.LMUY]\nvalue = 1", "case.parameters.LMUY.unit", 'unit = "kg"', "missing-key"),
        ('[case.parameters.LMUY]\nvalue = nan\nunit = "1"', "case.parameters.LMUY.value", "a finite",
         "wrong-value"),
        ('[case.parameters.LMUY]\nvalue = 1\nunit = "1"\nsd = 0', "case.parameters.LMUY.sd", "above zero",
         "wrong-value"),
        ('[case.parameters.LMUY]\nvalue = 1\nunit = "1"\nbounds = [2, 3]', "case.parameters.LMUY.bounds",
         "bounds around 1", "wrong-value"),
        ('[case.parameters.LMUY]\nvalue = 1\nunit = "1"\nbounds = [0]', "case.parameters.LMUY.bounds",
         "[a finite number, a finite number]", "wrong-value"),
    ],
)  # fmt: skip
def test_a_malformed_plan_is_refused_with_key_and_line(
    tmp_path: Path, lines: str, key: str, expected: str, rule: str
) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(f"date = 2026-03-17\n{lines}\n", encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_plan(path)
    error = caught.value
    assert (error.where or "").startswith(f"{path}: {key}") or (
        error.rule == "unknown-key" and error.where == str(path)
    )
    assert expected in str(error.expected)
    assert error.rule == rule
    assert error.line
    assert "correct the plan" in str(error.next_step) or error.rule == "unknown-key"
    assert error.exit_code == 2


@pytest.mark.parametrize("date", ["", "date = 3", 'date = "yesterday"', "date = 2026-03-17T08:00:00"])
def test_a_plan_needs_its_day(tmp_path: Path, date: str) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(f'kind = "test"\n{date}\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="a date such as 2026-03-17") as caught:
        read_plan(path)
    assert caught.value.where == f"{path}: date"


def test_all_faults_of_a_plan_are_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text('date = 2026-03-17\nseed = -1\n[road]\ndrum_runout_1 = 3\n[case]\nload = "x"\n')
    with pytest.raises(ConfigError, match="3 entries cannot be used") as caught:
        read_plan(path)
    assert all(key in str(caught.value) for key in ("seed", "road.drum_runout_1", "case.load"))


def test_an_effect_that_is_not_known_names_the_nearest(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text('date = 2026-03-17\neffects = ["relaxaton=0.5m"]\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="relaxation"):
        read_plan(path)
