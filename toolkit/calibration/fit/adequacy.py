"""Whether a session's data can determine its equation at all. What cannot is refused before any fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.errors import ConfigError, SessionError

if TYPE_CHECKING:
    from toolkit.calibration.session.read import Session

# Which terms the loads tell, and which only the noise of the cells (regression dilution).


# Of the size of a term's own part. Terms that the loads do not tell lie at 1. Straight cells at enough levels
# stay below 0.01, cells of which one has a curve of 5 % below 0.1, and balances that bend by 3 % with
# products of loads, which the clean indications have not, below 0.35.
NOISE_SHARE = 0.5
_CURVE = 3
# Columns that agree to this, of unit size, are one: levels that differ by less are the same level.
_SAME = 1e-6


def noise_shares(terms: Sequence[str], columns: Mapping[str, Array], loads: Array) -> dict[str, float]:
    """Return how much of the part that tells each nonlinear term is noise, as a share of its size.

    Parameters
    ----------
    terms : terms that are not dependent on these indications
    columns : indications (rows,), by name
    loads : reference loads (rows, loads)

    Notes
    -----
    Fewer loads than indications leave loads unnamed that move the cells too: nothing is judged then.
    """
    higher = [i for i, term in enumerate(terms) if term not in (*columns, INTERCEPT)]
    if not higher or loads.shape[1] < len(columns):
        return {}
    basis = build_basis(terms, columns)
    triangle = np.linalg.qr(basis.design, mode="r")
    back = np.linalg.inv(triangle)
    inverse = back @ back.T
    # Column j: the combination of terms, 1 of term j, that is at right angles to all other terms.
    apart = (inverse / np.diag(inverse))[:, higher]
    noise = (basis.design - basis.at(_clean(columns, loads))) @ apart
    size = np.linalg.norm(basis.design @ apart, axis=0)
    shares = np.linalg.norm(noise, axis=0) / size
    return {terms[i]: share for i, share in zip(higher, shares.tolist(), strict=True)}


def noise_terms(terms: Sequence[str], columns: Mapping[str, Array], loads: Array) -> dict[str, float]:
    """Return terms without which the loads tell all others, the last first, each with its `noise_shares`."""
    remaining, shares = list(terms), {}
    while noisy := {t: s for t, s in noise_shares(remaining, columns, loads).items() if s > NOISE_SHARE}:
        # The highest goes first: where it is gone the lower ones are often told.
        term, share = list(noisy.items())[-1]
        shares[term] = share
        remaining.remove(term)
    return shares


def _clean(columns: Mapping[str, Array], loads: Array) -> dict[str, Array]:
    """Return the indications by the reference loads alone: each cell's curve over each load."""
    rows, axes = loads.shape
    size = np.abs(loads).max(axis=0)
    scaled = loads / np.where(size > 0, size, 1.0)
    # Few rows would be followed by a curve, noise and all: they get a plane.
    highest = _CURVE if rows >= 2 * (_CURVE * axes + 1) else 1
    design = np.column_stack([np.ones(rows), *(scaled**power for power in range(1, highest + 1))])
    cells = np.array(list(columns.values())).T
    fitted = design @ np.linalg.lstsq(design, cells, rcond=_SAME)[0]
    return dict(zip(columns, fitted.T, strict=True))


COLLINEAR_FINDING = 30.0
COLLINEAR_REFUSED = 300.0
RANK = 1e-10
_LARGEST = 1e75  # its fourth power, a square's square, is still a double
# Products of columns tell a condition number below 100 to ten digits; beyond it the columns are decomposed.
_BY_PRODUCTS = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Adequacy:
    """Condition number of the indications and of the term matrix; ``vif`` one value an indication."""

    condition_number: float
    condition_number_terms: float
    vif: tuple[float, ...]


def condition_number(matrix: Array) -> float:
    """Return the 2-norm condition number of columns centred and scaled to unit length, no constant.

    >>> condition_number(np.array([[0.0, 1.0], [1.0, 0.0], [2.0, 1.0]])).__round__(6)
    1.0
    """
    return _condition(matrix - matrix.mean(axis=0))[0]


