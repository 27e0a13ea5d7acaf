"""What an answer advises where it has no name, and where it says that a mismatch is."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace as Of

import numpy as np
import pytest

from toolkit.diagnosis.answer import next_measurements as advice
from toolkit.diagnosis.answer.locate import places
from toolkit.diagnosis.answer.next_measurements import apart, next_measurements, to_find_it, zeros_to_read
from toolkit.diagnosis.fit.sensor_noise import ChannelNoise
from toolkit.diagnosis.search.unexplained import Line


def line(frequency, angle=""):
    return Line(frequency=frequency, p_value=0.0, share=0.5, width=0.01, angle=angle)


def found(*variables, inputs=("SA", "FZ"), unit="N", reason="", line=None):
    drivers = tuple(Of(name=name, unit="N", role="input") for name in inputs)
    problem = Of(case=Of(drivers=drivers), model=Of(outputs=(Of(name="FY", unit=unit),)), runs=())
    return Of(
        problem=problem,
        structure=tuple(Of(variables=(name,), reason=reason, line=line) for name in variables),
        augmented=Of(simulated={}),
    )


@pytest.mark.parametrize(
    ("variable", "told"),
    [
        ("SA", "SA alone varied"),
        ("dSA/dt", "the rate of SA alone varied"),
        ("FY", "apply known loads"),
        ("run", "from run to run: repeat one run unchanged"),
        ("time", "hold all inputs still"),
    ],
)
def test_the_advice_is_about_what_the_mismatch_depends_on(variable, told):
    (said,) = to_find_it(found(variable))
    assert told in said


def test_nobody_is_asked_to_drive_what_is_only_recorded():
    """A pendulum that swings freely, with its rate recorded beside its angle."""
    search = found("rate", "drate/dt")
    search.problem.case.drivers = (Of(name="rate", unit="rad/s", role="covariate"),)
    (said,) = to_find_it(search)
    assert said.endswith("on rate, the rate of rate: record runs in which rate takes other values.")


@pytest.mark.parametrize(
    ("levels", "told"),
    [
        (("p",), "as p does: change p within a run"),
        (("p", "T"), "as p and T do: change p and T within a run"),
    ],
)
def test_what_differs_from_run_to_run_as_a_recorded_level_does_is_looked_for_there(levels, told):
    """A damper's gas at three pressures: three runs, and no other note of what changed between them."""
    search = found("run", inputs=("v", *levels))
    for level in (345.0, 689.0, 1034.0):
        columns = {"v": np.linspace(-1, 1, 50)} | {name: level + np.linspace(0, 2, 50) for name in levels}
        search.problem.runs += (Of(columns=columns, rows=50),)
    (said,) = to_find_it(search)
    assert told in said


@pytest.mark.parametrize(
    ("reason", "line", "told"),
    [
        ("a line", line(1.55), "swings at 1.55 Hz: record what turns"),
        ("louder in r0.csv", None, "Vary one input alone"),
        ("more than its stated noise", None, "Vary one input alone"),
    ],
)
def test_a_line_and_an_event_of_time_are_no_drift(reason, line, told):
    (said,) = to_find_it(found("time", reason=reason, line=line))
    assert told in said


@pytest.mark.parametrize(
    ("inputs", "variable", "told", "never"),
    [
        (("tau",), "tau", "with tau varied in another way", "alone"),
        (("tau",), "time", "give tau the same course twice", "hold all inputs"),
        (("tau",), "a floor", "Vary tau slowly and fast", "one input alone"),
        ((), "time", "repeat the run unchanged", "inputs"),
        ((), "a floor", "Begin runs from other states", "input"),
    ],
)
def test_the_advice_is_for_the_inputs_that_there_are(inputs, variable, told, never):
    (said,) = to_find_it(found(variable, inputs=inputs))
    assert told in said
    assert never not in said


@pytest.mark.parametrize(
    ("unit", "is_load"),
    [("kN", True), ("N*m", True), ("kg", True), ("mV/V", True), ("mH", False), ("rad/s", False), ("%", False),
     ("V", False), ("m", False)],
)  # fmt: skip
def test_known_loads_are_applied_to_what_carries_a_load(unit, is_load):
    (said,) = to_find_it(found("FY", unit=unit))
    assert ("known loads" in said) is is_load
    assert ("small and large" in said) is not is_load


