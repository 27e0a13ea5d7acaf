"""Compare tests with each other, or with what a maker states: the first entry is the reference."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.characteristics.characterise import characteristic_rows
from toolkit.characteristics.model import Characteristics
from toolkit.characteristics.shared_errors import identity_of
from toolkit.comparison.differences import differences, pattern_effects
from toolkit.comparison.model import MODES, Comparison, Entry, Mode, Repeats
from toolkit.comparison.precision import repeats_of
from toolkit.errors import ConfigError, refuse_unknown
from toolkit.findings import Finding
from toolkit.machine import Machine
from toolkit.reduction.model import ReducedTest
from toolkit.units import from_si, in_both

# Slip angles at which two tables are read, where no test says which [deg].
DEFAULT_ANGLES = tuple(math.radians(s * a) for a in (0, 1, 2, 4, 6, 8, 10) for s in ((1, -1) if a else (1,)))
# What a comparison takes as the same; another value in a condition of this list is told.
_WATCHED = ("machine", "surface", "speed", "pressure", "rim", "protocol", "calibration", "reversal")
# What each mode is about, and so does not tell.
_SUBJECT: dict[Mode, tuple[str, ...]] = {
    "table": ("machine", "protocol", "calibration", "reversal"),
    "surfaces": ("surface",),
    "tires": ("rim",),
    "repeats": (),
}


def test_entry(
    reduced: ReducedTest,
    characteristics: Characteristics,
    *,
    machine: Machine,
    record: CalibrationRecord,
    source: str,
) -> Entry:
    """Return a test as an entry; its rows keep the parts that it shares with others."""
    info = reduced.info
    tire = " ".join(t for t in (info.tire_company, info.tire_series, info.tire_size, info.tire_DOT) if t)
    return Entry(
        label=info.name,
        kind="test",
        identity=identity_of(reduced),
        source=source,
        rows=characteristic_rows(reduced, characteristics, machine=machine, record=record),
        conditions=(
            ("tire", tire or None),
            ("belt", info.tire_belt),
            ("rim", info.tire_rim),
            ("surface", info.surface),
            ("pressure", _shown(info.pressure_Pa, "kPa", 1)),
            ("speed", _shown(info.speed_m_s, "km/h", 2)),
            ("machine", machine.name),
            ("calibration", record.id),
            ("protocol", reduced.protocol or None),
            ("reversal", info.reversal),
            ("day", info.date),
            ("operator", info.operator),
            ("mounting", info.mounting),
            ("laboratory", info.laboratory),
            ("special", info.special),
        ),
        calibration=reduced.calibration,
        simulated=info.simulated,
    )


def compare(
    entries: Sequence[Entry], *, mode: Mode | None = None, level: float = 0.05, reproducibility: bool = False
) -> Comparison:
    """Compare entries with the first.

    Parameters
    ----------
    mode : what the comparison is about; by default inferred from what the entries state
    level : chance of even one false decision in a table of differences
    reproducibility : demand it; an error where no two laboratories are named

    Raises
    ------
    ConfigError
        fewer than two entries, the same data twice, a level that is none, a mode that the entries do not
        bear, reproducibility without another laboratory
    """
    _check(entries, mode, level)
    labelled = _labelled(entries)
    kind = mode or infer_mode(labelled)
    table, left_out = differences(labelled, level=level)
    if not table:
        raise ConfigError(
            "nothing can be compared",
            where=", ".join(entry.source for entry in labelled),
            got="; ".join(left_out) or "no characteristic in common",
            expected="loads and characteristics in common",
            next_step="compare tests whose loads overlap, in the same direction of rotation",
            rule="nothing-in-common",
        )
    repeats = repeats_of(labelled, level=level) if kind == "repeats" else None
    if reproducibility and (repeats is None or repeats.reproducibility is None):
        laboratories = {entry.condition("laboratory") for entry in labelled} - {None}
        listed = ", ".join(map(str, laboratories)) or "none named"
        raise ConfigError(
            "reproducibility cannot be stated",
            where="--reproducibility",
            got=f"tests of {len(laboratories)} laboratories ({listed})",
            expected="repeats of one tire in two laboratories or more, named in test.toml (laboratory = ...)",
            next_step="leave the option out; repeatability and intermediate precision are given",
            rule="no-other-laboratory",
        )
    return Comparison(
        mode=kind,
        entries=labelled,
        level=level,
        differences=table,
        repeats=repeats,
        pattern=pattern_effects(labelled),
        left_out=left_out,
        findings=tuple(_findings(labelled, kind, repeats, stated=mode is not None)),
    )


def infer_mode(entries: Sequence[Entry]) -> Mode:
    """Return what a comparison is about: a maker's table, surfaces, tires, or repeats of one tire."""
    if any(entry.kind != "test" for entry in entries):
        return "table"
    if len({(entry.condition("tire"), entry.condition("belt")) for entry in entries}) > 1:
        return "tires"
    return "surfaces" if len({entry.condition("surface") for entry in entries}) > 1 else "repeats"