def terms_condition_number(matrix: Array) -> float:
    """Return the condition number of the full term matrix, each column scaled to unit length."""
    return _condition(matrix)[0]


def check_adequate(session: Session) -> Adequacy:
    """Refuse a session that cannot determine its coefficients.

    Raises
    ------
    SessionError
        ``dof``: fewer rows than terms plus one; ``cell``: a number too large for the arithmetic;
        ``not-spanning``: a load is missing; ``collinear``: the
        indications only move together; ``rank``: the terms are dependent
    """
    table, terms = session.table, session.terms
    if table.rows - len(terms) < 1:
        raise _refused(
            session, "too few rows for the terms", f"{table.rows} rows, {len(terms)} terms",
            f"at least {len(terms) + 1} rows, better 30", "dof", "apply more reference loads",
        )  # fmt: skip
    names = [load.name for load in session.loads]
    for name in (*session.indications, *names):
        column = table.column(name)
        if max(-column.min(), column.max()) > _LARGEST:
            row = int(np.argmax(np.abs(column)))
            raise _refused(
                session, f"row {row + 1}, column {name} holds a number that no cell reads",
                f"{float(column[row]):g}",
                f"at most {_LARGEST:g} in size", "cell", "correct the cell, or the unit in the header",
            )  # fmt: skip
    loads = table.matrix(names)
    constant = [n for n, spread in zip(names, np.ptp(loads, axis=0), strict=True) if spread == 0]
    if constant:
        raise _missing(
            session, constant, f"{', '.join(constant)} never var{'ies' if len(constant) == 1 else 'y'}"
        )
    if len(names) > 1 and (together_by := condition_number(loads)) > COLLINEAR_REFUSED:
        tied = _tied(loads, names)
        together = f"{', '.join(tied)} only vary together"
        raise _refused(
            session, f"the reference loads do not span the unknowns: {together}",
            f"{together} (condition number {together_by:.3g})",
            "each load varied independently of the others", "not-spanning",
            f"add rows in which {' or '.join(tied)} varies by itself",
        )  # fmt: skip
    cells = table.matrix(session.indications)
    dead = [n for n, spread in zip(session.indications, np.ptp(cells, axis=0), strict=True) if spread == 0]
    if dead:
        raise _refused(
            session, f"indication {', '.join(dead)} never changes", "one value in every row",
            "an indication that follows the loads", "not-spanning",
            "check the cell's wiring, and apply a load that it answers to",
        )  # fmt: skip
    number, correlation = _condition(cells - cells.mean(axis=0))
    if number > COLLINEAR_REFUSED:
        tied = _tied(cells, session.indications)
        if len(names) < len(session.indications):
            raise _missing(
                session, _unnamed(session),
                f"indications {', '.join(tied)} only move together (condition number {number:.3g}): "
                f"{len(session.indications)} indications need {len(session.indications)} independent loads, "
                f"the session varies {len(names)}",
            )  # fmt: skip
        raise _refused(
            session, "the indications are collinear",
            f"condition number {number:.3g}; {', '.join(tied)} only move together",
            f"at most {COLLINEAR_REFUSED:g}", "collinear",
            "change the load schedule so that each load is also applied by itself",
        )  # fmt: skip
    matrix = term_matrix(terms, table.columns(session.indications))
    # The indications and a constant have just been found to be far from dependent.
    plain = terms == (*session.indications, INTERCEPT)
    if not plain and terms_condition_number(_scaled_terms(matrix)) > 1 / RANK:
        raise _refused(
            session, "the terms are dependent on these data", ", ".join(terms),
            "terms that the data tell apart", "rank",
            'name those to leave out: drop = ["..."]; abs(X) equals X where X never changes sign',
        )  # fmt: skip
    return Adequacy(
        condition_number=number,
        condition_number_terms=terms_condition_number(matrix),
        # Variance inflation factors: the diagonal of the inverse of the correlations.
        vif=tuple(np.diag(np.linalg.inv(correlation)).tolist()),
    )


