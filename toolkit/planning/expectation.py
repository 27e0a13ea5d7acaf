"""What a test that is yet to be made will say: the budgets of its characteristics, by an earlier test.

Nothing of the budget is computed here. From the earlier test come the curves, the scatter of conditions
about them, that of the rows within a block, and what all rows share: record, tare, machine. A design's
conditions are put on those curves, and `characteristics.characterise` reads them as it reads measured ones.
Where the design's own residuals will have to tell the scatter, `scatter_of` says what they tell on average,
degrees of freedom too.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.channels import ROTATIONS, Rotation, seen_by_cells, signs
from toolkit.characteristics.characterise import rows_of
from toolkit.characteristics.characteristic import Characteristic
from toolkit.characteristics.groups import CHANNELS, Channel, Direction, DirectionFit, Group, directions_of
from toolkit.characteristics.model import Row
from toolkit.characteristics.scatter import Scatter, scatter_of
from toolkit.characteristics.shared_errors import SharedErrors, shared_errors_of
from toolkit.errors import ConfigError
from toolkit.machine import Machine
from toolkit.pipeline import TestResult
from toolkit.planning.demands import PEAK, Demand
from toolkit.planning.design import Design
from toolkit.reduction.common_load import slopes
from toolkit.reduction.model import Condition
from toolkit.simulation.tire import TireTruth, revolution_time_s
from toolkit.tires.evaluate import estimate_at, slope_estimate_at, value_at
from toolkit.tires.model import CurveFit

_NEAR_ZERO_RAD = float(np.radians(2.5))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Curve:
    # One load and direction of the earlier test: its curves, and of its conditions along the slip angle the
    # squares of what their rows leave, and one condition as a pattern.
    fit: DirectionFit
    SA: Array
    squares: dict[Channel, Array]
    pattern: Condition


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EarlierTest:
    """What a plan takes from a test.

    ``measured`` are its directions; ``variances`` and ``variances_u`` (sources,) those of the sources of
    scatter with their standard uncertainties; ``load_spread`` is how far blocks stood off their common load,
    as a share; ``offset_rad`` by how much the wheel stood beyond its step on average, which is the steering's
    zero; ``mirrored`` names directions that it lacks, whose curves are those of the other one; ``tire`` names
    its tire in a class; ``lengths_m`` are the relaxation lengths that it measured, by nominal load.
    """

    machine: Machine
    shared: SharedErrors
    curves: dict[tuple[float, Rotation], _Curve]
    cells: Array
    variances: Array
    variances_u: Array
    load_spread: float = 0.0
    offset_rad: float = 0.0
    mirrored: tuple[Rotation, ...] = ()
    tire: str = ""
    lengths_m: dict[float, float] = dataclasses.field(default_factory=dict)
    measured: tuple[Direction, ...] = ()

    @property
    def loads_N(self) -> tuple[float, ...]:
        """The nominal loads that have curves in every direction [N]."""
        return tuple(sorted({load for load, _ in self.curves}))

    @property
    def reach_rad(self) -> tuple[float, float]:
        """The slip angles between which every curve was measured [rad]."""
        return (
            max(float(curve.SA[0]) for curve in self.curves.values()),
            min(float(curve.SA[-1]) for curve in self.curves.values()),
        )

    def force(self, SA: ArrayLike, load_N: float, rotation: Rotation) -> Array:
        """Return FY [N] of the curve of a nominal load at slip angles [rad]."""
        return _values(self.curves[load_N, rotation].fit, "FY", SA)

    def rows_density(self, load_N: float, rotation: Rotation) -> float:
        """Return the density of the noise of FY's rows at small slip [N^2 s], by the means of its conditions.

        The mean of a stretch of noise of the density S has the variance S over the stretch's time.
        """
        curve, protocol = self.curves[load_N, rotation], self.machine.protocol
        turn_s = revolution_time_s(TireTruth(), protocol.speed_m_s or self.machine.drum.speed_m_s)
        near = np.abs(curve.SA) <= max(_NEAR_ZERO_RAD, float(np.abs(curve.SA).min()))
        return float(np.mean(curve.squares["FY"][near])) * protocol.average_revolutions * turn_s

    def similar(self, *, stiffness: float, friction: float, tire: str) -> EarlierTest:
        """Return this test on a similar tire: stiffness and friction times these.

        Forces are F'(SA) = friction F(SA stiffness / friction), as Pacejka's similarity method has them (Tire
        and Vehicle Dynamics, 3rd ed. 2012, 4.2); the shifts of the curves stay, so that plysteer follows the
        stiffness and conicity stays. Scatter and what all rows share are this test's.
        """

        def scaled(fit: CurveFit | None) -> CurveFit | None:
            return None if fit is None else _similar(fit, {"B": stiffness / friction, "D": friction})

        curves = {
            key: dataclasses.replace(
                curve, fit=dataclasses.replace(curve.fit, FY=scaled(curve.fit.FY), MZ=scaled(curve.fit.MZ))
            )
            for key, curve in self.curves.items()
        }
        return dataclasses.replace(self, curves=curves, tire=tire)

    def directions(self, design: Design) -> tuple[Direction, ...]:
        """Return the directions of a design, its conditions on the curves of this test."""
        steps = np.sort(np.asarray(design.slip_angles_rad))
        angles = steps + self.offset_rad
        loads = sorted(design.loads_N)
        directions = {}
        for rotation in (rotation for rotation in ROTATIONS if rotation in design.rotations):
            curves = [self.curves[load, rotation] for load in loads]
            values = {c: np.array([_values(curve.fit, c, angles) for curve in curves]) for c in CHANNELS}
            own = {c: self._own_u(curves, c, angles, values[c]) for c in CHANNELS}
            for place, (load, curve) in enumerate(zip(loads, curves, strict=True)):
                y = {c: values[c][place] for c in CHANNELS}
                u = {c: own[c][place] for c in CHANNELS}
                directions[load, rotation] = self._direction(curve, load, rotation, steps, y, u)
        return tuple(
            directions[key] for key in sorted(directions, key=lambda k: (k[0], ROTATIONS.index(k[1])))
        )

    def _own_u(self, curves: Sequence[_Curve], channel: Channel, angles: Array, values: Array) -> Array:
        """Return what rows and the way to the common load leave of each condition (loads, angles)."""
        squares = np.array([np.interp(angles, curve.SA, curve.squares[channel]) for curve in curves])
        FZ = np.array([curve.fit.load_N for curve in curves])
        carried = np.zeros_like(squares)
        for place in range(len(angles)):
            for row, slope in enumerate(slopes(FZ, values[:, place])):
                carried[row, place] = 0.0 if slope is None else slope.u * self.load_spread * FZ[row]
        return np.asarray(np.sqrt(squares + carried**2))

    def _direction(
        self,
        curve: _Curve,
        load: float,
        rotation: Rotation,
        steps: Array,
        y: Mapping[Channel, Array],
        u: Mapping[Channel, Array],
    ) -> Direction:
        FZ = curve.fit.load_N
        sign = signs(self.machine.axes, "SAE", seen_by_cells(rotation, self.shared.reversal))
        seen = np.column_stack([sign["FY"] * y["FY"], sign["MZ"] * y["MZ"], np.full(len(steps), FZ)])
        shown = np.column_stack([seen, np.ones(len(steps))]) @ self.cells
        conditions = tuple(
            dataclasses.replace(
                curve.pattern,
                file=f"{rotation} {place}", step_SA=float(step), SA=float(step) + self.offset_rad,
                FZ=FZ, FZ_common=FZ,
                FY=float(y["FY"][place]), FY_common=float(y["FY"][place]),
                MZ=float(y["MZ"][place]), MZ_common=float(y["MZ"][place]),
                u_FY=float(u["FY"][place]), u_FY_common=float(u["FY"][place]),
                u_MZ=float(u["MZ"][place]), u_MZ_common=float(u["MZ"][place]),
                indications=tuple(shown[place].tolist()), rotation=rotation, step_FZ=load,
            )
            for place, step in enumerate(steps)
        )  # fmt: skip
        fit = dataclasses.replace(curve.fit, rotation=rotation)
        return Direction(group=Group(load_N=FZ, rotation=rotation, conditions=conditions), fit=fit)

    def expected_scatter(self, directions: Sequence[Direction], *, shift: float = 0.0) -> Scatter:
        """Return the scatter that the residuals of a design will show on average."""
        variances = np.maximum(self.variances + shift * self.variances_u, 0.0)
        loads = {direction.group.load_N for direction in directions}
        if len(loads) == 1:
            # One load alone gives no slope to carry a block by: how far it stands off is scatter.
            variances = variances + (self.load_spread * loads.pop()) ** 2 * (np.arange(len(variances)) == 2)
        return scatter_of(directions, expected=variances)

    def foreseen(self, design: Design, *, shift: float = 0.0) -> tuple[tuple[Direction, ...], Scatter]:
        """Return the directions of a design with the scatter that its residuals will show on average."""
        return _foreseen(self, design, shift)

    def rows(
        self, design: Design, demands: Collection[Demand], *, shift: float = 0.0, known: bool = False
    ) -> tuple[Row, ...]:
        """Return the rows that demands name, as the design's reduced test will have them.

        Parameters
        ----------
        shift : of the scatter's variances, in their standard uncertainties: how sure the rows are
        known : by the scatter as this test has it, whatever the design's own residuals will show of it
        """
        directions, scatter = self.foreseen(design, shift=shift)
        if known:
            scatter = dataclasses.replace(scatter, variances=self.variances)
        named = {(demand.characteristic, demand.SA_rad) for demand in demands if demand.name != PEAK}
        peaks = self._peaks(design) if any(demand.name == PEAK for demand in demands) else ()

        def wanted(declared: Characteristic, SA: float | None) -> bool:
            if SA is None:
                return (declared.name, None) in named
            return (declared.name == "FY" and SA in peaks) or any(
                name == declared.name and at is not None and abs(at - SA) < 1e-9 for name, at in named
            )

        return rows_of(directions, shared=self.shared, scatter=scatter, wanted=wanted)

    def _peaks(self, design: Design) -> frozenset[float]:
        """Return the slip angles on either side at which FY is largest, of any load and direction [rad]."""
        angles = np.array(sorted(set(design.slip_angles_rad)))
        peaks = set()
        for load in design.loads_N:
            for rotation in design.rotations:
                force = np.abs(self.force(angles, load, rotation))
                for side in (angles[angles < 0], angles[angles > 0]):
                    if len(side):
                        peaks.add(float(side[np.argmax(force[np.isin(angles, side)])]))
        return frozenset(peaks)


@functools.lru_cache(maxsize=128)
def _foreseen(earlier: EarlierTest, design: Design, shift: float) -> tuple[tuple[Direction, ...], Scatter]:
    # A search asks for the same design by its screen, by its budget and for other demands.
    directions = earlier.directions(design)
    return directions, earlier.expected_scatter(directions, shift=shift)


def earlier_test(result: TestResult, *, machine: Machine, record: CalibrationRecord | None) -> EarlierTest:
    """Return what a plan takes from a reduced and characterised test.

    Raises
    ------
    ConfigError
        ``plan-like``: no load of it has curves of FY and MZ
    """
    reduced = result.reduced
    directions = directions_of(reduced, result.characteristics.fits)
    scatter = scatter_of(directions)
    curves: dict[tuple[float, Rotation], _Curve] = {}
    for direction in directions:
        step = direction.group.conditions[0].step_FZ
        if direction.fit.FY is None or direction.fit.MZ is None or step is None:
            continue
        curves[step, direction.group.rotation] = _Curve(
            fit=direction.fit,
            SA=direction.group.SA,
            squares={
                "FY": np.array([c.u_FY**2 for c in direction.group.conditions]),
                "MZ": np.array([c.u_MZ**2 for c in direction.group.conditions]),
            },
            pattern=direction.group.conditions[0],
        )
    if not curves:
        raise ConfigError(
            "the earlier test has no curves to plan by", where=f"--like {reduced.info.name}",
            got="no load with curves of FY and MZ", expected="a test of at least seven slip angles at a load",
            next_step="name another test, or a tire file", rule="plan-like",
        )  # fmt: skip
    mirrored = tuple(r for r in ROTATIONS if not any(rotation == r for _, rotation in curves))
    for rotation in mirrored:
        other = ROTATIONS[1 - ROTATIONS.index(rotation)]
        curves |= {(load, rotation): curve for (load, of), curve in list(curves.items()) if of == other}
    both = {load for load, _ in curves if all((load, rotation) in curves for rotation in ROTATIONS)}
    return EarlierTest(
        machine=machine,
        shared=shared_errors_of(reduced, machine=machine, record=record),
        curves={key: curve for key, curve in curves.items() if key[0] in both},
        cells=_cells(reduced.used(), machine, result),
        measured=directions,
        variances=scatter.variances,
        variances_u=scatter.variances_u,
        offset_rad=float(
            np.mean([c.SA - c.step_SA for c in reduced.used() if c.step_SA is not None] or [0.0])
        ),
        load_spread=float(np.sqrt(np.mean([(c.FZ_common / c.FZ - 1) ** 2 for c in reduced.used()]))),
        mirrored=mirrored,
        lengths_m={
            step: row.estimate.value
            for row in result.characteristics.of("relaxation_length")
            if row.estimate is not None
            for step in {d.group.conditions[0].step_FZ for d in directions if d.group.load_N == row.load_N}
            if step is not None
        },
    )


def pooled(tests: Sequence[EarlierTest]) -> EarlierTest:
    """Return the first of several tests of one tire, with the scatter that all of them show together.

    One alone says little of so many variances, and their mean takes for seen what a single test imagined.

    Parameters
    ----------
    tests : at least one, of the same loads
    """
    first, *others = tests
    scatter = scatter_of(first.measured, beside=[other.measured for other in others])
    return dataclasses.replace(first, variances=scatter.variances, variances_u=scatter.variances_u)


def _similar(fit: CurveFit, factors: Mapping[str, float]) -> CurveFit:
    """Return a curve with some of its parameters times factors."""
    sizes = np.array([factors.get(parameter.name, 1.0) for parameter in fit.parameters])
    changed = dataclasses.replace(
        fit,
        parameters=tuple(
            dataclasses.replace(parameter, value=parameter.value * size)
            for parameter, size in zip(fit.parameters, sizes.tolist(), strict=True)
        ),
        covariance=tuple(map(tuple, (np.asarray(fit.covariance) * np.outer(sizes, sizes)).tolist())),
    )
    return dataclasses.replace(
        changed,
        value_at_zero=None if fit.value_at_zero is None else estimate_at(changed, 0.0),
        slope_at_zero=None if fit.slope_at_zero is None else slope_estimate_at(changed, 0.0),
    )


def _cells(conditions: Sequence[Condition], machine: Machine, result: TestResult) -> Array:
    """Return how the cells' means follow FY, MZ and FZ in the machine's axes, and a constant: (4, cells)."""
    reversal = result.reduced.info.reversal
    rows = []
    for condition in conditions:
        sign = signs(machine.axes, "SAE", seen_by_cells(condition.rotation, reversal))
        rows.append([sign["FY"] * condition.FY, sign["MZ"] * condition.MZ, condition.FZ, 1.0])
    table = np.array(rows)
    scale = np.maximum(np.abs(table).max(axis=0), 1e-300)
    indications = np.array([condition.indications for condition in conditions])
    solution = np.linalg.lstsq(table / scale, indications, rcond=None)[0]
    return np.asarray(solution / scale[:, None])


def _values(fit: DirectionFit, channel: Channel, SA: ArrayLike) -> Array:
    curve = fit.FY if channel == "FY" else fit.MZ
    if curve is None:  # `earlier_test` takes none without both
        raise ValueError(f"no curve of {channel} at {fit.load_N:g} N")
    return value_at(curve, SA)
