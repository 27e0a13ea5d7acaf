"""What the four physical models share: signs, limits, shapes, units; and fits of each other's curves."""

import numpy as np
import pytest

from tests.conftest import SHARED_DATA
from toolkit.simulation.tire import aligning_moment, lateral_force
from toolkit.tires.global_data import measured
from toolkit.tires.global_fit import fit_global
from toolkit.tires.global_model import make_rows
from toolkit.tires.models import find

F0 = 3705.0
# A passenger tire in each model's words.
TIRES = {
    "brush": {"C": 18.0, "C_Z": -0.5, "MU": 0.95, "MU_Z": -0.06, "A": 0.08, "A_P": 0.6},
    "tmeasy": {
        "dFy0": 17.0, "dFy0_Z": -0.5, "FyM": 0.95, "FyM_Z": -0.06, "syM": 0.16, "syM_Z": 0.2, "FyD": 0.1,
        "syD": 0.44, "FxD": 0.2, "n0": 0.028, "n0_Z": 0.1, "sy0": 0.13, "syED": 0.17,
    },
    "treadsim": {
        "C": 26.0, "C_Z": -0.3, "A": 0.075, "A_P": 0.5, "N": 4.0, "SKEW": 0.2, "MU": 1.05, "MU_P": 0.1,
        "MU_V": 0.02, "YAW": 0.3, "BEND": 0.2,
    },
    "lugre": {
        "C": 18.0, "C_Z": -0.5, "MU": 1.2, "MU_Z": -0.06, "R": 0.8, "VS": 3.0, "L": 0.16, "TOP": 0.6,
        "FRONT": 0.4,
    },
}  # fmt: skip
OFFSETS = {"SH": 0.004, "SV": 0.02, "SM": 1e-3}
NAMES = tuple(TIRES)
ALL = pytest.mark.parametrize("name", NAMES)
LONG = pytest.mark.campaign("the slowest fits: each model describes a published tire in every run")
# The M-15's own plan: 13 slip angles [deg], five loads [N].
ANGLES = (0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10)
LOADS = (1112.0, 2522.0, 3705.0, 4898.0, 6103.0)
# The largest errors of thesis table 3.1 among the physical models: a fit that does worse has missed.
WORST_FY, WORST_MZ = 4.85, 25.29


def at(name, SA, FZ=F0, given=None, **more):
    model = find(name)
    values = model.values({**TIRES[name], **(given or {})})
    return model.forces(values, make_rows(SA, FZ, FNOMIN=F0, **more))


def table(name, given=None, noise=0.0):
    SA, FZ = (one.ravel() for one in np.meshgrid(np.radians(ANGLES), LOADS))
    o = at(name, SA, FZ, given)
    rng = np.random.default_rng(5)
    FY = o.FY * (1 + noise * rng.standard_normal(len(SA)))
    return measured({"SA": SA, "FZ": FZ, "FY": FY, "MZ": o.MZ}, axes="SAE")


@ALL
def test_signs_are_those_of_SAE(name):
    o = at(name, np.radians([-4.0, 4.0]))
    assert o.FY[0] > 0 > o.FY[1]
    assert o.MZ[0] < 0 < o.MZ[1]
    driven = at(name, 0.0, KAPPA=[-0.05, 0.05])
    assert driven.FX[0] < 0 < driven.FX[1]


@ALL
def test_a_tire_without_offsets_is_odd_and_offsets_shift_it(name):
    SA = np.radians(np.linspace(0.1, 14, 30))
    one, other = at(name, SA), at(name, -SA)
    np.testing.assert_allclose(one.FY, -other.FY, rtol=1e-9)
    np.testing.assert_allclose(one.MZ, -other.MZ, rtol=1e-7, atol=1e-9)
    moved = at(name, -OFFSETS["SH"], given=OFFSETS)
    assert moved.FY[0] == pytest.approx(F0 * OFFSETS["SV"], rel=1e-9)
    assert moved.MZ[0] == pytest.approx(F0 * OFFSETS["SM"], rel=1e-9)


@ALL
def test_no_load_and_no_slip_give_nothing(name):
    for o in (at(name, 0.0, [0.0, 500.0, 9000.0]), at(name, [0.1, -0.3], 0.0, OFFSETS, KAPPA=0.1, IA=0.05)):
        for channel in ("FX", "FY", "MZ"):
            np.testing.assert_allclose(o[channel], 0.0, atol=1e-9)


