"""MF 5.2 and 6.x combined: limits, symmetries, and sums written out again from the equations."""

import math

import numpy as np
import pytest

from toolkit.tires.mf import equivalent
from toolkit.tires.models import mf52, mf61
from toolkit.tires.slip import state

F0, R0 = 4000.0, 0.3
P = {
    "PCX1": 1.6, "PDX1": 1.1, "PDX2": -0.1, "PDX3": 2.0, "PEX1": 0.3, "PEX2": 0.1, "PEX4": 0.1, "PKX1": 22.0,
    "PKX2": 0.5, "PKX3": 0.2, "PHX1": 1e-3, "PVX1": 2e-3, "RBX1": 12.0, "RBX2": 10.0, "RCX1": 1.1,
    "RHX1": 0.01,
    "PCY1": 1.3, "PDY1": 1.0, "PDY2": -0.1, "PDY3": 1.5, "PEY1": -0.5, "PEY2": -0.3, "PEY3": 0.1, "PEY4": 2.0,
    "PKY1": -20.0, "PKY2": 1.6, "PKY3": 0.4, "PHY1": 2e-3, "PHY2": 1e-3, "PHY3": 0.05, "PVY1": 0.01,
    "PVY3": -0.3, "PVY4": 0.1, "RBY1": 8.0, "RBY2": 7.0, "RBY3": 0.01, "RCY1": 1.05, "RHY1": 0.01,
    "RVY1": 0.04, "RVY3": 0.2, "RVY4": 12.0, "RVY5": 1.9, "RVY6": 20.0,
    "QBZ1": 9.0, "QBZ2": -1.0, "QBZ4": 0.3, "QBZ5": -0.5, "QBZ9": 6.0, "QBZ10": 0.2, "QCZ1": 1.15,
    "QDZ1": 0.1, "QDZ2": -0.005, "QDZ3": 0.2, "QDZ4": -1.0, "QDZ6": 2e-3, "QDZ7": 1e-3, "QDZ8": -0.1,
    "QDZ9": 0.05, "QEZ1": -2.0, "QEZ4": 0.2, "QHZ1": 3e-3, "QHZ3": 0.05, "SSZ1": 0.02,
    "SSZ2": 0.01, "SSZ3": 0.3,
}  # fmt: skip
MORE = {
    "PKY6": -1.0,
    "PKY7": 0.1,
    "QDZ10": 0.3,
    "PPX1": 0.1,
    "PPY1": 0.3,
    "PPY2": 0.5,
    "PPZ1": -0.3,
    "NOMPRES": 1,
}
SA = np.radians(np.linspace(-12, 12, 25))
MODELS = pytest.mark.parametrize("model", [mf52, mf61], ids=["5.2", "6.x"])


def forces(model, p=P, **at):
    angles = at.pop("angles", "star")
    q = state(p, **{"SA": 0.0, "FZ": F0, "FNOMIN": F0, **at}, angles=angles)
    return model.forces(p, q, UNLOADED_RADIUS=R0)


