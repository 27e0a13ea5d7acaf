"""Physics of reduced values: what no tire can do, whatever calibration computed it.

    |FY| <= min(FRICTION FZ, STIFFNESS FZ (|SA| + STEER_ZERO) + PULL FZ + CAMBER FZ |IA|) + 3 u0
    hypot(FX, FY) <= FRICTION FZ
    |MZ| <= TRAIL |FY| + RESIDUAL_MOMENT FZ + 3 u0
    mean |FY| >= SLIDING mean FZ                                     at 8 deg of slip and more; else a warning
    1 <= -(dFY/dSA) / FZ <= 40 per rad,    0 <= (dMZ/dSA) / -(dFY/dSA) <= TRAIL          about zero slip
    FY(forward) and FY(reverse) agree but for pull, in axes that follow the travel

``u0`` is the standard uncertainty of a zero. The bounds are those of `limits`; values are in SAE J670 axes
that follow the travel. A departure is a wrong measurement: nothing here is a judgement of the tire.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.findings import Finding, Level
from toolkit.reduction import limits

Rule = Literal[
    "impossible-force",
    "impossible-moment",
    "impossible-slope",
    "impossible-reversal",
    "impossible-cells",
    "implausible-friction",
]
RULES: tuple[Rule, ...] = (
    "impossible-force",
    "impossible-moment",
    "impossible-slope",
    "impossible-reversal",
    "impossible-cells",
)
_SMALL = math.radians(4.5)  # slopes are taken within this slip angle,
_SPAN = math.radians(1.5)  # over at least this span;
_SLIDING = math.radians(7.5)  # where a tire slides, whatever its stiffness
_LARGE = math.radians(1.5)  # and the direction of a force counts beyond this
_SURE = 3.0  # standard uncertainties of a zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """Values to be judged, each array (n,): SI, FZ positive, FY, MZ and SA in SAE axes with the travel.

    ``place`` names each value for a reader, ``block`` its slip-angle and load step (equal: comparable),
    ``reverse`` its direction. ``u_FY`` and ``u_MZ`` are standard uncertainties of the zero. ``FX`` and the
    inclination angle ``IA`` are zeros where they are not measured, NaN where a tire leaned by an angle that
    is not known. ``trail_m`` is the longest trail that the tire can have. ``signed``
    False: directions of travel and axes are not known, so only sizes are judged.
    """

    place: tuple[str, ...]
    FZ: Array
    SA: Array
    FY: Array
    MZ: Array
    reverse: NDArray[np.bool_]
    block: tuple[tuple[float | None, float | None], ...]
    u_FY: Array
    u_MZ: Array
    FX: Array
    IA: Array
    trail_m: float = limits.TRAIL.high
    signed: bool = True

    def part(self, rows: NDArray[np.bool_]) -> Readings:
        """Return some of the values."""
        index = np.flatnonzero(rows)
        return Readings(
            place=tuple(self.place[i] for i in index),
            FZ=self.FZ[index], SA=self.SA[index], FY=self.FY[index], MZ=self.MZ[index],
            reverse=self.reverse[index], block=tuple(self.block[i] for i in index),
            u_FY=self.u_FY[index], u_MZ=self.u_MZ[index], FX=self.FX[index], IA=self.IA[index],
            trail_m=self.trail_m, signed=self.signed,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """One law that values break: the rule, where, number and bound, and what it usually means."""

    rule: Rule
    where: str
    message: str
    cause: str

    def finding(
        self, level: Level = "error", *, of: str = "", cause: str | None = None, more: str = ""
    ) -> Finding:
        """Return it as a finding, of a level that is no error where it is only implausible.

        ``of`` says whose values they are, ``cause`` replaces the usual one, ``more`` is a further sentence.
        """
        text = f"{of}: " if of else ""
        text += f"{self.message}: {self.cause if cause is None else cause}" + (f"; {more}" if more else "")
        level = level if self.rule in RULES else "warning"
        return Finding(rule=self.rule, where=self.where, message=text, level=level)


def departures(readings: Readings, *, share: float = 0.0) -> tuple[Departure, ...]:
    """Return every law that the values break, worst value first; empty where all is possible.

    ``share``: so large a part of single values may break a bound before it is told (rows of a noisy table).
    """
    findings = [*_force(readings, share), *_moment(readings, share)]
    if readings.signed:
        findings += [*_slopes(readings), *_reversal(readings), *sliding(readings)]
    return tuple(findings)


def _force(r: Readings, share: float) -> list[Departure]:
    # Without a slip angle (NaN) friction alone bounds a force.
    angle = np.abs(r.SA) + limits.STEER_ZERO.high
    thrust = limits.PULL.high + limits.CAMBER.high * np.abs(r.IA)
    bound = np.fmin(limits.FRICTION.high, limits.STIFFNESS.high * angle + thrust)
    use = np.maximum(np.abs(r.FY) - _SURE * r.u_FY, 0.0) / r.FZ
    excess = np.maximum(use / bound, np.hypot(use, r.FX / r.FZ) / limits.FRICTION.high)
    over = np.flatnonzero(excess > 1.0)
    if len(over) <= share * len(excess):
        return []
    worst = int(np.argmax(excess))
    lean = f", {limits.CAMBER.high:g} per rad of inclination" if r.IA[worst] else ""
    usual = (
        "the friction of any tire on any laboratory surface"
        if bound[worst] >= limits.FRICTION.high
        else f"{limits.STIFFNESS.high:g} times the load per rad{lean}, a steering zero "
        f"{math.degrees(limits.STEER_ZERO.high):g} deg off and a pull of {limits.PULL.high:g} of the load"
    )
    return [
        Departure(
            rule="impossible-force",
            where=r.place[worst],
            message=_use(r, worst)
            + (f"{math.degrees(r.SA[worst]):+.2f} deg of slip and " if np.isfinite(r.SA[worst]) else "")
            + f"{r.FZ[worst]:.0f} N; no tire exceeds "
            f"{bound[worst]:.2f} there ({usual}); {_count(over, r)} beyond the bound",
            cause="a cell is turned round, a coefficient has a wrong sign, or forces or loads are in another "
            "unit",
        )
    ]


def _use(r: Readings, index: int) -> str:
    FX, FY, FZ = r.FX[index], r.FY[index], r.FZ[index]
    if FX:
        return f"the force in the road's plane is {math.hypot(FX, FY) / FZ:.2f} of the load at "
    return f"|FY| is {abs(FY) / FZ:.2f} of the load at "


def _moment(r: Readings, share: float) -> list[Departure]:
    bound = r.trail_m * np.abs(r.FY) + limits.RESIDUAL_MOMENT.high * r.FZ + _SURE * r.u_MZ
    excess = np.where(bound > 0, np.abs(r.MZ) / np.where(bound > 0, bound, 1.0), 0.0)
    over = np.flatnonzero(excess > 1.0)
    if len(over) <= share * len(excess):
        return []
    worst = int(np.argmax(excess))
    return [
        Departure(
            rule="impossible-moment",
            where=r.place[worst],
            message=f"|MZ| is {abs(r.MZ[worst]):.1f} N·m beside a side force of {abs(r.FY[worst]):.0f} N at "
            f"{r.FZ[worst]:.0f} N; no tire exceeds {bound[worst]:.1f} N·m there (a trail of "
            f"{1e3 * r.trail_m:.0f} mm and {1e3 * limits.RESIDUAL_MOMENT.high:g} mm of the load); "
            f"{_count(over, r)} beyond the bound",
            cause="two cells are exchanged, a coefficient has a wrong sign, or moments are in another unit",
        )
    ]


def _slopes(r: Readings) -> list[Departure]:
    departures = []
    for reverse in (False, True):
        run = r.part(r.reverse == reverse)
        slopes = [slope for slope in (_slope(run, load) for load in {b for _, b in run.block}) if slope]
        if not slopes:
            continue
        FZ, CF, CM = (float(sum(column)) for column in zip(*slopes, strict=True))
        where = f"drum {'reverse' if reverse else 'forward'}"
        stiffness, trail = CF / FZ, CM / CF if CF else math.inf
        low, high = limits.STIFFNESS.low, limits.STIFFNESS.high
        if not low <= stiffness <= high:
            cause = (
                "FY rises with SA: a cell is turned round, a coefficient has a wrong sign, or a reversed run "
                "is not named in test.toml"
                if stiffness < 0
                else "forces, loads or angles are in another unit, or a cell is dead"
            )
            departures.append(
                Departure(
                    rule="impossible-slope",
                    where=f"{where}, FY",
                    message=f"the cornering stiffness is {stiffness:.3g} times the load per rad over "
                    f"{len(slopes)} loads; that of tires is {low:g} to {high:g}",
                    cause=cause,
                )
            )
        elif not 0.0 <= trail <= r.trail_m:
            departures.append(
                Departure(
                    rule="impossible-slope",
                    where=f"{where}, MZ",
                    message="the trail at small slip, aligning over cornering stiffness, is "
                    f"{1e3 * trail:.1f} mm over {len(slopes)} loads; that of the tire lies between "
                    f"0 and {1e3 * r.trail_m:.0f} mm",
                    cause="two cells are exchanged, one is turned round, or a coefficient of MZ has a wrong "
                    "sign",
                )
            )
    return departures


def _slope(run: Readings, load: float | None) -> tuple[float, float, float] | None:
    # Mean load, cornering and aligning stiffness [N/rad, N·m/rad] about zero slip, None where too few points.
    if load is None:
        return None
    near = np.array([b == load for _, b in run.block]) & (np.abs(run.SA) <= _SMALL)
    SA = run.SA[near]
    if len(SA) < 2 or np.ptp(SA) < _SPAN:
        return None
    fit = np.polynomial.polynomial.polyfit(SA, np.column_stack([run.FY[near], run.MZ[near]]), 1)
    return float(run.FZ[near].mean()), float(-fit[1, 0]), float(fit[1, 1])


def _reversal(r: Readings) -> list[Departure]:
    # Every two values at one step of slip angle and load, of two files: pull is left, never a mirror image.
    sums, differences = [], []
    places: list[str] = []
    groups: dict[tuple[float | None, float | None], list[int]] = {}
    for index, block in enumerate(r.block):
        if None not in block and abs(r.SA[index]) > _LARGE:
            groups.setdefault(block, []).append(index)
    for group in groups.values():
        for first, second in itertools.pairwise(group):
            sums.append(r.FY[first] + r.FY[second])
            differences.append(r.FY[first] - r.FY[second])
            if r.FY[first] * r.FY[second] < 0:
                places.append(r.place[second])
    if not places:
        return []
    even, opposite = (float(np.sqrt(np.mean(np.square(values)))) for values in (sums, differences))
    if opposite <= even:
        return []
    return [
        Departure(
            rule="impossible-reversal",
            where=places[0],
            message=f"at equal slip angle and load FY has opposite signs in {len(places)} of {len(sums)} "
            f"pairs of runs: they differ by {opposite:.0f} N (rms) where their sum is {even:.0f} N; a tire "
            "keeps its side force in axes that follow the travel, but for its pull",
            cause="a reversed run is not named as such in test.toml, or a cell was turned round between the "
            "runs",
        )
    ]


def sliding(r: Readings) -> list[Departure]:
    """Return what is to be said where values show less friction than any dry surface; of sizes alone."""
    far = np.abs(r.SA) >= _SLIDING
    force = np.hypot(r.FX[far], r.FY[far])
    if not force.any():  # beyond that angle nothing was measured
        return []
    use = float(force.sum() / r.FZ[far].sum())
    if use >= limits.SLIDING.low:
        return []
    return [
        Departure(
            rule="implausible-friction",
            where=f"{int(far.sum())} values from {math.degrees(_SLIDING):g} deg",
            message=f"the side force is {use:.2f} of the load where a tire slides; on a dry surface it is "
            f"{limits.SLIDING.low:g} and more",
            cause="the surface was wet or icy, or forces or loads are in another unit",
        )
    ]


def _count(over: NDArray[np.intp], r: Readings) -> str:
    return f"{len(over)} of {len(r.FZ)} values {'lies' if len(over) == 1 else 'lie'}"


def of_sizes(
    places: Sequence[str],
    *,
    FZ: Array,
    SA: Array,
    FY: Array,
    MZ: Array,
    FX: Array | None = None,
    IA: Array | None = None,
    trail_m: float = limits.TRAIL.high,
) -> Readings:
    """Return readings of which only sizes can be judged: blocks of one file, or rows of a table; FZ > 0."""
    none = np.zeros(len(FZ))
    return Readings(
        place=tuple(places), FZ=FZ, SA=SA, FY=FY, MZ=MZ, reverse=none.astype(bool),
        block=((None, None),) * len(FZ), u_FY=none, u_MZ=none, FX=none if FX is None else FX,
        IA=none if IA is None else IA, trail_m=trail_m, signed=False,
    )  # fmt: skip


def longest_trail(radius_m: float | None) -> float:
    """Return the longest trail [m] of a tire by its free radius; None: of any tire on the machine."""
    if radius_m is None:
        return limits.TRAIL.high
    return min(limits.TRAIL.high, limits.TRAIL_PER_RADIUS.high * radius_m)
