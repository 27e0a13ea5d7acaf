"""`toolkit fit` with models over all loads: the contract's keys, comparison, figures, what is refused."""

import functools
import json

import numpy as np
import pytest

from tests.cli import one_command
from toolkit.cli import fit
from toolkit.errors import ToolkitError
from toolkit.lab.tire_tests.fit_models import model_choice
from toolkit.simulation.tire import aligning_moment, lateral_force
from toolkit.tires.models import model_names

KEYS = (
    "model channel load_N axes n dof parameters standard_errors not_determined at_bound error_percent "
    "scatter_floor_percent cornering_stiffness_N_per_rad loss converged message"
).split()
FAST = ("pacejka94", "mf52", "brush")


run = functools.partial(one_command.run, fit.command)


def write(path, *, loads=(1100.0, 2500.0, 3700.0, 4900.0), angles=None, noise=0.003, turn=1.0, FZ_sign=1.0):
    # The published tire of SAE 870421 in adapted-SAE axes.
    rng, lines = np.random.default_rng(1), ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    for FZ in loads:
        for degrees in angles if angles is not None else np.arange(-10.0, 11.0, 2.0):
            SA = np.radians(degrees)
            FY = float(lateral_force(slip_angle=SA, load=FZ)) + rng.normal(0, noise * FZ)
            MZ = float(aligning_moment(slip_angle=SA, load=FZ)) + rng.normal(0, 0.03 * noise * FZ)
            lines.append(f"{turn * degrees},{FZ_sign * FZ},{FY:.4f},{MZ:.5f}")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def tire(tmp_path):
    return write(tmp_path / "tire.csv", turn=-1.0)  # mirrored slip: SAE


def models(*names):
    return [word for name in names for word in ("--model", name)]


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    tire = write(tmp_path_factory.mktemp("answer") / "tire.csv", turn=-1.0)
    code, out = run(tire, *models("magic_formula", *FAST), "--json")
    return code, json.loads(out)


def test_every_model_gives_one_fit_a_channel_with_the_contracts_keys(answer):
    code, told = answer
    assert code == 0
    every = [one for one in told["fits"] if one["load_N"] is None]
    assert [(one["model"], one["channel"]) for one in every] == [
        (name, channel) for name in FAST for channel in ("FY", "MZ")
    ]
    assert sum(one["load_N"] is not None for one in told["fits"]) == 8
    for one in told["fits"]:
        assert set(KEYS) <= set(one)
        assert one["axes"] == "SAE"
        missing = {name for name, error in one["standard_errors"].items() if error is None}
        assert missing == set(one["not_determined"])
    for one in every:
        assert one["converged"], one["message"]
        assert set(one["fixed"]) <= set(one["not_determined"])
        assert one["n"] == 44
        stiffness = one["cornering_stiffness_N_per_rad"] or one["aligning_stiffness_Nm_per_rad"]
        assert stiffness["value"] > 0
    # The set's own stiffness at 3.7 kN is 1003 N/deg; pacejka94 is the same form but for one constant.
    lateral = next(one for one in every if (one["model"], one["channel"]) == ("pacejka94", "FY"))
    load = next(one for one in lateral["loads"] if abs(one["load_N"] - 3700) < 1)
    assert np.radians(load["stiffness"]["value"]) == pytest.approx(1003, rel=0.03)


def test_comparison_has_an_entry_for_every_model_and_channel(answer):
    rows = answer[1]["comparison"]["rows"]
    assert {(row["model"], row["channel"]) for row in rows} == {
        (name, channel) for name in ("magic_formula", *FAST) for channel in ("FY", "MZ")
    }
    for row in rows:
        own = [
            one for one in answer[1]["fits"]
            if (one["model"], one["channel"]) == (row["model"], row["channel"])
        ]  # fmt: skip
        if own[0]["load_N"] is None:
            assert row["error_percent"] == own[0]["error_percent"]
            # Of FY alone a fit without a load is no better there: MZ's trail may gain by another FY.
            worse = row["prediction_error_percent"] > row["error_percent"]
            assert worse or row["channel"] == "MZ"
        else:
            assert row["prediction_error_percent"] is None
    assert answer[1]["comparison"]["scatter_floor_percent"] == {"FY": None, "MZ": None}


def test_what_did_not_vary_is_one_note(answer):
    notes = [one for one in answer[1]["findings"] if one["rule"] == "not-varied"]
    assert len(notes) == 1
    assert notes[0]["level"] == "note"


def test_text_is_the_table_of_the_thesis(tire):
    code, out = run(tire, *models("magic_formula", "mf52"))
    assert code == 0
    lines = out.splitlines()
    head = next(line for line in lines if line.startswith("error in %"))
    assert head.split()[3:] == ["magic_formula", "mf52", "floor"]
    assert any(line.startswith("Pure FY") for line in lines)
    assert any("load left out" in line for line in lines)


def test_figures_are_written_and_named(tire, tmp_path):
    folder = tmp_path / "made" / "figures"
    _, out = run(tire, *models("magic_formula", "mf52"), "--figures", folder, "--json")
    names = json.loads(out)["figures"]
    assert names == sorted(one.name for one in folder.iterdir())
    for model in ("magic_formula", "mf52"):
        for channel in ("FY", "MZ"):
            assert {f"{model}_{channel}_curves.png", f"{model}_{channel}_residuals.png"} <= set(names)
    assert {"comparison_pure_FY.png", "comparison_pure_MZ.svg"} <= set(names)
    assert all((folder / name).stat().st_size > 1000 for name in names)


