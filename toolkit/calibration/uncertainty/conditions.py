"""Conditions of use that no session states: they belong to the one who reads the instrument."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Temperature:
    """How far from the session's temperature the instrument is used.

    ``half_range_K`` [K] at most, either way; ``coefficient_per_K`` [1/K] relative change of the load with
    temperature, None where the cells' own stated coefficients are to be taken.
    """

    half_range_K: float
    coefficient_per_K: float | None = None