@pytest.mark.parametrize(
    ("speeds", "wave", "wrapped", "told"),
    [
        ((1.0, 1.0), 0.0, False, "24 times per turn of angle"),
        ((2.0, 2.0), 0.0, True, "12 times per turn of angle"),
        (
            (1.0, 1.1),
            0.0,
            False,
            "record what turns",
        ),  # at two speeds a line of the angle has two frequencies
        ((1.0, 1.0), 0.1, False, "record what turns"),  # it turns unevenly
        ((0.0, 0.0), 0.3, False, "record what turns"),  # it swings to and fro
    ],
)
def test_a_line_in_step_with_a_recorded_angle_is_told_by_its_number_per_turn(speeds, wave, wrapped, told):
    t = np.arange(0, 10, 0.005)
    search = found("time", inputs=("angle", "load"), reason="a line", line=line(24.0))
    search.problem.case.drivers[0].unit = "deg"
    for speed in speeds:
        turns = speed * t + wave * np.sin(2 * np.pi * 0.7 * t)
        angle = 360 * (turns % 1 if wrapped else turns)
        search.problem.runs += (Of(t=t + 3, columns={"angle": angle}, rows=len(t)),)
    (said,) = to_find_it(search)
    assert "24 Hz" in said
    assert told in said


@pytest.mark.parametrize(
    ("swing", "bent", "told"),
    [
        (1.0525, 3.1575, "3 times as fast as SA: it answers to SA"),
        (1.0525, 1.0525, "swings at 1.052 Hz, as fast as SA: it answers to SA"),
        (1.0525, 2.6, "record what turns"),
        (0.11, 5.0, "record what turns"),  # among so many multiples any line would be
    ],
)
def test_a_line_at_a_multiple_of_an_inputs_swing_is_an_answer_to_it(swing, bent, told):
    """A damper's valve bends its force: three times its stroke's frequency, and nothing else turns."""
    t = np.arange(0, 30, 0.01)
    search = found("time", reason="a line", line=replace(line(bent), width=1 / 30))
    for phase in (0.0, 1.0):
        columns = {"SA": 5 * np.sin(2 * np.pi * swing * t + phase), "FZ": np.full(len(t), 4000.0)}
        search.problem.runs += (Of(t=t, columns=columns, rows=len(t)),)
    (said,) = to_find_it(search)
    assert told in said


def test_a_line_of_an_angle_is_told_by_its_number_per_turn():
    (said,) = to_find_it(found("angle", inputs=("angle", "load"), reason="a line", line=line(24.0, "angle")))
    assert said.startswith("The mismatch swings 24 times per turn of angle: repeat the run at another speed")


def test_the_variable_that_a_mismatch_depends_on_stands_before_a_narrower_range():
    # What happens once, while the motion is fastest: a range of v holds it as narrowly as one of time does.
    t = np.linspace(0, 10, 400)
    v = np.where((t > 4) & (t < 5), 3 * np.sin(np.pi * (t - 4)), 0.3 * np.sin(7 * t))
    run = Of(columns={"v": v}, t=t, name="run01.csv", conditions={}, rows=len(t))
    case = Of(drivers=(Of(name="v", unit="m/s"),), channels=(), has_time=True)
    problem = Of(
        case=case, runs=(run,), slices=(slice(0, 400),), kept={"F": np.ones(400, bool)},
        model=Of(outputs=(Of(name="F", unit="N"),)),
    )  # fmt: skip
    signal = v * np.abs(v)
    first = [places(problem, "F", signal, np.cos(t), depends)[0].variable for depends in ((), ("time",))]
    assert first == ["v", "time"]


def test_a_measurement_names_the_effects_that_it_is_for():
    told = apart(Of(name="viscous_damping", equivalent_to=("quadratic_drag", "coulomb_friction")))
    # Both need what physics asks of a law of speed: three speeds, said once.
    assert told.count("three speeds") == 1
    assert "(viscous_damping, quadratic_drag)" in told
    assert told.endswith("(coulomb_friction)")


