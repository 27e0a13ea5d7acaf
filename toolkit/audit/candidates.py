"""Candidates: every record, with every sign of a channel or the constant, and every order of the columns.

A candidate is (record, order of the columns, signs in FY, signs in MZ). The columns are exchanged for both
loads together, signs are wrong in each load by itself. Full and issued coefficients of one record are two
forms of the same candidate.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.audit.model import Columns
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.registry.plausible import RANGE
from toolkit.calibration.terms import INTERCEPT, parse_term, term_matrix
from toolkit.units import si_scale, unit

CONSTANT = "constant"
ROUND_OFF = 8 * float(np.finfo(np.float64).eps)
"""Of a sum of products in double precision, in parts of the sum of their sizes."""

_ALL_ORDERS = 5  # beyond so many channels only exchanges of two are tried
_FIFTH = 4  # the fifth significant digit stands four places below the first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Family:
    """The sign variants of one load by one record, form and order of columns, evaluated on a file.

    ``signs`` (variants, channels + 1) of +-1, the constant last; ``coefficients`` (variants, terms) in the
    file's unit of the load; ``predicted`` (variants, rows); ``bound`` (rows,) that rounding of the printed
    digits explains; ``slack`` (rows,) what half a unit of the coefficients' fifth digit adds.
    """

    signs: NDArray[np.int8]
    coefficients: Array
    predicted: Array
    bound: Array
    slack: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Group:
    """One record in one form and order of columns: a family for each load that the file has."""

    record: CalibrationRecord
    issued: bool
    order: tuple[int, ...]
    families: dict[str, Family]


def orders(n: int) -> Iterator[tuple[int, ...]]:
    """Yield orders of n columns, the file's own first.

    >>> list(orders(2))
    [(0, 1), (1, 0)]
    """
    if n <= _ALL_ORDERS:
        yield from itertools.permutations(range(n))
        return
    yield tuple(range(n))
    for a, b in itertools.combinations(range(n), 2):
        swapped = list(range(n))
        swapped[a], swapped[b] = b, a
        yield tuple(swapped)


def unfit(record: CalibrationRecord, columns: Columns) -> str | None:
    """Return why a record cannot have computed a file, None where it can."""
    if set(record.indications) != set(columns.names):
        return f"its indications are {', '.join(record.indications)}"
    have = dict(zip(columns.names, columns.units, strict=True))
    for name, text in zip(record.indications, record.indication_units, strict=True):
        if unit(text).dimension != unit(have[name]).dimension:
            return f"its indications are in {text}, the file's in {have[name]}"
    missing = [load for load in columns.loads if load not in {fit.load for fit in record.loads}]
    return f"it has no equation for {', '.join(missing)}" if missing else None


def cannot_correct(record: CalibrationRecord, columns: Columns) -> str | None:
    """Return why a record's values would not be better than a file's own, None where they may be.

    A program may have computed anything by it. But what lies twenty times beyond the range of the calibration
    no cell has survived: the column is in another unit, or of another instrument, than the record's.
    """
    if (reason := unfit(record, columns)) is not None:
        return reason
    for cell in record.cells:
        if cell.minimum is None or cell.maximum is None:
            continue  # a legacy record has no range
        at = columns.names.index(cell.name)
        largest = float(np.abs(columns.x[:, at]).max(initial=0.0)) * si_scale(columns.units[at])
        fitted = max(abs(cell.minimum), abs(cell.maximum)) * si_scale(cell.unit)
        if largest > RANGE * fitted:
            scale = si_scale(cell.unit)
            return f"{cell.name} reads {largest / scale:.4g} {cell.unit}, calibrated to {fitted / scale:.4g}"
    return None


def group_of(
    record: CalibrationRecord, columns: Columns, *, order: tuple[int, ...], issued: bool = False
) -> Group:
    """Return a record's sign variants on a file, by full or issued coefficients, in one order of columns."""
    # Each indication in the record's unit, in the record's order.
    place = [columns.names.index(name) for name in record.indications]
    scale = np.array(
        [
            si_scale(columns.units[p]) / si_scale(text)
            for p, text in zip(place, record.indication_units, strict=True)
        ]
    )
    x, half = (columns.x[:, place] * scale)[:, order], (columns.half_x[:, place] * np.abs(scale))[:, order]
    return Group(
        record=record,
        issued=issued,
        order=order,
        families={
            load: _family(record, record.load(load), columns, load, x, half, issued=issued)
            for load in columns.loads
        },
    )


