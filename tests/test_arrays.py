"""What is kept of the very same arrays, and what is computed again."""

import numpy as np

from toolkit.arrays import kept_of_the_same


def test_the_very_same_arrays_are_answered_once_and_equal_ones_again():
    asked = []

    @kept_of_the_same(2)
    def total(first, second):
        asked.append(1)
        return first + second

    one, two = np.arange(3.0), np.ones(3)
    assert total(one, two) is total(one, two)
    assert len(asked) == 1
    np.testing.assert_array_equal(total(one.copy(), two), total(one, two))
    assert len(asked) == 2
    total(two, one)  # the third: the first is forgotten
    total(one, two)
    assert len(asked) == 4
