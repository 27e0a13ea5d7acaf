import contextlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import toolkit
from toolkit.errors import ConfigError, OutputError, ToolkitError
from toolkit.files import read_toml
from toolkit.machine import load_machine
from toolkit.recording.folder import read_test_folder
from toolkit.recording.marks import SIMULATED, is_own_output
from toolkit.recording.read import read_recording
from toolkit.simulation.plan import Plan, read_plan, with_effects
from toolkit.simulation.run import simulate
from toolkit.simulation.session import schedule, simulate_session
from toolkit.simulation.write import write_session, write_test

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
TEST_PLAN, SESSION_PLAN = EXAMPLES / "test_plan.toml", EXAMPLES / "session_plan.toml"


@pytest.fixture(scope="module")
def session():
    return simulate_session(read_plan(SESSION_PLAN))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    plan = replace(read_plan(TEST_PLAN), slip_angles_rad=(0.0, 0.02), loads_N=(1112.0, 3705.0))
    folder = tmp_path_factory.mktemp("virtual") / "test"
    test = simulate(plan)
    return test, folder, write_test(test, folder)


class TestPlan:
    def test_packaged_plan_spells_out_the_defaults(self):
        plan = read_plan(TEST_PLAN)
        plain = Plan(kind="test", title="", date=plan.date, machine=plan.machine, seed=0)
        for stage in ("tire", "road", "carriage", "cells", "acquisition", "session"):
            stated = getattr(plan, stage)
            if stage == "acquisition":  # the accident is the example's own
                assert stated.negated == ("E5",)
                stated = replace(stated, negated=())
            assert stated == getattr(plain, stage), stage
        assert len(plan.slip_angles_rad) * len(plan.rotations) == 26
        assert len(plan.loads_N) == 5
        assert read_plan(SESSION_PLAN).session == plain.session

    @pytest.mark.parametrize(
        ("line", "told"),
        [
            ("[tire]\nplystear = { value = 1, unit = 'deg' }", "plysteer"),
            ("[tire]\nplysteer = 0.1", "unit"),
            ("[tire]\nplysteer = { value = 1, unit = 'N' }", "angle"),
            ("[tire]\nconicity = { value = 9e9, unit = 'N' }\n", ""),
            ("machine = 'm15'", "real machine"),
            ("machine = 'm16'", "m16"),
            ("date = 'yesterday'", "yesterday"),
            ("rotations = ['sideways']", "sideways"),
            ("slip_angles = [0, 1]", "slip_angles"),
            ("seed = -1", "seed"),
            ("file_name = 'run.xlsx'", "run.xlsx"),
            ("[cells.D51]\ncapacity = { value = 1, unit = 'kN' }", "rated_output"),
            ("[acquisition]\nnegated = ['D53']", "D53"),
        ],
    )
    def test_bad_plans_are_told_as_such(self, tmp_path, line, told):
        lines = [] if line.startswith("date") else ["date = 2026-03-17"]
        path = tmp_path / "plan.toml"
        path.write_text("\n".join([*lines, line]), encoding="utf-8")
        with pytest.raises(ToolkitError) as caught:
            simulate(read_plan(path))
        assert told in str(caught.value)
        assert caught.value.next_step

    def test_a_plan_overrides(self, tmp_path):
        path = tmp_path / "plan.toml"
        path.write_text(
            "date = 2026-03-17\nloads = { value = [2, 4], unit = 'kN' }\n[cells]\n"
            "crosstalk = { value = 1, unit = '%' }\nD51 = { gain_error = { value = 0.02, unit = '1' } }\n",
            encoding="utf-8",
        )
        plan = read_plan(path, seed=5)
        assert (plan.seed, plan.loads_N) == (5, (2000.0, 4000.0))
        assert (plan.cells.crosstalk_FZ_FY, plan.cells.D51.gain_error, plan.cells.E5.gain_error) == (
            0.01,
            0.02,
            0,
        )


class TestSession:
    def test_schedule_varies_every_load_both_ways(self, session):
        shares = np.array([point.shares for point in schedule()])
        assert np.all(shares.min(axis=0) == -1.0)
        assert np.all(shares.max(axis=0) == 1.0)
        assert np.abs(np.corrcoef(shares.T) - np.eye(3)).max() < 0.35  # E5 is loaded most by opposite signs
        assert len(session.run) >= 30
        assert set(session.run) == {1, 2, 3}

    def test_least_squares_finds_the_published_map(self, session):
        # numpy alone; lbf and lbf·ft per lbf of cell force, times 3000 lbf over the rated output
        rated = np.array([2.0131, 1.9874, 2.0046])
        published = {0: [0.99719, 0.99718, 1.0228], 1: [-0.15688, 0.16197, 0.0026666]}
        matrix = np.column_stack([session.indications, np.ones(len(session.run))])
        for load, row in published.items():
            found = np.linalg.lstsq(matrix, session.loads[:, load], rcond=None)[0]
            np.testing.assert_allclose(found[:3] * rated / 3000.0, row, rtol=3e-4, atol=3e-6)

    def test_cells_stay_within_their_capacity(self, session):
        assert np.all(np.abs(session.indications).max(axis=0) < [2.0131, 1.9874, 2.0046])

    def test_check_loads_have_full_rank_and_stand_apart(self, session):
        assert np.linalg.matrix_rank(session.check_loads) == 3
        fitted = {tuple(row) for row in session.loads.tolist()}
        assert not fitted & {tuple(row) for row in session.check_loads.tolist()}

    def test_files(self, session, tmp_path):
        files = write_session(session, tmp_path / "s")
        table = read_toml(files[0])
        assert (table["zero"], table["instrument"]) == ("tared", "m15-virtual")
        header = (tmp_path / "s" / table["data"]).read_text(encoding="utf-8").splitlines()[0]
        assert header == "D51 [mV/V],D52 [mV/V],E5 [mV/V],FY [lbf],MZ [lbf*ft],MX [lbf*ft],run,direction"
        assert all(SIMULATED in path.name + path.read_text(encoding="utf-8") for path in files)