@ALL
def test_forces_are_finite_everywhere_within_the_bounds(name):
    model = find(name)
    rng = np.random.default_rng(11)
    angle = np.radians([-90, -30, -5, -1e-9, 0, 1e-12, 2, 12, 45, 90, 3, 3, 3, 3.0])
    KAPPA = np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1, -0.5, 4, -2.0])
    SA, FZ = (one.ravel() for one in np.meshgrid(angle, [0.0, 1e-9, 50.0, 3000.0, 40_000.0]))
    rows = make_rows(
        SA, FZ, KAPPA=np.tile(KAPPA, 5), IA=np.tile([0.0, 0.1], 35), V=np.tile([0.0, 2.0], 35), FNOMIN=F0
    )
    low, high = (np.array([getattr(p, side) for p in model.parameters]) for side in ("low", "high"))
    for values in (low, high, *(rng.uniform(low, high) for _ in range(25))):
        o = model.forces(values, rows)
        for channel in ("FX", "FY", "MZ"):
            assert np.isfinite(o[channel]).all()


@ALL
def test_many_parameter_sets_at_once_are_each_by_itself(name):
    model = find(name)
    rng = np.random.default_rng(2)
    base = model.values(TIRES[name])
    sets = base * rng.uniform(0.95, 1.02, (6, len(base)))
    SA, FZ = (one.ravel() for one in np.meshgrid(np.radians(ANGLES), LOADS))
    rows = make_rows(SA, FZ, FNOMIN=F0)
    together = model.forces([sets[:, [i]] for i in range(len(base))], rows)
    for index, one in enumerate(sets):
        alone = model.forces(one, rows)
        for channel in ("FY", "MZ"):
            np.testing.assert_allclose(together[channel][index], alone[channel], rtol=1e-7, atol=1e-6)


@ALL
def test_rows_are_independent_of_each_other(name):
    SA, FZ = (one.ravel() for one in np.meshgrid(np.radians(ANGLES), LOADS))
    o = at(name, SA, FZ)
    for i in (0, 7, 40):
        alone = at(name, SA[i], FZ[i])
        assert alone.FY[0] == pytest.approx(o.FY[i], rel=1e-9, abs=1e-6)
        assert alone.MZ[0] == pytest.approx(o.MZ[i], rel=1e-7, abs=1e-6)


@ALL
def test_other_units_of_force_and_length_only_scale_the_answer(name):
    # lbf for N and in for m: every parameter that has a length is scaled, nothing else is.
    model = find(name)
    pound, inch, foot_free = 4.4482216, 0.0254, {"s/m": 1.0, "m/s": 1.0}
    values = model.values({**TIRES[name], "SM": 1e-3})
    scaled = [
        v / inch if p.unit == "m" else v * foot_free.get(p.unit, 1.0)
        for v, p in zip(values, model.parameters, strict=True)
    ]
    SA = np.radians(np.linspace(-12, 12, 13))
    metric = model.forces(values, make_rows(SA, 3000.0, FNOMIN=F0, UNLOADED_RADIUS=0.3))
    other = model.forces(scaled, make_rows(SA, 3000.0 / pound, FNOMIN=F0 / pound, UNLOADED_RADIUS=0.3 / inch))
    np.testing.assert_allclose(other.FY * pound, metric.FY, rtol=1e-8)
    np.testing.assert_allclose(other.MZ * pound * inch, metric.MZ, rtol=1e-7, atol=1e-7)


@ALL
def test_a_larger_load_gives_a_larger_force_and_a_smaller_share_of_it(name):
    FZ = np.linspace(800, 7000, 40)
    FY = -at(name, np.radians(6.0), FZ).FY
    assert np.all(np.diff(FY) > 0)
    assert np.all(np.diff(FY / FZ) < 0)


@ALL
def test_camber_thrust_points_towards_the_lean(name):
    given = {} if name == "treadsim" else {"K_IA": 0.1}
    o = at(name, 0.0, IA=np.radians([-4.0, 4.0]), given=given)
    assert o.FY[0] < 0 < o.FY[1]


