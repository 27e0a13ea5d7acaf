"""Whether a session's data can determine its equation at all. What cannot is refused before any fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.terms import term_matrix
from toolkit.errors import ConfigError, SessionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.read import Session

COLLINEAR_FINDING = 30.0
COLLINEAR_REFUSED = 300.0
RANK = 1e-10
_LARGEST = 1e75  # its fourth power, a square's square, is still a double


def condition_number(matrix: NDArray[np.float64]) -> float:
    """Return the 2-norm condition number of columns centred and scaled to unit length, no constant.

    >>> condition_number(np.array([[0.0, 1.0], [1.0, 0.0], [2.0, 1.0]])).__round__(6)
    1.0
    """
    values = _singular_values(_scaled(matrix))
    return float(np.inf) if values[-1] == 0 else float(values[0] / values[-1])


def terms_condition_number(matrix: NDArray[np.float64]) -> float:
    """Return the condition number of the full term matrix, each column scaled to unit length."""
    length = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    values = _singular_values(matrix / np.where(length == 0, 1.0, length))
    return float(np.inf) if values[-1] == 0 else float(values[0] / values[-1])


def check_adequate(session: Session) -> None:
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
        row = int(np.argmax(np.abs(table.column(name))))
        if abs(value := float(table.column(name)[row])) > _LARGEST:
            raise _refused(
                session, f"row {row + 1}, column {name} holds a number that no cell reads", f"{value:g}",
                f"at most {_LARGEST:g} in size", "cell", "correct the cell, or the unit in the header",
            )  # fmt: skip
    loads = table.matrix(names)
    constant = [n for n, spread in zip(names, np.ptp(loads, axis=0), strict=True) if spread == 0]
    if constant:
        raise _missing(
            session, constant, f"{', '.join(constant)} never var{'ies' if len(constant) == 1 else 'y'}"
        )
    if len(names) > 1 and condition_number(loads) > COLLINEAR_REFUSED:
        tied = _tied(loads, names)
        together = f"{', '.join(tied)} only vary together"
        raise _refused(
            session, f"the reference loads do not span the unknowns: {together}",
            f"{together} (condition number {condition_number(loads):.3g})",
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
    number = condition_number(cells)
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
    if terms_condition_number(_scaled_terms(matrix)) > 1 / RANK:
        raise _refused(
            session, "the terms are dependent on these data", ", ".join(terms),
            "terms that the data tell apart", "rank",
            'name those to leave out: drop = ["..."]; abs(X) equals X where X never changes sign',
        )  # fmt: skip


def _singular_values(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    # Those of R are those of the whole matrix: a decomposition of many rows is not made twice.
    values: NDArray[np.float64] = np.linalg.svd(np.linalg.qr(matrix, mode="r"), compute_uv=False)
    return values


def _scaled(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    centred = matrix - matrix.mean(axis=0)
    length = np.sqrt(np.einsum("ij,ij->j", centred, centred))
    scaled: NDArray[np.float64] = centred / np.where(length == 0, 1.0, length)
    return scaled


def _scaled_terms(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    # Centred where there is a constant to take the means up: the solver works on these columns.
    if np.ptp(matrix[:, -1]) != 0:
        return matrix
    return np.column_stack([_scaled(matrix[:, :-1]), matrix[:, -1]])


def _tied(matrix: NDArray[np.float64], names: Sequence[str]) -> list[str]:
    _, _, right = np.linalg.svd(_scaled(matrix), full_matrices=False)
    return [name for name, part in zip(names, np.abs(right[-1]), strict=True) if part > 0.3]


def _unnamed(session: Session) -> list[str]:
    """Return what load may be missing: MX for a hub of cells with levers, else any that is not named."""
    from toolkit.machine import load_machine, machine_names

    present = {load.name for load in session.loads}
    try:
        known = session.instrument in machine_names()
        levers = known and bool(load_machine(session.instrument).overturning_lever_m)
    except ConfigError:
        levers = False
    if levers and "MX" not in present:
        return ["MX"]
    return ["one of " + ", ".join(n for n in ("FX", "FY", "FZ", "MX", "MY", "MZ") if n not in present)]


def _missing(session: Session, names: list[str], got: str) -> SessionError:
    return _refused(
        session,
        f"the reference loads do not span the unknowns: {', '.join(names)} "
        f"{'is' if len(names) == 1 else 'are'} missing",
        got,
        "each load varied independently of the others", "not-spanning",
        f"add rows in which {' and '.join(names)} varies by itself",
    )  # fmt: skip


def _refused(
    session: Session, what: str, got: object, expected: object, rule: str, next_step: str
) -> SessionError:
    return SessionError(
        what, where=session.path, got=got, expected=expected,
        next_step=next_step + "; nothing was written", rule=rule,
    )  # fmt: skip
