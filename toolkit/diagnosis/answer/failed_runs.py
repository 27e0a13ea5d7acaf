"""Simulations that failed during a search: a refit that could not move is not one that need not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from toolkit.errors import FitError
from toolkit.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Callable

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.effects.applied import AppliedEffect


class FailedRuns:
    """A model's ``simulate`` that counts where the simulation gave nothing: by itself, and with an effect."""

    def __init__(self, simulate: Callable[..., dict[str, Array]]) -> None:
        self._simulate = simulate
        self._tried: set[tuple[float, ...]] = set()
        self._failed: set[tuple[float, ...]] = set()
        self._first = ""
        self._with: dict[str, list[int]] = {}  # effect -> simulations with it, and those that gave nothing

    def __call__(self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> dict[str, Array]:
        """Return the outputs of a run."""
        values = tuple(p.values())
        counted = self._with.setdefault(_told(active[-1]), [0, 0]) if active else [0, 0]
        counted[0] += 1
        if not active:
            self._tried.add(values)
        try:
            return self._simulate(run, p, active)
        except FitError as error:
            counted[1] += 1
            if not active:
                self._failed.add(values)
                told = ", ".join(f"{name} = {value:.6g}" for name, value in p.items())
                self._first = self._first or f"{run.name}, {told}: {error.got}"
            raise

    def findings(self, case: Case) -> tuple[Finding, ...]:
        """Return what is to be told; nothing where every simulation gave numbers."""
        never = sorted(name for name, (attempts, failed) in self._with.items() if attempts == failed)
        lines = [
            Finding(
                rule="effect-not-simulated",
                where=f"{case.path.name}: simulation",
                message=f"with {name} the simulation gave no usable output at any size that was tried",
                level="note",
            )
            for name in never
        ]
        if self._failed:
            lines.append(
                Finding(
                    rule="simulator-refuses",
                    where=f"{case.path.name}: simulation",
                    message=f"with {len(self._failed)} of {len(self._tried)} sets of parameters the "
                    f"simulation gave no usable output, first {self._first}",
                )
            )
        return tuple(lines)


def _told(effect: AppliedEffect) -> str:
    return effect.key._replace(source=None).label
