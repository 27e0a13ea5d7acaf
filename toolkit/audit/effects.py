"""What a repair does to what a requester reads off a test: cornering stiffness and pull, old and new.

Both are read off the means of the load blocks in one way, so that nothing but the calibration differs: the
stiffness is the secant through the +-1 deg steps (thesis, SAE), pull the line through the steps next to
0 deg of a forward and a reversed run, each at the load as it was. `toolkit process` subtracts a tare, carries
to a common load and fits curves; this compares without them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from toolkit.audit.model import CLEAN
from toolkit.channels import ROTATIONS, Rotation
from toolkit.characteristics.catalogue import summary
from toolkit.characteristics.derivations import half_at_zero, secant
from toolkit.characteristics.groups import CHANNELS
from toolkit.findings import Finding
from toolkit.machine import load_machine, machine_names

if TYPE_CHECKING:
    from toolkit.characteristics.characteristic import Characteristic, Scope

_NEEDED = ("SA_deg", "FY_N", "MZ_Nm", "FY_change_N", "MZ_change_Nm", "step_SA_deg", "step_FZ_N")

Point = tuple[float, float, float, float, float]
"""SA [rad], then FY and MZ as the file has them and by the record in force [N, N·m], in SAE axes."""


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

    def add(self, line: Mapping[str, Any]) -> None:
        """Take a file's plain answer."""
        self.files += 1
        self.dirty += line["grade"] not in CLEAN
        if line["repair"] is not None:
            self.worst_FY_N = max(self.worst_FY_N, line["repair"]["FY_max_abs_N"] or 0.0)
            self.worst_MZ_Nm = max(self.worst_MZ_Nm, line["repair"]["MZ_max_abs_Nm"] or 0.0)
        sign = line["to_SAE"]
        for block in line["conditions"]:
            if any(block[key] is None for key in _NEEDED):
                continue
            FY, MZ = sign["FY"] * block["FY_N"], sign["MZ"] * block["MZ_Nm"]
            dFY, dMZ = sign["FY"] * block["FY_change_N"], sign["MZ"] * block["MZ_change_Nm"]
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
    # In axes that follow the travel; see `toolkit.characteristics.derivations`.
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