def _design(record: CalibrationRecord, fit: LoadFit, x: Array, half: Array) -> tuple[Array, Array]:
    # The terms, and how far each may be off when every indication is off by half its last place.
    names = record.indications
    if all(term == INTERCEPT or term in names for term in fit.terms):
        terms, moved = np.empty((len(x), len(fit.terms))), np.empty((len(x), len(fit.terms)))
        for j, term in enumerate(fit.terms):
            terms[:, j] = 1.0 if term == INTERCEPT else x[:, names.index(term)]
            moved[:, j] = 0.0 if term == INTERCEPT else half[:, names.index(term)]
        return terms, moved
    values = {name: x[:, i] for i, name in enumerate(names)}
    terms = term_matrix(fit.terms, values)
    moved = np.zeros_like(terms)
    for i, name in enumerate(record.indications):
        moved += np.abs(term_matrix(fit.terms, {**values, name: x[:, i] + half[:, i]}) - terms)
    return terms, moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Variants:
    # What a family has before any file is seen.
    signs: NDArray[np.int8]
    coefficients: Array
    size: Array
    slack: Array


@lru_cache(maxsize=1024)
def _variants(fit: LoadFit, indications: tuple[str, ...], to_file: float, issued: bool) -> _Variants:
    plain = np.array(fit.issued if issued else fit.coefficients)
    signs = np.array(list(itertools.product((1, -1), repeat=len(indications) + 1)), dtype=np.int8)
    turned = np.column_stack([_turn(indications, name, signs) for name in fit.terms])
    return _Variants(
        signs=signs,
        coefficients=plain * to_file * turned,
        size=np.abs(plain * to_file),
        slack=half_fifth_digit(plain) * abs(to_file),
    )


def _family(
    record: CalibrationRecord,
    fit: LoadFit,
    columns: Columns,
    load: str,
    x: Array,
    half: Array,
    *,
    issued: bool,
) -> Family:
    terms, moved = _design(record, fit, x, half)
    to_file = si_scale(fit.unit) / si_scale(columns.y_units[load])
    variants = _variants(fit, record.indications, to_file, issued)
    size = np.abs(terms)
    return Family(
        signs=variants.signs,
        coefficients=variants.coefficients,
        predicted=variants.coefficients @ terms.T,
        # Large terms may cancel to a small load: the sum's own round-off is no departure.
        bound=columns.half_y[load]
        + 1e-9 * np.abs(columns.y[load])
        + (moved + ROUND_OFF * size) @ variants.size,
        slack=size @ variants.slack,
    )


def _turn(indications: tuple[str, ...], term: str, signs: NDArray[np.int8]) -> Array:
    # A channel with the wrong sign turns every term in which it stands to an odd power.
    if term == INTERCEPT:
        return signs[:, -1].astype(np.float64)
    factor = np.ones(len(signs))
    for name, power in parse_term(term).powers:
        if power % 2:
            factor = factor * signs[:, indications.index(name)]
    return factor


def half_fifth_digit(values: Array) -> Array:
    """Return half a unit of the fifth significant digit of each value, 0 for 0.

    >>> import numpy as np
    >>> half_fifth_digit(np.array([0.99719, -0.0026666, 0.0])).tolist()
    [5e-06, 5e-08, 0.0]
    """
    size = np.abs(np.asarray(values, dtype=np.float64))
    return np.array([0.0 if v == 0 else 0.5 * 10.0 ** (int(f"{v:e}"[-3:]) - _FIFTH) for v in size.tolist()])


