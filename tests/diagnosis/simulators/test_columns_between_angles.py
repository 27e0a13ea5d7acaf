"""Simulated columns at few slip angles: the tire between them, and what cannot be judged for want of it."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import ONE, write_case
from tests.diagnosis.tire_case import toml
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.columns import ColumnsModel
from toolkit.diagnosis.simulators.surface import Surface, scatter
from toolkit.diagnosis.simulators.tire import base_drive
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import ConfigError

ANGLES = np.array([-0.3, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10.0])
LOADS = np.array([1112, 2522, 3705, 4897, 6103.0])
COLUMNS = toml('kind = "columns"\nsimulated = { FY = "FY_sim", MZ = "MZ_sim" }', mu="", runs=ONE)


def magic(SA, FZ):
    """Return FY of the Magic Formula with plysteer and conicity, SAE; slip angle in deg."""
    x = np.deg2rad(SA) + 0.002
    D, K = FZ * (1.05 - 1.5e-5 * FZ), 70e3 * np.sin(2 * np.arctan(FZ / 4500))
    B = K / (1.4 * D)
    return -D * np.sin(1.4 * np.arctan(B * x + 0.8 * (B * x - np.arctan(B * x)))) + 0.01 * FZ


def brush(SA, FZ, *, shorter=1.0):
    """Return FY and MZ of a brush on a parabola of pressure (Pacejka 2012, 3.2.1), SAE; slip angle in deg."""
    a = 0.06 * np.sqrt(FZ / 4000) * shorter
    slip = np.tan(np.deg2rad(SA))
    u = np.minimum(np.abs(slip) * 2 * 8e6 * a**2 / (3 * FZ), 1.0)
    s = np.sign(slip)
    return -3 * FZ * s * (u - u**2 + u**3 / 3), FZ * a * s * u * (1 - u) ** 3


def table(*, angles=ANGLES, FY=magic, noise=0.0, recorded=None, seed=0):
    """Return every load at every angle, three rows each, simulated and recorded."""
    rng = np.random.default_rng(seed)
    SA = np.repeat(angles, 3 * len(LOADS))
    FZ = np.tile(np.repeat(LOADS, 3), len(angles)) + rng.normal(0, 8, len(SA))
    simulated = FY(SA, FZ), brush(SA, FZ)[1]
    real = simulated if recorded is None else recorded(SA, FZ)
    made = {
        "t": 0.25 * np.arange(len(SA)),
        "SA": SA,
        "FZ": FZ,
        "FY_sim": simulated[0],
        "MZ_sim": simulated[1],
    }
    made["FY"] = real[0] + rng.normal(0, max(noise, 1e-9), len(SA))
    made["MZ"] = real[1] + rng.normal(0, max(noise, 1e-9) / 20, len(SA))
    return pd.DataFrame(made)


def written(folder, *frames):
    runs = "".join(f'[[recording.run]]\nfile = "r{i}.csv"\n' for i in range(len(frames)))
    files = {f"r{i}__csv": frame for i, frame in enumerate(frames)}
    return read_case(write_case(folder, COLUMNS.replace(ONE, runs), simulator=None, **files))


def asked(case, SA, FZ):
    """Return FY and MZ of the surface at other slip angles [deg] and loads."""
    run = case.runs[0]
    surface, start = Surface(case), base_drive(case, run, load_N=4000.0, outputs=False)
    return [
        run.simulated[name] + surface.difference(name, run, np.deg2rad(SA), FZ, start)
        for name in ("FY", "MZ")
    ]


@pytest.mark.parametrize("share", [0.75, 0.87, 0.95, 1.05])
def test_a_table_of_thirteen_angles_gives_the_tire_between_them(tmp_path, share):
    case = written(tmp_path, table())
    SA, FZ = share * case.runs[0].columns["SA"], case.runs[0].columns["FZ"]
    FY, MZ = asked(case, SA, FZ)
    # Largest force 6 kN, largest moment 70 N·m
    np.testing.assert_allclose(FY, magic(SA, FZ), atol=30)
    np.testing.assert_allclose(MZ, brush(SA, FZ)[1], atol=2.5)
    assert np.sqrt(np.mean((FY - magic(SA, FZ)) ** 2)) < 8
    assert np.sqrt(np.mean((MZ - brush(SA, FZ)[1]) ** 2)) < 0.6


def test_at_the_points_of_a_table_its_own_values_stand(tmp_path):
    case = written(tmp_path, table())
    run = case.runs[0]
    other = np.random.default_rng(1).permutation(run.rows)
    FY, MZ = asked(case, run.columns["SA"][other], run.columns["FZ"][other])
    np.testing.assert_allclose(FY, run.simulated["FY"][other], atol=1.0)
    np.testing.assert_allclose(MZ, run.simulated["MZ"][other], atol=0.05)


def test_between_angles_a_force_that_falls_has_no_wiggle(tmp_path):
    frame = table(FY=lambda SA, FZ: brush(SA, FZ)[0])
    case = written(tmp_path, frame)
    for load in (1500.0, 4000.0, 6000.0):
        SA = np.linspace(-10, 10, len(frame))
        FY, _ = asked(case, SA, np.full(len(SA), load))
        # A brush never rises again: beyond its sliding angle it stays at mu FZ, here FZ.
        assert np.diff(FY).max() < 2e-4 * load
        assert np.abs(FY).max() < 1.01 * load


@pytest.mark.parametrize("angles", [ANGLES, np.array([-8, -4, -2, -1, 0, 1, 2, 4, 8.0])])
def test_the_error_between_angles_is_known_by_its_size(tmp_path, angles):
    case = written(tmp_path, table(angles=angles))
    SA, FZ = 0.9 * case.runs[0].columns["SA"], case.runs[0].columns["FZ"]
    between = Surface(case).between
    FY, MZ = asked(case, SA, FZ)
    for name, away in {"FY": FY - magic(SA, FZ), "MZ": MZ - brush(SA, FZ)[1]}.items():
        wrong = float(np.sqrt(np.mean(away**2)))
        assert wrong < between[name] < 20 * wrong


@pytest.mark.parametrize(("noise", "judged"), [(0.5, False), (400.0, True)])
def test_few_angles_under_little_noise_are_judged_by_what_is_known_between_them(tmp_path, noise, judged):
    case = written(tmp_path, table(angles=np.array([-10, -5, -2, 2, 5, 10.0]), noise=noise))
    assert scatter(case, "FY", 4000.0) == pytest.approx(noise, rel=0.2)
    model = ColumnsModel(case)
    SA, FZ = 0.9 * case.runs[0].columns["SA"], case.runs[0].columns["FZ"]
    wrong = float(np.sqrt(np.mean((asked(case, SA, FZ)[0] - magic(SA, FZ)) ** 2)))
    floor = problem_of(case, model).floor["FY"]
    assert floor < 1e-3 if judged else floor > wrong > noise
    assert [one.rule for one in model.capability.findings] == ([] if judged else ["case-few-slip-angles"] * 2)


def test_a_sweep_knows_the_tire_between_its_rows(tmp_path):
    SA = 9 * np.sin(np.arange(300) / 20)
    FZ = 4000 + 1500 * np.sin(np.arange(300) / 7)
    rng = np.random.default_rng(3)
    FY = magic(SA, FZ)
    frame = pd.DataFrame({"t": 0.1 * np.arange(300), "SA": SA, "FZ": FZ, "FY_sim": FY})
    frame["MZ_sim"] = brush(SA, FZ)[1]
    frame["FY"], frame["MZ"] = FY + rng.normal(0, 8, 300), frame["MZ_sim"] + rng.normal(0, 0.4, 300)
    case = written(tmp_path, frame)
    made, _ = asked(case, 0.9 * SA, FZ)
    np.testing.assert_allclose(made, magic(0.9 * SA, FZ), atol=8)
    assert ColumnsModel(case).capability.findings == ()


@pytest.mark.campaign("a whole diagnosis: the flat table against the drum is a brush's in every run")
def test_a_drum_against_a_table_of_columns_is_the_shorter_patch(tmp_path):
    # Stiffness of force as the patch length squared, of moment as its cube; the peak stays.
    def drum(SA, FZ):
        return brush(SA, FZ, shorter=np.sqrt(0.86))

    frames = [table(FY=lambda SA, FZ: brush(SA, FZ)[0], recorded=drum, noise=20.0, seed=i) for i in range(2)]
    made = diagnose(written(tmp_path, *frames), None).diagnosis
    assert [one.name for one in made.effects] == ["drum_curvature"]
    reduction = next(one for one in made.effects[0].parameters if one.name == "reduction")
    assert reduction.value == pytest.approx(0.14, abs=0.01)


def test_an_effect_of_no_size_leaves_the_columns_as_they_are(tmp_path):
    case = written(tmp_path, table())
    curved = AppliedEffect(effect=effects()["drum_curvature"], values={"reduction": 0.0})
    made = ColumnsModel(case).simulate(case.runs[0], {}, [curved])
    np.testing.assert_allclose(made["FY"], case.runs[0].simulated["FY"], atol=1e-9)


def test_a_direction_that_no_run_has_is_not_predicted(tmp_path):
    path = written(tmp_path, table(noise=2.0)).path
    table(noise=2.0, seed=1).to_csv(tmp_path / "ahead.csv", index=False)
    with path.open("a", encoding="utf-8") as file:
        file.write('[[recording.predict]]\nfile = "ahead.csv"\nrotation = "reverse"\n')
    with pytest.raises(ConfigError, match="not known in this direction"):
        diagnose(read_case(path), None)
