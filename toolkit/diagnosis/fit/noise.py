"""Coloured noise: an autoregression per output, fitted by Burg over all runs, and exact whitening with it.

Residuals of steady models are autocorrelated; a test that takes them as white names an effect in nearly
every clean recording. Here a residual is judged by its innovations: what its own past does not predict.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import NOISE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """By what a rest is weighed that is no noise: its size, over values that its memory leaves independent.

    ``rows`` to one independent value. Of an output that only drifts it is its changes over some rows, as many
    as are ``apart``; of any other its values, none apart.
    """

    rows: float
    apart: int = 0

    def weighed(self, values: Array, where: Layout) -> Array:
        """Return what counts of kept values, (n,) or (n, k): nothing of rows with none so far behind them."""
        if not self.apart:
            return values
        changes = np.zeros_like(values)
        for segment in where.segments:
            part = values[segment]
            changes[segment][self.apart :] = part[self.apart :] - part[: len(part) - self.apart]
        return changes

    def counted(self, where: Layout) -> int:
        """Return how many rows of a layout count."""
        return sum(max(segment.stop - segment.start - self.apart, 0) for segment in where.segments)

    def independent(self, where: Layout) -> float:
        """Return the number of independent values of a layout."""
        return self.counted(where) / self.rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Autoregression:
    """An autoregression: reflection coefficients, and the innovations' standard deviation.

    ``reflection`` has one entry an order; white noise has none. ``sd`` is in the output's unit. What a
    simulation is off by is no noise, and its past foretells no row of it: it has a ``memory`` and is weighed
    by that.
    """

    reflection: tuple[float, ...]
    sd: float
    memory: Memory | None = None

    @property
    def is_coloured(self) -> bool:
        """Tell whether rows are weighed by what their past foretells of them."""
        return bool(self.reflection) and self.memory is None

    @property
    def marginal_sd(self) -> float:
        """Standard deviation of the noise itself."""
        keep = math.prod(1 - k * k for k in self.reflection)
        return self.sd / math.sqrt(max(keep, 1e-12))

    @property
    def correlation_rows(self) -> float:
        """Rows to one independent value of the noise's mean: its spectrum at zero over its variance."""
        if self.memory is not None:
            return self.memory.rows
        polynomial = predictor(self.reflection)[-1]
        at_zero = (self.sd / max(abs(1 - float(np.sum(polynomial))), 1e-6)) ** 2
        return max(1.0, at_zero / max(self.marginal_sd**2, 1e-300))


def memory_of(noise: Autoregression, rows: int) -> float:
    """Return the rows to one independent value of a noise's square, and of its mean, whichever are more.

    A mean square of many rows scatters as one of so many fewer (Bartlett).
    """
    correlation = autocovariance(noise, max(rows, 2)) / noise.marginal_sd**2
    return max(noise.correlation_rows, 2 * float(np.sum(correlation**2)) - 1)


def predictor(reflection: Sequence[float]) -> list[Array]:
    """Return the predictor of every order 0..p: value = sum a_j * value[-j] (Levinson's recursion)."""
    orders: list[Array] = [np.zeros(0)]
    for k in reflection:
        last = orders[-1]
        orders.append(np.concatenate([last - k * last[::-1], [k]]))
    return orders


def autocovariance(noise: Autoregression, count: int) -> Array:
    """Return the noise's autocovariance at lags 0 to ``count`` - 1, shape (count,)."""
    orders = predictor(noise.reflection)
    gamma = np.zeros(count)
    gamma[0] = noise.marginal_sd**2
    innovation, p = gamma[0], len(noise.reflection)
    for k in range(1, min(p + 1, count)):
        # Levinson's recursion read backwards: the reflection coefficient gives the next lag.
        predicted = float(orders[k - 1] @ gamma[k - 1 : 0 : -1]) if k > 1 else 0.0
        gamma[k] = predicted + noise.reflection[k - 1] * innovation
        innovation *= 1 - noise.reflection[k - 1] ** 2
    for k in range(p + 1, count):
        gamma[k] = float(orders[p] @ gamma[k - 1 : k - p - 1 : -1]) if p and k > p else 0.0
    return gamma


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Where the values of one output stand in all its runs: segments without a gap, and what is masked.

    ``index`` are places of the kept values among all rows of all runs; ``segments`` slices of them; ``runs``
    is how many runs have any.
    """

    index: NDArray[np.int64]
    segments: tuple[slice, ...]
    runs: int = 1

    @property
    def n(self) -> int:
        """Number of kept values."""
        return len(self.index)


@dataclass(frozen=True, slots=True, eq=False)
class Differences:
    """Differences of an output's kept values over some ``rows`` within a layout; over none the values."""

    where: Layout
    rows: int

    @property
    def layout(self) -> Layout:
        """Where the differences themselves stand: all of them, one after the other."""
        counts = [max(part.stop - part.start - self.rows, 0) for part in self.where.segments]
        ends = np.cumsum([0, *counts]).tolist()
        segments = tuple(slice(a, b) for a, b in itertools.pairwise(ends) if b > a)
        return Layout(np.arange(ends[-1]), segments, self.where.runs)

    def of(self, column: Array) -> Array:
        """Return the differences of a column over all rows, (rows,) or (rows, k)."""
        values = column[self.where.index]
        parts = [values[part] for part in self.where.segments]
        return np.concatenate(
            [part[self.rows :] - part[: len(part) - self.rows] if self.rows else part for part in parts]
        )


