"""TYDEX 1.3 files of measured tires: sections of fixed columns, read in SI or written from a table.

TYDEX-Format Description and Reference Manual, release 1.3 (1997). Lines of **CONSTANTS: name in 10 columns,
description 30, unit 10, value. Lines of **MEASURCHANNELS: name 10, description 30, unit 10, factor 10,
offsets 10 and 10. Data stand in columns of 10, one a channel; physical = factor x value + offset in the
unit that is given; a constant applies to every row. The W axes are ISO-W; FX is the same in C and W, and
without camber FY, FZ and MZ are too. With camber they are not read in C: MZ would need the loaded radius.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import CHANNELS
from toolkit.errors import CellError, UnreadableError
from toolkit.findings import Finding
from toolkit.inputs import TYDEX_FILE, read_input
from toolkit.units import unit

SYMBOLS = {channel.tydex: symbol for symbol, channel in CHANNELS.items() if channel.tydex} | {
    "FXW": "FX", "FXC": "FX", "RUNTIME": "t",
}  # fmt: skip
# Of the wheel carrier's axes: without camber these are the same in C and W, since C only lies higher.
_CARRIER = {"FYC": "FY", "FZC": "FZ", "MZC": "MZ"}
NAMES = {symbol: channel.tydex for symbol, channel in CHANNELS.items() if channel.tydex} | {"t": "RUNTIME"}
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][+-]?[0-9]{1,4})?")
_WIDTH = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TydexChannel:
    """One channel in its own unit; ``values`` [unit] (rows,). ``symbol`` is None where it is not ours."""

    name: str
    symbol: str | None
    unit: str
    values: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TydexFile:
    """A file: its channels, the constants that are channels among them; ``other`` is what is neither."""

    where: str
    channels: tuple[TydexChannel, ...]
    other: tuple[str, ...]
    findings: tuple[Finding, ...]


def read_tydex(path: Path) -> TydexFile:
    """Read a file; all of it or nothing.

    Raises
    ------
    UnreadableError
        no TYDEX file, no channels or data, its end or rows are missing, or its offsets say two things
    CellError
        text, NaN or infinity in a number's place, or a row of another length
    UnitError
        the unit of a known channel is unknown or of another dimension
    """
    data = read_input(path, TYDEX_FILE)
    if b"\0" in data:
        raise _refuse(
            path, "not-a-tydex", "the file is no TYDEX file", "bytes that are no text", "sections of text"
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    sections = _sections(text, path)
    rows, misaligned = _data(sections["MEASURDATA"], len(_lines(sections["MEASURCHANNELS"])), path)
    measured = [
        _channel(number, line, rows[:, i], path)
        for i, (number, line) in enumerate(_lines(sections["MEASURCHANNELS"]))
    ]
    ignored = [f"**{name}" for name, lines in sections.items() if name not in _KNOWN and _lines(lines)]
    ignored += [f"{name} ({_lines(sections[name])[0][1].strip()[:30]} ...)" for name in ("COMMENTS",)
              if name in sections and _lines(sections[name])]  # fmt: skip
    ignored += [line[:_WIDTH].strip() for _, line in _lines(sections.get("HEADER", []))]
    symbols = {channel.symbol for channel in measured}
    findings = []
    for number, line in _lines(sections.get("CONSTANTS", [])):
        name, value = line[:_WIDTH].strip(), line[50:].strip()
        symbol = SYMBOLS.get(name.upper())
        if symbol is None:
            ignored.append(f"{name} = {value}")
        elif symbol in symbols:
            text = f"{name} is measured and a constant of {value}: the measured values count"
            findings.append(Finding(rule="tydex-constant", where=str(path), message=text, level="note"))
        else:
            number_of = _number(value, f"{path}, line {number}", f"the constant {name}")
            column = np.full(len(rows), number_of)
            measured.append(_made(name, symbol, line[40:50].strip(), column, f"{path}, line {number}"))
            symbols.add(symbol)
    measured, carried = _from_carrier(measured, str(path))
    findings += carried
    symbols |= {channel.symbol for channel in measured}
    if misaligned:
        text = f"{misaligned} rows do not stand in columns of 10: read by their spaces"
        findings.append(Finding(rule="tydex-columns", where=str(path), message=text))
    for symbol in symbols - {None}:
        if sum(channel.symbol == symbol for channel in measured) > 1:
            raise _refuse(path, "doubled-column", f"{symbol} is measured twice", symbol, "one such channel")
    return TydexFile(
        where=str(path), channels=tuple(measured), other=tuple(ignored), findings=tuple(findings)
    )


def _from_carrier(measured: list[TydexChannel], where: str) -> tuple[list[TydexChannel], list[Finding]]:
    # What C and W have in common is read from C where the file has no W.
    have = {channel.symbol for channel in measured}
    names = [
        channel.name for channel in measured if _CARRIER.get(channel.name.upper(), "FX") not in have | {"FX"}
    ]
    if not names:
        return measured, []
    listed = ", ".join(names)
    if any(channel.symbol == "IA" and np.any(channel.values) for channel in measured):
        text = (
            f"{listed}: not read, for with camber the axes of the wheel carrier (C) are not those of the road"
        )
        return measured, [Finding(rule="tydex-axes", where=where, message=text)]
    statement = (
        "the camber is zero" if "IA" in have else "the file names no camber, so that it counts as zero"
    )
    text = f"{listed}: read from the axes of the wheel carrier (C) as of the road (W), for {statement}"
    channels = [
        _made(channel.name, _CARRIER[channel.name.upper()], channel.unit, channel.values, where)
        if channel.name in names
        else channel
        for channel in measured
    ]
    return channels, [Finding(rule="tydex-axes", where=where, message=text, level="note")]


_KNOWN = ("HEADER", "COMMENTS", "CONSTANTS", "MEASURCHANNELS", "MEASURDATA", "END")


def _sections(text: str, path: Path) -> dict[str, list[tuple[int, str]]]:
    sections: dict[str, list[tuple[int, str]]] = {}
    name = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("**"):
            name, *tail = line[2:].split(maxsplit=1) or [""]
            name = name.upper()
            if name in sections:
                raise _refuse(path, "not-a-tydex", f"**{name} stands twice", f"line {number}", "each once")
            sections[name] = [(0, tail[0])] if tail and name == "MEASURDATA" else []
        elif name:
            sections[name].append((number, line.rstrip()))
    for needed in ("MEASURCHANNELS", "MEASURDATA"):
        if not _lines(sections.get(needed, [])):
            raise _refuse(
                path, "not-a-tydex", f"the file has no **{needed}",
                ", ".join(f"**{section}" for section in sections) or "no section",
                "a TYDEX file with channels and data",
            )  # fmt: skip
    if "END" not in sections:
        raise _refuse(path, "tydex-end", "the file ends before **END", f"the last line is {number}", "**END")
    return sections


def _lines(section: Sequence[tuple[int, str]]) -> list[tuple[int, str]]:
    return [(number, line) for number, line in section if number and line.strip() and line[0] != "!"]


def _data(section: list[tuple[int, str]], count: int, path: Path) -> tuple[Array, int]:
    rows, misaligned = [], 0
    for number, line in _lines(section):
        where = f"{path}, line {number}"
        fixed = [line[at : at + _WIDTH].strip() for at in range(0, _WIDTH * count, _WIDTH)]
        free = line.split()
        if len(free) == count:
            misaligned += free != fixed
            fixed = free
        elif len(line) > _WIDTH * count and line[_WIDTH * count :].strip():
            raise CellError(
                f"the row has more than {count} columns of 10", where=where, got=f"{len(line)} characters",
                expected=f"{count} channels", next_step="export the file again", rule="ragged-row",
            )  # fmt: skip
        rows.append([_number(cell, where, "a value") for cell in fixed])
    comment = section[0][1] if section and section[0][0] == 0 else ""
    if comment.strip().isdigit() and int(comment) != len(rows):
        raise _refuse(
            path, "tydex-end", "rows of the file are missing", f"{len(rows)} rows", f"{int(comment)} rows"
        )
    return np.array(rows, dtype=np.float64), misaligned


def _channel(number: int, line: str, values: Array, path: Path) -> TydexChannel:
    where = f"{path}, line {number}"
    name = line[:_WIDTH].strip()
    cells = [line[at : at + _WIDTH].strip() for at in (50, 60, 70)]
    factor = _number(cells[0], where, f"the factor of {name}") if cells[0] else 1.0
    offsets = [_number(cell, where, f"an offset of {name}") if cell else 0.0 for cell in cells[1:]]
    if all(offsets):
        raise _refuse(
            where, "tydex-offset", f"{name} has two offsets", " and ".join(cells[1:]),
            "one: physical = factor x value + offset",
        )  # fmt: skip
    physical = factor * values + sum(offsets)
    return _made(name, SYMBOLS.get(name.upper()), line[40:50].strip(), physical, where)


def _made(name: str, symbol: str | None, text: str, values: Array, where: str) -> TydexChannel:
    if symbol is not None:
        text = text or ("1" if symbol == "KAPPA" else "")
        stated = unit(text if text != "-" else "1", where=f"{where}, {name}")
        if stated.dimension != CHANNELS[symbol].dimension:
            from toolkit.units import si_scale

            si_scale(text, CHANNELS[symbol].dimension, where=f"{where}, {name}")
        text = stated.text
    return TydexChannel(name=name, symbol=symbol, unit=text, values=values)


def tydex_text(
    columns: Mapping[str, tuple[str, Array]], *, comments: Sequence[str] = ()
) -> tuple[str, tuple[Finding, ...]]:
    """Return the text of a file in the W axes, and the finding of what ten columns could not hold.

    Parameters
    ----------
    columns : by symbol (unit, values (rows,)) in ISO-W; a symbol without a TYDEX name is the caller's to name
    """
    lines = ["**HEADER", f"{'RELEASE':<10}{'Release of TYDEX-Format':<30}{'':<10}1.3", "", "**COMMENTS"]
    lines += [*comments, "", "**CONSTANTS", "", "**MEASURCHANNELS"]
    printed, largest, place = [], 0.0, ""
    for symbol, (text, values) in columns.items():
        shown_unit = {"1": "-", "N*m": "Nm"}.get(text, text)
        lines.append(f"{NAMES[symbol]:<10}{CHANNELS[symbol].name:<30}{shown_unit:<10}{'1':<10}{'0':<10}0")
        cells = [fitted(value) for value in values.tolist()]
        printed.append(cells)
        back = np.array([float(cell) for cell in cells])
        loss = float(np.abs(back - values).max(initial=0.0) / (np.abs(values).max(initial=0.0) or 1.0))
        if loss > largest:
            largest, place = loss, symbol
    rows = len(printed[0]) if printed else 0
    lines += ["", f"**MEASURDATA{rows:>10}"]
    lines += ["".join(f"{cell:>10}" for cell in row) for row in zip(*printed, strict=True)]
    lines += ["**END"]
    findings: tuple[Finding, ...] = ()
    if largest > 0:
        text = f"ten columns round the values, most in {place}: by {largest:.1e} of its largest"
        findings = (Finding(rule="tydex-digits", where="**MEASURDATA", message=text, level="note"),)
    return "\n".join(lines) + "\n", findings


def fitted(value: float) -> str:
    """Return a number in nine characters at most, with all the digits that these hold.

    >>> fitted(-1234.56789), fitted(0.1), fitted(-1.23456789e-7)
    ('-1234.568', '0.1', '-1.23e-07')
    """
    value += 0.0  # a sign that was turned leaves -0
    if len(short := f"{value:.12g}") <= _WIDTH - 1 and float(short) == value:
        return short
    for digits in range(9, 0, -1):
        if len(text := f"{value:.{digits}g}") <= _WIDTH - 1:
            return text
    return f"{value:.0e}"


def _number(text: str, where: str, problem: str) -> float:
    number = float(text.lower().replace("d", "e")) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise CellError(
            f"{problem} is no number", where=where, got=repr(text) if text else "an empty field",
            expected="a finite number with a decimal point", next_step="mend that line",
            rule="text-cell" if text else "empty-cell",
        )  # fmt: skip
    return number


def _refuse(where: object, rule: str, problem: str, actual: object, expected: str) -> UnreadableError:
    return UnreadableError(
        problem,
        where=where,
        got=actual,
        expected=expected,
        next_step="export the file again, whole",
        rule=rule,
    )