def written_out(SA, FZ, IA, KAPPA, *, version):
    """The sums once more, scalar, by hand from Pacejka (2002; 2012) and Besselink (2010)."""
    c = {**dict.fromkeys("QBZ3 QEZ2 QEZ3 QEZ5 QHZ2 QHZ4 PHX2 PVX2 PVY2 REX1 SSZ4".split(), 0.0), **P}
    a, g, df = math.tan(SA), math.sin(IA), FZ / F0 - 1
    sgn = lambda x: (x > 0) - (x < 0)  # noqa: E731
    curve = lambda B, E, x: B * x - E * (B * x - math.atan(B * x))  # noqa: E731
    # FX
    kx = KAPPA + c["PHX1"]
    Dx = FZ * (c["PDX1"] + c["PDX2"] * df) * (1 - c["PDX3"] * g**2)
    Kx = FZ * (c["PKX1"] + c["PKX2"] * df) * math.exp(c["PKX3"] * df)
    Ex = min(1, (c["PEX1"] + c["PEX2"] * df) * (1 - c["PEX4"] * sgn(kx)))
    FX0 = Dx * math.sin(1.6 * math.atan(curve(Kx / (1.6 * Dx), Ex, kx))) + FZ * c["PVX1"]
    Bxa = c["RBX1"] * math.cos(math.atan(c["RBX2"] * KAPPA))
    FX = FX0 * math.cos(1.1 * math.atan(Bxa * (a + 0.01))) / math.cos(1.1 * math.atan(Bxa * 0.01))

    def lateral(g):
        K = c["PKY1"] * F0 * math.sin(2 * math.atan(FZ / (c["PKY2"] * F0))) * (1 - c["PKY3"] * abs(g))
        Svg = FZ * (c["PVY3"] + c["PVY4"] * df) * g
        Sh = c["PHY1"] + c["PHY2"] * df + (c["PHY3"] * g if version == "5.2" else -Svg / K)
        D = FZ * (c["PDY1"] + c["PDY2"] * df) * (1 - c["PDY3"] * g**2)
        Sv = FZ * c["PVY1"] + Svg
        E = min(1, (c["PEY1"] + c["PEY2"] * df) * (1 - (c["PEY3"] + c["PEY4"] * g) * sgn(a + Sh)))
        B = K / (1.3 * D)
        return D * math.sin(1.3 * math.atan(curve(B, E, a + Sh))) + Sv, D, K, B, Sh + Sv / K

    FY0, D, K, B, shift = lateral(g)
    Byk = c["RBY1"] * math.cos(math.atan(c["RBY2"] * (a - c["RBY3"])))
    Gyk = math.cos(1.05 * math.atan(Byk * (KAPPA + 0.01))) / math.cos(1.05 * math.atan(Byk * 0.01))
    Svyk = D * (c["RVY1"] + c["RVY3"] * g) * math.cos(math.atan(c["RVY4"] * a))
    FY = Gyk * FY0 + Svyk * math.sin(c["RVY5"] * math.atan(c["RVY6"] * KAPPA))
    # MZ
    both = lambda x: math.atan(math.sqrt(math.tan(x) ** 2 + (Kx / K * KAPPA) ** 2)) * sgn(x)  # noqa: E731
    at, ar = a + c["QHZ1"] + c["QHZ3"] * g, a + shift
    Bt = (c["QBZ1"] + c["QBZ2"] * df) * (1 + c["QBZ4"] * g + c["QBZ5"] * abs(g))
    Dt = FZ * R0 / F0 * (c["QDZ1"] + c["QDZ2"] * df) * (1 + c["QDZ3"] * g + c["QDZ4"] * g**2)
    Et = min(1, c["QEZ1"] * (1 + c["QEZ4"] * 2 / math.pi * math.atan(Bt * c["QCZ1"] * at)))
    t = Dt * math.cos(c["QCZ1"] * math.atan(curve(Bt, Et, both(at)))) * math.cos(SA)
    Dr = FZ * R0 * (c["QDZ6"] + c["QDZ7"] * df + (c["QDZ8"] + c["QDZ9"] * df) * g)
    Mr = Dr * math.cos(math.atan((c["QBZ9"] + c["QBZ10"] * B * 1.3) * both(ar))) * math.cos(SA)
    FY_of_trail = Gyk * (FY0 if version == "5.2" else lateral(0.0)[0])
    s = R0 * (c["SSZ1"] + c["SSZ2"] * FY / F0 + c["SSZ3"] * g)
    return FX, FY, -t * FY_of_trail + Mr + s * FX


@pytest.mark.parametrize(("model", "version"), [(mf52, "5.2"), (mf61, "6.x")])
@pytest.mark.parametrize("at", [(0.05, 5000, 0.04, -0.06), (-0.1, 2500, -0.05, 0.1), (0.02, 4000, 0.03, 0.0)])
def test_forces_are_the_sums_written_out(model, version, at):
    SA, FZ, IA, KAPPA = at
    made = forces(model, SA=SA, FZ=FZ, IA=IA, KAPPA=KAPPA)
    expected = written_out(SA, FZ, IA, KAPPA, version=version)
    assert (made.FX, made.FY, made.MZ) == pytest.approx(expected, rel=1e-12)


