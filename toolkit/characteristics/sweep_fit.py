"""How far the side force lags a steered slip angle: the fit of a sweep in time at one load and one speed.

A tire follows a small change of its slip angle over a distance (Pacejka, Tire and Vehicle Dynamics, 3rd ed.
2012, 7.1), with s the distance rolled and F the steady curve near zero slip, here a cubic:

    length da'/ds + a' = SA,    FY = F(a')

Whatever delays the channel of FY by tau against that of the slip angle adds to the length: at one speed
nothing parts ``sigma + V tau``, the *apparent length* that a sweep gives. It may be negative, where the slip
angle is the later channel. Turn slip while the wheel is steered goes with the distance as the relaxation
does, and is part of it: of a stretched string of relaxation length sigma and half contact length a, the
length is sigma + a. What is meant is the mean distance of the answer, whose form may be another one than the
equation's: a term of second order in the rate, which has no such distance, is fitted beside it, and what the
fit says without it, and with a length that falls with the slope of FY (a carcass as a spring, 7.2), is in the
uncertainty.

Length, curve, a drift, run-out and what the tire brings from before each stretch are fitted jointly by least
squares. Their residuals repeat themselves: the variance of the length is that of the noise at the frequencies
at which the length acts, by the residuals' own spectrum, each ordinate counted for what the fit left of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Rotation
from toolkit.effects.filters import lag
from toolkit.machine import Sweeping
from toolkit.reduction.sweep import LEAST_RAD, Sweep

STARTS_M = (0.0, 0.1, 0.3, 0.8)
_LONGEST_M = 5.0
_TURNS = 40
_FORMS = 4  # passes over the curve's slope, after which the length at zero slip changes no more
_LEAST_SLOPE = 0.05  # of that at zero slip: beyond the peak the slope has no sense as a length
_STEP_M = 1e-3
_SURE_M = 1e-7
_ORDINATES = 12  # of the spectrum on either side of one
_UNSURE_M = 0.25  # a standard uncertainty beyond it says that the steering shows nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepFit:
    """What one recording says at one load: the apparent length, how sure it is, and the curve at zero slip.

    Attributes
    ----------
    file, file_sha256, rotation, first_row, last_row : where it stands; rows from 1
    load_N, speed_m_s, steer_rate_rad_s : means over its rows, the rate of what is steered
    rows : that were fitted
    length_m, u_m, dof : the apparent length, its standard uncertainty by the noise, degrees of freedom
    form_m : its standard uncertainty by the form of the answer, as far as other forms say another length
    stiffness_N_rad, offset_N : -dFY/dSA and FY at zero slip
    speed_u : relative standard uncertainty of the speed
    delay_s, delay_u_s : of FY behind the slip angle, as the machine states it; None where nobody does
    """

    file: str
    file_sha256: str
    rotation: Rotation
    first_row: int
    last_row: int
    load_N: float
    speed_m_s: float
    steer_rate_rad_s: float
    rows: int
    length_m: float
    u_m: float
    dof: float
    form_m: float
    stiffness_N_rad: float
    offset_N: float
    speed_u: float
    delay_s: float | None = None
    delay_u_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lag:
    """A fitted length [m] with u and dof, the curve's coefficients, the residuals [N] and its derivative.

    ``moved`` (rows,) [N/m] is what a longer tire changes that nothing else of the fit can; ``basis``
    (rows, parameters) is orthonormal and spans all that was fitted.
    """

    length_m: float
    slope: float
    level: float
    residual: Array
    moved: Array
    basis: Array

    @property
    def noise(self) -> tuple[float, float]:
        """Standard uncertainty of the length [m] and its degrees of freedom."""
        return uncertainty(self.moved, self.residual, self.basis)


def fit_sweep(sweep: Sweep, sweeping: Sweeping | None) -> SweepFit | None:
    """Return the fit of a sweep; None where its steering does not show a length.

    Parameters
    ----------
    sweeping : what the machine states of its speed and of the delay between its channels
    """
    if float(np.ptp(sweep.SA)) < LEAST_RAD:
        return None
    fits = forms_of(sweep)
    if fits is None:
        return None
    lag, form = fits
    u, dof = lag.noise
    if not (math.hypot(u, form) <= _UNSURE_M and dof >= 1):
        return None
    delay = None if sweeping is None else sweeping.delay
    return SweepFit(
        file=sweep.file, file_sha256=sweep.file_sha256, rotation=sweep.rotation,
        first_row=sweep.first_row, last_row=sweep.last_row,
        load_N=float(np.mean(sweep.FZ)), speed_m_s=float(np.mean(sweep.V)),
        steer_rate_rad_s=sweep.steer_rate_rad_s, rows=len(sweep.t),
        length_m=lag.length_m, u_m=u, dof=dof, form_m=form,
        stiffness_N_rad=-lag.slope, offset_N=lag.level, speed_u=sweep.speed_u,
        delay_s=None if delay is None else delay.value_s, delay_u_s=None if delay is None else delay.u_s,
    )  # fmt: skip


def forms_of(sweep: Sweep, starts_m: Sequence[float] = STARTS_M) -> tuple[Lag, float] | None:
    """Return the fit of a sweep and the length's standard uncertainty by its form [m]; None without one.

    Other forms of the answer say another length: a rectangle as wide as each is away, on either side (GUM
    4.3.7). Noise alone parts the fit from the one of fewer terms by the difference of their variances
    (Hausman, Econometrica 46 (1978) 1251), which is in the length's own uncertainty already.
    """
    sharp = [_settled(sweep, start, sharp=True) for start in starts_m]
    lag, plain = _nearest(sharp), _nearest(_settled(sweep, start, sharp=False) for start in starts_m)
    # A length that falls with the slope is sought from where the one that does not has settled.
    falls = _nearest(None if settled is None else _falling(sweep, settled) for settled in sharp)
    if lag is None or falls is None or plain is None:
        return None
    by_noise = max(lag.noise[0] ** 2 - plain.noise[0] ** 2, 0.0)
    away = (falls.length_m - lag.length_m) ** 2
    away += max((plain.length_m - lag.length_m) ** 2 - by_noise, 0.0)
    return lag, math.sqrt(away / 3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Settled:
    # A fit that further turns change no more, the curve's slope [N/rad] at every row, and the length [m]
    # that the last turn stepped to.
    lag: Lag
    slope: Array
    length_m: float


def _nearest(fits: Iterable[_Settled | None]) -> Lag | None:
    """Return the fit of the smallest residuals; None where none ends inside."""
    inside = [fit.lag for fit in fits if fit is not None]
    return min(inside, key=lambda fit: float(fit.residual @ fit.residual), default=None)


def _settled(sweep: Sweep, start_m: float, *, sharp: bool, ratio: Array | None = None) -> _Settled | None:
    """Return the fit from one start (Gauss and Newton, what is linear eliminated); None where it runs away.

    Parameters
    ----------
    sharp : whether a term of second order in the rate stands beside the lag
    ratio : of the length at every row to the one at zero slip; without it they are the same
    """
    s = sweep.distance_m
    length = start_m
    ratio = np.ones_like(s) if ratio is None else ratio
    for _ in range(_TURNS):
        fitted, slope = _at(length, ratio, sweep, s, sharp=sharp)
        squares = float(fitted.moved @ fitted.moved)
        if squares <= 0:
            return None
        step = float(fitted.moved @ fitted.residual) / squares
        reach = 0.5 * abs(length) + 0.1
        length += float(np.clip(step, -reach, reach))
        if abs(length) > _LONGEST_M:
            return None
        if abs(step) < _SURE_M:
            break
    return _Settled(lag=fitted, slope=slope, length_m=length) if fitted.slope else None


def _falling(sweep: Sweep, settled: _Settled) -> _Settled | None:
    """Return the fit whose length falls with the slope of the curve, from the one whose length does not."""
    for _ in range(_FORMS - 1):
        ratio = np.maximum(settled.slope / settled.lag.slope, _LEAST_SLOPE)
        following = _settled(sweep, settled.length_m, sharp=True, ratio=ratio)
        if following is None:
            return None
        settled = following
    return settled


def _at(length: float, ratio: Array, sweep: Sweep, s: Array, *, sharp: bool) -> tuple[Lag, Array]:
    """Return the linear fit at a length, and the curve's slope [N/rad] at every row."""
    SA, FY, stretches = sweep.SA, sweep.FY, sweep.stretches
    size = max(float(np.abs(SA).max()), 1e-12)
    followed, moved, sharper = np.empty_like(s), np.empty_like(s), np.empty_like(s)
    before = np.zeros((len(s), len(stretches)))
    for number, rows in enumerate(stretches):
        lengths = length * ratio[rows]
        followed[rows] = _followed(s[rows], SA[rows], lengths)
        again = _followed(s[rows], followed[rows], lengths)
        sharper[rows] = followed[rows] - 2 * again + _followed(s[rows], again, lengths)
        longer, shorter = ((length + step) * ratio[rows] for step in (_STEP_M, -_STEP_M))
        change = _followed(s[rows], SA[rows], longer) - _followed(s[rows], SA[rows], shorter)
        moved[rows] = change / (2 * _STEP_M)
        before[rows, number] = _forgotten(s[rows], lengths)
    x = followed / size
    columns = np.column_stack([
        np.ones_like(x), x, x**2, x**3, np.linspace(-1.0, 1.0, len(x)), before, sweep.explained,
        *([sharper / size] if sharp else []),
    ])  # fmt: skip
    basis = _orthonormal(columns)
    coefficients, *_ = np.linalg.lstsq(columns, FY, rcond=None)
    level, first, second, third = coefficients[:4].tolist()
    slope = (first + 2 * second * x + 3 * third * x**2) / size
    gradient = slope * moved
    gradient = gradient - basis @ (basis.T @ gradient)
    norm = float(np.linalg.norm(gradient))
    whole = np.column_stack([basis, gradient / norm]) if norm > 0 else basis
    residual = FY - basis @ (basis.T @ FY)
    return Lag(
        length_m=length, slope=first / size, level=level, residual=residual, moved=gradient, basis=whole
    ), slope


