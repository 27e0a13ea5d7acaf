"""What no tire can do is told, and what published tires do is not."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.campaigns.tires import sweep
from tests.recording.fig4_4 import ROWS
from toolkit.reduction import limits
from toolkit.reduction.physics import Readings, departures, longest_trail, of_sizes
from toolkit.simulation.tire import aligning_moment, lateral_force
from toolkit.tires.models import tmeasy
from toolkit.tires.tir import read_tir
from toolkit.tires.tir_evaluate import evaluate_tir

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
published = pytest.mark.skipif(not SHARED.is_dir(), reason="the public data sets are not on this machine")
LBF, LBF_FT = 4.4482216152605, 1.3558179483314
ANGLES = np.radians(np.linspace(-12, 12, 49))


def rules(readings: Readings, **options: float) -> set[str]:
    return {one.rule for one in departures(readings, **options)}


def bakker(**changes: object) -> Readings:
    """Return the published passenger tire at five loads, forward, in SAE axes."""
    return sweep(
        ANGLES,
        (1112, 2522, 3705, 4897, 6103),
        FY=lambda a, FZ: lateral_force(slip_angle=-a, load=FZ),
        MZ=lambda a, FZ: aligning_moment(slip_angle=-a, load=FZ),
        trail_m=longest_trail(0.316),
        **changes,
    )


# Figure 4.4


def figure_4_4(FY: NDArray[np.float64], MZ: NDArray[np.float64]) -> Readings:
    table = np.array(ROWS)
    return of_sizes(
        [f"row {i}" for i in range(10)], FZ=table[:, 0] * LBF, SA=np.radians(table[:, 4]), FY=FY * LBF,
        MZ=MZ * LBF_FT,
    )  # fmt: skip


def test_figure_4_4_as_it_stands_is_impossible_in_every_row() -> None:
    table = np.array(ROWS)
    stored = figure_4_4(table[:, 5], table[:, 6])
    (found,) = departures(stored)
    assert found.rule == "impossible-force"
    assert "1.49 of the load at -0.30 deg" in found.message
    assert "10 of 10 values" in found.message
    for row in range(10):
        assert rules(stored.part(np.arange(10) == row)) == {"impossible-force"}


def test_the_corrected_rows_are_possible() -> None:
    # The published coefficients of section 4.1, by hand; |Fy| is 0.01 to 0.21 of the load then.
    FZ, D52, D51, E5, _, _, _ = np.array(ROWS).T
    FY = 0.99719 * D51 + 0.99718 * D52 + 1.0228 * E5 + 0.6473
    MZ = -0.15688 * D51 + 0.16197 * D52 + 0.0026666 * E5 + 0.68759
    assert [round(float(one), 2) for one in (abs(FY) / FZ)[::2]] == [0.01, 0.16, 0.21, 0.22, 0.21]
    assert rules(figure_4_4(FY, MZ)) == set()


# published tires


def test_the_published_passenger_tire_is_possible() -> None:
    assert rules(bakker()) == set()


@published
def test_truck_tires_of_a_maker_are_possible() -> None:
    for path in sorted((SHARED / "goodyear_feda_tir").glob("*.tir")):
        tir = read_tir(path)

        def force(a: NDArray[np.float64], FZ: float, name: str, tir: object = tir) -> NDArray[np.float64]:
            return -np.asarray(getattr(evaluate_tir(tir, SA=-a, FZ=FZ)[0], name))  # type: ignore[arg-type]

        found = sweep(
            ANGLES,
            (4000, 8353, 16929, 23809, 35000),
            FY=lambda a, FZ, force=force: force(a, FZ, "FY"),
            MZ=lambda a, FZ, force=force: force(a, FZ, "MZ"),
            trail_m=longest_trail(0.503),
        )
        assert rules(found) == set(), path.name


def coefficients(name: str) -> tuple[list[float], list[float]]:
    text = (SHARED / "bicycle_schwalbe_mf89" / "tire_data.py").read_text()
    body = text.split(f"{name} =")[1].split("SchwalbeT03_", 1)[0]
    lists = re.findall(r"_coef=\[(.*?)\]", body, re.DOTALL)
    forces, moments = (
        [float(one) for one in re.findall(r"-?\d+\.\d+", re.sub(r"#.*", "", text))] for text in lists
    )
    return forces, moments


def magic_89(
    D: float, BCD: float, C: float, E: float, Sh: float, Sv: float, x: NDArray[np.float64]
) -> object:
    B, X = BCD / (C * D), x + Sh
    return D * np.sin(C * np.arctan(B * X - E * (B * X - np.arctan(B * X)))) + Sv


@published
@pytest.mark.parametrize("pressure", ["300kPa", "400kPa", "500kPa"])
def test_bicycle_tires_are_possible(pressure: str) -> None:
    f, m = coefficients(f"SchwalbeT03_{pressure}")
    assert (len(f), len(m)) == (14, 18)

    def FY(a: NDArray[np.float64], FZ: float) -> object:
        F = FZ / 1e3
        BCD = f[3] * np.sin(np.arctan(F / f[4]) * 2)
        shift = f[9] * F + f[10], f[12] * F + f[13]
        return -magic_89(f[1] * F**2 + f[2] * F, BCD, f[0], f[6] * F + f[7], *shift, np.degrees(a))  # type: ignore[operator]

    def MZ(a: NDArray[np.float64], FZ: float) -> object:
        F = FZ / 1e3
        BCD = (m[3] * F**2 + m[4] * F) * np.exp(-m[5] * F)
        shift = m[12] * F + m[13], m[16] * F + m[17]
        E = m[7] * F**2 + m[8] * F + m[9]
        return -magic_89(m[1] * F**2 + m[2] * F, BCD, m[0], E, *shift, np.degrees(a))  # type: ignore[operator]

    small = np.radians(np.linspace(-8, 8, 33))
    found = sweep(small, (200, 343, 488, 700, 1000), FY=FY, MZ=MZ, trail_m=longest_trail(0.35))
    assert rules(found) == set()


@published
def test_engineered_tires_of_a_simulator_are_possible() -> None:
    folder = SHARED / "chrono_tmeasy_examples"
    for path in folder.glob("*.json"):
        said = re.search(r'"Coefficient of Friction": ([0-9.]+)', path.read_text())
        assert said is not None
        assert float(said[1]) < limits.FRICTION.high
    text = (folder / "van_TMeasyTireFull.json").read_text()
    part = text.split('"Lateral"')[1].split('"Aligning"')[0]
    values = {name: json.loads(array) for name, array in re.findall(r'"([^"]+)": (\[[^\]]*\])', part)}
    trail = json.loads(re.search(r'"Normalized Trail at Zero Slip sy": (\[[^\]]*\])', text)[1])  # type: ignore[index]
    for index, FZ in enumerate((1900.0, 3800.0)):
        dF0, FM, FS, sM, sS = (one[index] for one in values.values())

        def FY(a: NDArray[np.float64], _: float, p: tuple[float, ...] = (dF0, FM, sM, FS, sS)) -> object:
            names = ("dF0", "FM", "sM", "FS", "sS")
            return -np.sign(a) * tmeasy.curve(np.abs(np.tan(a)), **dict(zip(names, p, strict=True)))

        # A patch of 0.2 m, as long as that of any van's tire.
        length = 0.2 * trail[index]
        found = sweep(
            ANGLES, (FZ,), FY=FY, MZ=lambda a, FZ, FY=FY, t=length: -t * np.cos(6 * a) * FY(a, FZ),
            trail_m=longest_trail(0.376),
        )  # fmt: skip
        assert rules(found) == set()


@published
def test_the_rows_of_a_real_racing_tire_are_possible() -> None:
    table = np.genfromtxt(SHARED / "ttc_cornering" / "cornering_IA0_P83kPa.csv", delimiter=",", names=True)
    FZ = np.abs(table["FZ_N"])
    block = tuple((None, float(load)) for load in np.round(FZ / 550))
    none = np.zeros(len(FZ))
    found = Readings(
        place=("row",) * len(FZ), FZ=FZ, SA=np.radians(table["SA_deg"]), FY=table["FY_N"], MZ=table["MZ_Nm"],
        reverse=none.astype(bool), block=block, u_FY=none, u_MZ=none, FX=none, IA=none,
    )  # fmt: skip
    assert len(FZ) == 7494
    assert rules(found) == set()


# laws, one by one


def test_the_bound_of_a_force_near_zero_slip_and_of_friction() -> None:
    def one(SA_deg: float, use: float) -> set[str]:
        return rules(
            of_sizes(
                ["x"],
                FZ=np.array([1000.0]),
                SA=np.radians([SA_deg]),
                FY=np.array([1000.0 * use]),
                MZ=np.zeros(1),
            )
        )

    # 40 per rad over 0.5 + 1 deg and 0.15: 1.197 of the load
    assert one(1.0, 1.19) == set()
    assert one(-1.0, -1.21) == {"impossible-force"}
    assert one(8.0, 1.99) == set()
    assert one(8.0, 2.01) == {"impossible-force"}
    assert one(float("nan"), 1.99) == set()


def test_a_longitudinal_force_uses_friction_too() -> None:
    one = of_sizes(
        ["x"], FZ=np.array([1000.0]), SA=np.radians([8.0]), FY=np.array([1500.0]), MZ=np.zeros(1),
        FX=np.array([1500.0]),
    )  # fmt: skip
    (found,) = departures(one)
    assert "2.12 of the load" in found.message


def test_camber_thrust_is_possible() -> None:
    # A motorcycle tire at 40 deg carries tan(40 deg) = 0.84 of its load without slip.
    for IA, expected in ((40.0, set()), (0.0, {"impossible-force"})):
        one = of_sizes(
            ["x"], FZ=np.array([1500.0]), SA=np.zeros(1), FY=np.array([1260.0]), MZ=np.zeros(1),
            IA=np.radians([IA]),
        )  # fmt: skip
        assert rules(one) == expected


def test_signs_of_the_stiffnesses() -> None:
    good = bakker()
    assert rules(dataclasses.replace(good, MZ=-good.MZ)) == {"impossible-slope"}
    assert rules(dataclasses.replace(good, FY=-good.FY, MZ=-good.MZ)) == {"impossible-slope"}
    assert rules(dataclasses.replace(good, FY=-good.FY, MZ=-good.MZ, signed=False)) == set()


@pytest.mark.parametrize(
    ("scales", "expected"),
    [
        ({"FZ": 1 / LBF}, {"impossible-force", "impossible-slope"}),  # pounds read as newtons
        ({"FZ": 1e-3}, {"impossible-force", "impossible-slope"}),  # kN read as N
        ({"FZ": 1e3}, {"impossible-slope", "implausible-friction"}),
        ({"FY": LBF}, {"impossible-force", "impossible-slope"}),
        ({"FY": 1e-3, "MZ": 1e-3}, {"impossible-slope", "implausible-friction"}),
        ({"FY": 1 / LBF, "MZ": 1 / LBF_FT}, {"implausible-friction"}),  # pounds read as newtons
        ({"MZ": 12.0}, {"impossible-moment", "impossible-slope"}),  # lbf·in read as lbf·ft
        ({"SA": np.pi / 180}, {"impossible-force"}),  # radians read as deg: the span is too short for a slope
    ],
)
def test_slips_of_a_unit(scales: dict[str, float], expected: set[str]) -> None:
    good = bakker()
    wrong = {name: getattr(good, name) * factor for name, factor in scales.items()}
    assert rules(dataclasses.replace(good, **wrong)) == expected


def test_forces_loads_and_moments_in_another_unit_together_change_nothing() -> None:
    for factor in (1e-3, 0.2248, 1e3):
        good = bakker()
        scaled = dataclasses.replace(good, FZ=good.FZ * factor, FY=good.FY * factor, MZ=good.MZ * factor)
        turned = dataclasses.replace(scaled, FY=-scaled.FY)
        assert rules(scaled) == set()
        assert rules(turned) == {"impossible-slope"}


def both_ways(**reverse: object) -> Readings:
    one, other = bakker(), bakker(reverse=True, **reverse)
    joined = {
        name: np.concatenate([getattr(one, name), getattr(other, name)])
        for name in ("FZ", "SA", "FY", "MZ", "reverse", "u_FY", "u_MZ", "FX", "IA")
    }
    return dataclasses.replace(one, place=one.place + other.place, block=one.block + other.block, **joined)  # type: ignore[arg-type]


def test_a_reversed_run_repeats_the_forward_one_but_for_pull() -> None:
    good = both_ways()
    assert rules(good) == set()
    # A conicity of a tenth of the load, five times any tire's, has opposite signs and is no mirror image.
    pulled = dataclasses.replace(good, FY=good.FY + np.where(good.reverse, -0.05, 0.05) * good.FZ)
    assert "impossible-reversal" not in rules(pulled)
    mirrored = dataclasses.replace(good, FY=np.where(good.reverse, -1, 1) * good.FY)
    assert rules(mirrored) == {"impossible-slope", "impossible-reversal"}
    # The run is not named as reversed: its blocks are doubled, its slopes average out, the mirror shows.
    assert "impossible-reversal" in rules(dataclasses.replace(mirrored, reverse=np.zeros_like(good.reverse)))


def test_a_zero_that_is_not_known_widens_the_bounds() -> None:
    one = of_sizes(["x"], FZ=np.array([1000.0]), SA=np.zeros(1), FY=np.array([700.0]), MZ=np.zeros(1))
    assert rules(one) == {"impossible-force"}
    assert rules(dataclasses.replace(one, u_FY=np.array([100.0]))) == set()


def test_single_outliers_of_a_noisy_table_are_left_to_their_own_finding() -> None:
    good = bakker(signed=False)
    FY = good.FY.copy()
    FY[7] *= 50
    assert rules(dataclasses.replace(good, FY=FY)) == {"impossible-force"}
    assert rules(dataclasses.replace(good, FY=FY), share=0.02) == set()


def limit_values() -> Iterator[limits.Limit]:
    for value in vars(limits).values():
        if isinstance(value, limits.Limit):
            yield value


def test_every_bound_names_its_source() -> None:
    found = list(limit_values())
    assert len(found) >= 9
    for one in found:
        assert one.low < one.high
        assert len(one.source) > 20


def test_a_leaning_tire_thrusts_by_its_camber() -> None:
    # A motorcycle tire at 45 deg carries itself by camber: about tan(45 deg) of the load at most.
    values = {"FZ": np.array([2000.0]), "SA": np.zeros(1), "FY": np.array([1360.0]), "MZ": np.zeros(1)}
    assert rules(of_sizes(["here"], **values)) == {"impossible-force"}
    assert rules(of_sizes(["here"], **values, IA=np.radians([45.0]))) == set()
    # By how much it leaned is not known: friction alone bounds it.
    assert rules(of_sizes(["here"], **values, IA=np.array([np.nan]))) == set()