@MODELS
def test_vector_equals_scalar_and_no_slip_ratio_is_pure_slip(model):
    many = forces(model, SA=SA, IA=0.03, KAPPA=0.05)
    one = forces(model, SA=SA[3], IA=0.03, KAPPA=0.05)
    assert (many.FX[3], many.FY[3], many.MZ[3]) == (one.FX, one.FY, one.MZ)
    # RHY1 = 0 makes kappa = 0 the top of the weight: combined slip is then pure slip.
    p = {**P, "SSZ1": 0.0, "SSZ2": 0.0, "SSZ3": 0.0}
    pure = model.side(p, state(p, SA=SA, FZ=F0, FNOMIN=F0, IA=0.03))
    assert forces(model, p, SA=SA, IA=0.03).FY == pytest.approx(pure.FY, rel=1e-14)


@MODELS
def test_longitudinal_stiffness_is_its_own_equation(model):
    p = {**P, "PHX1": 0.0, "PVX1": 0.0, "PEX4": 0.0, "RHX1": 0.0}
    step = 1e-7
    FX = forces(model, p, KAPPA=np.array([-step, step]), FZ=5000.0).FX
    K = 5000.0 * (22.0 + 0.5 * 0.25) * math.exp(0.2 * 0.25)  # 4.E15
    assert (FX[1] - FX[0]) / (2 * step) == pytest.approx(K, rel=1e-6)


@MODELS
def test_a_tire_without_built_in_asymmetry_mirrors(model):
    odd = "PHY1 PHY2 PVY1 PEY3 RBY3 RVY1 QHZ1 QDZ3 QBZ4 QDZ6 QDZ7 QEZ4 RHX1 SSZ1".split()
    p = {name: value for name, value in {**P, **MORE}.items() if name not in odd}
    left = forces(model, p, SA=SA, IA=0.04, KAPPA=0.05)
    right = forces(model, p, SA=-SA, IA=-0.04, KAPPA=0.05)
    assert left.FX == pytest.approx(right.FX, rel=1e-12)
    assert left.FY == pytest.approx(-right.FY, rel=1e-12, abs=1e-9)
    assert left.MZ == pytest.approx(-right.MZ, rel=1e-12, abs=1e-9)


def test_pressure_scales_what_its_equations_say():
    p = {"PKX1": 20.0, "PCX1": 1.5, "PDX1": 1.0, "PPX1": 0.4, "PPX2": -0.2, "PPX3": -0.1, "PPX4": 0.3}
    q = {"FZ": F0, "FNOMIN": F0, "pressure_change": 0.2}
    assert forces(mf61, p, KAPPA=1e-8, **q).FX / 1e-8 == pytest.approx(20 * F0 * (1 + 0.08 - 0.008), rel=1e-6)
    top = forces(mf61, p, KAPPA=np.linspace(0, 1, 20001), **q).FX.max()
    assert top == pytest.approx(F0 * (1 - 0.02 + 0.012), rel=1e-6)
    assert forces(mf52, p, KAPPA=0.1, **q).FX == forces(mf52, p, KAPPA=0.1, FZ=F0).FX


@MODELS
def test_no_load_no_force_and_raw_angles(model):
    empty = forces(model, SA=SA, FZ=0.0, IA=0.02, KAPPA=0.03)
    assert not np.any([empty.FX, empty.FY, empty.MZ])
    # Without camber only the tangent parts the two: the raw angle of arctan(tan a) is a.
    star = forces(model, SA=SA).FY
    assert forces(model, SA=np.tan(SA), angles="raw").FY == pytest.approx(star, rel=1e-14)


@MODELS
def test_curvature_factors_never_exceed_one(model):
    # E = 5 would turn the curve round; limited to 1 it is the one of E = 1.
    for name in ("PEX1", "PEY1", "QEZ1", "REX1", "REY1"):
        base = {**P, "PEX2": 0.0, "PEX4": 0.0, "PEY2": 0.0, "PEY3": 0.0, "PEY4": 0.0, "QEZ4": 0.0}
        high, one = (forces(model, {**base, name: E}, SA=SA, KAPPA=0.06) for E in (5.0, 1.0))
        assert np.array_equal([high.FX, high.FY, high.MZ], [one.FX, one.FY, one.MZ])