def describe(
    record: CalibrationRecord, order: tuple[int, ...], signs: dict[str, tuple[int, ...]]
) -> str | None:
    """Return a variant in words, None for the plain record.

    Signs first: ``E5 negative in FY, MZ`` names the sign that the file has; then exchanged columns,
    ``D51<->D52``, or for three ``D51->D52->E5->D51``: the first one's coefficient took the next one's column.
    """
    parts = []
    names = (*record.indications, CONSTANT)
    for i, name in enumerate(names):
        by_sign: dict[str, list[str]] = {}
        for load, turned in signs.items():
            if turned[i] < 0:
                by_sign.setdefault(_sign_in_file(record.load(load), name), []).append(load)
        parts += [f"{name} {sign} in {', '.join(loads)}" for sign, loads in by_sign.items()]
    cells_seen: set[int] = set()
    for start, image in enumerate(order):
        if start in cells_seen or image == start:
            continue
        cycle = [start]
        while order[cycle[-1]] != start:
            cycle.append(order[cycle[-1]])
        cells_seen.update(cycle)
        shown = [record.indications[i] for i in cycle]
        parts.append("<->".join(shown) if len(shown) == 2 else "->".join([*shown, shown[0]]))
    return "; ".join(parts) or None


def shared(variants: Sequence[str | None]) -> str | None:
    """Return what each of these variants tells, in the words of `describe`; None where that is nothing.

    >>> shared(["E5 negative in FY, MZ", f"E5 negative in FY, MZ; {CONSTANT} positive in FY"])
    'E5 negative in FY, MZ'
    """
    told = [_statements(variant) for variant in variants]
    common = [
        (change, [load for load in loads if all(load in other.get(change, ()) for other in told)])
        for change, loads in told[0].items()
    ]
    parts = [f"{change} in {', '.join(loads)}" if any(loads) else change for change, loads in common if loads]
    return "; ".join(parts) or None


def _statements(variant: str | None) -> dict[str, list[str]]:
    """Return the loads of each change of sign in a variant; of exchanged columns one without a name."""
    parts = (part.rpartition(" in ") for part in (variant or "").split("; ") if part)
    return {change or loads: loads.split(", ") if change else [""] for change, _, loads in parts}


def by_columns(variant: str, loads: tuple[str, ...]) -> bool:
    """Tell whether a variant is also what a turned or an exchanged cell column would look like.

    Such a column shows in every load; a constant is no column.

    >>> by_columns("E5 negative in FY, MZ", ("FY", "MZ")), by_columns("D51<->D52", ("FY", "MZ"))
    (True, True)
    >>> by_columns("E5 negative in FY", ("FY", "MZ")), by_columns(f"{CONSTANT} positive in FY", ("FY",))
    (False, False)
    """
    turned: dict[str, set[str]] = {}
    for change, named in _statements(variant).items():
        if any(named):
            turned.setdefault(change.rpartition(" ")[0], set()).update(named)
    return CONSTANT not in turned and all(named == {*loads} for named in turned.values())


def turned_against(record: CalibrationRecord, rival: CalibrationRecord, loads: tuple[str, ...]) -> str | None:
    """Return which signs a record has otherwise than another of the same magnitudes; None where it has not.

    It tells in one line what was wrong with a withdrawn record: ``E5 negative in FY, MZ``.
    """
    signs: dict[str, tuple[int, ...]] = {}
    for load in loads:
        mine, theirs = record.load(load), rival.load(load)
        if mine.terms != theirs.terms or record.indications != rival.indications:
            return None
        if not np.allclose(np.abs(mine.coefficients), np.abs(theirs.coefficients), rtol=1e-9, atol=0.0):
            return None
        pairs = zip(mine.coefficients, theirs.coefficients, strict=True)
        factor = dict(zip(mine.terms, (1 if a * b >= 0 else -1 for a, b in pairs), strict=True))
        signs[load] = tuple(factor.get(name, 1) for name in (*record.indications, INTERCEPT))
    return describe(rival, tuple(range(len(record.indications))), signs)


def _sign_in_file(fit: LoadFit, name: str) -> str:
    term = INTERCEPT if name == CONSTANT else name
    plain = dict(zip(fit.terms, fit.coefficients, strict=True)).get(term)
    if plain is None:  # the channel stands in higher terms only
        return "turned"
    return "positive" if plain < 0 else "negative"
