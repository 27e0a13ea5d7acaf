"""An equation led along its recording: states that follow what was read, and what its predictions miss.

A free simulation that lacks a large effect moves elsewhere than the plant did, and what would explain the
difference is then looked for at states that the plant never had. Followed by a smoother, the states are the
plant's, and what the equation lacks stands in the errors of its predictions from row to row. These answer to
every term in proportion, however large it is: the term at the followed states, and a step of a parameter, are
carried through the same filter, and least squares on the prediction errors tell how much of each there is.

The process noise that the following needs has the size that makes the recording likeliest. What the
equation lacks is in that size as well, and hides in it where it acts slowly: a damping in the noise of a
camera. The steadier following, of less process noise, shows it.

Source: Ljung, System Identification, 2nd ed. (1999), ch. 3 and 7 (prediction errors); Rauch, Tung, Striebel,
AIAA J. 3 (1965) 1445 (the smoother); Kristensen, Madsen, Jorgensen, Automatica 40 (2004) 225 (process noise).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.trajectory import recursion

if TYPE_CHECKING:
    from toolkit.arrays import Array


PARAMETER_STEP = 1e-3  # of its prior sd: for the answer of the prediction errors to a parameter
_PASSES = 4  # the equation is taken as linear about the states of the pass before
_SETTLED = 1e-3  # of a state's spread
_PROCESS = 10.0 ** np.arange(-4.0, 1.1, 0.5)  # of the fastest rate of a state: process noise that is tried
_SENSOR = 10.0 ** np.arange(-2.0, 0.1)  # of the largest that the sensor's noise can be
_COLOURED = 10.0 ** np.array(
    [-2.0, -1.0, 0.0, 0.2, 0.4]
)  # of a sensor whose noise is not white: as if larger
_TRIED = 1_000  # rows of a run by which the noise is chosen
_UNSURE = 0.1  # of a state's spread, by which its start is open
_SINGULAR = 1e-12  # of a state's spread squared: states that nothing moves
_UNREAD = 1e12  # times the sensor's variance, of a row that was not read


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """An equation about states of all rows.

    ``ends`` are the states one row on, (states, rows - 1); ``slopes`` their derivatives, (rows - 1, states,
    states), zero where a run ends; ``entry`` what a unit of rate in each own state does until the next row,
    (rows - 1, states, own states); ``shown`` and ``shows`` the outputs, (outputs, rows), and their
    derivatives, (rows, outputs, states).
    """

    ends: Array
    slopes: Array
    entry: Array
    shown: Array
    shows: Array


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Prediction errors along a recording, over their standard deviations, and how they answer.

    Attributes
    ----------
    states : that follow the recording, (states, rows)
    rates : by which they move on until the next row, (states, rows - 1)
    errors : of every prediction, (rows, outputs); NaN where nothing was read
    closed : how an error of the states, over their spreads, is carried on under the filter, (rows - 1,
        states, states)
    shows : how it shows in the prediction errors, (rows, outputs, states)
    read : how an error of the outputs enters the states of the next row, (rows - 1, states, outputs)
    whitened : how it shows in the prediction errors, (rows, outputs, outputs)
    entry : what a unit of rate in each own state does until the next row, (rows - 1, states, own states)
    spread : of the states, (states,)
    starts : by what the states at every run's first row are off where they were put, (states, runs)
    starts_sd : standard deviation of that, (states, runs)
    """

    states: Array
    rates: Array
    errors: Array
    closed: Array
    shows: Array
    read: Array
    whitened: Array
    entry: Array
    spread: Array
    starts: Array
    starts_sd: Array

    @property
    def log_scale(self) -> float:
        """Log-likelihood of the prediction errors, but for half their squares and what is constant."""
        own = np.abs(np.einsum("kyy->ky", self.whitened))
        return float(np.log(own[np.isfinite(self.errors)]).sum())

    def answers(self, added: Array, outputs: Array | None = None) -> Array:
        """Return how the prediction errors answer to additions, (rows, outputs, columns).

        Parameters
        ----------
        added : to the states of the next row, (states, columns, rows - 1)
        outputs : to the outputs of the row, (rows, outputs, columns)
        """
        scaled = added / self.spread[:, None, None]
        if outputs is not None:
            scaled = scaled - np.einsum("kny,kyc->nck", self.read, outputs[:-1])
        first = np.zeros((*added.shape[:2], 1))
        moved = np.concatenate([first, recursion(self.closed[:, None], scaled)], axis=2)
        answers = np.einsum("kyn,nck->kyc", self.shows, moved)
        return np.asarray(answers if outputs is None else answers + self.whitened @ outputs)


