"""The relaxation length: what parts it from a delay, and what it says where nothing does."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.characteristics.sweep_factory import swept
from tests.characteristics.tire_factory import LOAD, M15, reduced_test
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.model import Characteristics, Row
from toolkit.characteristics.sweep_fit import SweepFit
from toolkit.characteristics.sweep_length import relaxation_length, speeds_of, weights_of
from toolkit.machine.protocol import Delay, Sweeping
from toolkit.reduction.sweep import Sweep

STATED = dataclasses.replace(
    M15,
    sweeping=Sweeping(
        speeds_m_s=(1.0, 4.0), steer_rates_rad_s=(0.01, 0.07), source="test",
        delay=Delay(value_s=0.01, u_s=0.003, source="test"),
    ),
)  # fmt: skip


def read(sweeps: tuple[Sweep, ...], machine: object = M15) -> tuple[Characteristics, Row]:
    found = characterise(reduced_test(pressure_Pa=234e3), machine=machine, record=None, sweeps=sweeps)  # type: ignore[arg-type]
    row = found.at("relaxation_length", LOAD, "forward")
    assert row is not None
    return found, row


def test_two_speeds_part_it_from_a_delay_that_nobody_states() -> None:
    found, row = read(swept(0.5, tau=0.02))
    assert row.estimate is not None
    assert row.estimate.value == pytest.approx(0.5, abs=row.estimate.expanded()[0])
    assert row.estimate.expanded()[0] < 0.06
    assert [finding.rule for finding in found.findings] == []
    reverse = found.at("relaxation_length", LOAD, "reverse")
    assert reverse is not None
    assert "[sweeps]" in (reverse.lacking or "")


def test_one_speed_names_no_length_without_a_stated_delay() -> None:
    found, row = read(swept(0.5, tau=0.02, speeds=(2.0,)))
    assert row.estimate is None
    assert "not parted" in (row.lacking or "")
    (finding,) = found.findings
    assert (finding.rule, finding.level) == ("sweep-one-speed", "warning")
    assert "FY lags by 5" in finding.message  # 500 mm and 2 m/s times 20 ms


def test_a_stated_delay_is_taken_off_and_its_uncertainty_stands_in_the_budget() -> None:
    found, row = read(swept(0.5, tau=0.01, speeds=(2.0,)), STATED)
    assert row.estimate is not None
    assert row.estimate.value == pytest.approx(0.5, abs=row.estimate.expanded()[0])
    assert dict(row.sources)["delay"] == pytest.approx(2.0 * 0.003)
    assert [(finding.rule, finding.level) for finding in found.findings] == [("sweep-one-speed", "note")]


def test_without_sweeps_it_says_what_to_do() -> None:
    _, row = read(())
    assert row.estimate is None
    assert "test.toml" in (row.lacking or "")


def test_a_sweep_of_a_load_that_the_test_has_not_is_told() -> None:
    found, _ = read(swept(0.5, load=2 * LOAD, speeds=(2.0,)))
    assert [finding.rule for finding in found.findings] == ["sweep-unused"]


FIT = SweepFit(
    file="a", file_sha256="", rotation="forward", first_row=1, last_row=2, load_N=LOAD, speed_m_s=2.0,
    steer_rate_rad_s=0.02, rows=2, length_m=0.54, u_m=0.01, dof=20.0, form_m=0.0, stiffness_N_rad=1.0,
    offset_N=0.0, speed_u=0.0,
)  # fmt: skip
FAST = dataclasses.replace(FIT, file="b", speed_m_s=4.0, length_m=0.58)


def test_by_hand_two_speeds() -> None:
    # y = sigma + V tau through (2, 0.54) and (4, 0.58): 0.5 at V = 0, 2 y1 - y2, u = sqrt(5) 0.01.
    number = relaxation_length((FIT, FAST), load_N=LOAD, owner="m", test="t")
    assert number is not None
    assert number.value == pytest.approx(0.5)
    assert number.estimate().u == pytest.approx(math.sqrt(5) * 0.01)
    assert speeds_of((FIT, FAST, FIT)) == (2.0, 4.0)


def test_by_hand_one_speed_with_a_stated_delay() -> None:
    stated = dataclasses.replace(FIT, delay_s=0.01, delay_u_s=0.002)
    number = relaxation_length((stated, stated), load_N=LOAD, owner="m", test="t")
    assert number is not None
    assert number.value == pytest.approx(0.54 - 2 * 0.01)
    weights, of_delay = weights_of((stated, stated))
    np.testing.assert_allclose(weights, 0.5)
    assert of_delay == pytest.approx(-2.0)


def test_a_delay_of_little_doubt_makes_two_speeds_surer_and_a_wide_one_does_not() -> None:
    def u(delay_u: float | None) -> float:
        sweeps = tuple(
            dataclasses.replace(fit, delay_s=None if delay_u is None else 0.02, delay_u_s=delay_u)
            for fit in (FIT, FAST)
        )
        number = relaxation_length(sweeps, load_N=LOAD, owner="m", test="t")
        assert number is not None
        return number.estimate().u

    assert u(1e-6) == pytest.approx(0.01 / math.sqrt(2), rel=1e-3)
    assert u(10.0) == pytest.approx(u(None), rel=1e-3)


def test_a_length_is_carried_to_the_load_with_its_doubt() -> None:
    # Between one length at all loads and the law of the stiffness: half the power, over a rectangle.
    stated = dataclasses.replace(FIT, delay_s=0.0, delay_u_s=0.0, u_m=0.0)
    number = relaxation_length((stated,), load_N=1.03 * LOAD, owner="m", test="t")
    assert number is not None
    assert number.value == pytest.approx(0.54 * math.sqrt(1.03), rel=1e-4)
    assert dict(number.by_source())["load"] == pytest.approx(0.54 * math.log(1.03) * 0.5 / math.sqrt(3))