def _check(entries: Sequence[Entry], mode: Mode | None, level: float) -> None:
    if len(entries) < 2:
        raise ConfigError(
            "a comparison takes two tests or more", where="compare", got=f"{len(entries)} argument(s)",
            expected="two or more: tests, reduced tests, a maker's table", next_step="name another one",
            rule="too-few-entries",
        )  # fmt: skip
    if not 0 < level < 1:
        raise ConfigError(
            "the level is no probability", where="--level", got=level, expected="a number between 0 and 1",
            next_step="0.05 is usual", rule="wrong-value",
        )  # fmt: skip
    if mode is not None:
        refuse_unknown("mode", mode, MODES, where="--mode", rule="unknown-mode")
    for identity, count in Counter(entry.identity for entry in entries).items():
        if count > 1:
            twice = [entry.source for entry in entries if entry.identity == identity]
            raise ConfigError(
                "the same data is compared with itself", where=", ".join(twice), got="the same recordings",
                expected="different tests", next_step="name each test once", rule="same-test",
            )  # fmt: skip
    tests = [entry for entry in entries if entry.kind == "test"]
    if mode == "repeats" and len(tests) < len(entries):
        raise ConfigError(
            "a maker's table is no repeat of a test", where="--mode", got="repeats", expected="tests only",
            next_step="leave --mode away", rule="mode",
        )  # fmt: skip


def _labelled(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """Return the entries with a label of their own each: equal names take their folders, else a number."""
    named: dict[str, list[Entry]] = {}
    for entry in entries:
        named.setdefault(entry.label, []).append(entry)
    marks = {label: iter(_marks(alike)) for label, alike in named.items() if len(alike) > 1}
    return tuple(
        replace(entry, label=f"{entry.label} ({next(marks[entry.label])})") if entry.label in marks else entry
        for entry in entries
    )


def _marks(alike: Sequence[Entry]) -> list[str]:
    """Return what tells entries of one name apart: the ends of their folders that differ, else numbers."""
    folders = [PurePath(entry.source).parts[:-1] for entry in alike]
    for depth in range(1, max(map(len, folders)) + 1):
        ends = ["/".join(folder[-depth:]) for folder in folders]
        if all(ends) and len(set(ends)) == len(ends):
            return ends
    return [str(number) for number in range(1, len(alike) + 1)]


def _findings(
    entries: Sequence[Entry], mode: Mode, repeats: Repeats | None, *, stated: bool
) -> list[Finding]:
    findings = []
    tests = [entry for entry in entries if entry.kind == "test"]
    for name in _WATCHED:
        stating = [entry for entry in entries if entry.kind == "test" or entry.condition(name)]
        values = {entry.label: entry.condition(name) for entry in stating}
        if name in _SUBJECT[mode] or len(set(values.values())) < 2:
            continue
        values_by_test = ", ".join(f"{label}: {value or 'not stated'}" for label, value in values.items())
        what = "tests" if len(stating) == len(tests) else "tests and tables"
        message = f"the {what} differ in {name} ({values_by_test}): a difference may come from it"
        findings.append(Finding(rule="conditions-differ", where=name, message=message, level="note"))
    outliers: dict[str, list[str]] = {}
    for precision in repeats.precisions if repeats else ():
        if precision.outlier:
            where = f"{precision.name} at {in_both(precision.load_N, 'N', '.0f')}"
            outliers.setdefault(precision.farthest, []).append(where)
    for label, places in outliers.items():
        message = f"stands apart from the other repeats in {', '.join(places)} (Grubbs, Holm over the table)"
        findings.append(Finding(rule="repeat-outlier", where=label, message=message, level="note"))
    inferred = infer_mode(entries)
    if stated and mode != inferred and inferred != "repeats":
        message = f"compared as {mode}; by what the tests state it is a comparison of {inferred}"
        findings.append(Finding(rule="mode", where="--mode", message=message))
    if len({entry.simulated for entry in tests}) > 1:
        message = "simulated and measured tests are compared with each other"
        findings.append(Finding(rule="simulated-and-measured", where="compare", message=message))
    return findings


def _shown(value: float | None, unit: str, digits: int) -> str | None:
    return None if value is None else f"{float(from_si(value, unit)):.{digits}f} {unit}"
