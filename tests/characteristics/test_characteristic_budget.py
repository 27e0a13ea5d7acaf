"""Every line of a characteristic's budget against what it stands for: make the error, fit again, look.

A part of the budget is d value / d variable times the variable's standard uncertainty, signed. Here each
error is made in the conditions of a tire whose curves are known, everything is fitted anew, and the change of
every characteristic is held against the part.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.characteristics.tire_factory import LOAD, M15, PLYSTEER, Key, at_load, reduced_test, rows_of_many
from toolkit.characteristics.catalogue import characteristics
from toolkit.characteristics.characterise import characterise, characteristic_rows
from toolkit.characteristics.characteristic import TRANSIENT
from toolkit.characteristics.model import Row
from toolkit.characteristics.shared_errors import root_of
from toolkit.characteristics.uncertain import Part, Uncertain, weighted
from toolkit.reduction.model import ReducedTest, Tare

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord

THREE = (2000.0, LOAD, 6000.0)
U_ZERO = M15.stated_uncertainty("SA").u


def rows(reduced: ReducedTest, record: CalibrationRecord | None = None) -> dict[Key, Row]:
    found = characterise(reduced, machine=M15, record=record)
    again = characteristic_rows(reduced, found, machine=M15, record=record)
    return {(row.name, row.load_N, row.rotation, row.SA_rad): row for row in again}


def part(row: Row, source: str) -> float:
    """The signed sum of the parts of a source that is one variable."""
    mine = [one for one in row.number.parts if one.source == source]
    assert len(mine) <= 1
    return mine[0].u if mine else 0.0


def change(
    bare: dict[Key, Row], moved: dict[Key, Row], half: dict[Key, Row] | None = None
) -> dict[Key, float]:
    """The change of every value; with ``half`` (the opposite error) half the difference of the two."""
    back = bare if half is None else half
    return {
        key: (moved[key].number.value - back[key].number.value) / (1 if half is None else 2) for key in bare
    }


def test_a_zero_of_the_slip_angle_moves_each_value_as_its_part_says() -> None:
    bare = rows(reduced_test(loads=THREE))
    moved = change(bare, *(rows(reduced_test(loads=THREE, zero_rad=s * U_ZERO)) for s in (1, -1)))
    for key, row in bare.items():
        assert part(row, "slip angle zero") == pytest.approx(
            moved[key], rel=2e-3, abs=1e-5 * (1 + abs(row.number.value))
        ), key


def test_the_zero_of_the_slip_angle_is_whole_in_plysteer_and_cancels_in_conicity() -> None:
    found = rows(reduced_test())
    plysteer, conicity, residual = (
        found[name, LOAD, "both", None] for name in ("plysteer", "conicity", "PRAT_at_FY_zero")
    )
    assert abs(part(plysteer, "slip angle zero")) == pytest.approx(60_000 * U_ZERO, rel=1e-4)
    assert abs(part(conicity, "slip angle zero")) < 1e-6 * 60_000 * U_ZERO
    assert abs(part(residual, "slip angle zero")) < 1e-9


def test_a_scale_of_the_slip_angle_moves_each_value_as_its_part_says() -> None:
    size = M15.stated_uncertainty("SA_scale").relative
    bare = rows(reduced_test(loads=THREE))
    moved = change(bare, *(rows(reduced_test(loads=THREE, stretch=s * size)) for s in (1, -1)))
    for key, row in bare.items():
        assert part(row, "slip angle scale") == pytest.approx(
            moved[key], rel=2e-3, abs=1e-5 * (1 + abs(row.number.value))
        ), key


def test_an_error_of_the_load_moves_each_value_as_its_part_says() -> None:
    """The tire's values are parabolas of the load, whose slope three loads give exactly."""
    size = M15.stated_uncertainty("FZ").relative
    bare = rows(reduced_test(loads=THREE))
    for key, row in bare.items():
        force, moment = _growth(key[1], size)
        # A lever is a moment over a force; the slip angle does not change with the load.
        by_unit = {"N": force, "N*m": moment, "m": moment - force}
        relative = by_unit[row.characteristic.unit.removesuffix("/rad")]
        assert part(row, "load") == pytest.approx(-relative * row.number.value, rel=1e-6, abs=1e-9), key


