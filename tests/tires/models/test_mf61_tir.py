"""MF 6.1 against its limits and the single-load formula; the global fit; the property file."""

import numpy as np
import pytest

from toolkit.channels import signs
from toolkit.errors import ConfigError, UnreadableError
from toolkit.tires.global_data import measured
from toolkit.tires.global_fit import fit_global
from toolkit.tires.models.magic_formula import value
from toolkit.tires.models.mf61 import MODEL, forces
from toolkit.tires.slip import state
from toolkit.tires.tir import read_tir
from toolkit.tires.tir_write import tir_text, tire_fit, write_tir

F0 = 4000.0
P = {
    "PCY1": 1.3, "PDY1": 1.0, "PDY2": -0.1, "PEY1": -0.5, "PEY2": -0.3, "PKY1": -20.0, "PKY2": 1.6,
    "QBZ1": 9.0, "QBZ2": -1.0, "QCZ1": 1.15, "QDZ1": 0.1, "QDZ2": -0.005, "QEZ1": -2.0, "QBZ10": 0.5,
}  # fmt: skip
SA = np.radians(np.linspace(-12, 12, 25))


def pure(p, **rows):
    """Forces and moments of pure side slip; `rows` are SA [rad], FZ [N] and camber IA [rad]."""
    return forces(p, state(p, FNOMIN=F0, **rows), UNLOADED_RADIUS=0.3)


def test_cornering_stiffness_is_its_own_equation():
    # Pacejka (2012) 4.E25 at zero camber: K = PKY1 F0 sin(PKY4 arctan(FZ / (PKY2 F0))).
    for FZ in (1500.0, 4000.0, 6000.0):
        step = 1e-6
        FY = pure(P, SA=np.array([-step, step]), FZ=FZ).FY
        K = -20.0 * F0 * np.sin(2 * np.arctan(FZ / (1.6 * F0)))
        assert (FY[1] - FY[0]) / (2 * step) == pytest.approx(K, rel=1e-6)


def test_stiffness_is_largest_at_PKY2_times_the_nominal_load():
    loads = np.linspace(1000, 12000, 1101)
    FY = pure(P, SA=1e-5, FZ=loads).FY
    assert loads[np.argmax(np.abs(FY))] == pytest.approx(1.6 * F0, abs=10)
    assert np.abs(FY).max() == pytest.approx(20.0 * F0 * 1e-5, rel=1e-6)


def test_at_one_load_it_is_the_magic_formula_in_the_tangent():
    FZ, df = 5000.0, 0.25
    K = -20.0 * F0 * np.sin(2 * np.arctan(FZ / (1.6 * F0)))
    D = (1.0 - 0.1 * df) * FZ
    one = (K / (1.3 * D), 1.3, D, -0.5 - 0.3 * df, 0.0, 0.0)
    assert pure(P, SA=SA, FZ=FZ).FY == pytest.approx(value(one, np.tan(SA)), rel=1e-12)


def test_small_slip_moment_is_trail_times_force():
    # t(0) = D_t = QDZ1 FZ R0 / F0 at the nominal load: 0.1 x 0.3 m.
    a = 1e-7
    MZ = pure(P, SA=a, FZ=F0).MZ
    assert -MZ / pure(P, SA=a, FZ=F0).FY == pytest.approx(0.03, rel=1e-6)


def test_a_tire_without_shifts_is_odd_and_camber_mirrors():
    p = {**P, "PKY6": -1.0, "PVY3": 0.1, "QDZ8": -0.05, "PHY1": 0.0}
    for IA in (0.0, 0.05):
        left = pure(p, SA=SA, FZ=F0, IA=IA).FY
        right = pure(p, SA=-SA, FZ=F0, IA=-IA).FY
        assert left == pytest.approx(-right, rel=1e-12, abs=1e-9)


LOADS = (1500.0, 2800.0, 4000.0, 5200.0, 6400.0)