def check_levels(session: Session) -> None:
    """Refuse a session whose model has terms that only the noise of the cells tells apart (`dilution`).

    It is asked of a session that is to be entered; what was recorded before stays readable.

    Raises
    ------
    SessionError
        ``load-levels``
    """
    loads = session.table.matrix([load.name for load in session.loads])
    untold = noise_terms(session.terms, session.table.columns(session.indications), loads)
    if not untold:
        return
    unresolved = [term for term in session.terms if term in untold]
    worst = max(untold, key=untold.__getitem__)
    drop = ", ".join(f'"{term}"' for term in unresolved)
    raise _refused(
        session,
        f"the loads do not tell {', '.join(unresolved)}: only the noise of the cells would decide about "
        f"{'it' if len(unresolved) == 1 else 'them'}",
        f"{min(untold[worst], 1.0):.0%} of what sets {worst} apart from the other terms is noise",
        f"at most {NOISE_SHARE:.0%}", "load-levels",
        "apply more load levels on each axis, and combined loads for products of cells, or leave the terms "
        f"out: drop = [{drop}]",
    )  # fmt: skip


def _condition(matrix: Array) -> tuple[float, Array]:
    """Return the condition number of columns at unit length, and their products (columns, columns)."""
    products, length = _products(matrix)
    squares = np.linalg.eigvalsh(products)
    if squares[0] > _BY_PRODUCTS * squares[-1]:
        return float(np.sqrt(squares[-1] / squares[0])), products
    # Singular values of R are those of the whole matrix: the long side is left behind.
    values = np.linalg.svd(np.linalg.qr(matrix / length, mode="r"), compute_uv=False)
    return (float(np.inf) if values[-1] == 0 else float(values[0] / values[-1])), products


def _products(matrix: Array) -> tuple[Array, Array]:
    """Return the products of columns at unit length (columns, columns), and their lengths, 1 where 0."""
    products = matrix.T @ matrix
    length = np.sqrt(np.diag(products))
    length = np.where(length == 0, 1.0, length)
    return products / np.outer(length, length), length


def _scaled(matrix: Array) -> Array:
    centred = matrix - matrix.mean(axis=0)
    scaled: Array = centred / _products(centred)[1]
    return scaled


def _scaled_terms(matrix: Array) -> Array:
    # Centred where there is a constant to take the means up: the solver works on these columns.
    if np.ptp(matrix[:, -1]) != 0:
        return matrix
    return np.column_stack([_scaled(matrix[:, :-1]), matrix[:, -1]])


def _tied(matrix: Array, names: Sequence[str]) -> list[str]:
    _, _, right = np.linalg.svd(_scaled(matrix), full_matrices=False)
    return [name for name, part in zip(names, np.abs(right[-1]), strict=True) if part > 0.3]


def _unnamed(session: Session) -> list[str]:
    """Return what load may be missing: MX for a hub of cells with levers, else any that is not named."""
    from toolkit.machine import load_machine, machine_names

    present = {load.name for load in session.loads}
    try:
        is_machine = session.instrument in machine_names()
        levers = is_machine and bool(load_machine(session.instrument).layout.overturning_lever_m)
    except ConfigError:
        levers = False
    if levers and "MX" not in present:
        return ["MX"]
    return ["one of " + ", ".join(n for n in ("FX", "FY", "FZ", "MX", "MY", "MZ") if n not in present)]


def _missing(session: Session, names: list[str], actual: str) -> SessionError:
    return _refused(
        session,
        f"the reference loads do not span the unknowns: {', '.join(names)} "
        f"{'is' if len(names) == 1 else 'are'} missing",
        actual,
        "each load varied independently of the others", "not-spanning",
        f"add rows in which {' and '.join(names)} varies by itself",
    )  # fmt: skip


def _refused(
    session: Session, problem: str, actual: object, expected: object, rule: str, next_step: str
) -> SessionError:
    return SessionError(
        problem, where=session.path, got=actual, expected=expected,
        next_step=next_step + "; nothing was written", rule=rule,
    )  # fmt: skip
