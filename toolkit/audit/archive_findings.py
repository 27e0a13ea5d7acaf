"""What the files of an archive show together: copies, late edits, changed conventions, missing conditions.

It changes no grade; but for values that no tire has, it only informs. Files are added one by one, sorted by
path, as plain answers; what is kept of each is a few bytes.

One of them is what a repair does to what a requester reads off a test: cornering stiffness and pull, old and
new. Both are read off the means of the load blocks in one way, so that nothing but the calibration differs:
the stiffness is the secant through the +-1 deg steps (thesis, SAE), pull the line through the steps next to 0
deg of a forward and a reversed run, each at the load as it was. `toolkit process` subtracts a tare, carries
to a common load and fits curves; this compares without them.
"""

from __future__ import annotations

import json
import math
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from toolkit.audit.day import CONTRADICTED, TwoDays, saved_before
from toolkit.audit.model import CLEAN, NOT_IDENTIFIED
from toolkit.audit.sides import disputed
from toolkit.audit.structure import odd_counts
from toolkit.channels import ROTATIONS, Rotation
from toolkit.characteristics.catalogue import summary
from toolkit.characteristics.characteristic import Characteristic, Scope
from toolkit.characteristics.groups import CHANNELS
from toolkit.characteristics.reading import half_at_zero, secant
from toolkit.findings import Finding, Level
from toolkit.machine import load_machine, machine_names
from toolkit.reduction.physics import RULES

_NEEDED = ("SA_deg", "FY_N", "MZ_Nm", "FY_change_N", "MZ_change_Nm", "step_SA_deg", "step_FZ_N")

Point = tuple[float, float, float, float, float]
"""SA [rad], then FY and MZ as the file has them and by the record in force [N, N·m], in SAE axes."""


def unread_folder(where: str, error: OSError) -> Finding:
    """Return what is said of a folder that cannot be read, or that is gone by the time that it is."""
    reason = error.strerror or "an error"
    message = f"the folder cannot be read, and nothing in it was looked at: {reason}"
    return Finding(rule="unreadable-folder", where=where, message=message)


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One characteristic of one load: ``old`` by the files' own values, ``new`` by the record in force.

    ``name`` is that of the catalogue's summary, as ``cornering_stiffness`` [N/rad] of a direction or
    ``conicity`` [N], whose ``rotation`` is None; ``unit`` is SI.
    """

    load_N: float
    name: str
    rotation: Rotation | None
    unit: str
    old: float
    new: float


@dataclass(slots=True, kw_only=True, eq=False)
class TestSums:
    """The load blocks of one test, by direction and nominal load [N] and slip angle [deg]."""

    __test__ = False  # not a pytest class

    test: str
    instrument: str
    date: str
    own_protocol: bool
    files: int = 0
    dirty: int = 0
    worst_FY_N: float = 0.0
    worst_MZ_Nm: float = 0.0
    points: dict[tuple[Rotation, float, float], Point] = field(default_factory=dict)
    blocks: dict[str, list[tuple[int, int]]] = field(default_factory=dict)

    def add(self, line: Mapping[str, Any]) -> None:
        """Take a file's plain answer."""
        self.files += 1
        by_cells = not disputed(line)
        self.dirty += line["grade"] not in CLEAN and by_cells
        if line["repair"] is not None and by_cells:
            self.worst_FY_N = max(self.worst_FY_N, line["repair"]["FY_max_abs_N"] or 0.0)
            self.worst_MZ_Nm = max(self.worst_MZ_Nm, line["repair"]["MZ_max_abs_Nm"] or 0.0)
        if not any(note["rule"] == "foreign-row" for note in line["notes"]):
            self.blocks[line["path"]] = [(b["first_row"], b["last_row"]) for b in line["conditions"]]
        sign = line["to_SAE"]
        for block in line["conditions"]:
            if any(block[key] is None for key in _NEEDED):
                continue
            FY, MZ = sign["FY"] * block["FY_N"], sign["MZ"] * block["MZ_Nm"]
            dFY = sign["FY"] * block["FY_change_N"] if by_cells else 0.0
            dMZ = sign["MZ"] * block["MZ_change_Nm"] if by_cells else 0.0
            SA = sign["SA"] * math.radians(block["SA_deg"])
            key = (line["rotation"], block["step_FZ_N"], round(block["step_SA_deg"], 6))
            self.points.setdefault(key, (SA, FY, MZ, FY + dFY, MZ + dMZ))

    def summary(self) -> dict[str, Any]:
        """Return the test under the keys of the answer; its effects only where a file is not clean."""
        return {
            "test": self.test,
            "instrument": self.instrument,
            "date": self.date,
            "files": self.files,
            "not_clean": self.dirty,
            "FY_max_abs_N": self.worst_FY_N,
            "MZ_max_abs_Nm": self.worst_MZ_Nm,
            "effects": [asdict(effect) | {"change": effect.new - effect.old} for effect in self.effects()]
            if self.dirty
            else [],
        }

    def effects(self) -> tuple[Effect, ...]:
        """Return every characteristic that the test's files give, by load."""
        summary_effects: list[Effect] = []
        for load in sorted({load for _, load, _ in self.points}):
            at_zero: dict[Rotation, tuple[float, ...]] = {}
            for rotation in ROTATIONS:
                near = self._pair(rotation, load)
                if near is not None:
                    summary_effects += _stiffness(near, load, rotation)
                points = sorted(p for (r, at, _), p in self.points.items() if (r, at) == (rotation, load))
                crossing = _at_zero(points)
                if crossing is not None:
                    at_zero[rotation] = crossing
            if len(at_zero) == 2:
                summary_effects += _pull(at_zero["forward"], at_zero["reverse"], load)
        return tuple(summary_effects)

    def _pair(self, rotation: Rotation, load: float) -> tuple[Point, Point] | None:
        below, above = (self.points.get((rotation, load, angle)) for angle in (-1.0, 1.0))
        return None if below is None or above is None else (below, above)

    def slope_signs(self) -> Iterator[tuple[str, int]]:
        """Yield the sign of dFY/dSA of each direction whose smallest steps tell it."""
        for rotation in ROTATIONS:
            total = 0.0
            for load in {at for r, at, _ in self.points if r == rotation}:
                near = self._pair(rotation, load)
                if near is not None:
                    total += (near[1][1] - near[0][1]) / (near[1][0] - near[0][0])
            if total:
                yield rotation, 1 if total > 0 else -1

    def missing(self) -> Iterator[Finding]:
        """Yield the protocol's slip angles that no file of a recorded direction has."""
        if self.own_protocol or self.instrument not in machine_names():
            return
        planned = load_machine(self.instrument).protocol.slip_angles_rad
        for rotation in ROTATIONS:
            measured = {step for r, _, step in self.points if r == rotation}
            absent = [a for a in (round(math.degrees(step), 6) for step in planned) if a not in measured]
            if measured and absent:
                angles = ", ".join(f"{angle:g}" for angle in absent)
                message = f"drum {rotation}: no recording at slip angle {angles} deg"
                yield Finding(rule="missing-condition", where=self.test, message=message, level="note")


