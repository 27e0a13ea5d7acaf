"""Starts and forces that the global Magic Formulas (MF 5.2, 6.1, 6.2) share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.tires.global_model import Responses
from toolkit.tires.mf_combined import Forces
from toolkit.tires.slip import State, state

if TYPE_CHECKING:
    from toolkit.tires.global_model import GlobalParameter, Rows, Seeds

Evaluator = Callable[..., Forces]


def mf_forces(parameters: Sequence[GlobalParameter], evaluator: Evaluator) -> Any:
    """Return the function ``forces(values, rows)`` of an evaluator of tire files."""
    names = tuple(one.name for one in parameters)

    def forces(values: Sequence[Any], rows: Rows) -> Responses:
        p: Mapping[str, Any] = dict(zip(names, values, strict=True))
        made = evaluator(p, mf_state(rows), UNLOADED_RADIUS=rows.UNLOADED_RADIUS)
        return Responses(FY=made.FY, MZ=made.MZ, FX=made.FX)

    return forces


def mf_state(rows: Rows) -> State:
    """Return the state of the rows: alpha* = tan(alpha), gamma* = sin(gamma), forward."""
    return state(
        {}, SA=rows.SA, FZ=rows.FZ, FNOMIN=rows.FNOMIN, IA=rows.IA, KAPPA=rows.KAPPA,
        pressure_change=rows.dpi, V=rows.V,
    )  # fmt: skip


def mf_starts(seeds: Seeds) -> Sequence[Mapping[str, float]]:
    """Return starts: stiffness and friction of each load from the seeds, shape and curvature tried.

    PKY1 enters linearly for each PKY2 and is solved on a grid of PKY2.
    """
    load, F0 = seeds.load, seeds.FNOMIN
    PDY1, PDY2 = seeds.at_nominal(seeds.peak / load)
    best = (np.inf, -20.0, 2.0)
    for PKY2 in np.geomspace(0.3, 12.0, 40) if len(load) > 1 else (2.0,):
        shape = F0 * np.sin(2 * np.arctan(load / F0 / PKY2))
        PKY1 = -float(shape @ seeds.stiffness / (shape @ shape))
        cost = float(np.sum((PKY1 * shape + seeds.stiffness) ** 2))
        best = min(best, (cost, PKY1, float(PKY2)))
    trail = seeds.at_nominal(seeds.trail / load * F0 / 0.3)[0] if np.isfinite(seeds.trail).any() else 0.1
    trail = trail if 0.01 < trail < 0.6 else 0.1
    common = {"PDY1": PDY1, "PDY2": PDY2, "PKY1": best[1], "PKY2": best[2], "QDZ1": trail}
    return [
        {**common, "PCY1": C, "PEY1": E, "QBZ1": B, "QCZ1": Ct, "QEZ1": Et, "PCX1": C + 0.2, "PEX1": E}
        for (C, E), (B, Ct, Et) in product(
            ((1.3, -0.5), (1.5, 0.4), (1.15, -2.5)), ((9.0, 1.2, -1.0), (18.0, 1.1, -3.0))
        )
    ]
