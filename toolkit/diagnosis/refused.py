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
    """A model's ``simulate`` that counts the parameters at which the simulation itself gave nothing."""

    def __init__(self, simulate: Callable[..., dict[str, NDArray[np.float64]]]) -> None:
        self._simulate = simulate
        self._tried: set[tuple[float, ...]] = set()
        self._failed: set[tuple[float, ...]] = set()
        self._first = ""

    def __call__(
        self, run: Run, p: Mapping[str, float], active: Sequence[Active]
    ) -> dict[str, NDArray[np.float64]]:
        """Return the outputs of a run."""
        values = tuple(p.values())
        if not active:
            self._tried.add(values)
        try:
            return self._simulate(run, p, active)
        except FitError as error:
            if not active:
                self._failed.add(values)
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
                message=f"with {len(self._failed)} of {len(self._tried)} sets of parameters the simulation "
                f"gave no usable output, first {self._first}",
            ),
        )