def _growth(load: float, size: float) -> tuple[float, float]:
    """d ln(y) of FY and MZ for the relative change ``size`` of the load, by central differences."""
    up, down = at_load(load * (1 + 1e-6)), at_load(load * (1 - 1e-6))
    here = at_load(load)
    return tuple((a - b) / (2e-6 * c) * size for a, b, c in zip(up, down, here, strict=True))  # type: ignore[return-value]


def test_one_load_alone_takes_the_values_as_proportional_to_it() -> None:
    row = rows(reduced_test())["plysteer", LOAD, "both", None]
    assert part(row, "load") == pytest.approx(-0.005 * PLYSTEER, rel=1e-6)


@pytest.mark.parametrize(
    ("reversal", "whole", "gone"), [("drum", "conicity", "plysteer"), ("tire", "plysteer", "conicity")]
)
def test_a_zero_of_the_cells(reversal: str, whole: str, gone: str, virtual_record: CalibrationRecord) -> None:
    """Fixed in the machine: with the drum reversed it stays in conicity, with the tire turned in plysteer."""
    shifted = {s: rows(reduced_test(cell_shift=(s * 10.0, 0.0), reversal=reversal)) for s in (1, -1)}
    moved = {
        name: (
            shifted[1][name, LOAD, "both", None].number.value
            - shifted[-1][name, LOAD, "both", None].number.value
        )
        / 2
        for name in (whole, gone)
    }
    assert moved[whole] == pytest.approx(10.0, rel=1e-9)
    assert moved[gone] == pytest.approx(0.0, abs=1e-6)
    # And so say the parts of an untared test: three cells, each its own variable.
    open_zero = dataclasses.replace(
        reduced_test(reversal=reversal),
        tare=Tare(source="none", values=(), unit="mV/V", u=(("D51", 1e-4), ("D52", 2e-4), ("E5", 1e-4))),
    )
    found = rows(open_zero, virtual_record)
    c = virtual_record.load("FY").coefficients
    shift = math.hypot(c[0] * 1e-4, c[1] * 2e-4, c[2] * 1e-4)
    budget = {name: dict(found[name, LOAD, "both", None].number.by_source()) for name in (whole, gone)}
    assert budget[whole]["cell zero"] == pytest.approx(shift, rel=1e-6)
    assert budget[gone].get("cell zero", 0.0) < 1e-9 * shift


def test_the_scatter_of_a_tare_that_serves_all_files_goes_where_an_open_zero_goes(
    virtual_record: CalibrationRecord,
) -> None:
    u = (("D51", 1e-5), ("D52", 1e-5), ("E5", 1e-5))
    tared = dataclasses.replace(
        reduced_test(), tare=Tare(source="file zero.xlsx", values=(), unit="mV/V", u=u)
    )
    found = rows(tared, virtual_record)
    c = np.array(virtual_record.load("FY").coefficients[:3])
    conicity, plysteer = (
        dict(found[n, LOAD, "both", None].number.by_source()) for n in ("conicity", "plysteer")
    )
    assert conicity["tare"] == pytest.approx(float(np.linalg.norm(c)) * 1e-5, rel=1e-6)
    assert plysteer.get("tare", 0.0) < 1e-12


def test_a_tare_of_each_file_is_a_shift_of_that_file_alone(virtual_record: CalibrationRecord) -> None:
    own = reduced_test()
    own = dataclasses.replace(
        own,
        tare=Tare(source="block", values=(), unit="mV/V", u=(("D51", 1e-5),)),
        conditions=tuple(dataclasses.replace(c, u_FY_zero=2.0) for c in own.conditions),
    )
    same = dataclasses.replace(own, conditions=tuple(
        dataclasses.replace(c, u_FY_zero=0.0, u_FY_common=2.0) for c in own.conditions
    ))  # fmt: skip
    for key, row in rows(own, virtual_record).items():
        alike = dict(rows(same, virtual_record)[key].number.by_source()) if key[0] == "conicity" else None
        if alike is not None:
            assert dict(row.number.by_source())["tare"] == pytest.approx(alike["repeatability"], rel=1e-9)