def test_a_folder_that_cannot_be_written_is_refused_before_the_fit(tire, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ToolkitError) as caught:
        run(tire, *models("mf52"), "--figures", tmp_path / "file" / "figures")
    assert caught.value.rule == "not-writable"


def test_all_names_every_model_of_the_catalogue():
    assert set(model_choice(["all"])) == set(model_names())
    assert model_choice(["brush", "mf52", "brush"]) == ("brush", "mf52")


def test_robust_and_weights_are_told(tire):
    _, out = run(tire, *models("brush"), "--loss", "robust", "--weights", "noise", "--json")
    for one in json.loads(out)["fits"]:
        assert (one["loss"], one["weights"]) == ("robust", "noise")


def test_negative_loads_are_loads(tire, tmp_path):
    other = write(tmp_path / "down.csv", turn=-1.0, FZ_sign=-1.0)
    first, second = (json.loads(run(path, *models("brush"), "--json")[1])["fits"] for path in (tire, other))
    assert first == second


def test_swapped_axes_are_a_finding_and_nothing_is_flipped(tmp_path):
    path = write(tmp_path / "swapped.csv")  # adapted SAE, declared as SAE
    code, out = run(path, *models("brush"), "--json")
    told = json.loads(out)
    assert code == 1
    found = [one for one in told["findings"] if one["rule"] == "axes-contradiction"]
    assert {one["where"].rsplit(" ", 1)[-1] for one in found} == {"FY", "MZ"}
    assert next(one for one in told["fits"] if one["channel"] == "FY")["error_percent"] > 20


@pytest.mark.campaign("the same table in its own axes: other tables are fitted in theirs in every run")
def test_a_table_in_the_axes_that_are_stated_has_no_finding(tmp_path):
    path = write(tmp_path / "swapped.csv")
    code, out = run(path, *models("mf52"), "--axes", "adapted-SAE", "--json")
    assert code == 0
    assert json.loads(out)["fits"][0]["error_percent"] < 2


def test_a_load_that_never_changes_fixes_what_changes_with_it(tmp_path):
    path = write(tmp_path / "one.csv", loads=(3700.0,), turn=-1.0)
    code, out = run(path, *models("mf52", "pacejka94"), "--json")
    assert code == 0
    for one in json.loads(out)["fits"]:
        assert any("one load" in why for why in one["fixed"].values())
        assert one["prediction_error_percent"] is None


def test_slip_angles_of_one_sign_are_said(tmp_path):
    path = write(tmp_path / "half.csv", angles=np.arange(0.5, 11.0, 1.0), turn=-1.0)
    code, out = run(path, *models("magic_formula", "mf52"), "--json")
    told = json.loads(out)
    assert code in (0, 1)
    single, every = told["fits"][0], next(one for one in told["fits"] if one["load_N"] is None)
    assert "one sign" in single["message"]
    assert single["cornering_stiffness_N_per_rad"] is None
    assert "one sign" in every["fixed"]["PEY3"]


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda cells: [*cells[:2], "nan", cells[3]], "text-cell"),
        (lambda cells: ["2.0", *cells[1:]], "constant-column"),
        (lambda cells: [cells[0], "0", *cells[2:]], "no-load-block"),
    ],
)
def test_bad_tables_end_with_two_and_write_nothing(tire, tmp_path, change, rule):
    head, *lines = tire.read_text().splitlines()
    tire.write_text("\n".join([head, *(",".join(change(line.split(","))) for line in lines)]) + "\n")
    with pytest.raises(ToolkitError) as caught:
        run(tire, *models("mf61"), "--tir", tmp_path / "x.tir", "--figures", tmp_path / "figures")
    error = caught.value
    assert (error.rule, error.exit_code) == (rule, 2)
    assert error.where
    assert error.expected
    assert error.next_step
    assert not (tmp_path / "x.tir").exists()
    assert not (tmp_path / "figures").exists()


def test_times_stand_apart_from_the_answer_and_errors_carry_their_degrees_of_freedom(answer):
    told = answer[1]
    assert set(told["timing"]["models"]) == {"magic_formula", *FAST}
    assert all("seconds" not in row for row in told["comparison"]["rows"])
    for one in told["fits"]:
        if one["load_N"] is None:
            continue
        # Eleven rows of white noise, six parameters.
        for name, error in one["standard_errors"].items():
            assert one["standard_error_dof"][name] == (None if error is None else 5)
        stiffness = one["cornering_stiffness_N_per_rad"] or one["aligning_stiffness_Nm_per_rad"]
        if stiffness is not None:
            assert stiffness["dof"] == 5


def test_a_fit_of_a_table_says_how_its_record_stands(tire):
    plain = json.loads(run(tire, *models("brush"), "--json")[1])
    lines = tire.read_text().splitlines()
    marked = [lines[0] + ",calibration", *(f"{line},UNVERIFIED CALIBRATION: m15-r2" for line in lines[1:])]
    tire.write_text("\n".join(marked) + "\n")
    code, out = run(tire, *models("brush"), "--json")
    told = json.loads(out)
    assert code == 1
    (finding,) = [one for one in told["findings"] if one["rule"] == "unverified"]
    assert "m15-r2" in finding["message"]
    assert told["fits"] == plain["fits"]