def layout(times: Sequence[Array], counted: Sequence[NDArray[np.bool_]], *, ordered: bool = True) -> Layout:
    """Return the layout of one output.

    Parameters
    ----------
    times : of each run [s], shape (n_run,)
    counted : of each run, which values count
    ordered : rows follow each other; else each is a series of its own, and of no other's past
    """
    index, segments, offset, start = [], [], 0, 0
    for t, good in zip(times, counted, strict=True):
        at = np.flatnonzero(good)
        if len(at):
            steps = np.diff(t[at])
            usual = np.median(np.diff(t)) if len(t) > 1 else 1.0
            breaks = np.flatnonzero((steps > NOISE.gap * usual) | (not ordered)) + 1
            for piece in np.split(at, breaks):
                segments.append(slice(start, start + len(piece)))
                start += len(piece)
            index.append(at + offset)
        offset += len(t)
    places = np.concatenate(index) if index else np.zeros(0, dtype=np.int64)
    return Layout(places.astype(np.int64), tuple(segments), len(index))


def fit_noise(
    residual: Array,
    where: Layout,
    *,
    floor: float,
    sd: float | None = None,
    used: int = 0,
    memory: Memory | None = None,
) -> Autoregression:
    """Return the noise of a residual: Burg's method over all segments, the order by BIC.

    Parameters
    ----------
    residual : kept values, (n,)
    floor : smallest standard deviation that can be [unit of the output], the resolution of the numbers
    sd : total sensor noise that a certificate states; the innovations are never taken as smaller than what
        it leaves
    used : parameters that were fitted to the residual
    memory : by which a residual is weighed that is known to be no noise
    """
    n = where.n
    if memory is not None:
        residual, n = memory.weighed(residual, where), memory.counted(where)
    if n == 0:
        return Autoregression(reflection=(), sd=floor, memory=memory)
    variance = float(np.sum(residual**2)) / n
    if memory is None and sd is not None and variance > (NOISE.mismatch * sd) ** 2:
        # Most of it is none of the sensor's. Taken as coloured noise, a smooth mismatch foretells itself, and
        # what mends all but a jagged rest of it would look worse than nothing.
        return Autoregression(reflection=(), sd=math.sqrt(variance * n / max(n - used, 1)))
    reflection: list[float] = []
    best, best_score = 0, math.log(max(variance, 1e-300))
    usable = _telling(where)
    if usable:
        # One segment behind the other, as a recording may have hundreds: what a segment's first values would
        # take from the one before is none.
        lengths = np.array([segment.stop - segment.start for segment in usable])
        starts = np.cumsum(lengths) - lengths
        forward = backward = np.concatenate([residual[segment] for segment in usable])
        innovation = variance
        for order in range(1, NOISE.orders + 1):
            forward, backward = forward[1:], backward[:-1]
            if len(starts) > 1:
                forward, backward = forward.copy(), backward.copy()
                before, first = starts - order, starts - 1
                backward[before[before >= 0]] = 0.0
                forward[first[(first >= 0) & (first < len(forward))]] = 0.0
            top = float(forward @ backward)
            bottom = float(forward @ forward) + float(backward @ backward)
            if bottom <= 0 or int(np.maximum(lengths - order, 0).sum()) < NOISE.fewest - order:
                break
            k = max(min(2 * top / bottom, 0.9999), -0.9999)
            forward, backward = forward - k * backward, backward - k * forward
            reflection.append(k)
            innovation *= 1 - k * k
            score = math.log(max(innovation, 1e-300)) + order * math.log(n) / n
            if score < best_score - 1e-12:
                best, best_score = order, score
    coefficients = tuple(reflection[:best])
    if memory is not None:
        keep = max(math.prod(1 - k * k for k in coefficients), 1e-12)
        size = max(math.sqrt(variance * n / max(n - used, 1)), floor)
        return Autoregression(reflection=coefficients, sd=size * math.sqrt(keep), memory=memory)
    white = whiten(residual, where, Autoregression(reflection=coefficients, sd=1.0))
    dof = max(n - used, 1)
    sd_of_innovations = math.sqrt(float(np.sum(white**2)) / dof)
    if sd is not None:
        sd_of_innovations = max(
            sd_of_innovations,
            sd * math.sqrt(math.prod(1 - k * k for k in coefficients))
            if not coefficients
            else sd_of_innovations,
        )
    return Autoregression(reflection=coefficients, sd=max(sd_of_innovations, floor))


