"""An earlier test for plans: the independent tire of the characteristics' tests, its scatter known."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from tests.characteristics.tire_factory import M15, reduced_test
from toolkit.characteristics.characterise import characterise
from toolkit.pipeline import TestResult
from toolkit.planning.expectation import EarlierTest, earlier_test

LOADS = tuple(M15.protocol.loads_N)
# Of one condition: of its rows [N, N·m], and beyond them FY, MZ, load [N], slip angle [rad]; none of a rest.
ROWS = (2.0, 0.05)
VARIANCES = np.array([3.0**2, 0.06**2, 1.0**2, np.radians(0.002) ** 2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


@functools.cache
def earlier(
    loads: tuple[float, ...] = LOADS, directions: tuple[str, ...] = ("forward", "reverse")
) -> EarlierTest:
    """An earlier test whose scatter is what `VARIANCES` say."""
    reduced = reduced_test(loads=loads, directions=directions, u=ROWS)
    found = characterise(reduced, machine=M15, record=None)
    known = earlier_test(TestResult(reduced=reduced, characteristics=found), machine=M15, record=None)
    return dataclasses.replace(known, variances=VARIANCES, variances_u=0.2 * VARIANCES, load_spread=0.01)