@pytest.mark.parametrize("name", ["brush", "treadsim", "lugre"])
def test_a_locked_wheel_is_dragged_against_its_velocity(name):
    SA = np.radians([0.0, 20.0, -50.0, 80.0])
    o = at(name, SA, KAPPA=-1.0, V=0.0)
    size = np.hypot(o.FX, o.FY)
    np.testing.assert_allclose(size, size[0], rtol=1e-3)  # friction does not ask where the wheel points
    np.testing.assert_allclose(o.FX / size, -np.cos(SA), atol=1e-3)
    np.testing.assert_allclose(o.FY / size, -np.sin(SA), atol=1e-3)


@ALL
def test_every_parameter_acts(name):
    model = find(name)
    base = model.values({**TIRES[name], **OFFSETS})
    SA, FZ, KAPPA, IA = (
        one.ravel()
        for one in np.meshgrid(np.radians([-8.0, 1.0, 5.0, 20.0]), LOADS, [0.0, 0.08, 0.4], [0.0, 0.05])
    )
    rows = make_rows(SA, FZ, KAPPA=KAPPA, IA=IA, FNOMIN=F0)
    before = model.forces(base, rows)
    for place, one in enumerate(model.parameters):
        moved = base.copy()
        moved[place] += one.size if moved[place] + one.size <= one.high else -one.size
        after = model.forces(moved, rows)
        change = max(np.abs(after[c] - before[c]).max() for c in ("FX", "FY", "MZ"))
        assert change > 1e-6 * F0, one.name


@pytest.mark.parametrize("name", [pytest.param(name, marks=[LONG] * (name == "lugre")) for name in NAMES])
def test_a_model_finds_its_own_curves_again_without_start_values(name):
    fitted = fit_global(find(name), table(name, OFFSETS), predict=False)
    for channel in ("FY", "MZ"):
        one = fitted.fit(channel)
        assert one.error_percent < 0.05, one.message
        assert one.converged, one.message
    if name == "brush":
        found = dict(zip(find(name).names, fitted.values, strict=True))
        for key, value in {**TIRES[name], **OFFSETS}.items():
            assert found[key] == pytest.approx(value, rel=1e-4, abs=1e-6), key


@pytest.mark.parametrize(
    ("truth", "name"),
    [("treadsim", "brush"), ("brush", "tmeasy"), pytest.param("lugre", "treadsim", marks=LONG)],
)
def test_a_model_comes_near_the_curves_of_another(truth, name):
    fitted = fit_global(find(name), table(truth), predict=False)
    # Another shape: not exact, and still within what physical models reach on measured tires.
    assert 1e-3 < fitted.fit("FY").error_percent < WORST_FY
    assert 1e-3 < fitted.fit("MZ").error_percent < WORST_MZ


@ALL
def test_a_published_passenger_tire_is_described(name):
    SA, FZ = (one.ravel() for one in np.meshgrid(np.radians(ANGLES), LOADS))
    FY = lateral_force(slip_angle=-SA, load=FZ)  # its slip angle is that of the adapted SAE axes
    MZ = aligning_moment(slip_angle=-SA, load=FZ)
    fitted = fit_global(
        find(name), measured({"SA": SA, "FZ": FZ, "FY": FY, "MZ": MZ}, axes="SAE"), predict=False
    )
    assert fitted.fit("FY").converged
    assert fitted.fit("FY").error_percent < WORST_FY
    assert fitted.fit("MZ").error_percent < WORST_MZ


@pytest.mark.skipif(not SHARED_DATA.is_dir(), reason="no shared data")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=LONG) if name in ("treadsim", "tmeasy", "lugre") else name for name in NAMES],
)
def test_a_real_cornering_run_is_described(name):
    d = np.genfromtxt(SHARED_DATA / "ttc_cornering" / "cornering_IA0_P83kPa.csv", delimiter=",", names=True)
    data = measured(
        {"SA": np.radians(d["SA_deg"]), "FZ": np.abs(d["FZ_N"]), "FY": d["FY_N"], "MZ": d["MZ_Nm"],
         "V": d["V_kph"] / 3.6}, axes="SAE",
    )  # fmt: skip
    fitted = fit_global(find(name), data, predict=False)
    for channel, worst in (("FY", WORST_FY), ("MZ", WORST_MZ)):
        if (name, channel) == ("brush", "MZ"):
            continue  # its moment ends where its FY says that all slides: it misses this tire's
        one = fitted.fit(channel)
        assert one.converged, one.message
        beyond = np.sqrt(one.error_percent**2 - one.scatter_floor_percent**2)
        assert 0.5 < beyond < worst  # no model is the tire, and none does better than its scatter
