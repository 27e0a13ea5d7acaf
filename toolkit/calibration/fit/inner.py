"""The inner product of two long columns, in one thread.

The threads of a BLAS gain nothing on some thousand numbers, wait for each other where cores are shared, and
add in an order that depends on their number: a record's last digit should not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def inner(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the sum of products of two columns (rows,).

    >>> inner(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    11.0
    """
    return float(np.einsum("i,i->", a, b))
