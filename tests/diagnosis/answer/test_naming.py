"""Whether what was found is named beside a rest that has no name."""

from types import SimpleNamespace as Of

import numpy as np
import pytest

from toolkit.diagnosis.answer import naming
from toolkit.diagnosis.fit.structure import RUNS
from toolkit.diagnosis.law import rivals
from toolkit.diagnosis.search.bends import is_outsized
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects


def search(*, explained, unexplained, before, after, zero=0.0):
    """Return a search by its log-likelihoods, and two unseen runs with errors (rms) about a zero."""
    step = Of(active=Of(effect=Of(from_digits=False)), gain=explained)
    rest = Of(output="y", variables=("u",), rest=False, gain=2 * unexplained)
    errors = Of(channel="y", refitted_rmse=before, augmented_rmse=after, noise_floor=0.02)
    wave = np.tile(np.sqrt(2) * np.sin(2 * np.pi * np.arange(50) / 50), 2)
    problem = Of(
        names=("y",), observed={"y": np.zeros(100)}, kept={"y": np.ones(100, bool)},
        slices=(slice(0, 50), slice(50, 100)), rates={},
    )  # fmt: skip
    return Of(
        problem=problem, steps=(step,), structure=(rest,), errors=(errors,), skipped=(), kept=False,
        held_refitted=Of(simulated={"y": zero + before * wave}),
        held_augmented=Of(simulated={"y": after * wave}),
    )  # fmt: skip


@pytest.fixture
def plain(monkeypatch):
    """Leave the other rules out: no parameter far off, no law of a cell, nothing within the accuracy."""
    monkeypatch.setattr(naming, "implausible", lambda _: ())
    monkeypatch.setattr(naming, "is_outsized", lambda *_: False)
    monkeypatch.setattr(naming, "_is_within_accuracy", lambda _: False)
    monkeypatch.setattr(naming, "held_out_errors", lambda of, **_: of.errors)


@pytest.mark.parametrize(
    ("before", "after", "zero", "unknown"),
    [(0.71, 0.49, 0.0, False), (0.71, 0.60, 0.0, True), (0.60, 0.60, 2.0, True)],
)
@pytest.mark.usefixtures("plain")
def test_what_takes_more_of_the_unseen_rows_than_it_leaves_is_not_outweighed(before, after, zero, unknown):
    """A coloured noise weighs a slow error of half a volt little; the mean of a rest is any zero's."""
    found = search(explained=20.0, unexplained=60.0, before=before, after=after, zero=zero)
    assert naming.mostly_unknown(found) is unknown


@pytest.mark.parametrize(
    ("left", "parameters", "kept"),
    [(0.60, 3, True), (0.60, 1, False), (0.575, 3, True), (0.575, 2, False), (0.30, 3, False)],
)
@pytest.mark.usefixtures("plain")
def test_a_name_is_not_withdrawn_for_a_law_that_takes_no_more(monkeypatch, left, parameters, kept):
    """What takes less than it leaves is named all the same, where the best of all laws takes no more.

    Of one with more parameters most is enough: 0.71^2 - 0.60^2 is 83 % of 0.71^2 - 0.575^2.
    """
    found = search(explained=20.0, unexplained=60.0, before=0.71, after=0.60)
    alone = Of(simulated={"y": left / 0.60 * found.held_augmented.simulated["y"]})
    laws = Of(complete=True, listed=(Of(predicts=True),), fit=parameters, held_out=alone)
    found.augmented, found.problem.judged = 2, lambda _, values: values
    for module in (naming, rivals):
        monkeypatch.setattr(module, "parameters_of", lambda fit: fit)
    monkeypatch.setattr(naming, "replace", lambda of, **changed: Of(**{**vars(of), **changed}))
    assert naming.mostly_unknown(found)
    assert naming.kept_beside_laws(found, laws).kept is kept
    assert naming.mostly_unknown(naming.kept_beside_laws(found, laws)) is not kept


@pytest.mark.parametrize(("variables", "unknown"), [(("u",), True), (RUNS, False)])
@pytest.mark.usefixtures("plain")
def test_what_leaves_several_times_what_it_takes_is_no_name_where_the_rest_is_no_noise(variables, unknown):
    """A lag takes a fifth of the error of a servo that turns only so fast; a colour makes noise of the rest.

    Of zeros that move from run to run nothing is said of what is left within them: it stays noise.
    """
    found = search(explained=60.0, unexplained=1.0, before=0.71, after=0.63)
    found.problem.stated_sd = lambda _: None
    (output,), (rest,) = found.errors, found.structure
    output.noise_floor, output.sensor_sd, rest.variables = 0.60, 0.01, variables
    found.augmented = Of(residual={"y": 0.60 / 0.63 * found.held_augmented.simulated["y"]})
    assert naming.mostly_unknown(found) is unknown


@pytest.mark.parametrize(("step", "unknown"), [("step 3: joint fits", False), ("swaps", True)])
@pytest.mark.usefixtures("plain")
def test_steps_of_a_search_that_was_cut_short_are_shown_beside_a_rest_that_it_has_not_seen(step, unknown):
    found = search(explained=20.0, unexplained=60.0, before=0.71, after=0.6)
    found.skipped = (step,)
    assert naming.mostly_unknown(found) is unknown


@pytest.mark.parametrize(("unit", "outsized"), [("N", True), ("mV/V", True), ("T", False), ("degC", False)])
def test_a_loop_as_wide_as_no_cell_has_speaks_against_a_cell_and_not_against_an_iron(unit, outsized):
    effect = effects()["hysteresis"]
    values = {each.name: 1.0 for each in effect.parameters}
    active = AppliedEffect(effect=effect, channel="B", values=values | {"width": 1.0, "gain": 1.0})
    problem = Of(
        names=("B",), observed={"B": np.linspace(-1, 1, 50)}, kept={"B": np.ones(50, bool)},
        slices=(slice(0, 50),), runs=(),
        model=Of(outputs=(Of(name="B", unit=unit),), capability=Of(motion=None)),
        case=Of(channels=(Of(name="B", unit=unit),), unit=lambda _: unit, parameters=()),
    )  # fmt: skip
    assert is_outsized(problem, active) is outsized