def _stiffness(near: tuple[Point, Point], load: float, rotation: Rotation) -> list[Effect]:
    below, above = near
    slope = [(b - a) / (above[0] - below[0]) for a, b in zip(below, above, strict=True)]
    return [
        Effect(
            load_N=load,
            name=str(entry.summary),
            rotation=rotation,
            unit=entry.unit,
            old=entry.sign * slope[1 + at],
            new=entry.sign * slope[3 + at],
        )
        for entry, at in _entries("direction")
    ]


def _pull(F: tuple[float, ...], R: tuple[float, ...], load: float) -> list[Effect]:
    # In axes that follow the travel; see `toolkit.characteristics.reading`.
    return [
        Effect(
            load_N=load,
            name=str(entry.summary),
            rotation=None,
            unit=entry.unit,
            old=(F[at] + entry.sign * R[at]) / 2,
            new=(F[2 + at] + entry.sign * R[2 + at]) / 2,
        )
        for entry, at in _entries("load")
    ]


def _entries(scope: Scope) -> Iterator[tuple[Characteristic, int]]:
    """Yield what the summary of a report has of a scope, each with the place of its channel: FY 0, MZ 1."""
    for entry in summary():
        if entry.scope == scope and entry.read in (secant, half_at_zero):
            yield entry, CHANNELS.index(entry.channel)


def _at_zero(points: list[Point]) -> tuple[float, ...] | None:
    # FY, MZ old and new on the line through the neighbours of SA = 0.
    below = max((p for p in points if p[0] <= 0), default=None)
    above = min((p for p in points if p[0] > 0), default=None)
    if below is None or above is None:
        return None
    share = -below[0] / (above[0] - below[0])
    return tuple(a + share * (b - a) for a, b in zip(below[1:], above[1:], strict=True))


# Values that are too many for the memory: JSON lines in a temporary file.


