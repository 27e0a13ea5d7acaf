"""Every characteristic, one file each: found by scan, never listed by hand.

A file of this package declares one ``CHARACTERISTIC``. What several of them share, the tables that they are
columns of and the figures that they are series of, is declared in `toolkit.characteristics.layout`.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from toolkit.characteristics.characteristic import Characteristic, Figure, Scope, WideTable

_SCOPES: tuple[Scope, ...] = ("load", "direction", "angle")


@cache
def characteristics() -> tuple[Characteristic, ...]:
    """Return all, in the order of a test's rows: of loads, of directions, at slip angles.

    >>> [one.name for one in characteristics()][:3]
    ['conicity', 'plysteer', 'CRAT']
    """
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    declared: list[Characteristic] = [module.CHARACTERISTIC for module in modules]
    return tuple(sorted(declared, key=lambda one: (_SCOPES.index(one.scope), one.order, one.name)))


def characteristic(name: str) -> Characteristic:
    """Return one by its name; `KeyError` where there is none."""
    return {one.name: one for one in characteristics()}[name]


def of_scope(scope: Scope) -> tuple[Characteristic, ...]:
    """Return those of a scope, in the order of rows."""
    return tuple(one for one in characteristics() if one.scope == scope)


def by_channel(declared: tuple[Characteristic, ...]) -> tuple[Characteristic, ...]:
    """Return characteristics with those of FY before those of MZ, as tables and figures show them."""
    return tuple(sorted(declared, key=lambda one: one.channel))


def tables() -> tuple[WideTable, ...]:
    """Return the wide tables, in the order of a report."""
    return tuple(
        sorted({one.table for one in characteristics()}, key=lambda table: (table.place, table.name))
    )


def columns(table: WideTable) -> tuple[Characteristic, ...]:
    """Return the characteristics that are the columns of a wide table, from left to right."""
    return by_channel(tuple(one for one in characteristics() if one.table == table))


def figures() -> dict[Figure, tuple[Characteristic, ...]]:
    """Return the report's figures of characteristics and the series of each."""
    series: dict[Figure, tuple[Characteristic, ...]] = {}
    for one in _drawn():
        if one.figure is not None:
            series[one.figure] = (*series.get(one.figure, ()), one)
    return series


def comparison_figures() -> dict[Figure, Characteristic]:
    """Return the figures of a comparison and what each draws."""
    return {one.comparison_figure: one for one in _drawn() if one.comparison_figure is not None}


def summary() -> tuple[Characteristic, ...]:
    """Return those that a report's summary has at one load, in the order of its tables."""
    return tuple(one for table in tables() for one in columns(table) if one.summary is not None)


def compared() -> tuple[Characteristic, ...]:
    """Return those that a comparison takes, in the order of the source document's figures 6.6 to 6.29."""
    return tuple(one for one in _drawn() if one.compared)


def _drawn() -> tuple[Characteristic, ...]:
    return tuple(one for scope in _SCOPES for one in by_channel(of_scope(scope)))
