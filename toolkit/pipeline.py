"""Raw recordings to characteristics: the only place that chains the stages."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.characteristics.model import Characteristics
from toolkit.reduction.model import ReducedTest


@dataclass(frozen=True, slots=True, kw_only=True)
class TestResult:
    """A test from end to end."""

    __test__ = False  # not a pytest class

    reduced: ReducedTest
    characteristics: Characteristics
