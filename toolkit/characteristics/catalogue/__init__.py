"""Every characteristic, one file each: found by scan, never listed by hand.

A file of this package declares one ``CHARACTERISTIC``. What several of them share, the tables that they are
columns of and the figures that they are series of, is declared in `toolkit.characteristics.characteristic`.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from operator import attrgetter
from pkgutil import iter_modules

from toolkit.characteristics.characteristic import Characteristic, Figure, Scope, WideTable

_SCOPES: tuple[Scope, ...] = ("load", "direction", "angle")


@cache
def characteristics() -> tuple[Characteristic, ...]:
    """Return all, in the order of a test's rows: of loads, of directions, at slip angles.

    >>> [declared.name for declared in characteristics()][:3]
    ['conicity', 'plysteer', 'CRAT']
    """
    modules = (import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__))
    declared: list[Characteristic] = [module.CHARACTERISTIC for module in modules]
    return tuple(sorted(declared, key=_place))


@cache
def by_name() -> dict[str, Characteristic]:
    """Return all by their names."""
    return {declared.name: declared for declared in characteristics()}


def _place(declared: Characteristic) -> tuple[int, int, str]:
    return _SCOPES.index(declared.scope), declared.order, declared.name


def of_scope(scope: Scope) -> tuple[Characteristic, ...]:
    """Return those of a scope, in the order of rows."""
    return tuple(declared for declared in characteristics() if declared.scope == scope)


def by_channel(declared: tuple[Characteristic, ...]) -> tuple[Characteristic, ...]:
    """Return characteristics with those of FY before those of MZ, as tables and figures show them."""
    return tuple(sorted(declared, key=attrgetter("channel")))


def tables() -> tuple[WideTable, ...]:
    """Return the wide tables, in the order of a report."""
    wide = {declared.table for declared in characteristics()}
    return tuple(sorted(wide, key=attrgetter("place", "name")))


def columns(table: WideTable) -> tuple[Characteristic, ...]:
    """Return the characteristics that are the columns of a wide table, from left to right."""
    return by_channel(tuple(declared for declared in characteristics() if declared.table == table))


def figures() -> dict[Figure, tuple[Characteristic, ...]]:
    """Return the report's figures of characteristics and the series of each."""
    series: dict[Figure, tuple[Characteristic, ...]] = {}
    for declared in _drawn():
        if declared.figure is not None:
            series[declared.figure] = (*series.get(declared.figure, ()), declared)
    return series


def comparison_figures() -> dict[Figure, Characteristic]:
    """Return the figures of a comparison and what each draws."""
    return {
        declared.comparison_figure: declared
        for declared in _drawn()
        if declared.comparison_figure is not None
    }


def summary() -> tuple[Characteristic, ...]:
    """Return those that a report's summary has at one load, in the order of its tables."""
    return tuple(
        declared for table in tables() for declared in columns(table) if declared.summary is not None
    )


def compared() -> tuple[Characteristic, ...]:
    """Return those that a comparison takes, in the order of the source document's figures 6.6 to 6.29."""
    return tuple(declared for declared in _drawn() if declared.compared)


def _drawn() -> tuple[Characteristic, ...]:
    return tuple(declared for scope in _SCOPES for declared in by_channel(of_scope(scope)))