def test_the_pressure_goes_in_proportion_and_only_where_the_test_says_it() -> None:
    stated = M15.stated_uncertainty("P")
    assert "pressure" not in {p.source for r in rows(reduced_test()).values() for p in r.number.parts}
    for row in rows(reduced_test(pressure_Pa=234e3)).values():
        expected = row.number.value * stated.effect * stated.u / 234e3
        assert part(row, "pressure") == pytest.approx(expected, rel=1e-12)


def test_the_scatter_of_the_rows_goes_through_the_fit() -> None:
    """Trials: each condition scatters by its own u; the spread of what is read off is the part."""
    u = (8.0, 0.3)
    bare = rows(reduced_test(u=u))
    rng = np.random.default_rng(5)
    base = reduced_test()
    trials: dict[Key, list[float]] = {key: [] for key in bare}
    drawn = []
    for _ in range(200):
        noise = rng.normal(size=(len(base.conditions), 2)) * u
        drawn.append(dataclasses.replace(base, conditions=tuple(
            dataclasses.replace(c, FY_common=c.FY_common + float(e), MZ_common=c.MZ_common + float(f))
            for c, (e, f) in zip(base.conditions, noise, strict=True)
        )))  # fmt: skip
    for found in rows_of_many(drawn):
        for key, row in found.items():
            trials[key].append(row.number.value)
    for key, row in bare.items():
        sd = float(np.std(trials[key], ddof=1))
        # 200 trials know a standard deviation to 5 %; the fit bends by a little more.
        assert dict(row.number.by_source())["repeatability"] == pytest.approx(sd, rel=0.2), key


def test_many_tests_fitted_together_are_each_as_fitted_alone() -> None:
    tests = [reduced_test(loads=THREE, zero_rad=s * U_ZERO, u=(8.0, 0.3)) for s in (0, 1, -1)]
    for test, found in zip(tests, rows_of_many(tests), strict=True):
        alone = rows(test)
        assert found.keys() == alone.keys()
        for key, row in found.items():
            assert row.number.value == pytest.approx(alone[key].number.value, rel=1e-9, abs=1e-9)
            assert row.number.estimate().u == pytest.approx(alone[key].number.estimate().u, rel=1e-6)


def test_the_fit_and_the_rows_are_never_counted_twice() -> None:
    """A perfect curve has no misfit: what is left is the rows' scatter; without it, nothing."""
    for row in rows(reduced_test()).values():
        assert dict(row.number.by_source()).get("repeatability", 0.0) == 0.0
        assert dict(row.number.by_source()).get("fit", 0.0) < 1e-6 * (1 + abs(row.number.value))


def test_the_sources_of_a_budget_add_up_to_the_value_s_uncertainty() -> None:
    found = characterise(reduced_test(u=(8.0, 0.3), pressure_Pa=234e3), machine=M15, record=None)
    budgeted = [row for row in found.rows if row.SA_rad is None and row.estimate is not None]
    # Each of the load, and of each of its directions; a relaxation length needs a recording in time.
    times = {"load": 1, "direction": 2}
    stepped = [declared for declared in characteristics() if declared.table != TRANSIENT]
    assert len(budgeted) == sum(times.get(declared.scope, 0) for declared in stepped)
    for row in budgeted:
        assert row.estimate is not None
        assert math.sqrt(sum(u * u for _, u in row.sources)) == pytest.approx(row.estimate.u, rel=1e-12)
        assert {source for source, _ in row.sources} <= set(row.characteristic.budget)


