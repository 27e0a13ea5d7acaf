"""Simulations that failed during a search: a refit that could not move is not one that need not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from toolkit.errors import FitError
from toolkit.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from toolkit.diagnosis.case import Case, Run
    from toolkit.diagnosis.model import Active


class Refused:
    """A model's ``simulate`` that counts how often the simulation itself, without effects, gave nothing."""

    def __init__(self, simulate: Callable[..., dict[str, NDArray[np.float64]]]) -> None:
        self._simulate = simulate
        self._calls = self._failed = 0
        self._first = ""

    def __call__(
        self, run: Run, p: Mapping[str, float], active: Sequence[Active]
    ) -> dict[str, NDArray[np.float64]]:
        """Return the outputs of a run."""
        self._calls += not active
        try:
            return self._simulate(run, p, active)
        except FitError as error:
            if not active:
                self._failed += 1
                told = ", ".join(f"{name} = {value:.6g}" for name, value in p.items())
                self._first = self._first or f"{run.name}, {told}: {error.got}"
            raise

    def findings(self, case: Case) -> tuple[Finding, ...]:
        """Return what is to be told; nothing where every simulation gave numbers."""
        if not self._failed:
            return ()
        return (
            Finding(
                rule="simulator-refuses",
                where=f"{case.path.name}: simulation",
                message=f"{self._failed} of {self._calls} simulations with other values of the parameters "
                f"gave no usable output, first {self._first}",
            ),
        )