def _followed(s: Array, SA: Array, lengths: Array) -> Array:
    # A negative length is the lag of the slip angle behind the force: the same equation, backwards.
    if lengths[0] >= 0:
        return lag(s, SA, lengths)
    return lag(-s[::-1], SA[::-1], -lengths[::-1])[::-1]


def _forgotten(s: Array, lengths: Array) -> Array:
    """Return how much of what was before a stretch is still there at each of its rows."""
    steps = np.abs(np.diff(s) / np.where(np.abs(lengths[1:]) > 1e-9, lengths[1:], 1e-9))
    gone = np.concatenate(([0.0], np.cumsum(steps)))
    return np.exp(-(gone if lengths[0] >= 0 else gone[-1] - gone))


def _orthonormal(columns: Array) -> Array:
    sizes = np.linalg.norm(columns, axis=0)
    scaled = columns[:, sizes > 0] / sizes[sizes > 0]
    vectors, weights, _ = np.linalg.svd(scaled, full_matrices=False)
    return np.asarray(vectors[:, weights > 1e-10 * weights[0]])


def uncertainty(moved: Array, residual: Array, basis: Array) -> tuple[float, float]:
    """Return the standard uncertainty of a parameter under coloured noise, and its degrees of freedom.

    Least squares gives the parameter as a weighted sum of the rows, moved / |moved|^2. Its variance is the
    noise's spectrum under that of these weights (Priestley, Spectral Analysis and Time Series, 1981, 6.1).
    The spectrum is the residuals' periodogram, averaged over neighbouring ordinates, of each of which the
    fit has left a share of one less its leverage.

    Parameters
    ----------
    moved : derivative by the parameter, less what the others explain of it (rows,)
    residual : of the fit (rows,)
    basis : orthonormal, spans every derivative (rows, parameters)
    """
    rows = len(residual)
    power = np.abs(np.fft.rfft(residual)) ** 2 / rows
    leverage = np.sum(np.abs(np.fft.rfft(basis, axis=0)) ** 2, axis=1) / rows
    remaining = 1 - np.minimum(leverage, 1.0)
    weights = np.abs(np.fft.rfft(moved)) ** 2
    weights[1 : (rows + 1) // 2] *= 2
    weights /= weights.sum()
    reach = min(_ORDINATES, (len(power) - 1) // 2)
    near, remained = _sums(power, reach), _sums(remaining, reach)
    spectrum = near / np.maximum(remained, 1e-12)
    variance = float(weights @ spectrum) / float(moved @ moved)
    return math.sqrt(variance), 2 * float(weights @ remained)


def _sums(values: Array, reach: int) -> Array:
    """Return sums over neighbours; a spectrum goes on beyond its ends as in a mirror."""
    mirrored = np.concatenate([values[reach:0:-1], values, values[-2 : -reach - 2 : -1]])
    return np.convolve(mirrored, np.ones(2 * reach + 1), mode="valid")