def rows(axes="SAE", noise=0.0, loads=LOADS):
    rng = np.random.default_rng(2)
    flip = signs("ISO-W", axes)
    columns = {"SA": [], "FZ": [], "FY": [], "MZ": []}
    for FZ in loads:
        FY = pure(P, SA=SA, FZ=FZ).FY
        MZ = pure(P, SA=SA, FZ=FZ).MZ
        columns["SA"].append(flip["SA"] * SA)
        columns["FZ"].append(np.full(len(SA), FZ))
        for channel, y in (("FY", FY), ("MZ", MZ)):
            columns[channel].append(flip[channel] * y + rng.normal(0, noise * np.abs(y).max(), len(y)))
    return measured({name: np.concatenate(parts) for name, parts in columns.items()}, axes=axes)


@pytest.fixture(scope="module")
def data():
    return rows(noise=0.003)


@pytest.fixture(scope="module")
def fit(data):
    return fit_global(MODEL, data)


def test_global_fit_recovers_the_surface_from_SAE_curves(fit):
    FY, MZ = fit.fit("FY"), fit.fit("MZ")
    assert FY.converged
    assert MZ.converged
    assert FY.nominal_load_N == 4000.0
    assert FY.error_percent < 0.6
    assert MZ.error_percent < 1.2
    p = dict(zip(MODEL.names, fit.values, strict=True))
    for FZ in (2000.0, 4600.0):  # loads between those that were fitted
        truth = pure(P, SA=SA, FZ=FZ).FY
        assert np.abs(pure(p, SA=SA, FZ=FZ).FY - truth).max() < 0.01 * np.abs(truth).max()
        moment = pure(P, SA=SA, FZ=FZ).MZ
        model = pure(p, SA=SA, FZ=FZ).MZ
        assert np.abs(model - moment).max() < 0.03 * np.abs(moment).max()


def test_property_file_reads_back_to_the_same_numbers(tmp_path, fit, data):
    path = tmp_path / "tire.tir"
    fit = tire_fit(MODEL, fit, data)
    write_tir(path, fit, comments=("simulated",))
    read = read_tir(path)
    assert path.read_text().startswith("! simulated\n")
    assert read.version == "6.x"
    assert read.section("UNITS")["ANGLE"] == "radians"
    assert read.number("FNOMIN") == fit.FNOMIN
    assert (read.number("ALPMIN"), read.number("ALPMAX")) == fit.SA_range
    found = read.coefficients()
    given = {name: number for _, entries in fit.coefficients for name, number in entries}
    assert given
    assert all(found[name] == number for name, number in given.items())
    assert found["LMUY"] == found["LKY"] == 1.0
    assert found["PKY4"] == 2.0
    assert pure(found, SA=SA, FZ=3000.0).FY == pytest.approx(pure(given, SA=SA, FZ=3000.0).FY, rel=1e-14)
    assert tir_text(fit) == tir_text(fit)


def test_comments_quotes_and_fit_types_of_other_programs(tmp_path):
    path = tmp_path / "other.tir"
    path.write_text(
        "$ comment\n[MODEL]\nFITTYP = 5  $typarr\nTYRESIDE='a $ b'\n! x\n"
        "[LATERAL_COEFFICIENTS]\nPCY1 = 1.2E0 !c\n"
    )
    read = read_tir(path)
    assert (read.version, read.get("TYRESIDE"), read.coefficients()) == ("5.2", "a $ b", {"PCY1": 1.2})
    path.write_text("[MODEL]\nFITTYP = 7\n")
    with pytest.raises(ConfigError):
        _ = read_tir(path).version
    with pytest.raises(ConfigError, match="no number FNOMIN"):
        read_tir(path).number("FNOMIN")
    path.write_text("not a tire file")
    with pytest.raises(UnreadableError):
        read_tir(path)
    with pytest.raises(UnreadableError):
        read_tir(tmp_path / "none.tir")
