"""Headers to channels: by the machine's own headers, or as ``SYMBOL [unit]``; nothing is guessed.

A header printed as the machine prints it has the unit of the machine definition. A header with a unit in
brackets has that unit, which must be of the machine's dimension. Any other column is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NoReturn, cast

from toolkit.channels import CHANNELS, Axes, channel_of
from toolkit.errors import ColumnError, UnitError
from toolkit.machine import Machine
from toolkit.machine.definition import Column, Role
from toolkit.spelling import nearest
from toolkit.units import split_header, unit

_EXTRA_ROLES: dict[str, Role] = {"t": "time", "TIRE_ANGLE": "angle", "DRUM_ANGLE": "angle"}
_LONGEST = 200
_OPTIONAL: tuple[Role, ...] = ("acquired",)


@dataclass(frozen=True, slots=True, kw_only=True)
class Assigned:
    """A column of a file that was recognised; ``index`` counts from 0 at the file's first column."""

    index: int
    symbol: str
    header: str
    unit: str
    role: Role


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rig:
    name: str
    columns: tuple[Column, ...]
    simulated: bool = False
    axes: Axes = "machine"


def rig(name: str, units: Mapping[str, str]) -> Machine:
    """Return what readers ask a machine definition for, of a rig that has none.

    Parameters
    ----------
    units : the columns that a file must have, each with the unit of its dimension
    """
    columns = tuple(
        Column(symbol=symbol, header=f"{symbol} [{text}]", unit=text, role="indication")
        for symbol, text in units.items()
    )
    return cast(Machine, _Rig(name=name, columns=columns))  # readers ask for no more


def assign_columns(headers: Sequence[str], machine: Machine, *, where: object) -> tuple[Assigned, ...]:
    """Return the channel of every column, in the order of the file.

    Parameters
    ----------
    headers : texts of the header row; an empty text is an unused column
    machine : whose definition names headers, units and roles
    where : file and sheet, for the messages

    Raises
    ------
    ColumnError
        rule ``unknown-unit unit-dimension unknown-column doubled-column missing-column``

    Examples
    --------
    >>> from toolkit.machine import load_machine
    >>> row = ["SA [deg]", "fz LOAD", "D51 (Filtered)", "D52 (Filtered)", "E5 (Filtered)", "t [s]"]
    >>> [(one.symbol, one.unit) for one in assign_columns(row, load_machine("m15"), where="doctest")]
    [('SA', 'deg'), ('FZ', 'lbf'), ('D51', 'lbf'), ('D52', 'lbf'), ('E5', 'lbf'), ('t', 's')]
    """
    assigneds = tuple(
        _assign(index, header, machine, where) for index, header in enumerate(headers) if header.strip()
    )
    _check_once(assigneds, where)
    _check_whole(assigneds, machine, headers, where)
    return assigneds


def header_of(machine: Machine) -> Callable[[str], bool]:
    """Return what tells whether a text is a header of the machine.

    A row with one such text is taken for a recording's.
    """
    return lambda header: _machine_column(_split(header, machine)[0], machine) is not None


def _split(header: str, machine: Machine) -> tuple[str, str | None]:
    return split_header(
        header, lambda name: _machine_column(name, machine) is not None or channel_of(name) is not None
    )


def _assign(index: int, header: str, machine: Machine, where: object) -> Assigned:
    name, printed = _split(header, machine)
    column = _machine_column(name, machine)
    if printed is None:
        # Without a printed unit only the machine's own header has one: a bare symbol could be anything.
        if column is None or _plain(name) != _plain(column.header):
            _no_unit(header[:_LONGEST], name, column, machine, where)
        return Assigned(index=index, symbol=column.symbol, header=header, unit=column.unit, role=column.role)
    try:
        read = unit(printed, where=where)
    except UnitError as error:
        raise ColumnError(
            f"column {header!r} has a unit that is not known",
            where=where, got=printed, expected=error.expected, next_step=error.next_step, rule="unknown-unit",
        ) from error  # fmt: skip
    if column is not None:
        _check_dimension(header, read.text, read.dimension, unit(column.unit).dimension, column.unit, where)
        return Assigned(index=index, symbol=column.symbol, header=header, unit=read.text, role=column.role)
    channel = channel_of(name)
    if channel is not None:
        _check_dimension(header, read.text, read.dimension, channel.dimension, channel.si, where)
    symbol = channel.symbol if channel else name
    return Assigned(
        index=index, symbol=symbol, header=header, unit=read.text, role=_EXTRA_ROLES.get(symbol, "covariate")
    )


