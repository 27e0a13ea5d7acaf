"""Whether what was found is named beside a rest that has no name."""

from types import SimpleNamespace as Of

import numpy as np
import pytest

from toolkit.diagnosis.answer import naming
from toolkit.diagnosis.answer.next_measurements import outsized
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects


def search(*, explained, unexplained, before, after, floor):
    """Return a search by its log-likelihoods, and the held-out errors of its one output."""
    step = Of(active=Of(effect=Of(from_digits=False)), gain=explained)
    rest = Of(output="y", variables=("u",), rest=False, gain=2 * unexplained)
    errors = Of(channel="y", refitted_rmse=before, augmented_rmse=after, noise_floor=floor)
    return Of(problem=Of(), steps=(step,), structure=(rest,), errors=(errors,))


@pytest.fixture
def plain(monkeypatch):
    """Leave the other rules out: no parameter far off, no law of a cell, nothing within the accuracy."""
    monkeypatch.setattr(naming, "implausible", lambda _: ())
    monkeypatch.setattr(naming, "outsized", lambda _: False)
    monkeypatch.setattr(naming, "_is_within_accuracy", lambda _: False)
    monkeypatch.setattr(naming, "held_out_errors", lambda of, **_: of.errors)


@pytest.mark.parametrize(("after", "unknown"), [(0.49, False), (0.60, True)])
@pytest.mark.usefixtures("plain")
def test_what_takes_more_of_the_unseen_rows_than_it_leaves_is_not_outweighed(after, unknown):
    """A coloured noise weighs a slow error of half a volt by a few units of the log-likelihood."""
    found = search(explained=20.0, unexplained=60.0, before=0.71, after=after, floor=0.02)
    assert naming.mostly_unknown(found) is unknown


@pytest.mark.parametrize(
    ("unit", "is_outsized"), [("N", True), ("mV/V", True), ("T", False), ("degC", False)]
)
def test_a_loop_as_wide_as_no_cell_has_speaks_against_a_cell_and_not_against_an_iron(unit, is_outsized):
    effect = effects()["hysteresis"]
    values = {each.name: 1.0 for each in effect.parameters}
    active = AppliedEffect(effect=effect, channel="B", values=values | {"width": 1.0, "gain": 1.0})
    problem = Of(
        names=("B",), observed={"B": np.linspace(-1, 1, 50)}, kept={"B": np.ones(50, bool)},
        slices=(slice(0, 50),), runs=(),
        model=Of(outputs=(Of(name="B", unit=unit),), capability=Of(motion=None)),
        case=Of(channels=(Of(name="B", unit=unit),), unit=lambda _: unit, parameters=()),
    )  # fmt: skip
    assert outsized(Of(problem=problem, steps=(Of(active=active),))) is is_outsized
