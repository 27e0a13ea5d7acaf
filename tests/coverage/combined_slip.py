"""Coverage of combined slip: parameters of Magic Formula 6.1 that are printed with a standard error.

A car tire is measured at three loads, at slip angles crossed with slip ratios, with one per cent of noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from tests.coverage.rows import CoverageRow, row_of
from tests.tires.tire_factory import CAR, crossed, measured
from toolkit.tires import global_data
from toolkit.tires.global_fit import fit_global
from toolkit.tires.global_model import GlobalModel, ModelFit
from toolkit.tires.models import find

SLIPS = {
    "wide": (-0.2, -0.1, 0.0, 0.1, 0.2),
    "fine": (-0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15),
}
# Magic Formula 6.1 is the same with these turned round.
EVEN = {"RBX2", "RBY2", "RVY1", "RVY2", "RVY4", "RVY6"}


def fitted(slips: tuple[float, ...], seed: int, *, step: float = 3.0) -> ModelFit:
    """Return the model fitted to one measurement; ``step`` between slip angles [deg]."""
    model = find("mf61")
    assert isinstance(model, GlobalModel)
    columns = crossed(
        FZ=[2000.0, 4000.0, 6000.0], KAPPA=list(slips), SA=np.radians(np.arange(-12.0, 12.1, step))
    )
    rows = measured(CAR, columns, noise=0.01, channels=("FX", "FY"), seed=seed)
    data = global_data.measured(rows, axes="ISO-W", rated_load_N=CAR["F0"], unloaded_radius_m=CAR["R0"])
    return fit_global(model, data, predict=False)


def errors(fit: ModelFit) -> Iterator[tuple[float, float]]:
    """Yield the error and the standard error of every parameter that is printed with one."""
    for channel in fit.fits:
        for parameter in channel.parameters:
            if parameter.standard_error is not None:
                truth, value = CAR.get(parameter.name, 0.0), parameter.value
                if parameter.name in EVEN:
                    truth, value = abs(truth), abs(value)
                yield value - truth, parameter.standard_error


def _errors(slips: tuple[float, ...], seed: int) -> list[tuple[float, float]]:
    return list(errors(fitted(slips, seed)))


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return a row for each set of slip ratios, one fit in seven for a repetition of the other tables.

    The parameters of a fit share its noise: the interval of the share is narrower than it ought to be.
    """
    seeds = [1000 * seed + i for i in range(max(8, repetitions // 7))]
    rows = []
    with ProcessPoolExecutor(workers) as pool:
        for name, slips in SLIPS.items():
            found = [one for fit in pool.map(partial(_errors, slips), seeds) for one in fit]
            u = [error for _, error in found]
            rows.append(
                row_of(
                    "parameters of combined slip, error where printed",
                    f"{len(seeds)} fits of {name} slip ratios",
                    errors=[error for error, _ in found],
                    u=u,
                    U=[2.0 * one for one in u],
                )
            )
    return rows
