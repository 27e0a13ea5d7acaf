"""Exact binomial intervals (Clopper and Pearson, Biometrika 26, 1934)."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.stats import beta


@dataclass(frozen=True, slots=True)
class Rate:
    """An observed rate with its exact 95 % interval."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """Return the observed rate; nan where nothing was observed."""
        return self.hits / self.of if self.of else float("nan")

    @property
    def low(self) -> float:
        """Return the lower end."""
        return float(beta.ppf(0.025, self.hits, self.of - self.hits + 1)) if self.hits else 0.0

    @property
    def high(self) -> float:
        """Return the upper end."""
        if self.hits == self.of:
            return 1.0
        return float(beta.ppf(0.975, self.hits + 1, self.of - self.hits))

    def __str__(self) -> str:
        """Return `12 of 40 = 30.0 % (16.6 to 46.5)`."""
        if not self.of:
            return "none observed"
        low, high = 100 * self.low, 100 * self.high
        return f"{self.hits} of {self.of} = {100 * self.value:.1f} % ({low:.1f} to {high:.1f})"


def rate(flags: list[bool]) -> Rate:
    """Return the rate of true flags."""
    return Rate(sum(flags), len(flags))
