"""When to recalibrate: drift between sessions as a state-space model, and what an interval risks.

The errors of a check load, each by the record before, add up to the path that the instrument would have gone
without new records (`paths_of`). The path is a local level with a constant trend (Durbin and Koopman, Time
Series Analysis by State Space Methods, 3.2), read at unequal times,

    y_i = m + v t_i + w(t_i) + e_i,   w a random walk of variance q a year,  e_i ~ N(0, r)

in tolerances and years; a path that was cut, by an adjustment or a record without its check load, goes on
with a level m of its own. Few sessions tell q and r badly: they are integrated over a grid by the restricted
likelihood, flat in the standard deviations, and so is v. After h years the error of a new record is then

    v h + w(h) + e,   a mixture of normals over the grid

and the interval is the longest whose error stays inside the tolerance with the reliability that is asked
for, at every day of it. ILAC-G24 / OIML D 10 names the end-of-period reliability, control charts (method 2)
and the classical method; NCSLI RP-1 the reliability target.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from toolkit.arrays import Array
from toolkit.declared import Entry
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.control.chart import Chart

YEAR = 365.25
FEWEST = 4
"""Readings of a path, its beginning among them: three are gone with level, trend and one scatter."""
SHORTEST, LONGEST = 30, 1826  # days
STEP = 1.5
"""An interval grows to this times the longest gap between sessions at most: beyond it nothing was seen."""
ASSUMPTIONS = (
    "a steady trend and a random walk go on as they did",
    "a session finds what is beyond, and all tests since the session before are then recalled",
    "nothing breaks at once",
)
_WALK = np.linspace(0.0, 1.5, 31)  # standard deviation of w after a year [tolerances]
_NOISE = np.linspace(0.01, 0.6, 30)  # standard deviation of e [tolerances]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """The path of a load's error at a check load: ``years`` since its beginning, ``errors`` in tolerances.

    ``segment`` (readings,) numbers the parts that have a level of their own.
    """

    load: str
    check_load: str
    begin: dt.date
    years: Array
    errors: Array
    segment: NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift:
    """What a path tells: trend v, its standard uncertainty, q and r over the grid with their ``weight``."""

    path: Path
    weight: Array
    trend: Array
    u_trend: Array
    walk: Array
    noise: Array

    @property
    def trend_per_year(self) -> float:
        """Mean trend [tolerances a year]."""
        return float(self.weight @ self.trend)

    @property
    def walk_per_root_year(self) -> float:
        """Mean standard deviation of the random walk after a year [tolerances]."""
        return float(self.weight @ self.walk)

    def beyond(self, years: float) -> float:
        """Return the chance that a new record's error is beyond the tolerance after some years."""
        from scipy.special import ndtr

        mean = self.trend * years
        sd = np.sqrt((self.u_trend * years) ** 2 + self.walk**2 * years + self.noise**2)
        return float(self.weight @ (ndtr((-1 - mean) / sd) + ndtr((mean - 1) / sd)))