@pytest.mark.parametrize(
    ("rest", "skipped", "sentences"),
    [
        (False, (), []),
        (True, (), ["Vary u slowly and fast, little and much, and record what else may act."]),
        (
            False,
            ("laws",),
            ["Give the search more time (--budget): it ended before all of its tests were made."],
        ),
    ],
)
def test_whoever_has_something_left_is_told_what_to_measure(rest, skipped, sentences):
    """A filter is named, and its class is itself: what asks for a measurement is what it leaves."""
    search = found("time", inputs=("u",), unit="V", reason="a floor above a tenth of the output's spread")
    search.problem.runs = (Of(), Of())
    # No output's rest is beyond all noise, or to one side.
    search.problem.names, search.problem.model, search.augmented = (), Of(outputs=()), None
    search.disagreed, search.steps = None, ()
    named = (Of(name="filter_lag", equivalent_to=()),)
    laws = Of(listed=())
    said = next_measurements(search, named, "named", rest=rest, skipped=skipped, laws=laws)
    assert list(said) == sentences


@pytest.mark.parametrize(
    ("listed", "left"), [((), "2.4e+02 N"), ((Of(),), "1.5e+02 N"), ((Of(), Of()), None)]
)
def test_the_noise_of_a_sensor_is_asked_for_where_laws_leave_more_than_any(monkeypatch, listed, left):
    """A force is off by 240 N; one law leaves 150 N of it, and a second no more than noise may be."""
    sizes = {0: 240.0, 1: 150.0}
    search = found("time", inputs=("u",), unit="N", reason="a floor above a tenth of the output's spread")
    search.problem.model = Of(outputs=(Of(name="FX", unit="N"),))
    search.problem.stated_sd, search.problem.rates, search.augmented = lambda _: None, {}, 0
    search.disagreed, search.steps, search.problem.runs = None, (), (Of(), Of())
    monkeypatch.setattr(advice, "zeros_to_read", lambda _: [])

    def beyond(_, fit):
        rest = math.sqrt(sizes[fit] ** 2 - 16.0**2) if fit in sizes else 0.0
        return {"FX": ChannelNoise(sensor_sd=16.0, process_sd=rest, how="differences")} if rest else {}

    monkeypatch.setattr(advice, "beyond_noise", beyond)
    laws = Of(listed=listed, fit=len(listed))
    said = next_measurements(search, (), "unknown", rest=True, skipped=(), laws=laws)
    asked = [text for text in said if "standard deviation" in text]
    assert [text.split(" that are left")[0].split("how much of the ")[1] for text in asked] == (
        [] if left is None else [left]
    )


@pytest.mark.parametrize(
    ("zeros", "told"),
    [
        ((-0.05, -0.046, -0.09), ["T reads low in every run, by 0.046 to 0.09 N*m: read its zero before"]),
        ((0.05, 0.046, 0.09), ["T reads high in every run, by 0.046 to 0.09 N*m: read its zero before"]),
        ((0.05, -0.046, 0.09), []),
        ((-0.046,), ["T reads low all along, by 0.046 N*m: read its zero before"]),
        ((0.005, 0.005, 0.005), []),  # a tenth of what else is left
    ],
)
def test_a_zero_that_every_run_has_to_one_side_is_to_be_read(zeros, told):
    runs = len(zeros)
    wave = 0.03 * np.sin(np.arange(100 * runs) * 0.2)
    residual = np.concatenate(
        [zero + part - part.mean() for zero, part in zip(zeros, np.split(wave, runs), strict=True)]
    )
    problem = Of(
        rates={}, model=Of(outputs=(Of(name="T", unit="N*m"),)), kept={"T": np.ones(100 * runs, bool)},
        slices=tuple(slice(100 * k, 100 * k + 100) for k in range(runs)),
    )  # fmt: skip
    said = zeros_to_read(Of(problem=problem, augmented=Of(residual={"T": residual})))
    assert [text.split(" and after")[0] for text in said] == told
    problem.rates = {"T": 1}  # it drifts: where it is says nothing of a zero
    assert zeros_to_read(Of(problem=problem, augmented=Of(residual={"T": residual}))) == []


def test_the_advice_beside_a_name_is_about_what_it_leaves():
    (sentence,) = to_find_it(found("run"), subject="What is left")
    assert sentence.startswith("What is left differs from run to run")


def test_a_line_where_the_simulation_swings_by_itself_is_no_other_machines():
    t = np.arange(600) * 0.1
    search = found("time", reason="a line", line=line(0.5))
    search.problem.runs = (Of(t=t, columns={}, rows=len(t)),)
    search.problem.slices = (slice(0, len(t)),)
    search.augmented.simulated["FY"] = np.exp(-0.01 * t) * np.cos(2 * np.pi * 0.5 * t)
    (said,) = to_find_it(search)
    assert "where the simulated FY swings by itself" in said
