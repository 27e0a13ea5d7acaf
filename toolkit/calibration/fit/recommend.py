"""Recommend another set of terms, and never take it: the session decides.

Wider models are compared with the session's by the F test of nested models, Holm's step-down procedure
holding the risk that a sound session is told anything at RISK over all loads and models. Of the better models
on which no wider one improves, that of the least Bayesian information criterion is named. Terms beyond the
linear ones are candidates to drop where they are worth under 0.05 % of full scale in every load (AIAA R-091),
or are significant in none.

Where the residuals show that the scatter grows with the indications, all models weigh the rows by it.

References: Holm, Scandinavian Journal of Statistics 6 (1979); AIAA R-091A-2020; Draper and Smith, Applied
Regression Analysis (1998), ch. 6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.adequacy import NOISE_SHARE, RANK, noise_shares, terms_condition_number
from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.fit.profile import shown_profile
from toolkit.calibration.terms import INTERCEPT, model_terms, term_matrix

if TYPE_CHECKING:
    from toolkit.calibration.fit.regression import TermFit
    from toolkit.calibration.fit.session_fit import LoadResult, SessionFit
    from toolkit.calibration.session.read import Session

RISK = 0.01
NEGLIGIBLE_PERCENT = 0.05
HIGHEST_DEGREE = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Wider:
    """A model that fits better. ``lines`` go into SESSION.toml; ``loads`` are those that gain.

    ``F`` and ``probability`` (Holm's, over all comparisons) are of the load that gains most,
    ``before_percent_fs`` and ``after_percent_fs`` its residual standard deviation.
    """

    name: str
    lines: str
    loads: tuple[str, ...]
    F: float
    probability: float
    before_percent_fs: float
    after_percent_fs: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Droppable:
    """Terms that may go. ``small``: under 0.05 % of full scale in every load; ``idle``: significant in none.

    ``probability`` is the smallest over the loads of the F test that drops them all at once.
    """

    small: tuple[str, ...]
    idle: tuple[str, ...]
    lines: str
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sum:
    """The (weighted) sum of squared residuals of a fit, its rows and degrees of freedom."""

    squares: float
    rows: int
    dof: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Model:
    name: str
    lines: str
    terms: tuple[str, ...]


def holm(probabilities: Sequence[float]) -> tuple[float, ...]:
    """Return Holm's adjusted probabilities, in the order given.

    >>> holm([0.01, 0.04, 0.03])
    (0.03, 0.06, 0.06)
    """
    count, worst = len(probabilities), 0.0
    adjusted = [0.0] * count
    for rank, i in enumerate(sorted(range(count), key=lambda i: probabilities[i])):
        worst = max(worst, min(1.0, (count - rank) * probabilities[i]))
        adjusted[i] = worst
    return tuple(adjusted)


def recommend_wider(fit: SessionFit) -> Wider | None:
    """Return the simplest wider model on which no other improves; None where the session's is as good."""
    session, columns = fit.session, fit.session.table.columns(fit.session.indications)
    loads = [load for load in fit.loads if not load.exact]
    current = _Model(name="session", lines="", terms=session.terms)
    applied = session.table.matrix([load.name for load in session.loads])
    models = [m for m in _models(session) if _determined(m.terms, columns, applied)]
    if not models or not loads:
        return None
    refitted = _refit(fit, loads, current.terms, columns)
    solved = {(current.name, load.setting.name): total for load, total in zip(loads, refitted, strict=True)}
    for model in models:
        sums = _refit(fit, loads, model.terms, columns)
        solved |= {(model.name, load.setting.name): total for load, total in zip(loads, sums, strict=True)}
    better = _sound(fit, _better(current, models, loads, solved), models, loads)
    enough = [
        m
        for m in models
        if m.name in better
        and not _better(m, [n for n in models if set(m.terms) < set(n.terms)], loads, solved)
    ]
    if not enough:
        return None
    model = min(enough, key=lambda m: _information([solved[m.name, load.setting.name] for load in loads]))
    rows = better[model.name]
    ratio, probability, largest = min(rows, key=lambda row: (row[1], -row[0]))
    full = float(np.abs(session.table.column(largest)).max())
    before = 100 * next(load.fit.residual_sd for load in loads if load.setting.name == largest) / full
    old, new = solved[current.name, largest], solved[model.name, largest]
    shrink = float(np.sqrt(new.squares / new.dof / (old.squares / old.dof)))
    return Wider(
        name=model.name,
        lines=model.lines,
        loads=tuple(name for _, p, name in rows if p < RISK),
        F=ratio,
        probability=probability,
        before_percent_fs=before,
        after_percent_fs=before * shrink,
    )


def recommend_drop(fit: SessionFit) -> Droppable | None:
    """Return the terms beyond the linear ones that the data do not need; None where every one is needed.

    The indications themselves and the constant stay: they are the instrument and its zero.
    """
    session, columns = fit.session, fit.session.table.columns(fit.session.indications)
    higher = [name for name in session.terms if name not in (*session.indications, INTERCEPT)]
    loads = [load for load in fit.loads if not load.exact]
    if not higher or not loads:
        return None
    extent = dict(zip(session.terms, np.abs(term_matrix(session.terms, columns)).max(axis=0), strict=True))
    small, tests = set(higher), []
    for load in loads:
        full = float(np.abs(session.table.column(load.setting.name)).max())
        coefficients = dict(zip(session.terms, load.fit.coefficients, strict=True))
        error = dict(zip(session.terms, load.fit.standard_errors.tolist(), strict=True))
        small -= {t for t in higher if 100 * abs(coefficients[t]) * extent[t] >= NEGLIGIBLE_PERCENT * full}
        tests += [(t, _two_sided(coefficients[t] / error[t], load.fit)) for t in higher]
    adjusted = holm([p for _, p in tests])
    needed = {t for (t, _), p in zip(tests, adjusted, strict=True) if p < RISK}
    idle = [t for t in higher if t not in needed]
    out = [t for t in higher if t in small or t in idle]
    if not out:
        return None
    remaining = tuple(t for t in session.terms if t not in out)
    refitted = _refit(fit, loads, session.terms, columns)
    ratios = [
        _f_test(narrow, wide)
        for narrow, wide in zip(_refit(fit, loads, remaining, columns), refitted, strict=True)
    ]
    if idle and min(p for _, p in ratios) < RISK / len(loads):
        # Parallel terms share their effect: each seems idle while the other is there.
        out = [t for t in higher if t in small]
        idle = [t for t in idle if t in small]
        if not out:
            return None
        remaining = tuple(t for t in session.terms if t not in out)
        ratios = [
            _f_test(narrow, wide)
            for narrow, wide in zip(_refit(fit, loads, remaining, columns), refitted, strict=True)
        ]
    base = model_terms(session.model, session.indications, degree=session.degree)
    dropped = [t for t in base if t not in session.terms]
    keeps = [t for t in remaining if t not in (*session.indications, INTERCEPT)]
    return Droppable(
        small=tuple(t for t in out if t in small),
        idle=tuple(idle),
        lines=_lines("linear", [t for t in dropped if t in (*session.indications, INTERCEPT)])
        if not keeps
        else _drop_line([*dropped, *out]),
        probability=min(p for _, p in ratios),
    )


def _models(session: Session) -> list[_Model]:
    """Return the models that a session may name and that hold all of its own terms, simplest first."""
    names, present, degree = session.indications, set(session.terms), session.degree
    linear = model_terms("linear", names)
    balance = model_terms("balance", names)
    # What the session leaves out of the linear part on purpose stays out.
    dropped = [t for t in linear if t not in present]
    models = []
    cross = [t for t in balance if "*" in t and "abs" not in t]
    squares = [t for t in balance if t.endswith("^2")]
    for name, added in (("interaction", cross), ("interaction and squares", cross + squares)):
        requested = present | set(added)
        if cross and requested <= set(balance):
            ordered = tuple(t for t in balance if t in requested)
            drop = [t for t in balance if t not in requested]
            models.append(_Model(name=name, lines=_lines("balance", drop), terms=ordered))
    for higher in range(max(degree, 1) + 1, min(max(degree, 1) + 2, HIGHEST_DEGREE) + 1):
        terms = model_terms("polynomial", names, degree=higher, drop=dropped)
        lines = f'model = "polynomial"\ndegree = {higher}' + ("\n" + _drop_line(dropped) if dropped else "")
        models.append(_Model(name=f"degree {higher}", lines=lines, terms=terms))
    terms = tuple(t for t in balance if t not in dropped)
    models.append(_Model(name="balance", lines=_lines("balance", dropped), terms=terms))
    return [m for m in models if present < set(m.terms)]


def _better(
    base: _Model,
    models: Sequence[_Model],
    loads: Sequence[LoadResult],
    solved: Mapping[tuple[str, str], _Sum],
) -> dict[str, list[tuple[float, float, str]]]:
    """Return the models that fit better beyond chance: (F, Holm's probability, load) of every load."""
    tests = [
        (m.name, load, *_f_test(solved[base.name, load], solved[m.name, load]))
        for m in models
        for load in (load.setting.name for load in loads)
    ]
    rows: dict[str, list[tuple[float, float, str]]] = {}
    for (name, load, ratio, _), p in zip(tests, holm([t[3] for t in tests]), strict=True):
        rows.setdefault(name, []).append((ratio, p, load))
    return {name: row for name, row in rows.items() if min(p for _, p, _ in row) < RISK}


def _sound(
    fit: SessionFit,
    better: Mapping[str, list[tuple[float, float, str]]],
    models: Sequence[_Model],
    loads: Sequence[LoadResult],
) -> dict[str, list[tuple[float, float, str]]]:
    """Return the better models that are so whatever the rows scatter by, where they show that it grows.

    Weights by the scatter that rows show are estimates. Of the terms that a model adds, the coefficients must
    differ from zero by a covariance that takes each row's own residual for its scatter, too (HC3: MacKinnon
    and White, J. Econometrics 29 (1985) 305).
    """
    growing = {
        load.setting.name for load in loads if load.fit.weights is None and _root(fit, load) is not None
    }
    if not growing or not better:
        return dict(better)
    columns = fit.session.table.columns(fit.session.indications)
    narrow = build_basis(fit.session.terms, columns).design
    models_kept, tests = {}, len(models) * len(loads)
    for model in models:
        rows = better.get(model.name, [])
        wide = build_basis(model.terms, columns).design
        sound = [
            (ratio, max(p, tests * _robust(narrow, wide, fit.session.table.column(load))), load)
            if load in growing
            else (ratio, p, load)
            for ratio, p, load in rows
        ]
        if any(p < RISK for _, p, _ in sound):
            models_kept[model.name] = sound
    return models_kept


def _robust(narrow: Array, wide: Array, load: Array) -> float:
    """Return the probability of a wide design's further coefficients where rows scatter each by its own."""
    from scipy.special import fdtrc

    n = len(load)
    q = np.linalg.qr(narrow)[0]
    left = np.linalg.svd(wide - q @ (q.T @ wide), full_matrices=False)[0]
    added = left[:, : wide.shape[1] - narrow.shape[1]]
    every = np.column_stack([q, added])
    residual = load - every @ (every.T @ load)
    leverage = np.minimum(np.einsum("ij,ij->i", every, every), 1 - 1e-9)
    moved = added.T @ load
    spread = (added * (residual / (1 - leverage))[:, None] ** 2).T @ added
    wald = float(moved @ np.linalg.pinv(spread, hermitian=True) @ moved) / len(moved)
    return float(fdtrc(len(moved), n - every.shape[1], wald))


def _f_test(narrow: _Sum, wide: _Sum) -> tuple[float, float]:
    """Return F and its probability that the wide model's further terms gain nothing."""
    from scipy.special import fdtrc

    extra = narrow.dof - wide.dof
    if wide.squares <= 0:
        return float("inf"), 0.0
    ratio = max((narrow.squares - wide.squares) / extra / (wide.squares / wide.dof), 0.0)
    return ratio, float(fdtrc(extra, wide.dof, ratio))


def _information(sums: Sequence[_Sum]) -> float:
    """Return the Bayesian information criterion, summed over the loads (Schwarz, Ann. Statist. 6, 1978)."""
    tiny = float(np.finfo(float).tiny)
    return sum(
        total.rows * float(np.log(max(total.squares, tiny) / total.rows))
        + (total.rows - total.dof) * float(np.log(total.rows))
        for total in sums
    )


def _two_sided(t: float, fit: TermFit) -> float:
    from scipy.special import ndtr, stdtr

    return 2 * float(ndtr(-abs(t)) if fit.weights is not None else stdtr(fit.dof, -abs(t)))


def _refit(
    fit: SessionFit, loads: Sequence[LoadResult], terms: tuple[str, ...], columns: Mapping[str, Array]
) -> list[_Sum]:
    """Return what other terms leave over of each load; the coefficients themselves are not wanted."""
    table, design = fit.session.table, build_basis(terms, columns).design
    load = np.array([table.column(load.setting.name) for load in loads]).T
    roots = [_root(fit, load) for load in loads]
    if all(root is None for root in roots):
        return _left_over(design, load)
    return [
        _left_over(design, y[:, None])[0]
        if root is None
        else _left_over(design * root[:, None], (y * root)[:, None])[0]
        for y, root in zip(load.T, roots, strict=True)
    ]


def _left_over(design: Array, loads: Array) -> list[_Sum]:
    """Return what a design (rows, terms) leaves over of loads (rows, loads)."""
    n, p = design.shape
    # Of a triangle of both, what stands below the design's rows is as long as the residuals.
    below = np.asarray(np.linalg.qr(np.hstack([design, loads]), mode="r"))[p:, p:]
    return [_Sum(squares=float(residual @ residual), rows=n, dof=n - p) for residual in below.T]


def _root(fit: SessionFit, load: LoadResult) -> Array | None:
    """Return by what rows weigh in comparisons (rows,): as stated, or by the scatter that they show.

    Where the scatter grows with the indications, the rows that scatter most would pass for a curve.
    """
    if load.fit.weights is not None:
        return np.sqrt(load.fit.weights)
    session = fit.session
    sd = shown_profile(session.table.columns(session.indications), load.fit.residuals - load.of_runs)
    return None if sd is None else float(np.sqrt(np.mean(sd**2))) / sd


def _determined(terms: tuple[str, ...], columns: Mapping[str, Array], loads: Array) -> bool:
    matrix = term_matrix(terms, columns)
    if len(matrix) - len(terms) < 3:
        return False
    if terms[-1] == INTERCEPT:
        matrix = matrix - np.append(matrix[:, :-1].mean(axis=0), 0.0)
    # A column that only rounding tells from zero is undetermined too.
    if (np.abs(matrix).max(axis=0) == 0).any():
        return False
    if terms_condition_number(matrix) >= RANK**-0.5:
        return False
    # Noise that tells a term gains as much by the F test as a curve of the cells would.
    return max(noise_shares(terms, columns, loads).values(), default=0.0) <= NOISE_SHARE


def _lines(model: str, drop: Sequence[str]) -> str:
    return f'model = "{model}"' + ("\n" + _drop_line(drop) if drop else "")


def _drop_line(terms: Sequence[str]) -> str:
    return "drop = [" + ", ".join(f'"{term}"' for term in dict.fromkeys(terms)) + "]"
