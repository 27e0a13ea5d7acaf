"""One weighted least-squares problem: the vector that makes the whitened residual and the priors least.

A simulation is dear, and derivatives by differences take one for each parameter. They are taken anew only
where the simulation has left the straight line: on the way they are corrected by what each trial shows
(Broyden). An answer never rests on derivatives that are off by more than a few percent along the way to it.

Source: Broyden, Math. Comp. 19 (1965) 577.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Autoregression, Layout, whiten
from toolkit.diagnosis.fit.space import Space
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Stacked = dict[str, Array]

_TRIALS = 12
_AGAIN = 3
_BENT = 0.3  # of a step's response: more off the straight line, and derivatives are taken anew
_STRAIGHT = 0.02  # of the whole way's response: less off, and they were good enough to end on
_NOTHING = 0.1  # standard deviations of the noise, over the whole recording: no way at all


class Derivatives:
    """Derivatives of a simulation, kept from one trial to the next: d(simulated)/dx over all rows."""

    def __init__(self, space: Space) -> None:
        self.space = space
        self._last: tuple[Array, Stacked, Stacked] | None = None
        self._fresh: tuple[Array, Stacked, Stacked] | None = None

    def kept(self) -> Derivatives:
        """Return the last differences for another descent, which corrects them on its own way."""
        other = Derivatives(self.space)
        other._last = other._fresh = self._fresh
        return other

    def anew(self, x: Array) -> Stacked:
        """Return the derivatives at a vector by differences."""
        if self._fresh is None or not np.array_equal(self._fresh[0], x):
            self._fresh = (x.copy(), *self.space.around(x))
        self._last = self._fresh
        return self._fresh[2]

    def at(self, x: Array, weighing: Weighing) -> Stacked:
        """Return the derivatives at a vector: known ones, corrected ones, or those by differences."""
        if self._last is None:
            return self.anew(x)
        before, there, slopes = self._last
        step = x - before
        if not step.any():
            return slopes
        simulated = self.space.simulated(x)
        moved = {name: column - there[name] for name, column in simulated.items()}
        off = {name: change - slopes[name] @ step for name, change in moved.items()}
        if weighing.size(off) > max(_BENT * weighing.size(moved), _NOTHING):
            return self.anew(x)
        along = step / float(step @ step)
        self._last = (
            x.copy(),
            simulated,
            {name: slope + np.outer(off[name], along) for name, slope in slopes.items()},
        )
        return self._last[2]

    def trusted(self, x: Array, weighing: Weighing) -> bool:
        """Tell whether the last differences were taken near enough to a vector for it to be an answer."""
        if self._fresh is None:
            return False
        begun, there, slopes = self._fresh
        simulated = self.space.simulated(x)
        moved = {name: column - there[name] for name, column in simulated.items()}
        off = {name: change - slopes[name] @ (x - begun) for name, change in moved.items()}
        way = weighing.size(moved)
        return way < _NOTHING or weighing.size(off) < _STRAIGHT * way


class Weighing:
    """What rows are worth: their layouts and noise, and the priors beside them."""

    def __init__(self, space: Space, layouts: dict[str, Layout], noise: dict[str, Autoregression]) -> None:
        self._space, self._layouts, self._noise = space, layouts, noise

    def _whitened(self, values: Stacked) -> Array:
        parts = [
            whiten(values[name][where.index], where, self._noise[name])
            for name, where in self._layouts.items()
        ]
        white = np.concatenate(parts)
        return np.where(np.isfinite(white), white, 1e6)

    def size(self, values: Stacked) -> float:
        """Return the size of a difference of simulations in standard deviations of the noise."""
        return float(np.linalg.norm(self._whitened(values)))

    def cost(self, x: Array) -> Array:
        """Return the whitened residual with the priors' beneath, large where nothing can be simulated."""
        try:
            residual = self._space.residual(self._space.simulated(x))
        except FitError:
            return np.full(
                sum(layout.n for layout in self._layouts.values()) + len(self._space.problem.free), 1e6
            )
        p, _ = self._space.split(x)
        return np.concatenate([self._whitened(residual), self._space.problem.off_priors(p)])

    def slope(self, slopes: Stacked) -> Array:
        """Return d(cost)/dx from d(simulated)/dx."""
        prior = self._space.problem.prior_rows(self._space.sizes, len(self._space.sizes))
        return np.concatenate([self._whitened({name: -slope for name, slope in slopes.items()}), prior])


def descend(
    space: Space,
    layouts: dict[str, Layout],
    x: Array,
    noise: dict[str, Autoregression],
    derivatives: Derivatives,
) -> Array:
    """Return the vector of least squares, searched from ``x``.

    Parameters
    ----------
    noise : by which each output is whitened
    derivatives : found before, or empty; they are kept up
    """
    from scipy.optimize import least_squares

    if not len(x):
        return x
    weighing = Weighing(space, layouts, noise)

    def slope(v: NDArray[np.float64]) -> NDArray[np.float64]:
        return weighing.slope(derivatives.at(v, weighing))

    for _ in range(_AGAIN):
        x = least_squares(
            weighing.cost,
            x,
            slope,
            bounds=(space.low, space.high),
            x_scale=1.0,
            max_nfev=_TRIALS,
            ftol=1e-6,
            xtol=1e-5,  # of a parameter's size: the step after it would be smaller by orders
            gtol=1e-9,
        ).x
        if derivatives.trusted(x, weighing):
            break
        derivatives.anew(x)
    return x
