"""Signs in every axis system: an answer's equation holds with the channels as the case has them."""

import pytest

from tests.diagnosis.tire_case import SIGNS, python_tire
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.effects.catalogue import effects


def found(case):
    made = diagnose(read_case(case), None).diagnosis
    assert len(made.effects) == 1
    return made.effects[0]


def value(effect, name):
    parameter = next(one for one in effect.parameters if one.name == name)
    low, high = parameter.ci95
    assert low < parameter.value < high
    return parameter.value


@pytest.mark.parametrize("axes", SIGNS)
def test_an_angle_is_compared_with_the_recorded_slip_angle(axes):
    # alpha = SA - offset, and alpha = SA + pseudo_slip_angle, both with the case's own SA
    for name, parameter in (("steer_offset", "offset"), ("plysteer", "pseudo_slip_angle")):
        assert effects()[name].parameter(parameter).sign_in(axes) == SIGNS[axes][0]


@pytest.mark.parametrize("axes", SIGNS)
def test_a_pull_is_compared_with_the_recorded_force(axes):
    # FY = FY_model + force with the case's own FY; everything else stands in the channel's own axes already
    for name, parameter, sign in (
        ("conicity", "force_at_nominal_load", SIGNS[axes][1]), ("crosstalk", "coefficient", 1),
        ("channel_delay", "delay", 1),
    ):  # fmt: skip
        assert effects()[name].parameter(parameter).sign_in(axes) == sign


OTHER = pytest.mark.campaign(
    "axes that turn the slip angle alone: those that turn the force too in every run"
)


@pytest.mark.parametrize("axes", [pytest.param("adapted-SAE", marks=OTHER), "ISO-W"])
def test_a_steering_zero_of_plus_three_tenths(tmp_path, axes):
    made = found(python_tire(tmp_path, axes, offset=0.3))
    assert {made.name, *made.equivalent_to} == {"steer_offset", "plysteer"}
    angle = value(made, "offset") if made.name == "steer_offset" else -value(made, "pseudo_slip_angle")
    # 8 N of noise against some 700 N/deg, 240 rows: 0.001 deg; five of them
    assert angle == pytest.approx(0.3, abs=0.005)


def test_a_pull_to_the_positive_side_is_positive_in_its_axes(tmp_path):
    made = found(python_tire(tmp_path, "ISO-W", pull=100.0))
    assert {made.name, *made.equivalent_to} == {"conicity", "camber_offset", "crosstalk"}
    force = value(made, "coefficient") * 4000 if made.name == "crosstalk" else None
    if made.name == "conicity":
        force = value(made, "force_at_nominal_load")
    assert force == pytest.approx(100.0, abs=5.0)


def test_a_channel_that_is_late_has_a_positive_delay(tmp_path):
    # Two rows late: of a row and a half, what rounds the step of FZ between its rows is learned as a law.
    made = found(python_tire(tmp_path, "ISO-W", delay=0.2))
    assert "channel_delay" in {made.name, *made.equivalent_to}
    if made.name == "channel_delay":
        assert value(made, "delay") == pytest.approx(0.2, abs=0.01)