@dataclass(frozen=True, slots=True, kw_only=True)
class IntervalRisk:
    """What an interval of some days risks.

    ``beyond`` is the chance that the error is beyond the tolerance at its end; ``recalled_a_year`` how many
    tests a year would be recalled for it, all since the session before; None where nobody states them.
    """

    days: Annotated[int, Entry("of the interval")]
    beyond: Annotated[float, Entry("chance that the error is beyond the tolerance at its end")]
    sessions_a_year: Annotated[float, Entry("that it takes")]
    recalled_a_year: Annotated[
        float | None,
        Entry("tests that would be recalled for it; null where nobody states how many there are"),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class IntervalPlan:
    """The recommended interval ``days`` (0: not even the shortest serves), and what it rests on.

    ``limiting`` names load and check load that drift most; ``seen_days`` is the longest gap between sessions.
    """

    days: Annotated[int, Entry("of the recommended interval; 0 where not even the shortest serves")]
    reliability: Annotated[float, Entry("asked for at its end")]
    limiting: Annotated[str, Entry("load and check load that drift most")]
    readings: Annotated[int, Entry("of that check load")]
    paths: Annotated[int, Entry("of check loads that were judged")]
    trend_per_year: Annotated[float, Entry("of the drift, in tolerances")]
    walk_per_root_year: Annotated[float, Entry("of the random walk, in tolerances")]
    seen_days: Annotated[int, Entry("longest gap between sessions")]
    capped: Annotated[bool, Entry("whether it is kept near the gaps that were seen")]
    risks: Annotated[tuple[IntervalRisk, ...], Entry("of other intervals")]
    chosen: Annotated[IntervalRisk, Entry("of the recommended one")]


def paths_of(chart: Chart, dates: Mapping[str, dt.date]) -> tuple[Path, ...]:
    """Return the paths of a chart's series; ``dates`` are the session's of every record by id.

    Series of fewer readings than a drift takes are left out.
    """
    paths = []
    for series in chart.series:
        known: dict[str, tuple[float, int]] = {}
        readings: list[tuple[dt.date, float, int]] = []
        for point in series.points:
            if point.record not in known:
                known[point.record] = (0.0, len({segment for _, _, segment in readings}))
                readings.append((dates[point.record], 0.0, known[point.record][1]))
            level, segment = known[point.record]
            error = level + point.error / series.tolerance
            known[point.session_record] = (error, segment)
            readings.append((point.date, error, segment))
        path = path_of(series.load, str(series.check_load), readings)
        if path is not None:
            paths.append(path)
    return tuple(paths)


def path_of(load: str, check_load: str, readings: Sequence[tuple[dt.date, float, int]]) -> Path | None:
    """Return the path of (day, error in tolerances, segment); None where they are too few for a drift."""
    if not readings:
        return None
    ordered = sorted(readings)
    begin = ordered[0][0]
    years = np.array([(day - begin).days / YEAR for day, _, _ in ordered])
    segment = np.array([segment for _, _, segment in ordered], dtype=np.intp)
    if len(ordered) - len(np.unique(segment)) + 1 < FEWEST or np.ptp(years) <= 0:
        return None
    return Path(
        load=load, check_load=check_load, begin=begin, years=years,
        errors=np.array([error for _, error, _ in ordered]), segment=segment,
    )  # fmt: skip


def drift_of(path: Path) -> Drift:
    """Return what a path tells of its drift."""
    walk, noise = (grid.ravel() for grid in np.meshgrid(_WALK, _NOISE, indexing="ij"))
    t, y = path.years, path.errors
    levels = (path.segment[:, None] == np.unique(path.segment)).astype(np.float64)
    X = np.column_stack([t, levels])
    common = np.minimum(t[:, None], t)
    V = walk[:, None, None] ** 2 * common + noise[:, None, None] ** 2 * np.eye(len(t))
    inverse = np.linalg.inv(V)
    information = X.T @ inverse @ X
    covariance = np.linalg.inv(information)
    estimate = covariance @ (X.T @ (inverse @ y)[..., None])
    rest = y - (X @ estimate)[..., 0]
    squares = np.einsum("ki,kij,kj->k", rest, inverse, rest)
    loglik = -0.5 * (np.linalg.slogdet(V)[1] + np.linalg.slogdet(information)[1] + squares)
    weight = np.exp(loglik - loglik.max())
    return Drift(
        path=path, weight=weight / weight.sum(), trend=estimate[:, 0, 0],
        u_trend=np.sqrt(covariance[:, 0, 0]), walk=walk, noise=noise,
    )  # fmt: skip


def plan_interval(
    paths: Sequence[Path], *, reliability: float, tests_a_year: float | None = None
) -> IntervalPlan:
    """Return the longest interval that keeps a reliability at its end, by the path that drifts most.

    Raises
    ------
    ConfigError
        ``plan-history``: no path is long enough to tell a drift
    """
    if not paths:
        raise ConfigError(
            "the history is too short for a drift", where="the instrument's check loads",
            got="no check load that was read often enough",
            expected=f"one read in {FEWEST - 1} sessions or more, each by the record before it",
            next_step="keep the interval in use, and read the same check loads at each session",
            rule="plan-history",
        )  # fmt: skip
    drifts = [drift_of(path) for path in paths]
    longest = max(int(np.max(np.diff(path.years)) * YEAR + 0.5) for path in paths)
    most = min(max(int(STEP * longest), SHORTEST), LONGEST)
    days = 0
    for candidate in range(SHORTEST, most + 1):
        if max(drift.beyond(candidate / YEAR) for drift in drifts) > 1 - reliability:
            break
        days = candidate
    at = (days or SHORTEST) / YEAR
    limiting = max(drifts, key=lambda drift: drift.beyond(at))
    return IntervalPlan(
        days=days,
        reliability=reliability,
        limiting=f"{limiting.path.load} at {limiting.path.check_load}",
        readings=len(limiting.path.years),
        paths=len(paths),
        trend_per_year=limiting.trend_per_year,
        walk_per_root_year=limiting.walk_per_root_year,
        seen_days=longest,
        capped=days == most,
        risks=tuple(_risk(drifts, table_days, tests_a_year) for table_days in (91, 183, 365, 548, 731)),
        chosen=_risk(drifts, days or SHORTEST, tests_a_year),
    )


def _risk(drifts: Sequence[Drift], days: int, tests_a_year: float | None) -> IntervalRisk:
    beyond = max(drift.beyond(days / YEAR) for drift in drifts)
    recalled = None if tests_a_year is None else tests_a_year * beyond
    return IntervalRisk(
        days=days, beyond=beyond, sessions_a_year=YEAR / days,
        recalled_a_year=recalled if recalled is None or math.isfinite(recalled) else None,
    )  # fmt: skip
