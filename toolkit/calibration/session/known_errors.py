"""What a session states about the errors of its reference loads and indications, row by row.

**gls.** Reference loads that come from the same weights share those weights' error (GUM F.1.2.3; JCGM
100:2008, 5.2.4): the covariance of the loads is

    V_ij = u_i^2 (i = j) + v_i v_j (rows i and j of one group),

with v the standard uncertainty of the shared error as it acts on each row, of size U/k of
``[reference.uncertainty]``. A weight that is too heavy by a share makes every load too large by that share,
in the direction in which it pulls: *proportional*, the default, is v_i = (U/k) L_i / max|L|, with the fitted
loads L, so that the scatter of single rows is not taken for the scale (D'Agostini, NIM A 346 (1994) 306).
*constant*, v_i = U/k, is a hanger's or a zero's error. The independent u_i are a column ``u_<LOAD>``; without
one, the residual standard deviation of the ordinary fit, which also holds what groups differ by.

``[reference] shared_group`` names what shares: ``"run"``, ``"rotation"``, ``"direction"``; a load (rows of
the same nominal load hang on the same weights); a column of the data with names (headed ``name``) or numbers
(``name [1]``) of its own. Any other text is the name of one standard behind every row: declared where it is
that of ``[reference] standard`` or ``certificate``, else a note says how it was taken (`fit.findings`), and
one that is nearly a column's name is an error. As a table: ``{ column = "stack", error = "constant" }``;
without ``column`` it means every row.

**odr.** Uncertainties of the loads are a column ``u_<LOAD>``, else U/k; of an indication ``[cells.X] u``,
else its resolution over sqrt(12) (GUM F.2.2.1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.session.settings import wrong
from toolkit.spelling import nearest
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.statements import Reference, Statements
    from toolkit.calibration.session.table import Table

_LABELS = ("run", "direction", "rotation")
_ERRORS = ("proportional", "constant")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownErrors:
    """Of one load, in its unit: ``u`` (rows,) of single rows, None where the residuals must tell (gls).

    ``group`` (rows,) numbers the rows' groups from 0, ``u_shared`` is the standard uncertainty of a group's
    error and ``proportional`` tells how it acts; ``u_cells`` (indications,) in the indications' units.
    """

    u: Array | None
    group: NDArray[np.intp]
    u_shared: float
    proportional: bool
    u_cells: Array


def group_column(reference: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the data's column that a session's reference names as its group, read beside the loads."""
    group = reference.get("shared_group")
    name = group.get("column") if isinstance(group, dict) else group
    return (name,) if isinstance(name, str) and name not in _LABELS else ()


def row_columns(loads: Sequence[str], labels: Sequence[str] = ()) -> list[str]:
    """Return the columns that tell something of single rows: ``u_<LOAD>``, and the names of groups."""
    return [*(f"u_{load}" for load in loads), *labels]


def row_uncertainty(table: Table, load: str) -> Array | None:
    """Return the column ``u_<LOAD>`` (rows,) in the load's unit; None where the data have none."""
    name = f"u_{load}"
    if not table.has(name):
        return None
    factor = unit(table.unit(name)).factor / unit(table.unit(load)).factor
    return np.asarray(table.column(name) * factor, dtype=np.float64)


def known_errors(method: str, statements: Statements, table: Table, load: str, where: object) -> KnownErrors:
    """Return the errors that ``gls`` or ``odr`` needs of one load.

    Raises
    ------
    ConfigError
        ``session``: an uncertainty or the group is not stated, or cannot be
    """
    u, reference = row_uncertainty(table, load), statements.reference
    stated = reference.of(load)
    group = np.zeros(table.rows, dtype=np.intp)
    if method == "gls":
        group, proportional = _groups(reference, table, where)
        if stated is None:
            expected = "{ U, k, unit } of the error that the rows of a group share"
            raise wrong(where, f"reference.uncertainty.{load}", None, expected)
        if stated.relative is not None and not proportional:
            expected = f"U in the unit of {load} where the shared error is constant"
            raise wrong(where, f"reference.uncertainty.{load}", "a share of the applied load", expected)
        return KnownErrors(
            u=u, group=group, u_shared=stated.u, proportional=proportional, u_cells=np.zeros(0)
        )
    if u is None and (stated is None or not stated.U):
        expected = f"a column u_{load}, or reference.uncertainty.{load} = {{ U, k, unit }} with U above 0"
        raise wrong(where, f"the uncertainty of {load}", None if stated is None else stated.U, expected)
    u = reference.u_at(load, table.column(load)) if u is None else u
    if u is not None and not (u > 0).all():
        row = int((u <= 0).argmax()) + 1
        fault = f"a share of the applied load, which is 0 in row {row}"
        raise wrong(
            where, f"reference.uncertainty.{load}", fault, f"U in the unit of {load}, or a column u_{load}"
        )
    cells = np.array([_u_cell(c.u, c.stated_resolution, c.name, where) for c in statements.cells])
    return KnownErrors(u=u, group=group, u_shared=0.0, proportional=False, u_cells=cells)


def _u_cell(u: float | None, resolution: float | None, name: str, where: object) -> float:
    value = resolution / math.sqrt(12) if u is None and resolution is not None else u
    if value is None or not (math.isfinite(value) and value > 0):
        expected = f"a positive [cells.{name}] u (standard uncertainty), or resolution"
        raise wrong(where, f"cells.{name}.u", value, expected)
    return value


def undeclared_standard(reference: Reference, table: Table) -> str | None:
    """Return the name that was taken for one standard behind every row although nothing else names it so."""
    entry = reference.shared_group
    if not isinstance(entry, str) or entry in _LABELS or _column(entry, table) is not None:
        return None
    declared = [name.strip().casefold() for name in (reference.standard, reference.certificate) if name]
    return None if entry.strip().casefold() in declared else entry


def _groups(reference: Reference, table: Table, where: object) -> tuple[NDArray[np.intp], bool]:
    entry, error = reference.shared_group, _ERRORS[0]
    by_name = isinstance(entry, dict)
    if by_name:
        error, entry = entry.get("error", error), entry.get("column", "every row")
        by_name = entry != "every row"
    if not isinstance(entry, str) or not entry.strip():
        expected = 'what the rows share: "run", a load, a column, or the name of the standard'
        raise wrong(where, "reference.shared_group", entry, expected)
    if error not in _ERRORS:
        raise wrong(where, "reference.shared_group.error", error, " | ".join(_ERRORS))
    labels = _column(entry, table)
    if labels is None:
        if by_name or entry in _LABELS:
            raise wrong(where, "reference.shared_group", entry, "a column of the data")
        columns = [*_LABELS, *table.names, *(name for name, _ in table.labels)]
        near = nearest(entry, columns)
        if near and undeclared_standard(reference, table) is not None:
            expected = f"{near!r}, or the name of the standard as [reference] standard has it"
            raise wrong(where, "reference.shared_group", entry, expected)
        return np.zeros(table.rows, dtype=np.intp), error == "proportional"
    _, group = np.unique(labels, return_inverse=True)
    return np.asarray(group, dtype=np.intp).ravel(), error == "proportional"


def _column(name: str, table: Table) -> NDArray[Any] | None:
    if name == "direction":
        return table.up
    if name in _LABELS:
        return table.run if name == "run" else table.rotation
    texts = dict(table.labels).get(name)
    if texts is not None:
        return np.array(texts)
    return table.column(name) if table.has(name) else None
