"""When effects that were found are not named: a smooth discrepancy without a name explains more."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from toolkit.diagnosis.answer.naming import _is_smooth
from toolkit.diagnosis.search.unexplained import StructureFound
from toolkit.effects.catalogue import effects

ROWS = 6000
COST = 0.5 * math.log(ROWS)


def searched(gain, smooth_gain, *, columns=6, name="wear", rest=False):
    effect = effects()[name]
    active = SimpleNamespace(effect=effect, searched=effect.parameters[:1])
    smooth = StructureFound(
        output="FY", variables=("SA",), gain=2 * smooth_gain, p_value=1e-9, rest=rest, columns=columns
    )
    return SimpleNamespace(
        problem=SimpleNamespace(kept={"FY": np.ones(ROWS, dtype=bool)}),
        steps=(SimpleNamespace(active=active, gain=gain),),
        structure_before=(smooth,),
    )


# Six columns cost five parameters more than the effect's one, and three more are asked of them.
LEAST = 5 * COST + 3


@pytest.mark.parametrize(("more", "smooth"), [(LEAST + 1, True), (LEAST - 1, False), (0.0, False)])
def test_a_smooth_discrepancy_pays_for_its_columns(more, smooth):
    assert _is_smooth(searched(20.0, 20.0 + more)) is smooth


def test_what_is_read_off_the_digits_imitates_nothing():
    assert not _is_smooth(searched(20.0, 500.0, name="quantisation"))


def test_a_rest_and_a_line_are_no_smooth_discrepancy():
    assert not _is_smooth(searched(20.0, 500.0, rest=True))
    assert not _is_smooth(searched(20.0, 500.0, columns=0))
