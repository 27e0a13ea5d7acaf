"""What runs differ by beyond a zero and a gain of each load, and runs that do not differ at all.

The model of scatter (`records.scatter`) gives every run one zero and one gain of each load. Beyond it are

- *cells whose gains move by themselves* from run to run: the contributions of single cells then differ, and
  the covariance, which knows the sum of them, is too small;
- *a run of another instrument*: its equation, whatever its zero and gain, is not that of the other runs;
- *runs that were copied*: what they read at equal loads differs far less than what a run reads twice.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.profile import shown_profile
from toolkit.calibration.fit.session_rows import SessionRows, groups_of
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.recording.digits import half_last_places

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.session_fit import LoadResult
    from toolkit.calibration.session.read import Session

_RISK = 1e-4
_ODD = 5.0  # times what the other runs are from each other
_FORETOLD = 0.5  # of a row's variance: what the other runs foretell of its mean
_FEWEST_DOF = 5
_COPIED = 5.0  # times less than what else the rows scatter by, as standard deviations
_FEWEST_PAIRS = 10
_SAME_LOAD = 1e-3  # of the largest load
_DIGITS = 2.0  # scatter below so many last places is that of the digits


@dataclass(frozen=True, slots=True, kw_only=True)
class CellGains:
    """Gains of single cells that differ from run to run: F test, and their root mean square, a share."""

    F: float
    dof: tuple[int, int]
    probability: float
    size: float


@dataclass(frozen=True, slots=True, kw_only=True)
class OddRun:
    """A run whose equation is not that of the others, by ``off`` (rms) [the load's unit].

    ``others`` is what those are off by themselves; ``alone`` is False of two runs that contradict each other.
    """

    factor: str
    run: float
    off: float
    others: float
    alone: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CopiedRuns:
    """Two runs of one ``factor`` whose readings repeat.

    ``apart`` is what they differ by and ``usual`` what else the rows scatter by, standard deviations of a
    reading of ``indication`` in its unit; ``pairs`` of rows were compared,
    and ``against`` says with what.
    """

    factor: str
    runs: tuple[float, float]
    indication: str
    apart: float
    usual: float
    pairs: int
    against: str


def cell_gains(session: Session, load: LoadResult) -> CellGains | None:
    """Return that single cells' gains differ between runs beyond chance; None where they do not."""
    rows = _rows(session, load)
    if rows is None:
        return None
    names = [name for name in session.indications if name in load.fit.terms]
    x = session.table.matrix(names)
    lines = _of_groups(rows.group, np.column_stack([np.ones(len(x)), rows.relative]))
    narrow = np.column_stack([rows.mean.columns, lines])
    wide = np.column_stack([narrow, _of_groups(rows.group, x)])
    # Of what even the wide model leaves: gains that differ would pass for scatter that grows.
    sd = shown_profile(session.table.columns(session.indications), _residual(wide, rows.load))
    weight = np.ones(len(x)) if sd is None else float(np.sqrt(np.mean(sd**2))) / sd
    y = rows.load * weight
    (before, few), (after, many) = (_squares_left(part * weight[:, None], y) for part in (narrow, wide))
    extra, dof = many - few, len(rows.load) - many
    if extra < 1 or dof < _FEWEST_DOF or after <= 0:
        return None
    from scipy.special import fdtrc

    ratio = (before - after) / extra / (after / dof)
    probability = float(fdtrc(extra, dof, ratio))
    if not probability < _RISK / len(session.loads):
        return None
    # What the gains move of the loads, less what noise would.
    moved = max((before - after) - extra * after / dof, 0.0)
    c = np.asarray([load.fit.coefficients[load.fit.terms.index(name)] for name in names])
    parts = float(np.sum((x * c * weight[:, None]) ** 2))
    return CellGains(F=ratio, dof=(extra, dof), probability=probability, size=float(np.sqrt(moved / parts)))


def odd_run(session: Session, load: LoadResult) -> OddRun | None:
    """Return the run whose equation is that of another instrument; None where all runs are of one."""
    rows = _rows(session, load)
    if rows is None or load.fit.residual_sd <= load.setting.tolerance:
        return None
    design = term_matrix(load.fit.terms, session.table.columns(session.indications))
    off, within = [], []
    for run in range(rows.groups):
        in_run = rows.group == run
        other_rows = np.column_stack(
            [design, _of_groups(rows.group, np.column_stack([np.ones(len(design)), rows.relative]))]
        )[~in_run]
        length = np.linalg.norm(other_rows, axis=0)
        scaled = other_rows / np.where(length > 0, length, 1.0)
        solution, _, rank, _ = np.linalg.lstsq(scaled, rows.load[~in_run], rcond=1e-10)
        c = (solution / np.where(length > 0, length, 1.0))[: design.shape[1]]
        predicted = design[in_run] @ c
        about = np.column_stack([np.ones(len(predicted)), predicted])
        # Runs that load other axes tell nothing of each other.
        comparable = (
            len(predicted) > about.shape[1] + 2 and _leverage(design[~in_run], design[in_run]) < _FORETOLD
        )
        off.append(_rms(about, rows.load[in_run]) if comparable else 0.0)
        residual = rows.load[~in_run] - scaled @ solution
        within.append(float(np.sqrt(residual @ residual / max(len(residual) - rank, 1))))
    ratio = np.array(off) / np.maximum(within, 1e-300)
    at = int(np.argmax(ratio))
    if off[at] <= load.setting.tolerance or ratio[at] <= _ODD:
        return None
    number = session.table.rotation if rows.factor == "mounting" else session.table.run
    return OddRun(
        factor=rows.factor, run=float(np.unique(rows.group if number is None else number)[at]), off=off[at],
        others=within[at], alone=rows.groups > 2,
    )  # fmt: skip


def copied_runs(session: Session) -> CopiedRuns | None:
    """Return the two runs whose readings repeat each other most, where that is no chance; else None.

    At equal loads two runs differ by their zeros and gains, which are taken off cell by cell, and by noise.
    Runs that were read apart have one noise: that of each other pair of runs, and that of the rows of one run
    at one load. What all runs share (errors of single weights, the curve of the cells) is in neither: it
    drops out of differences at one load.
    """
    factor, group = groups_of(session.table, session.zero)
    if not group.any():
        return None
    applied = session.table.matrix([load.name for load in session.loads])
    largest = np.abs(applied).max(axis=0)
    applied = applied / np.where(largest > 0, largest, 1.0)
    x = session.table.matrix(session.indications)
    digits = 2 * np.median(half_last_places(x.T), axis=1)
    within = _within(x, applied, group, session.table.up)
    number = session.table.rotation if factor == "mounting" else session.table.run
    names = np.unique(group if number is None else number)
    apart = {}
    for first, second in itertools.combinations(range(int(group.max()) + 1), 2):
        pairs = _pairs(applied, group, session.table.up, first, second)
        if len(pairs) >= _FEWEST_PAIRS:
            apart[first, second] = len(pairs), _noise_of_pairs(x, applied, pairs)
    if not apart:
        return None
    (first, second), (count, noise) = min(apart.items(), key=lambda item: float(np.sum(item[1][1])))
    other_noise = [
        sizes for pair, (_, sizes) in apart.items() if pair != (first, second) and {first, second} & set(pair)
    ]
    # What repeats of hysteresis scatters within a run too: there runs are copies to the last digit alone.
    usual = {"rows of one run at one load": np.where(noise <= digits, within, 0.0)}
    if other_noise:
        usual["the other runs"] = np.min(other_noise, axis=0)
    for against, sizes in usual.items():
        resolved = sizes > _DIGITS * digits
        if resolved.any() and (noise[resolved] < sizes[resolved] / _COPIED).all():
            at = int(
                np.flatnonzero(resolved)[np.argmax(sizes[resolved] / np.maximum(noise[resolved], 1e-300))]
            )
            return CopiedRuns(
                factor=factor, runs=(float(names[first]), float(names[second])),
                indication=session.indications[at], apart=float(noise[at]), usual=float(sizes[at]),
                pairs=count, against=against,
            )  # fmt: skip
    return None


def _rows(session: Session, load: LoadResult) -> SessionRows | None:
    """Return the rows of a load where its runs can be told apart and all of them are at hand.

    Of an equation that bends, a zero or a tare of a run moves more than a zero and a gain of the load.
    """
    straight = set(load.fit.terms) == {*session.indications, INTERCEPT}
    if load.exact or load.fit.weights is not None or not straight:
        return None
    reference = session.table.column(load.setting.name)
    design = term_matrix(load.fit.terms, session.table.columns(session.indications))
    rows = SessionRows.of(design, reference, session.table, session.zero)
    return rows if rows.groups > 1 and len(rows.load) == len(reference) else None


def _of_groups(group: NDArray[np.int64], columns: Array) -> Array:
    """Return columns (rows, k) for each group by itself (rows, k x groups)."""
    member = group[:, None] == np.arange(int(group.max()) + 1)
    return np.asarray((columns[:, :, None] * member[:, None, :]).reshape(len(group), -1), dtype=np.float64)


def _squares_left(design: Array, load: Array) -> tuple[float, int]:
    """Return the squares that a design leaves of loads, and its rank."""
    q = _orthonormal(design)
    residual = load - q @ (q.T @ load)
    return float(residual @ residual), q.shape[1]


def _residual(design: Array, load: Array) -> Array:
    q = _orthonormal(design)
    return np.asarray(load - q @ (q.T @ load))


def _orthonormal(design: Array) -> Array:
    length = np.linalg.norm(design, axis=0)
    q, values, _ = np.linalg.svd(design[:, length > 0] / length[length > 0], full_matrices=False)
    return np.asarray(q[:, values > 1e-8 * values[0]])


def _rms(design: Array, load: Array) -> float:
    return float(np.sqrt(_squares_left(design, load)[0] / (len(load) - design.shape[1])))


def _leverage(design: Array, at: Array) -> float:
    """Return the mean variance of what the rows of a design foretell at other rows, by that of a row."""
    length = np.linalg.norm(design, axis=0)
    if not length.all():
        return np.inf
    _, values, right = np.linalg.svd(design / length, full_matrices=False)
    if values[-1] <= 1e-8 * values[0]:
        return np.inf
    return float(np.mean(np.sum((at / length @ right.T / values) ** 2, axis=1)))


def _pairs(
    applied: Array, group: NDArray[np.int64], up: NDArray[np.bool_] | None, first: int, second: int
) -> NDArray[np.int64]:
    """Return the rows of two runs that have one load, direction and place among such rows (pairs, 2)."""
    side = np.zeros(len(group)) if up is None else up.astype(np.float64)
    keys = np.column_stack([np.rint(applied / _SAME_LOAD), side])
    places: list[dict[tuple[float, ...], int]] = []
    for run in (first, second):
        met: dict[tuple[float, ...], int] = {}
        place = {}
        for row in np.flatnonzero(group == run).tolist():
            key = tuple(keys[row].tolist())
            met[key] = met.get(key, 0) + 1
            place[*key, float(met[key])] = row
        places.append(place)
    return np.array(
        [[places[0][key], places[1][key]] for key in places[0] if key in places[1]], dtype=np.int64
    )


def _noise_of_pairs(x: Array, applied: Array, pairs: NDArray[np.int64]) -> Array:
    """Return the noise of one reading of each indication, by what two runs differ in (indications,)."""
    apart = x[pairs[:, 0]] - x[pairs[:, 1]]
    columns = [np.ones(len(pairs)), *applied[pairs[:, 0]].T, *(applied[pairs[:, 0]] - applied[pairs[:, 1]]).T]
    return np.asarray(_sd(np.column_stack(columns), apart) / np.sqrt(2))


def _within(x: Array, applied: Array, group: NDArray[np.int64], up: NDArray[np.bool_] | None) -> Array:
    """Return the noise of one reading of each indication, by rows of one run at one load (indications,).

    What loading and unloading do apart, a parabola over each load, is taken off.
    """
    keys = np.column_stack([np.rint(applied / _SAME_LOAD), group])
    _, place, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    place = place.ravel()
    repeated = counts[place] > 1
    if np.count_nonzero(repeated) - np.count_nonzero(counts > 1) < _FEWEST_PAIRS:
        return np.zeros(x.shape[1])
    side = np.zeros(len(x)) if up is None else np.where(up, 1.0, -1.0)
    columns = np.column_stack(
        [side, *(side * part for load in applied.T for part in (load, np.abs(load), load * load)), *applied.T]
    )
    centred = [(values - _means(values, place))[repeated] for values in (columns, x)]
    spare = int(np.count_nonzero(counts > 1))
    return _sd(centred[0], centred[1], lost=spare)


def _means(values: Array, place: NDArray[np.int64]) -> Array:
    sums = np.stack([np.bincount(place, weights=column) for column in values.T], axis=1)
    means: Array = (sums / np.bincount(place)[:, None])[place]
    return means


def _sd(design: Array, values: Array, lost: int = 0) -> Array:
    """Return the standard deviation that a design leaves of values (rows, k); ``lost`` degrees of freedom."""
    length = np.linalg.norm(design, axis=0)
    design = design[:, length > 0] / length[length > 0]
    rank = 0
    if design.size:
        q, sizes, _ = np.linalg.svd(design, full_matrices=False)
        q = q[:, sizes > 1e-8 * sizes[0]]
        values, rank = values - q @ (q.T @ values), q.shape[1]
    dof = len(values) - rank - lost
    if dof < _FEWEST_DOF:
        return np.zeros(values.shape[1])
    return np.asarray(np.sqrt(np.sum(values**2, axis=0) / dof), dtype=np.float64)
