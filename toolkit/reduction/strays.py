"""Files of a test that do not belong to it: off the curve that all others make, or copied from another.

What a calibration, a wiring or a tire does wrong in every file, the laws of physics show (`physics`,
`cells`). In one file alone it hides in their pooled slopes, and spoils a conicity that is a hundredth of the
force. The other files know what that file should say: force over load is a smooth surface over slip angle
and load,

    y(SA, FZ) = sum a_ij x^i z^j,      x = arctan(k SA),  z = ln(FZ / mean)

with an odd and an even part, and a pull and a shift of the slip angle for each direction. Every slip angle of
every file is predicted by all others, and judged against what the others leave of their own predictions, so
that a curve that the surface fits badly, and a test that scatters, hides no fault and raises no alarm.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.findings import Finding
from toolkit.reduction.common_load import OnCurve, at_one_angle
from toolkit.units import from_si

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.recording.model import Recording
    from toolkit.reduction.model import Condition


_UNITS = {"FY": "N", "MZ": "N*m"}
_FAR = 10.0  # times what the other files leave; healthy tests stay under 5. And
_LARGE = {"FY": 0.06, "MZ": 0.15}  # of the largest force or moment over load
_ORDER, _LOAD_ORDER = 5, 2
# k [1/rad]: cornering stiffness over friction, of soft tires to stiff ones, the last on ice.
_SLOPES = (3.0, 6.0, 10.0, 15.0, 22.0, 30.0, 45.0, 70.0, 110.0)
_FEWEST_ANGLES = 5
_SPARE = 4  # freedoms that the surface leaves at least
_SUSPECTS = 3
_MOST_TRIALS = 8  # files that are tried as strays
_PART = 4  # one file in so many is tried; where over half of those are strays, nobody knows which are
_SHARED_ROWS = 8
_NO_SIGNAL = 1e-9
_ONE_ANGLE = float(np.radians(0.5))
_ALIKE = 0.3
_CURVED = 0.3  # of the largest: so far the surface may miss a sharp bend


def stray_findings(conditions: Sequence[Condition]) -> list[Finding]:
    """Return the files whose force or moment lies far off what all the other files of the test say."""
    blocks = [c for c in conditions if c.used and c.step_FZ is not None and c.FZ > 0]
    findings: dict[str, Finding] = {}
    for channel in _UNITS:
        for file, message in off_curve(blocks, channel).items():
            finding = Finding(rule="stray-file", where=file, message=message, level="error")
            findings.setdefault(file, finding)
    return list(findings.values())


def off_curve(points: Sequence[OnCurve], channel: str) -> dict[str, str]:
    """Return the files whose ``FY`` or ``MZ`` lies far off what all the others say, each with the message.

    ``points`` are load blocks at a nominal load, with a positive FZ.
    """
    messages: dict[str, str] = {}
    unit = _UNITS[channel]
    for stray in _strays(points, channel):
        point = points[stray.worst]
        angle = float(from_si(point.SA, "deg"))
        message = (
            f"{channel} lies off the curve that the other files make: {getattr(point, channel):.4g} "
            f"{unit} at {angle:+.2f} deg and {point.FZ:.0f} N where they give {stray.expected:.4g} "
            f"{unit}; that is {stray.times:.0f} times what they leave of each other"
        )
        messages.setdefault(point.file, message)
    return messages


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stray:
    # Its farthest condition, what the others give there, and how many times what they leave it is off.
    worst: int
    expected: float
    times: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Miss:
    """How far one group lies off what all others say: at each condition, rms, and that over its leverage.

    At an end of the curve the others say little: what they miss there is divided by what noise of theirs
    would be there.
    """

    off: Array
    size: float
    freed: float


def _strays(points: Sequence[OnCurve], channel: str) -> list[_Stray]:
    groups = [np.array(group) for group in at_one_angle(points)] if points else []
    if not groups:
        return []
    FZ = np.array([c.FZ for c in points])
    y = np.array([getattr(c, channel) for c in points]) / FZ
    surface = _Surface.of(points)
    trials = min(len(groups) // _PART, _MOST_TRIALS)
    if not trials or not surface.tells(groups, without=trials):
        return []
    core = _core(surface, y, groups, trials)
    apart = [group for group in groups if not any(group is member for member in core)]
    k = surface.slope(y, core)
    usual = _usual(surface.misses(y, core, k))

    def of(group: NDArray[np.intp]) -> _Miss:
        return surface.misses(y, [*core, group], k, asked=slice(-1, None))[0]

    # What the core foretells comes back to it, the nearest first; the strays are left.
    largest = float(np.max(np.abs(y[np.concatenate(core)])))
    while apart:
        misses = [of(group) for group in apart]
        nearest = min(range(len(apart)), key=lambda i: misses[i].freed)
        if misses[nearest].freed > _FAR * usual and misses[nearest].size > _LARGE[channel] * largest:
            break
        core.append(apart.pop(nearest))
    if len(apart) > max(1, trials // 2):
        return []
    misses = [of(group) for group in apart]
    angles = [float(np.mean(surface.SA[group])) for group in apart]
    strays = []
    for i, (group, miss) in enumerate(zip(apart, misses, strict=True)):
        twice = (_alike(angles[i] - angles[j], miss, misses[j]) for j in range(len(apart)) if j != i)
        if miss.size < _CURVED * largest and any(twice):
            continue
        place = int(np.argmax(np.abs(miss.off)))
        worst = int(group[place])
        expected = float((y[worst] - miss.off[place]) * FZ[worst])
        strays.append(_Stray(worst=worst, expected=expected, times=miss.freed / max(usual, 1e-12)))
    return strays


def _alike(apart_rad: float, first: _Miss, second: _Miss) -> bool:
    """Tell whether two files of one slip angle lie off alike: what a tire does twice is the tire's.

    So lies the knee of a tire on ice, which one slip angle shows in either direction. No curve bends as far
    as a force that has turned round.
    """
    first_mean, second_mean = float(np.mean(first.off)), float(np.mean(second.off))
    return abs(apart_rad) < _ONE_ANGLE and abs(first_mean - second_mean) < _ALIKE * max(
        abs(first_mean), abs(second_mean)
    )


def _core(
    surface: _Surface, y: Array, groups: Sequence[NDArray[np.intp]], count: int
) -> list[NDArray[np.intp]]:
    """Return the groups that agree best: without the few that the others foretell worst.

    Two strays hide each other, and accuse a third: one after another goes without which the others agree
    best, whether it is a stray or not.
    """
    core = list(groups)
    k = surface.slope(y, core)
    for _ in range(count):
        misses = surface.misses(y, core, k)
        trials = []
        for suspect in sorted(range(len(core)), key=lambda i: -misses[i].freed)[:_SUSPECTS]:
            remaining = surface.misses(y, core[:suspect] + core[suspect + 1 :], k)
            trials.append((sum(miss.freed**2 for miss in remaining), suspect))
        del core[min(trials)[1]]
    return core


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Surface:
    # Slip angle, z and direction (+-1, zeros where there is one) of each condition.
    SA: Array
    z: Array
    turn: Array

    @staticmethod
    def of(points: Sequence[OnCurve]) -> _Surface:
        z = np.log([c.FZ for c in points])
        turn = np.array([-1.0 if c.rotation == "reverse" else 1.0 for c in points])
        return _Surface(
            SA=np.array([c.SA for c in points]),
            z=z - z.mean(),
            turn=turn if np.ptp(turn) else np.zeros(len(points)),
        )

    def _angles(self, rows: NDArray[np.intp]) -> int:
        # How many slip angles, to a degree, the direction has that has the fewest.
        SA, turn = np.round(np.degrees(self.SA[rows])), self.turn[rows]
        return min(len(np.unique(SA[turn == side])) for side in np.unique(turn))

    def _design(self, rows: NDArray[np.intp], k: float) -> Array:
        z, turn, x = self.z[rows], self.turn[rows], np.arctan(k * self.SA[rows])
        order = min(_ORDER, self._angles(rows) - 3)
        load_order = min(_LOAD_ORDER, len(np.unique(np.round(z, 1))) - 1)
        columns = [x**i * z**j for i, j in itertools.product(range(order + 1), range(load_order + 1))]
        if np.ptp(turn):
            columns += [turn * z**j for j in range(min(load_order, 1) + 1)] + [turn * np.cos(x) ** 2]
        return np.column_stack(columns)

    def tells(self, groups: Sequence[NDArray[np.intp]], *, without: int) -> bool:
        """Tell whether enough slip angles and conditions stay to foretell some groups by the others."""
        angles = self._angles(np.concatenate(groups)) - without
        if angles < _FEWEST_ANGLES:
            return False
        spare = sum(sorted(len(group) for group in groups)[: len(groups) - without]) - _SPARE
        columns = self._design(np.concatenate(groups), _SLOPES[0]).shape[1]
        return bool(spare >= columns)

    def slope(self, y: Array, groups: Sequence[NDArray[np.intp]]) -> float:
        """Return the k [1/rad] by which the groups foretell one another best."""
        return min(_SLOPES, key=lambda k: _usual(self.misses(y, groups, k)))

    def misses(
        self, y: Array, groups: Sequence[NDArray[np.intp]], k: float, *, asked: slice = slice(None)
    ) -> list[_Miss]:
        """Return what each group that is asked misses of the surface of all others."""
        rows = np.concatenate(groups)
        ends = np.cumsum([len(group) for group in groups])
        parts = [np.arange(end - len(group), end) for group, end in zip(groups, ends, strict=True)][asked]
        X = self._design(rows, k)
        Q, singular, _ = np.linalg.svd(X / np.linalg.norm(X, axis=0), full_matrices=False)
        Q = Q[:, singular > _NO_SIGNAL * singular[0]]
        residual = y[rows] - Q @ (Q.T @ y[rows])
        misses: dict[int, _Miss] = {}
        for size in {len(part) for part in parts}:  # of one size together: they are many, and small
            places = [place for place, part in enumerate(parts) if len(part) == size]
            at = np.stack([parts[place] for place in places])
            # (I - H)^-1 r of the rows left out is what a fit without them misses there.
            spread = np.linalg.pinv(np.eye(size) - Q[at] @ Q[at].transpose(0, 2, 1), rcond=1e-6)
            off = (spread @ residual[at][..., None])[..., 0]
            rms = np.sqrt(np.mean(off**2, axis=1))
            freed = rms / np.maximum(np.sqrt(np.mean(spread.diagonal(axis1=1, axis2=2), axis=1)), 1.0)
            misses |= {
                place: _Miss(off=off[i], size=float(rms[i]), freed=float(freed[i]))
                for i, place in enumerate(places)
            }
        return [misses[place] for place in range(len(parts))]


def _usual(misses: Sequence[_Miss]) -> float:
    return float(np.median([miss.freed for miss in misses]))


def copied_findings(files: Sequence[tuple[str, Recording]]) -> list[Finding]:
    """Return the files that share rows with an earlier one: two recordings never share their noise."""
    first_file: dict[bytes, str] = {}
    findings = []
    for name, recording in files:
        cells = [c.values for c in recording.series if c.role == "indication"]
        if not cells:
            continue
        table = np.ascontiguousarray(np.stack(cells, axis=1))
        file_rows = {row.tobytes() for row in table}
        if len(file_rows) < max(_SHARED_ROWS, recording.rows // 2):
            continue  # without noise every row repeats
        from_file: dict[str, int] = {}
        for row in file_rows:
            if row in first_file:
                from_file[first_file[row]] = from_file.get(first_file[row], 0) + 1
        source = max(from_file, key=lambda key: from_file[key], default=None)
        if source is not None and from_file[source] >= max(_SHARED_ROWS, len(file_rows) // 2):
            message = (
                f"{from_file[source]} of {recording.rows} rows have the readings of every cell that {source} "
                "has: two recordings never share their noise"
            )
            findings.append(Finding(rule="repeated-readings", where=name, message=message, level="error"))
        for row in file_rows:
            first_file.setdefault(row, name)
    return findings
