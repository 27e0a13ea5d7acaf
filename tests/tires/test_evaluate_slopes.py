"""The slope at zero of every tire model, against the slope that the model's own equations state."""

import math

import numpy as np
import pytest

from toolkit.tires.evaluate import limit_slope, stiffness
from toolkit.tires.global_data import measured
from toolkit.tires.global_fit import fit_global
from toolkit.tires.global_model import GlobalModel, make_rows
from toolkit.tires.models import find, model_names

F0, FZ = 4000.0, 3000.0
RADIUS = 0.3
DFZ = FZ / F0 - 1
GLOBAL = tuple(name for name in model_names() if isinstance(find(name), GlobalModel))
# The initial slopes that the sources state, dFY/dSA and dMZ/dSA at SA = 0 in the model's axes, by parameters
# that have no camber, no shift and no offset.
BRUSH = {"C": 36.3, "C_Z": -0.4, "A": 0.0476, "A_P": 0.5}
TMEASY = {"dFy0": 34.9, "dFy0_Z": -0.2, "n0": 0.03}
TREADSIM = {"C": 30.0, "C_Z": -0.3, "A": 0.07, "A_P": 0.5, "YAW": 0.3, "BEND": 0.2, "MU_V": 0.02}
LUGRE = {"C": 25.0, "C_Z": -0.4, "L": 0.16, "L_P": 0.5, "TOP": 1.0, "R": 0.7}
MF = {"PKY1": -22.0, "PKY2": 1.8, "PDY1": 1.0, "QDZ1": 0.11, "QBZ1": 9.0}
P94 = {"a1": -20.0, "a2": 950.0, "a3": 1300.0, "a4": 6.0, "c3": -1.2, "c4": -2.1, "c5": 0.05}


def _brush():
    # Pacejka (2012), 3.2: CF, and CF a/3.
    CF = FZ * BRUSH["C"] * math.exp(BRUSH["C_Z"] * DFZ)
    return -CF, CF * BRUSH["A"] * math.sqrt(FZ / F0) / 3


def _tmeasy():
    # Rill (2012), 3.3: dF0, and the trail (n/L)0 L.
    CF = FZ * TMEASY["dFy0"] * (1 + TMEASY["dFy0_Z"] * DFZ)
    return -CF, CF * TMEASY["n0"] * math.sqrt(FZ / F0)


def _treadsim():
    # A tread that adheres everywhere on a carcass that yaws by MZ and bends by FY: the slip that is left is
    # the slip over 1 + yaw CM, and FY is lowered by bending once more.
    C = TREADSIM["C"] * math.exp(TREADSIM["C_Z"] * DFZ)
    a, softness = TREADSIM["A"] * math.sqrt(FZ / F0), FZ / F0 * C / TREADSIM["C"]
    yaw, bend = 1 + TREADSIM["YAW"] * softness * math.sqrt(FZ / F0), 1 + TREADSIM["BEND"] * softness
    return -FZ * C / (yaw * bend), FZ * C * a / (3 * yaw)


def _lugre():
    # A uniform pressure: bristles deflect in proportion to their way, d = sigma x, so that FY = C FZ sigma
    # and MZ = (2 C FZ sigma / L) int (x/L - 1/2) x dx = C FZ L/6 sigma.
    CF = FZ * LUGRE["C"] * math.exp(LUGRE["C_Z"] * DFZ)
    return -CF, CF * LUGRE["L"] * math.sqrt(FZ / F0) / 6


def _mf():
    # Pacejka (2012), 4.E25 and 4.E42: K_y, and minus the peak trail times it.
    K = MF["PKY1"] * F0 * math.sin(2 * math.atan(FZ / (MF["PKY2"] * F0)))
    return K, -K * FZ * RADIUS / F0 * MF["QDZ1"]


def _pacejka94():
    # Thesis, table 4.1: BCD, per degree.
    F = FZ / 1000
    return tuple(
        math.degrees(per_degree)
        for per_degree in (
            P94["a3"] * math.sin(2 * math.atan(F / P94["a4"])),
            (P94["c3"] * F * F + P94["c4"] * F) * math.exp(-P94["c5"] * F),
        )
    )


