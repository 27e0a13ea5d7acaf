"""What the tests of every format ask: the same table again, or a refusal with all of its parts."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from toolkit.errors import ToolkitError, UnreadableError
from toolkit.machine import load_machine

M15 = load_machine("m15")
ROWS = 12


def refused(read, data, rule, kind: type[ToolkitError] = UnreadableError):
    with pytest.raises(kind) as caught:
        read(data)
    assert "a recording" in caught.value.where
    return whole(caught.value, rule)


def whole(error, rule=None):
    """The same error, which has every part, the rule where one is told, and survives the way to a caller."""
    assert error.rule == rule if rule is not None else error.rule, str(error)
    assert error.where
    assert error.got
    assert error.expected
    assert error.next_step
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # noqa: S301
    return error


def same(one, table):
    for symbol, values in table.items():
        np.testing.assert_array_equal(one[symbol].values, values)
        assert one[symbol].values.dtype == np.float64
        assert not one[symbol].values.flags.writeable
