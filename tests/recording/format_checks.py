"""What the tests of every format ask: the same table again, or a refusal with all of its parts."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.errors import ToolkitError, UnreadableError
from toolkit.machine import load_machine

M15 = load_machine("m15")
ROWS = 12


def refused(read, data, rule, kind: type[ToolkitError] = UnreadableError):
    with pytest.raises(kind) as caught:
        read(data)
    error = caught.value
    assert error.rule == rule, str(error)
    assert "a recording" in error.where
    assert error.got
    assert error.expected
    assert error.next_step
    return error


def same(one, table):
    for symbol, values in table.items():
        np.testing.assert_array_equal(one[symbol].values, values)
        assert one[symbol].values.dtype == np.float64
        assert not one[symbol].values.flags.writeable