STATED = {
    "brush": (BRUSH, _brush, ("MU",)), "tmeasy": (TMEASY, _tmeasy, ("FyM",)),
    "treadsim": (TREADSIM, _treadsim, ("MU",)), "lugre": (LUGRE, _lugre, ("MU",)),
    "mf52": (MF, _mf, ("PDY1",)), "mf61": (MF, _mf, ("PDY1",)), "mf62": (MF, _mf, ("PDY1",)),
    "pacejka94": (P94, _pacejka94, ()),
}  # fmt: skip
LIKE = make_rows(0.0, F0, FNOMIN=F0, UNLOADED_RADIUS=RADIUS)


def slopes(name, given):
    model = find(name)
    values = list(model.values(given))
    return tuple(
        float(stiffness(model, values, load=FZ, like=LIKE, channel=channel)) for channel in ("FY", "MZ")
    )


@pytest.mark.parametrize("name", GLOBAL)
@pytest.mark.parametrize("friction", [1.0, 0.3, 0.05])
def test_the_slope_of_every_model_is_the_one_that_its_equations_state_whatever_the_friction(name, friction):
    given, stated, limits = STATED[name]
    at_zero = slopes(name, {**given, **dict.fromkeys(limits, friction)})
    # The bristles of TreadSim are summed: some parts in ten thousand of the integral.
    assert at_zero == pytest.approx(stated(), rel=5e-4 if name == "treadsim" else 1e-8)


@pytest.mark.parametrize("name", GLOBAL)
def test_the_slope_is_the_limit_of_force_over_angle(name):
    model = find(name)
    given, _, limits = STATED[name]
    values = list(model.values({**given, **dict.fromkeys(limits, 0.3)}))
    for channel, slope in zip(
        ("FY", "MZ"), slopes(name, {**given, **dict.fromkeys(limits, 0.3)}), strict=True
    ):
        departures = []
        for h in (1e-4, 1e-5, 1e-6):
            rows = make_rows([h], FZ, FNOMIN=F0, UNLOADED_RADIUS=RADIUS)
            departures.append(abs(float(model.forces(values, rows)[channel][0]) / h / slope - 1))
        assert departures[2] < 1e-3
        # It goes down with the angle, to where rounding takes over.
        assert departures[2] < 0.5 * departures[0] or departures[0] < 1e-6


@pytest.mark.parametrize("shift", [0.0, 1e-7, 3e-5, 1e-3, 0.02])
@pytest.mark.parametrize("friction", [1.0, 0.1])
def test_a_brush_with_a_steering_zero_has_the_slope_of_its_cubic_at_that_angle(shift, friction):
    # F = CF (s - theta s^2 + theta^2 s^3 / 3) with s = tan(SH): dF/ds = CF (1 - theta s)^2.
    C = 20.0
    theta = C / (3 * friction)
    s = math.tan(shift)
    expected = -FZ * C * max(1 - theta * s, 0.0) ** 2 * (1 + s * s)
    slope, _ = slopes("brush", {"C": C, "MU": friction, "SH": shift})
    assert slope == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_magic_formula_of_one_load_states_its_slope_itself():
    model = find("magic_formula")
    values = np.array([12.0, 1.4, 3000.0, -0.8, 0.006, 120.0])
    for SA in (-0.05, -0.006, 0.0, 0.1):
        slope = float(limit_slope(lambda angle: model.value(values, angle), SA))
        assert float(model.slope(values, SA)) == pytest.approx(slope, rel=1e-9)


@pytest.mark.parametrize(("C", "mu"), [(36.3, 0.3), (20.0, 1.0)])
def test_the_stiffness_of_a_fit_to_an_exact_brush_is_that_of_the_brush(C, mu):
    # Rows of the brush's published cubic, written out: no code of the model takes part.
    SA = np.radians(np.arange(-12.0, 12.25, 0.5))
    a, theta = 0.0476, C / (3 * mu)
    ts = np.minimum(theta * np.abs(np.tan(SA)), 1.0)
    FY = -np.sign(SA) * mu * FZ * (1 - (1 - ts) ** 3)
    MZ = -FY * a / 3 * (1 - ts) ** 3 / (1 - ts + ts * ts / 3)
    fit = fit_global(
        find("brush"), measured({"SA": SA, "FZ": np.full_like(SA, FZ), "FY": FY, "MZ": MZ}, axes="SAE")
    )
    assert abs(fit.fit("FY").slope_at_zero.value) == pytest.approx(C * FZ, rel=1e-6)
    assert fit.fit("MZ").slope_at_zero.value == pytest.approx(C * FZ * a / 3, rel=1e-5)
    assert abs(fit.fit("FY").loads[0].stiffness.value) == pytest.approx(C * FZ, rel=1e-6)