class Lines:
    """Takes plain values one by one, and gives them again in that order as often as is asked."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  it lives as long as this object
        self._count = 0
        weakref.finalize(self, self._file.close)

    def add(self, value: dict[str, Any]) -> None:
        """Append a value that JSON can hold."""
        self.take(json.dumps(value).encode() + b"\n")

    def take(self, line: bytes) -> None:
        """Append a value as the line that `raw` yields for it."""
        self._file.seek(0, 2)
        self._file.write(line)
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (json.loads(line) for line in self.raw())

    def raw(self) -> Iterator[bytes]:
        """Yield every value as a line."""
        place = 0
        for _ in range(self._count):
            self._file.seek(place)
            line = self._file.readline()
            place += len(line)
            yield line

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Lines):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]


_LATE_DAYS = 1  # a file is often saved on the day after its test


@dataclass(slots=True, eq=False)
class Across:
    """Takes the files of an archive one by one."""

    tests: Lines = field(default_factory=Lines)
    _open: dict[str, TestSums] = field(default_factory=dict)
    _slopes: dict[tuple[str, str], list[tuple[str, int]]] = field(default_factory=dict)
    _first: dict[bytes, str] = field(default_factory=dict)
    _days: TwoDays = field(default_factory=TwoDays)
    _units: dict[str, Counter[tuple[tuple[str, str], ...]]] = field(default_factory=dict)
    _with: dict[tuple[tuple[str, str], ...], list[str]] = field(default_factory=dict)

    def add(self, line: Mapping[str, Any]) -> Iterator[Finding]:
        """Take a file and yield what can be said at once."""
        path = line["path"]
        for note in line["notes"]:
            yield noted(note, path)
        yield from self._copies(line)
        self._days.add(line)
        if line["units"]:
            units = tuple(sorted(line["units"].items()))
            self._units.setdefault(line["instrument"], Counter())[units] += 1
            if len(few := self._with.setdefault(units, [])) < 4:
                few.append(path)
        if line["date"] is not None and line["modified"] is not None:
            late = _days(line["modified"]) - _days(line["date"])
            if late > _LATE_DAYS:
                message = (
                    f"by its own properties the file was last saved on {line['modified']}, {late} days after "
                    f"the test of {line['date']}"
                )
                yield Finding(rule="edited-after-test", where=path, message=message, level="note")
        early = saved_before(line)
        if early is not None:
            yield Finding(rule=CONTRADICTED, where=path, message=early, level="note")
        # Sorted by path, all files of a test's folder come in one stretch.
        for name in [name for name in self._open if name != "." and not path.startswith(name + "/")]:
            yield from self._closed(name)
        key = line["test"]
        if key is not None and line["date"] is not None and line["grade"] not in NOT_IDENTIFIED:
            if key not in self._open:
                self._open[key] = TestSums(
                    test=key,
                    instrument=line["instrument"],
                    date=line["date"],
                    own_protocol=line["own_protocol"],
                )
            self._open[key].add(line)

    def at_end(self) -> Iterator[Finding]:
        """Yield what only the whole archive can say."""
        for name in list(self._open):
            yield from self._closed(name)
        for path, message in self._days.told.items():
            yield Finding(rule=CONTRADICTED, where=path, message=message, level="note")
        yield from self._conventions()
        for (instrument, rotation), signs in self._slopes.items():
            majority = 1 if sum(sign for _, sign in signs) >= 0 else -1
            against = [name for name, sign in signs if sign != majority]
            if len(against) >= len(signs) / 2:
                continue  # no convention to depart from
            usual, direction = ("rises", "falls") if majority > 0 else ("falls", "rises")
            for name in against:
                message = (
                    f"drum {rotation}: Fy {direction} with the slip angle, and {usual} in "
                    f"{len(signs) - len(against)} of {len(signs)} tests of {instrument}: an axis has another "
                    "sign here"
                )
                yield Finding(rule="axes-changed", where=name, message=message, level="note")

    def _closed(self, name: str) -> Iterator[Finding]:
        test = self._open.pop(name)
        yield from test.missing()
        yield from odd_counts(test.blocks)
        for rotation, sign in test.slope_signs():
            self._slopes.setdefault((test.instrument, rotation), []).append((name, sign))
        self.tests.add(test.summary())

    def _copies(self, line: Mapping[str, Any]) -> Iterator[Finding]:
        reported = False
        for key, extent in ((line["sha256"], "byte for byte"), (line["values_sha256"], "in every number")):
            if key is None:
                continue
            short = bytes.fromhex(key[:32])
            first = self._first.setdefault(short, line["path"])
            if first != line["path"] and not reported:
                reported = True
                message = f"the same as {first}, {extent}"
                yield Finding(rule="duplicate-file", where=line["path"], message=message, level="note")

    def _conventions(self) -> Iterator[Finding]:
        for instrument, kinds in sorted(self._units.items()):
            usual = dict(kinds.most_common(1)[0][0])
            for units, count in kinds.items():
                differing = {
                    symbol: unit for symbol, unit in units if symbol in usual and usual[symbol] != unit
                }
                if differing:
                    text = ", ".join(f"{s} in {unit} for {usual[s]}" for s, unit in differing.items())
                    paths = self._with[units]
                    message = (
                        f"{text}: {count} file{'s' if count > 1 else ''} of {instrument}, such as {paths[0]}"
                    )
                    yield Finding(rule="units-changed", where=paths[0], message=message, level="note")


def noted(note: Mapping[str, str], path: str) -> Finding:
    """Return what a file's rows show, from its plain answer: it informs, but for what cannot be."""
    level: Level = "error" if note["rule"] in (*RULES, "discontinuity") else "note"
    level = "warning" if note["rule"] == "foreign-row" else level
    return Finding(rule=note["rule"], where=path, message=note["message"], level=level)


def _days(text: str) -> int:
    import datetime as dt

    return dt.date.fromisoformat(text).toordinal()
