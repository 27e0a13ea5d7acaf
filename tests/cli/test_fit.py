"""`toolkit fit` on tables: the JSON contract, exit codes, what is refused."""

import functools
import json

import numpy as np
import pytest

from tests.cli import one_command
from toolkit.cli import fit
from toolkit.errors import ToolkitError
from toolkit.tires.models.magic_formula import value

KEYS = (
    "model channel load_N axes n dof parameters standard_errors not_determined at_bound error_percent "
    "scatter_floor_percent cornering_stiffness_N_per_rad loss converged message"
).split()


run = functools.partial(one_command.run, fit.command)


@pytest.fixture
def tire(tmp_path):
    rng = np.random.default_rng(1)
    lines = ["SA [deg],FZ [N],FY [N],MZ [N*m]"]
    for FZ in (2000.0, 4000.0):
        for degrees in np.arange(-12.0, 12.5, 1.0):
            SA = np.radians(degrees)
            FY = value((11.0, 1.3, -FZ, -0.5, 0.002, 10.0), SA) + rng.normal(0, 0.004 * FZ)
            MZ = value((10.0, 2.3, 0.03 * FZ, -1.0, 0.002, 1.0), SA) + rng.normal(0, 2e-4 * FZ)
            lines.append(f"{degrees},{FZ},{FY:.4f},{MZ:.5f}")
    path = tmp_path / "tire.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_json_is_the_contract(tire):
    code, out = run(tire, "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["schema"] == 1
    assert len(answer["fits"]) == 4
    for one in answer["fits"]:
        assert set(KEYS) <= set(one)
        assert set(one["parameters"]) == set(one["standard_errors"]) == {"B", "C", "D", "E", "Sh", "Sv"}
        assert (one["n"], one["dof"], one["axes"], one["loss"]) == (25, 19, "SAE", "linear")
        missing = {name for name, error in one["standard_errors"].items() if error is None}
        assert missing == set(one["not_determined"])
    lateral, aligning = answer["fits"][:2]
    assert lateral["cornering_stiffness_N_per_rad"]["value"] == pytest.approx(11 * 1.3 * 2000, rel=0.1)
    assert aligning["cornering_stiffness_N_per_rad"] is None
    assert aligning["aligning_stiffness_Nm_per_rad"]["value"] > 0


def test_stiffness_is_positive_in_every_right_axis_system(tire):
    mirrored = tire.read_text().splitlines()
    turned = [mirrored[0]]
    for line in mirrored[1:]:
        SA, rest = line.split(",", 1)
        turned.append(f"{-float(SA)},{rest}")
    tire.write_text("\n".join(turned) + "\n")
    code, out = run(tire, "--axes", "adapted-SAE", "--json")
    assert code == 0
    assert all(
        (one["cornering_stiffness_N_per_rad"] or one["aligning_stiffness_Nm_per_rad"])["value"] > 0
        for one in json.loads(out)["fits"]
    )


def test_contradicted_axes_end_with_one(tire):
    code, out = run(tire, "--axes", "adapted-SAE", "--json")
    assert code == 1
    assert {finding["rule"] for finding in json.loads(out)["findings"]} >= {"axes-contradiction"}


def test_text_names_loads_errors_and_axes(tire):
    code, out = run(tire)
    assert code == 0
    assert "2000" in out
    assert "4000" in out
    assert "error %" in out
    assert "axes SAE" in out


def test_quiet_prints_nothing_and_the_same_run_gives_the_same_answer(tire):
    assert run(tire, "--quiet") == (0, "")
    first, second = (json.loads(run(tire, "--json")[1]) for _ in range(2))
    first.pop("timing")
    second.pop("timing")
    assert first == second


@pytest.mark.parametrize(
    ("arguments", "rule"),
    [
        (["--model", "no_such_model"], "unknown-model"),
        (["--tir", "out.tir"], "tir-needs-global"),
        (["--loss", "huber"], "unknown-loss"),
        (["--axes", "ISO"], "unknown-axes"),
    ],
)
def test_wrong_options_are_bad_input(tire, arguments, rule):
    with pytest.raises(ToolkitError) as caught:
        run(tire, *arguments)
    assert caught.value.rule == rule
    assert caught.value.exit_code == 2
    assert caught.value.next_step


def test_three_points_are_bad_input(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text("SA [deg],FZ [N],FY [N]\n-1,2000,300\n0,2000,5\n1,2000,-290\n")
    with pytest.raises(ToolkitError) as caught:
        run(path)
    assert caught.value.rule == "too-few-points"
    assert str(path) in caught.value.where


def test_a_table_without_a_load_is_bad_input(tmp_path, tire):
    path = tmp_path / "airborne.csv"
    head, *lines = tire.read_text().splitlines()
    cells = [line.split(",") for line in lines]
    path.write_text("\n".join([head, *(f"{SA},0,{FY},{MZ}" for SA, _, FY, MZ in cells)]) + "\n")
    with pytest.raises(ToolkitError, match="load is missing") as caught:
        run(path)
    assert caught.value.exit_code == 2
    assert str(path) in caught.value.where


def test_exact_data_have_standard_errors(tmp_path):
    path = tmp_path / "exact.csv"
    truth = {"B": 12.0, "C": 1.4, "D": -2100.0, "E": -0.6, "Sh": 0.004, "Sv": 15.0}
    degrees = np.linspace(-12.0, 12.0, 61)
    FY = value(tuple(truth.values()), np.radians(degrees))
    rows = [f"{a!r},2000,{b!r}" for a, b in zip(degrees.tolist(), FY.tolist(), strict=True)]
    path.write_text("\n".join(["SA [deg],FZ [N],FY [N]", *rows]) + "\n")
    code, out = run(path, "--json")
    one = json.loads(out)["fits"][0]
    assert code == 0
    assert one["not_determined"] == []
    assert one["parameters"] == pytest.approx(truth, rel=1e-8)
    assert all(0 < error < 1e-8 * abs(truth[name]) for name, error in one["standard_errors"].items())


def sweep(noise_N, loads=(4000.0,), count=41):
    """Return rows of a sweep as text, the Magic Formula's own curve and white noise."""
    rng, lines = np.random.default_rng(4), []
    for load in loads:
        SA = np.radians(np.linspace(-10, 10, count))
        FY = value(np.array([9.0, 1.4, -load, 0.1, 0.0, 0.0]), SA) + rng.normal(0, 1, count) * noise_N
        MZ = (
            value(np.array([7.0, 2.2, load / 40, -0.5, 0.0, 0.0]), SA)
            + rng.normal(0, 1, count) * noise_N / 20
        )
        lines += [f"{np.degrees(a):.3f},{load:g},{y:.3f},{m:.3f}" for a, y, m in zip(SA, FY, MZ, strict=True)]
    return lines


@pytest.mark.parametrize("loss", ["linear", "robust"])
@pytest.mark.parametrize("noise_N", [0.0, 8.0])
@pytest.mark.parametrize("place", [0, 20, 41])
def test_two_hundred_copies_of_a_row_are_told_and_leave_the_curve_to_the_others(
    tmp_path, loss, noise_N, place
):
    rows = sweep(noise_N)
    copies = rows[:place] + [rows[min(place, 40)]] * 200 + rows[place:]
    answers = []
    for name, lines in (("plain", rows), ("copies", copies)):
        (tmp_path / f"{name}.csv").write_text("\n".join(["SA [deg],FZ [N],FY [N],MZ [N*m]", *lines]) + "\n")
        answers.append(run(tmp_path / f"{name}.csv", "--loss", loss, "--json"))
    (_, plain), (code, found) = answers
    assert code == 1
    told = [one for one in json.loads(found)["findings"] if one["level"] != "note"]
    # No row is called an outlier because it is no copy.
    assert {one["rule"] for one in told} <= {"duplicates", "not-converged"}
    assert "200 of 241 rows are copies of others, one of them stands 201 times" in told[0]["message"]
    for one, other in zip(json.loads(plain)["fits"], json.loads(found)["fits"], strict=True):
        stiffness = [fit["cornering_stiffness_N_per_rad"] for fit in (one, other)]
        if one["channel"] == "FY":
            assert stiffness[1]["value"] == pytest.approx(stiffness[0]["value"], rel=0.01)


def test_a_few_equal_rows_are_no_finding(tmp_path):
    rows = sweep(8.0)
    (tmp_path / "x.csv").write_text("\n".join(["SA [deg],FZ [N],FY [N],MZ [N*m]", *rows, *rows[:4]]) + "\n")
    code, out = run(tmp_path / "x.csv", "--json")
    assert (code, [one for one in json.loads(out)["findings"] if one["level"] != "note"]) == (0, [])


@pytest.mark.parametrize(("name", "way"), [("a.tdx", "toolkit convert a.tdx a.csv"), ("a.txt", "a.csv")])
def test_a_file_of_another_kind_is_told_the_way_to_a_table(tmp_path, name, way):
    (tmp_path / name).write_text("**HEADER\n")
    with pytest.raises(ToolkitError) as caught:
        run(tmp_path / name)
    assert (caught.value.exit_code, caught.value.rule) == (2, "fit-source")
    assert way in caught.value.next_step