def following_shapes(rows: int, own: int, states: int, outputs: int, runs: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of every field of `Followed`, by its name.

    Parameters
    ----------
    own, states : of the equation, and with those that its forces bring along
    """
    return {
        "states": (states, rows), "rates": (states, rows - 1), "errors": (rows, outputs),
        "closed": (rows - 1, states, states), "shows": (rows, outputs, states),
        "read": (rows - 1, states, outputs), "whitened": (rows, outputs, outputs),
        "entry": (rows - 1, states, own), "spread": (states,), "starts": (states, runs),
        "starts_sd": (states, runs),
    }  # fmt: skip


def padded(values: Array, shape: tuple[int, ...]) -> Array:
    """Return an array with states more that nothing moves."""
    made = np.ones(shape) if len(shape) == 1 else np.zeros(shape)
    made[tuple(slice(0, size) for size in values.shape)] = values
    return made


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """What a filter runs over: rows of the runs side by side, (runs, rows, ...), the short ones padded.

    States are over their spreads.
    """

    slopes: Array
    entry: Array
    shows: Array
    missed: Array  # what the linear equation leaves of the next state, (runs, rows, states)
    residual: Array  # recorded less shown, (runs, rows, outputs); NaN where nothing was read


@dataclass(frozen=True, slots=True, eq=False)
class _Filtered:
    log_likelihood: Array
    errors: Array
    roots: Array
    gains: Array
    predicted: Array
    predicted_spread: Array
    filtered: Array
    filtered_spread: Array


def follow(
    linear_about: Callable[[Array], Linear],
    guess: Array,
    recorded: Array,
    slices: tuple[slice, ...],
    *,
    spread: Array,
    fastest: Array,
    sensor: Array,
    steadier: float = 1.0,
) -> Followed:
    """Return states that follow a recording, and the prediction errors along them.

    Parameters
    ----------
    linear_about : states of all rows -> the equation about them
    guess : states of all rows, of a simulation, (states, rows)
    recorded : outputs, (outputs, rows); NaN where nothing was read
    slices : rows of every run
    spread : of each state, (states,)
    fastest : rate of each own state, 0 where nothing can be added to it, (own states,)
    sensor : the largest that the noise of each output's sensor can be, (outputs,)
    steadier : by what the process noise is less than the likeliest
    """
    x = guess.copy()
    process, share = 1.0, 1.0
    for turn in range(_PASSES):
        about = linear_about(x)
        stretch = _stretch(about, x, recorded, slices, spread)
        if turn in (0, _PASSES // 2):
            process, share = _likeliest(stretch, fastest, sensor, _SENSOR if steadier == 1 else _COLOURED)
            process /= steadier
        passed = _filter(stretch, process * fastest[None], share * sensor[None])
        moved = _back(_smoothed(stretch, passed)[0], slices)
        x = x + moved * spread[:, None]
        if np.abs(moved).max() < _SETTLED:
            break
    about = linear_about(x)
    stretch = _stretch(about, x, recorded, slices, spread)
    passed = _filter(stretch, process * fastest[None], share * sensor[None])
    inverse = np.asarray(np.linalg.inv(passed.roots), dtype=np.float64)
    _, unsure = _smoothed(stretch, passed)
    first = [rows.start for rows in slices]
    across = stretch.slopes @ passed.gains

    def whole(values: Array) -> Array:
        return np.concatenate([values[i, : rows.stop - rows.start] for i, rows in enumerate(slices)])

    carried, read = whole(stretch.slopes - across @ stretch.shows)[:-1], whole(across)[:-1]
    for rows in slices[:-1]:
        carried[rows.stop - 1], read[rows.stop - 1] = 0.0, 0.0
    return Followed(
        states=x,
        rates=about.ends - x[:, :-1],
        errors=whole(passed.errors),
        closed=carried,
        shows=whole(np.asarray(inverse @ stretch.shows)),
        read=read,
        whitened=whole(inverse),
        entry=about.entry,
        spread=spread,
        starts=(x - guess)[:, first],
        starts_sd=unsure.T * spread[:, None],
    )


def _stretch(about: Linear, x: Array, recorded: Array, slices: tuple[slice, ...], spread: Array) -> _Stretch:
    """Return the runs side by side, the states over their spreads."""
    n, outputs, forced = len(x), len(recorded), about.entry.shape[2]
    longest = max(rows.stop - rows.start for rows in slices)
    slopes = np.zeros((len(slices), longest, n, n))
    entry = np.zeros((len(slices), longest, n, forced))
    shows = np.zeros((len(slices), longest, outputs, n))
    missed = np.zeros((len(slices), longest, n))
    residual = np.full((len(slices), longest, outputs), np.nan)
    off = (about.ends - x[:, 1:]) / spread[:, None]
    for i, rows in enumerate(slices):
        m = rows.stop - rows.start
        on = slice(rows.start, rows.stop - 1)
        slopes[i, : m - 1] = about.slopes[on] * (spread / spread[:, None])
        entry[i, : m - 1] = about.entry[on] / spread[:, None]
        missed[i, : m - 1] = off[:, on].T
        shows[i, :m] = about.shows[rows] * spread
        residual[i, :m] = (recorded[:, rows] - about.shown[:, rows]).T
    return _Stretch(slopes, entry, shows, missed, residual)


def _back(values: Array, slices: tuple[slice, ...]) -> Array:
    """Return what stands side by side, (runs, rows, states), behind one another, (states, rows)."""
    return np.concatenate([values[i, : rows.stop - rows.start] for i, rows in enumerate(slices)]).T


def _likeliest(stretch: _Stretch, fastest: Array, sensor: Array, shares: Array) -> tuple[float, float]:
    """Return the shares of process and sensor noise that make the first rows of the runs likeliest."""
    process, share = (axis.ravel() for axis in np.meshgrid(_PROCESS, shares, indexing="ij"))
    runs = len(stretch.slopes)
    parts = (stretch.slopes, stretch.entry, stretch.shows, stretch.missed, stretch.residual)
    first = _Stretch(*(np.tile(part[:, :_TRIED], (len(process), *[1] * (part.ndim - 1))) for part in parts))
    passed = _filter(
        first,
        np.repeat(process, runs)[:, None] * fastest,
        np.repeat(share, runs)[:, None] * sensor,
        keep=False,
    )
    total = passed.log_likelihood.reshape(len(process), runs).sum(axis=1)
    best = int(np.argmax(np.where(np.isfinite(total), total, -np.inf)))
    return float(process[best]), float(share[best])


def _filter(stretch: _Stretch, process: Array, sensor: Array, *, keep: bool = True) -> _Filtered:
    """Run the filter over the rows of several runs at once.

    Parameters
    ----------
    process, sensor : noises, (runs or 1, forced) and (runs or 1, outputs)
    keep : whether more than the likelihood is wanted
    """
    many, rows, outputs, n = stretch.shows.shape
    kept = rows if keep else 0
    read = np.isfinite(stretch.residual)
    residual = np.where(read, stretch.residual, 0.0)
    variance = np.where(read, 1.0, _UNREAD) * (sensor**2)[:, None, :]
    pushed = stretch.entry * process[:, None, None, :]
    x, P = np.zeros((many, n)), np.broadcast_to(_UNSURE**2 * np.eye(n), (many, n, n))
    errors, roots = np.full((many, kept, outputs), np.nan), np.zeros((many, kept, outputs, outputs))
    gains = np.zeros((many, kept, n, outputs))
    predicted, filtered = np.zeros((many, kept, n)), np.zeros((many, kept, n))
    predicted_spread, filtered_spread = np.zeros((many, kept, n, n)), np.zeros((many, kept, n, n))
    total = np.zeros(many)
    of = np.arange(outputs)
    for k in range(rows):
        C = stretch.shows[:, k]
        cross = P @ C.transpose(0, 2, 1)
        S = C @ cross
        S[:, of, of] += variance[:, k]
        root = np.linalg.cholesky(S)
        gain = np.linalg.solve(S, cross.transpose(0, 2, 1)).transpose(0, 2, 1)
        off = residual[:, k] - (C @ x[:, :, None])[:, :, 0]
        white = np.linalg.solve(root, off[:, :, None])[:, :, 0]
        total -= np.where(read[:, k], 0.5 * white**2 + np.log(root[:, of, of]), 0.0).sum(axis=1)
        if keep:
            predicted[:, k], predicted_spread[:, k] = x, P
            errors[:, k] = np.where(read[:, k], white, np.nan)
            roots[:, k], gains[:, k] = root, gain
        x = x + (gain @ off[:, :, None])[:, :, 0]
        P = P - gain @ cross.transpose(0, 2, 1)
        if keep:
            filtered[:, k], filtered_spread[:, k] = x, P
        A, w = stretch.slopes[:, k], pushed[:, k]
        x = (A @ x[:, :, None])[:, :, 0] + stretch.missed[:, k]
        P = A @ P @ A.transpose(0, 2, 1) + w @ w.transpose(0, 2, 1)
    return _Filtered(total, errors, roots, gains, predicted, predicted_spread, filtered, filtered_spread)


def _smoothed(stretch: _Stretch, passed: _Filtered) -> tuple[Array, Array]:
    """Return the states by all rows of their runs, (runs, rows, states), and how unsure the first ones are.

    The standard deviations are (runs, states).
    """
    x, P = passed.filtered.copy(), passed.filtered_spread[:, -1]
    eye = _SINGULAR * np.eye(x.shape[2])
    for k in range(x.shape[1] - 2, -1, -1):
        across = stretch.slopes[:, k] @ passed.filtered_spread[:, k]
        weight = np.linalg.solve(passed.predicted_spread[:, k + 1] + eye, across)
        step = (x[:, k + 1] - passed.predicted[:, k + 1])[:, None]
        x[:, k] += (step @ weight)[:, 0]
        less = passed.predicted_spread[:, k + 1] - P
        P = passed.filtered_spread[:, k] - weight.transpose(0, 2, 1) @ less @ weight
    return x, np.sqrt(np.maximum(np.einsum("rnn->rn", P), 0.0))
