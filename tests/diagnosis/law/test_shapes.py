"""The shapes of laws: what is put together of a signal can be evaluated, however little it moves."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.diagnosis.law.shapes import curve
from toolkit.effects.formula import formula


@pytest.mark.parametrize("spread", [1.0, 1e-3, 1e-5, 1e-7, 0.0])
def test_a_curve_has_as_many_knots_as_can_be_written(spread):
    x = 217.3 + spread * np.sin(np.arange(300) * 0.1)
    shape = curve(x)
    law = formula(shape.text.format(x="[P]"))
    assert set(law.parameters) == set(shape.units)
    if len(shape.units) > 1:
        heights = dict.fromkeys(shape.units, 2.5)
        np.testing.assert_allclose(law({"P": x}, heights), 2.5)