def _plain(text: str) -> str:
    return " ".join(text.split()).casefold()


def _machine_column(name: str, machine: Machine) -> Column | None:
    return _names(machine.columns).get(_plain(name))


@lru_cache(maxsize=32)
def _names(columns: tuple[Column, ...]) -> Mapping[str, Column]:
    # Every name of every column, once a machine; the first column that has a name keeps it.
    by_name: dict[str, Column] = {}
    for column in columns:
        channel = CHANNELS.get(column.symbol)
        for alias in (column.header, column.symbol, *(channel.aliases if channel else ())):
            by_name.setdefault(_plain(alias), column)
    return by_name


def _check_dimension(
    header: str, printed: str, dimension: str, expected: str, example: str, where: object
) -> None:
    if dimension != expected:
        raise ColumnError(
            f"column {header!r} has a unit of another kind",
            where=where,
            got=f"{printed} ({dimension})",
            expected=f"a unit of {expected}, such as {example}",
            next_step="correct the header, or name the machine that wrote the file",
            rule="unit-dimension",
        )


def _no_unit(header: str, name: str, column: Column | None, machine: Machine, where: object) -> NoReturn:
    if column is not None:
        raise ColumnError(
            f"column {header!r} has no unit",
            where=where,
            got=header,
            expected=f"{column.header!r} as the machine writes it, or '{column.symbol} [unit]'",
            next_step=f"write the unit into the header, for example '{column.symbol} [{column.unit}]'",
            rule="unknown-unit",
        )
    headers = [column.header for column in machine.columns]
    near = nearest(_plain(name), [_plain(header) for header in headers])
    match = next((header for header in headers if near and _plain(header) == near), None)
    raise ColumnError(
        f"column {header!r} is not known and has no unit",
        where=where,
        got=header,
        expected=f"{match!r}" if match else f"{', '.join(headers)}, or 'NAME [unit]'",
        next_step=f"did you mean {match!r}?" if match else "write its unit into the header as 'NAME [unit]'",
        rule="unknown-unit",
    )


def _check_once(assigneds: tuple[Assigned, ...], where: object) -> None:
    first: dict[str, Assigned] = {}
    for assigned in assigneds:
        # `t` and `T` are two channels; everything else is the same in either case.
        key = assigned.symbol if assigned.symbol in CHANNELS else assigned.symbol.casefold()
        if key in first:
            raise ColumnError(
                f"channel {assigned.symbol} has two columns",
                where=where,
                got=f"{first[key].header!r} and {assigned.header!r}",
                expected="one column a channel",
                next_step="remove or rename one of them in a copy of the file",
                rule="doubled-column",
            )
        first[key] = assigned


def _check_whole(
    assigneds: tuple[Assigned, ...], machine: Machine, headers: Sequence[str], where: object
) -> None:
    have = {assigned.symbol for assigned in assigneds}
    missing = [c for c in machine.columns if c.role not in _OPTIONAL and c.symbol not in have]
    if missing:
        raise ColumnError(
            f"the recording lacks {', '.join(repr(column.header) for column in missing)}",
            where=where,
            got=", ".join(repr(header) for header in headers if header.strip())[:400] or "no header",
            expected=", ".join(repr(c.header) for c in machine.columns if c.role not in _OPTIONAL),
            next_step=f"check the header row; the machine here is {machine.name}: define another one with "
            "'toolkit machine new RIG.toml --from FILE'",
            rule="missing-column",
        )
