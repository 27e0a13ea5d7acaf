"""What is predicted of a test is what the tests of that design then say."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.characteristics.tire_factory import M15, reduced_test
from tests.planning.planning_factory import LOADS, ROWS, VARIANCES, earlier
from toolkit.characteristics.characterise import characterise, characteristic_rows
from toolkit.characteristics.groups import Direction, DirectionFit, group
from toolkit.characteristics.scatter import scatter_of
from toolkit.errors import ConfigError
from toolkit.pipeline import TestResult
from toolkit.planning.demands import parse_demand
from toolkit.planning.design import Design, standard
from toolkit.planning.expectation import earlier_test, pooled
from toolkit.planning.protocol_search import Question
from toolkit.tires.evaluate import value_at

NAMES = ("conicity", "plysteer", "slope_cornering", "FY@8deg")
DEMANDS = tuple(parse_demand(name) for name in NAMES)
PROTOCOL = standard(M15, M15.rotations)
PLAN = Design(
    slip_angles_rad=tuple(map(math.radians, (-10, -4, -2, -1, -1, 0, 1, 1, 2, 4, 8, 10))),
    loads_N=LOADS,
    rotations=("forward", "reverse"),
)


def test_what_an_expected_test_says_of_its_scatter_is_the_scatter() -> None:
    beside = [2.0**2, 0.04**2, np.radians(0.003) ** 2, 4.0**2, 0.1**2, np.radians(0.004) ** 2]
    expected = VARIANCES + np.array([0.0, 0.0, 0.0, 0.0, *beside])
    found = scatter_of(earlier().directions(PROTOCOL), expected=expected)
    np.testing.assert_allclose(found.variances, expected, rtol=1e-6)


def test_with_few_freedoms_load_and_slip_angle_count_as_scatter_of_the_channels() -> None:
    few = dataclasses.replace(PLAN, loads_N=LOADS[:1], rotations=("forward",))
    found = scatter_of(earlier().directions(few), expected=VARIANCES)
    assert found.variances[2] == found.variances[3] == 0.0
    assert found.variances[0] > VARIANCES[0]


def drawn(design: Design, seed: int) -> TestResult:
    """A test of a design with the scatter that the earlier test stands for."""
    rng = np.random.default_rng(seed)
    degrees = tuple(np.degrees(sorted(design.slip_angles_rad)).round(6))
    bare = reduced_test(angles=degrees, loads=design.loads_N, directions=design.rotations, u=ROWS)
    scatter = scatter_of(earlier().directions(design), expected=VARIANCES)
    moved = {(round(load), rotation): s.by_channel for (load, rotation), s in scatter.directions.items()}
    noisy = []
    for place, condition in enumerate(bare.conditions):
        by_channel = moved[round(condition.FZ), condition.rotation]
        z = rng.standard_normal(len(VARIANCES)) * np.sqrt(VARIANCES)
        rows = rng.standard_normal(2) * ROWS
        FY = condition.FY + float(by_channel["FY"][:, place % len(degrees)] @ z) + rows[0]
        MZ = condition.MZ + float(by_channel["MZ"][:, place % len(degrees)] @ z) + rows[1]
        noisy.append(dataclasses.replace(condition, FY=FY, MZ=MZ, FY_common=FY, MZ_common=MZ))
    reduced = dataclasses.replace(bare, conditions=tuple(noisy))
    return TestResult(reduced=reduced, characteristics=characterise(reduced, machine=M15, record=None))


WHOLE = pytest.mark.campaign("the machine's whole protocol: a plan of few steps asks more of the prediction")


@pytest.mark.campaign("drawn tests of a design: its scatter stands against its formula in every run")
@pytest.mark.parametrize("design", [pytest.param(PROTOCOL, marks=WHOLE), PLAN], ids=["protocol", "plan"])
def test_the_uncertainty_that_is_predicted_is_that_of_tests_of_the_design(design: Design) -> None:
    known = dataclasses.replace(earlier(), load_spread=0.0)
    question = Question(tires=(known,), demands=DEMANDS, loads_N=LOADS)
    predicted = {(reach.demand.label, round(reach.load_N)): reach.u for reach in question.reaches(design)}
    seen: dict[tuple[str, float], list[float]] = {}
    for seed in range(12):
        result = drawn(design, seed)
        rows = characteristic_rows(result.reduced, result.characteristics, machine=M15, record=None)
        for row in rows:
            label = (
                "FY@8deg"
                if row.SA_rad is not None and math.isclose(row.SA_rad, math.radians(8))
                else row.name
            )
            key = (label, round(row.load_N))
            if row.estimate is not None and key in predicted and row.name in (label, "FY"):
                seen.setdefault(key, []).append(row.estimate.u**2)
    assert len(seen) == len(predicted)
    # The scatter has some 60 to 100 freedoms in a test: the mean of twelve is sure to 5 %.
    ratios = [math.sqrt(np.mean(seen[key])) / predicted[key] for key in predicted]
    assert all(0.88 < ratio < 1.12 for ratio in ratios), dict(zip(predicted, ratios, strict=True))


def test_conditions_stand_where_the_wheel_stood_beside_its_steps() -> None:
    offset = math.radians(-0.3)
    bare = reduced_test(loads=LOADS, u=ROWS)
    moved = tuple(dataclasses.replace(c, SA=c.SA + offset) for c in bare.conditions)
    reduced = dataclasses.replace(bare, conditions=moved)
    result = TestResult(reduced=reduced, characteristics=characterise(reduced, machine=M15, record=None))
    known = earlier_test(result, machine=M15, record=None)
    assert known.offset_rad == pytest.approx(offset)
    for direction in known.directions(PROTOCOL):
        steps = np.array([c.step_SA for c in direction.group.conditions])
        np.testing.assert_allclose(direction.group.SA - steps, offset)
        assert direction.fit.FY is not None
        np.testing.assert_allclose(direction.group.values("FY"), value_at(direction.fit.FY, steps + offset))


def test_a_test_of_one_direction_stands_for_both() -> None:
    known = earlier(directions=("forward",))
    assert known.mirrored == ("reverse",)
    assert known.loads_N == LOADS
    assert len(known.directions(PROTOCOL)) == 2 * len(LOADS)


def test_a_test_without_curves_is_refused() -> None:
    reduced = reduced_test(angles=(-2.0, 0.0, 2.0))
    result = TestResult(reduced=reduced, characteristics=characterise(reduced, machine=M15, record=None))
    with pytest.raises(ConfigError) as error:
        earlier_test(result, machine=M15, record=None)
    assert error.value.rule == "plan-like"


def test_several_tests_tell_of_one_scatter_together() -> None:
    """What an estimate of a single test imagines, because it cannot fall below zero, its mean keeps."""
    tests = [earlier_test(drawn(PROTOCOL, seed), machine=M15, record=None) for seed in range(6)]
    together = pooled(tests)
    mean = np.mean([one.variances for one in tests], axis=0)
    imagined = np.flatnonzero((VARIANCES == 0) & (mean > 0))
    assert len(imagined) >= 3
    assert np.mean(together.variances[imagined] / mean[imagined]) < 0.5
    seen = [0, 1]
    np.testing.assert_allclose(together.variances[seen], VARIANCES[seen], rtol=0.5)
    assert (together.variances_u[seen] < np.mean([one.variances_u[seen] for one in tests], axis=0)).all()


def test_a_block_is_carried_by_its_neighbours_the_worse_the_fewer_they_are() -> None:
    def own(loads: tuple[float, ...]) -> float:
        design = dataclasses.replace(PROTOCOL, loads_N=loads)
        direction = next(d for d in earlier().directions(design) if math.isclose(d.group.load_N, LOADS[2]))
        return float(direction.group.own_u("FY")[0])

    alone, three, five = own(LOADS[2:3]), own(LOADS[1:4]), own(LOADS)
    assert alone == pytest.approx(ROWS[0])  # nothing is carried: how far it stands off is scatter of the load
    # The tire grows with the load by a parabola: a cubic through five loads knows it, two secants do not.
    assert three > 1.01 * alone
    assert five == pytest.approx(alone)


def test_directions_are_those_of_measured_groups() -> None:
    known = earlier()
    mine = known.directions(PROTOCOL)
    measured = group(reduced_test(loads=LOADS, u=ROWS))
    assert [(d.group.load_N, d.group.rotation) for d in mine] == [(g.load_N, g.rotation) for g in measured]
    for direction, seen in zip(mine, measured, strict=True):
        assert isinstance(direction, Direction)
        assert isinstance(direction.fit, DirectionFit)
        np.testing.assert_allclose(direction.group.values("FY"), seen.values("FY"), atol=1e-3)