def test_a_condition_holds_every_source() -> None:
    """At 4 deg, by hand: rows, slip angle by the curve's slope, load by the parabola, pressure."""
    reduced = reduced_test(u=(8.0, 0.3), loads=THREE, pressure_Pa=234e3)
    found = characterise(reduced, machine=M15, record=None)
    here = next(
        c for c in reduced.conditions
        if c.rotation == "forward" and c.FZ == LOAD and abs(c.SA - math.radians(4)) < 1e-9
    )  # fmt: skip
    u = next(p.u_FY for p in found.points if (p.file, p.first_row) == (here.file, here.first_row))
    # Slope of the factory's curve at 4 deg: d/dx of peak sin(C arctan(k x)), k = stiffness / (peak C).
    k, x = 60_000 / (4000 * 1.3), math.radians(4)
    slope = -4000 * math.cos(1.3 * math.atan(k * x)) * 1.3 * k / (1 + (k * x) ** 2)
    grown = _growth(LOAD, 0.005)[0]
    parts = (8.0, slope * U_ZERO, slope * x * 0.005, grown * here.FY, here.FY * 0.5 * 3500 / 234e3)
    assert u == pytest.approx(math.sqrt(sum(p * p for p in parts)), rel=1e-3)


def test_values_at_the_protocol_s_slip_angles_stay_inside_what_was_measured() -> None:
    found = characterise(
        reduced_test(angles=(-6.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0)), machine=M15, record=None
    )
    degrees = {round(math.degrees(row.SA_rad)) for row in found.rows if row.SA_rad is not None}
    assert degrees == {-6, -4, -2, -1, 0, 1, 2, 4}


@pytest.mark.parametrize("seed", range(4))
def test_the_root_of_a_covariance_is_a_root(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(4, 3)) * rng.uniform(1e-6, 1e3, size=(4, 1))
    V = half @ half.T  # of rank 3
    L = root_of(V)
    assert np.allclose(L @ L.T, V, rtol=1e-7, atol=1e-9 * np.sqrt(np.outer(np.diag(V), np.diag(V))))
    assert np.allclose(L, np.tril(L))


def test_what_two_numbers_share_cancels_in_their_difference() -> None:
    shared = Part(source="calibration", key="one record", u=5.0)
    one = Uncertain(value=100.0, unit="N", parts=(shared, Part(source="fit", key="a", u=3.0, dof=7)))
    other = Uncertain(value=90.0, unit="N", parts=(shared, Part(source="fit", key="b", u=4.0, dof=9)))
    difference = weighted([(1.0, one), (-1.0, other)]).estimate()
    assert (difference.value, difference.u) == (10.0, 5.0)
    # Welch-Satterthwaite, GUM G.4.1.
    assert difference.dof == pytest.approx(5.0**4 / (3.0**4 / 7 + 4.0**4 / 9))
    assert weighted([(1.0, one), (1.0, other)]).estimate().u == pytest.approx(math.sqrt(100 + 25))


def test_two_directions_whose_scatter_is_one_estimate_have_its_degrees_of_freedom() -> None:
    """(F - R)/2 of two values whose u follow from one s^2: t on the freedoms of s^2, not on twice as many.

    Two values of one pool, 3 and 4 on 7 freedoms: u^2 is 25/9 of the first one's, and as sure as that one.
    """
    pooled = [
        Uncertain(value=0.0, unit="N", parts=(Part(source="fit", key=key, u=u, dof=7, pool="s"),))
        for key, u in (("a", 3.0), ("b", 4.0))
    ]
    estimate = weighted([(0.5, pooled[0]), (-0.5, pooled[1])]).estimate()
    assert (estimate.u, estimate.dof) == (pytest.approx(2.5), pytest.approx(7))
    rng = np.random.default_rng(3)
    base = reduced_test()
    drawn = dataclasses.replace(base, conditions=tuple(
        dataclasses.replace(c, FY_common=c.FY_common + float(e), MZ_common=c.MZ_common + float(f))
        for c, (e, f) in zip(base.conditions, rng.normal(size=(26, 2)) * (8.0, 0.3), strict=True)
    ))  # fmt: skip
    found = rows(drawn)
    for name in ("conicity", "CRAT"):
        number = found[name, LOAD, "both", None].number
        fit = Uncertain(value=0.0, unit="N", parts=tuple(p for p in number.parts if p.source == "fit"))
        assert len(fit.parts) == 2
        assert fit.estimate().dof <= max(p.dof for p in fit.parts) * (1 + 1e-9)