class TestFiles:
    def test_read_back_as_written_and_marked(self, written):
        test, folder, files = written
        assert sorted(path.name for path in folder.iterdir()) == sorted(path.name for path in files)
        for file in test.files:
            back = read_recording(folder / file.name, load_machine("m15-virtual"))
            assert back.simulated
            for symbol, values in file.columns.items():
                assert np.array_equal(back[symbol].values, values), symbol

    def test_folder_reads_as_a_test_with_tare_and_directions(self, written):
        test, folder, _ = written
        found = read_test_folder(folder)
        assert len(found.files) == 4
        assert [found.rotation_of(folder / file.name) for file in test.files] == ["forward"] * 2 + [
            "reverse"
        ] * 2
        assert {name: value for name, value, _ in found.tare_values} == dict(test.tare)
        assert found.info.simulated
        assert found.info.pressure_Pa == pytest.approx(34 * 6894.757)

    def test_truth_is_an_output_not_a_recording(self, written):
        assert is_own_output(written[1] / "truth.json")

    def test_again_into_the_same_folder_gives_the_same_bytes(self, written):
        test, folder, files = written
        before = [path.read_bytes() for path in files]
        write_test(test, folder)
        assert [path.read_bytes() for path in files] == before

    def test_a_folder_with_other_files_is_refused_untouched(self, written, tmp_path):
        (tmp_path / "mine.txt").write_text("keep", encoding="utf-8")
        with pytest.raises(OutputError, match="other files"):
            write_test(written[0], tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@given(st.text(max_size=40))
def test_any_text_as_an_effect_is_a_plan_or_a_clear_error(text):
    plan = Plan(kind="test", title="", date="2026-03-17", machine=load_machine("m15-virtual"), seed=0)
    with contextlib.suppress(ConfigError):
        assert with_effects(plan, [text]).effects


@pytest.mark.parametrize(
    "line",
    [
        "rotations = []",
        '[tire]\nfree_radius = { value = -0.316, unit = "m" }',
        '[tire]\nfree_radius = { value = nan, unit = "m" }',
        '[road]\ndrum_runout_1 = { value = inf, unit = "N" }',
    ],
)
def test_a_plan_that_cannot_be_is_refused_with_its_place(tmp_path, line):
    path = tmp_path / "plan.toml"
    path.write_text(f'schema = 1\nkind = "test"\ndate = 2026-03-17\n{line}\n')
    with pytest.raises(ConfigError) as caught:
        read_plan(path)
    assert caught.value.rule == "wrong-value"
    assert str(path) in str(caught.value.where)


@pytest.mark.parametrize(
    ("runs", "reversal", "reverse"),
    [
        ([("forward", "normal"), ("forward", "turned")], "tire", ["FM_run_2.xlsx"]),
        ([("forward", "normal"), ("reverse", "normal")], "drum", ["FM_run_2.xlsx"]),
        ([("forward", "turned"), ("forward", "turned")], "drum", []),
        ([("forward", "turned"), ("reverse", "normal")], "drum", ["FM_run_2.xlsx"]),
    ],
)
def test_runs_of_a_tire_turned_on_its_hub_are_told_to_the_pipeline(tmp_path, runs, reversal, reverse):
    plan = tmp_path / "plan.toml"
    listed = "".join(
        f'[[run]]\nrotation = "{rotation}"\nmounting = "{mounting}"\n'
        'slip_angles = { value = [1], unit = "deg" }\n'
        for rotation, mounting in runs
    )
    plan.write_text(
        f'kind = "test"\ndate = 2026-03-17\nseed = 1\nfile_name = "FM_run_{{number}}.xlsx"\n{listed}'
    )
    write_test(simulate(read_plan(plan)), tmp_path / "made")
    info = read_test_folder(tmp_path / "made").info
    assert info.reversal == reversal
    turned = [name for name, rotation in read_toml(tmp_path / "made/test.toml").get("rotations", {}).items()
              if rotation == "reverse"]  # fmt: skip
    assert turned == reverse