def test_friction_falls_with_slip_speed_only_where_LMUV_says_so():
    p = {**P, "LMUV": 0.5}
    q = state(p, SA=0.1, FZ=F0, FNOMIN=F0, KAPPA=0.2, V=20.0, V0=10.0)
    slip_speed = 20.0 * math.hypot(0.2, math.tan(0.1))
    assert q.mu_y == pytest.approx(1 / (1 + 0.5 * slip_speed / 10.0))
    assert state(P, SA=0.1, FZ=F0, FNOMIN=F0, V=20.0, V0=10.0).mu_y == 1.0


def test_backward_turns_the_slip_angle():
    back, forth = (state(P, SA=s, FZ=F0, FNOMIN=F0, V=v) for s, v in ((0.1, -5.0), (-0.1, 5.0)))
    assert back.a == forth.a


# What makes left and right, or braking and driving, differ: a half turn does not carry it over.
LEFT_RIGHT = "PHY1 PHY2 PVY1 PEY3 RBY3 RVY1 QHZ1 QDZ3 QBZ4 QDZ6 QDZ7 QEZ4 RHX1 SSZ1".split()
BRAKE_DRIVE = "PHX1 PVX1 PEX4 RHY1 RVY3".split()


def half_turn(p, **at):
    """Return (Vx, Vy, IA, Vsx) seen from axes turned by half a turn about z, as SA, IA, KAPPA, V again."""
    V, SA = at["V"], at["SA"]
    Vx, Vy = -V, V * np.tan(SA)  # -(Vy) with Vy = -V tan(SA)
    Vsx = at["KAPPA"] * abs(V)  # -(Vsx) with Vsx = -KAPPA |V|
    return {"V": Vx, "SA": np.arctan(-Vy / Vx), "IA": -at["IA"], "KAPPA": -Vsx / abs(Vx), "FZ": at["FZ"]}


@MODELS
@pytest.mark.parametrize("IA", [0.0, 0.05])
@pytest.mark.parametrize("KAPPA", [0.0, 0.06, -0.2])
@pytest.mark.parametrize("angles", ["star", "raw"])
def test_backward_is_forward_seen_after_a_half_turn(model, IA, KAPPA, angles):
    p = {
        n: v for n, v in {**P, **MORE, "RBX3": -3.0, "RBY4": 5.0}.items() if n not in LEFT_RIGHT + BRAKE_DRIVE
    }
    at = {"SA": SA, "IA": IA, "KAPPA": KAPPA, "V": -20.0, "FZ": 5000.0}
    back, forth = forces(model, p, angles=angles, **at), forces(model, p, angles=angles, **half_turn(p, **at))
    # The axes x and y are turned, z is not.
    assert back.FX == pytest.approx(-forth.FX, rel=1e-12, abs=1e-9)
    assert back.FY == pytest.approx(-forth.FY, rel=1e-12, abs=1e-9)
    assert back.MZ == pytest.approx(forth.MZ, rel=1e-12, abs=1e-9)


@MODELS
def test_the_side_force_acts_behind_the_contact_point_in_the_direction_of_travel(model):
    # Trail alone: MZ = x FY, and x has the sign of -Vx.
    p = {n: P[n] for n in "PCY1 PDY1 PKY1 PKY2 QBZ1 QCZ1 QDZ1".split()}
    for V in (20.0, -20.0):
        made = forces(model, p, SA=np.radians([-2.0, 3.0]), V=V)
        assert np.all(np.sign(made.MZ / made.FY) == -np.sign(V))


@pytest.mark.parametrize("V", [0.0, -0.0])
def test_a_tire_that_stands_counts_as_forward(V):
    assert forces(mf61, SA=0.03, V=V).MZ == forces(mf61, SA=0.03, V=1.0).MZ


def test_equivalent_slip_keeps_sign_and_grows_with_kappa():
    slips = np.array([-2.0, -0.5, 0.0, 0.5, 2.0])
    assert np.array_equal(equivalent(slips, np.asarray(1.0), np.zeros(5)), slips)
    joined = equivalent(slips, np.asarray(1.0), np.full(5, 0.4))
    assert np.all(np.abs(joined) >= np.abs(slips))
    assert joined[3] == pytest.approx(math.atan(math.hypot(math.tan(0.5), 0.4)))