def _telling(where: Layout) -> list[slice]:
    """Return the segments that tell a noise's colour: the long ones, or all where those are the fewer rows.

    A recording with a pause after every few rows has its longest segments where it stood still, and what is
    left there has not the colour of the rest. Short runs without a pause tell none: what each leaves about
    its own zero is a scatter of the runs (`run_scatter`).
    """
    long = [segment for segment in where.segments if segment.stop - segment.start >= NOISE.fewest]
    held = sum(segment.stop - segment.start for segment in long)
    paused = len(where.segments) >= NOISE.paused * where.runs
    return list(where.segments) if held < NOISE.telling * where.n and (held or paused) else long


def whiten(values: Array, where: Layout, noise: Autoregression) -> Array:
    """Return innovations over their standard deviation; ``values`` (n,) or (n, columns).

    Exact for a stationary autoregression: the first values of a segment are predicted by lower orders.
    """
    if noise.memory is not None:
        return noise.memory.weighed(values, where) / (noise.marginal_sd * math.sqrt(noise.memory.rows))
    orders = predictor(noise.reflection)
    p = len(noise.reflection)
    if p == 0:
        return values / noise.sd
    innovations = values.copy()
    for j, weight in enumerate(orders[p], start=1):
        innovations[j:] -= weight * values[:-j]
    early = _early(noise)
    starts = np.array([segment.start for segment in where.segments], dtype=np.intp)
    rows = np.array([segment.stop for segment in where.segments], dtype=np.intp) - starts
    # A recording with a gap in every day has hundreds of segments: the first values of all are taken at once.
    lower = np.diag(early)
    for k in range(1, p):
        lower[k, :k] = -early[k] * orders[k][::-1]
    within = np.arange(p)
    at, there = starts[:, None] + within, within < rows[:, None]
    columns = values if values.ndim > 1 else values[:, None]
    first = (lower @ columns[np.minimum(at, len(values) - 1)])[there]
    innovations[at[there]] = first if values.ndim > 1 else first[:, 0]
    return innovations / noise.sd


def draws(noise: Autoregression, where: Layout, count: int, rng: np.random.Generator) -> Array:
    """Return series of a noise over a layout, (n, count): what `whiten` makes white again.

    Stationary from the first value of a segment on, however long its memory: nothing has to settle.
    """
    from scipy.signal import lfilter

    orders, p = predictor(noise.reflection), len(noise.reflection)
    series = noise.sd * rng.standard_normal((where.n, count))
    early = _early(noise)
    denominator = np.concatenate([[1.0], -orders[p]])
    for segment in where.segments:
        x = series[segment]  # a view: innovations before, values after
        begun = min(p, len(x))
        for k in range(begun):
            x[k] = orders[k] @ x[:k][::-1] + x[k] / early[k]
        if len(x) > p > 0:
            past = np.array([orders[p][j:] @ x[begun - p + j : begun][::-1] for j in range(p)])
            x[p:] = lfilter([1.0], denominator, x[p:], axis=0, zi=past)[0]
    return series


def _early(noise: Autoregression) -> list[float]:
    """Return the innovation sd of the noise's own order over that of every lower order."""
    p = len(noise.reflection)
    return [math.sqrt(math.prod(1 - noise.reflection[j] ** 2 for j in range(k, p))) for k in range(p)]


def log_likelihood(residual: Array, where: Layout, noise: Autoregression) -> float:
    """Return the Gaussian log-likelihood of a residual under a noise (natural logarithm)."""
    white = whiten(residual, where, noise)
    if noise.memory is not None:
        constant = math.log(noise.marginal_sd) + 0.5 * math.log(2 * math.pi)
        return float(-0.5 * np.sum(white**2) - noise.memory.independent(where) * constant)
    p = len(noise.reflection)
    shorter = 0.0
    if p:
        tails = [math.log(math.prod(1 - noise.reflection[j] ** 2 for j in range(k, p))) / 2 for k in range(p)]
        shorter = sum(sum(tails[: min(p, segment.stop - segment.start)]) for segment in where.segments)
    n = where.n
    return float(-0.5 * np.sum(white**2) - n * math.log(noise.sd) - 0.5 * n * math.log(2 * math.pi) + shorter)
