"""What all rows of a test share: the record's coefficients, the zeros of the cells, the slip angle's scale.

A characteristic is, to first order, a weighted sum of conditions. The record's coefficients are the same
in every one of them, so their uncertainty goes through the weighted sum of the sensitivities, not through
the conditions one by one: it cancels in a difference of equal readings and adds in a sum. What the record's
session stated (reference standard, indications, drift of the zero, creep) is in their covariance: an error of
the scale stays in conicity and stiffness in proportion to their values, a shift of the zero goes where the
signs of the axes take it (`uncertainty.propagation`).

Every share is a signed `Part` whose key says which variable it is. Two tests that one record computed share
its keys; what the machine definition states is common to all tests of the machine or drawn anew in each one
(``common = "machine" | "test"``).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.apply import coefficient_jacobian
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.uncertainty.common_errors import record_covariance
from toolkit.channels import Axes, Reversal, seen_by_cells, signs
from toolkit.characteristics.uncertain import Part
from toolkit.machine import Correction, Machine, TypeB
from toolkit.reduction.corrections import u_SA, zero_shifts
from toolkit.reduction.model import Condition, ReducedTest
from toolkit.units import si_scale

# A pivot of a correlation matrix below this is rounding.
_NO_PIVOT = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SharedErrors:
    """What every row of a test has in common.

    ``record`` computed the rows (None where it is not at hand: its share is then zero); ``machine_axes``
    are the axes of its cells; ``tared`` says that a tare was subtracted; ``u_cell_zero`` is the standard
    uncertainty of each cell's zero in the record's units, one shift of every row (the open zero of an
    untared bridge, or the scatter of a tare that serves all files). ``SA SA_scale FZ P zero`` are what the
    machine states of the slip angle's zero and scale, the load, the pressure and the cells' zeros;
    ``pressure_Pa`` None where the test does not say it. ``machine`` and ``test`` name the owners of
    variables; ``reversal`` says what was turned for the runs called reverse.
    ``corrections`` are those of the machine on FY and MZ, whose uncertainty all rows share.
    ``covariance`` of each load's coefficients follows from the record and what its session stated.
    """

    record: CalibrationRecord | None
    machine_axes: Axes
    tared: bool
    SA: TypeB
    SA_scale: TypeB
    FZ: TypeB
    P: TypeB
    zero: TypeB
    u_cell_zero: tuple[float, ...] = ()
    pressure_Pa: float | None = None
    machine: str = ""
    test: str = ""
    reversal: Reversal = "drum"
    corrections: tuple[Correction, ...] = ()
    covariance: Mapping[str, Array] = field(init=False, repr=False)
    roots: Mapping[str, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        covariances = {} if self.record is None else record_covariance(self.record)
        object.__setattr__(self, "covariance", MappingProxyType(covariances))
        roots = {load: root_of(covariance) for load, covariance in covariances.items()}
        object.__setattr__(self, "roots", MappingProxyType(roots))

    def owner(self, stated: TypeB) -> str:
        """Return who owns the variable of a statement: the machine, or this test alone."""
        return self.machine if stated.common == "machine" else f"{self.machine}/{self.test}"

    def signed(self, channel: str, conditions: Sequence[Condition]) -> Array:
        """Return the sign of a channel from the cells' axes to SAE for each condition (conditions,)."""
        return np.array(
            [
                signs(self.machine_axes, "SAE", seen_by_cells(condition.rotation, self.reversal))[channel]
                for condition in conditions
            ],
            dtype=float,
        )

    def calibration_rows(self, channel: str, conditions: Sequence[Condition]) -> Array:
        """Return how each independent variable of the record moves each condition [SI]: (variables, rows).

        The variables are those of the triangular root of the coefficients' covariance; none without one.
        """
        if self.record is None or channel not in self.covariance or not conditions:
            return np.zeros((0, len(conditions)))
        names = self.record.indications
        # The conditions hold tared means. A record whose intercept carries the zero of its session loses
        # that term with the tare, and the difference to a tare of zero says so.
        tare = dict.fromkeys(names, 0.0) if self.tared else None
        rows = {
            name: np.array([condition.indications[i] for condition in conditions])
            for i, name in enumerate(names)
        }
        jacobian = coefficient_jacobian(self.record, channel, rows, tare)
        moved = (jacobian @ self.roots[channel]).T * si_scale(self.record.load(channel).unit)
        return np.asarray(moved * self.signed(channel, conditions))

    def zero_rows(self, channel: str, conditions: Sequence[Condition]) -> Array:
        """Return how each cell's zero, then each correction of the machine, moves each condition [SI].

        Shape (cells + corrections, rows); no row for a cell where its zero is known.
        """
        sign = self.signed(channel, conditions)
        rows = [self._correction_row(correction, channel, conditions) for correction in self.corrections]
        if self.record is not None and conditions and any(self.u_cell_zero):
            cells = np.array([correction.indications for correction in conditions]).T
            rows = [*zero_shifts(self.record, cells, self.u_cell_zero)[channel], *rows]
        return np.reshape(np.asarray(rows, dtype=float), (len(rows), len(conditions))) * sign

    def _correction_row(self, correction: Correction, channel: str, conditions: Sequence[Condition]) -> Array:
        """Return what the uncertainty of a correction moves in each condition [SI], machine axes."""
        if correction.channel != channel:
            return np.zeros(len(conditions))
        source = str(correction.source)
        sign = np.ones(len(conditions)) if source == "FZ" else self.signed(source, conditions)
        values = np.array([getattr(condition, source) for condition in conditions], dtype=float)
        return np.asarray(correction.u * correction.factor * sign * values)

    def calibration_parts(self, channel: str, moved: Array) -> list[Part]:
        """Return the record's parts of a weighted sum that its variables move by ``moved``."""
        sha = "" if self.record is None else self.record.sha256
        return [
            Part(source="calibration", key=f"calibration/{sha}/{channel}/{i}", u=float(u))
            for i, u in enumerate(moved)
        ]

    def zero_parts(self, moved: Array) -> list[Part]:
        """Return the parts of a weighted sum that the cells' zeros and the corrections move by ``moved``.

        FY and MZ have the same keys: one cell moves both.
        """
        source = "tare" if self.tared else "cell zero"
        owner = f"{self.machine}/{self.test}" if self.tared else self.owner(self.zero)
        cells = len(moved) - len(self.corrections)
        return [
            *(
                Part(source=source, key=f"{source}/{owner}/{i}", u=float(u))
                for i, u in enumerate(moved[:cells])
            ),
            *(
                Part(
                    source="machine correction",
                    key=f"correction/{self.machine}/{correction.label}",
                    u=float(u),
                )
                for correction, u in zip(self.corrections, moved[cells:], strict=True)
            ),
        ]

    def angle_parts(self, slope: float, stretch: float) -> list[Part]:
        """Return the slip angle's parts.

        Parameters
        ----------
        slope : d value / d slip angle [value per rad]
        stretch : d value / d ln(slip angle), all angles together [value]

        An angle that reads too large by e stands for one smaller by e: both enter with a minus.
        """
        zero, scale = self.owner(self.SA), self.owner(self.SA_scale)
        return [
            Part(source="slip angle zero", key=f"SA zero/{zero}", u=-slope * self.SA.u),
            Part(source="slip angle scale", key=f"SA scale/{scale}", u=-stretch * self.SA_scale.relative),
        ]

    def load_part(self, slope: float, FZ: float) -> Part:
        """Return the part of the load cell: ``slope`` is d value / d FZ [value per N] at the load FZ [N]."""
        u = float(np.hypot(self.FZ.u, self.FZ.relative * FZ))
        return Part(source="load", key=f"FZ/{self.owner(self.FZ)}", u=slope * u)

    def pressure_part(self, value: float) -> Part | None:
        """Return the part of the inflation pressure; None where the test does not say its pressure."""
        if self.pressure_Pa is None or not self.P.effect:
            return None
        relative = float(np.hypot(self.P.u / self.pressure_Pa, self.P.relative))
        return Part(source="pressure", key=f"P/{self.owner(self.P)}", u=value * self.P.effect * relative)


def shared_errors_of(
    reduced: ReducedTest, *, machine: Machine, record: CalibrationRecord | None
) -> SharedErrors:
    """Return what the rows of a reduced test have in common."""
    own_tares = reduced.tare.source == "block"  # a tare of each file is no shift of all rows
    SA = machine.stated_uncertainty("SA")
    u_uncorrected = u_SA(machine, np.array([condition.MZ for condition in reduced.conditions]))
    return SharedErrors(
        record=record,
        machine_axes=machine.axes,
        tared=reduced.tare.source != "none",
        SA=replace(SA, u=float(np.hypot(SA.u, u_uncorrected))) if u_uncorrected else SA,
        SA_scale=machine.stated_uncertainty("SA_scale"),
        FZ=machine.stated_uncertainty("FZ"),
        P=machine.stated_uncertainty("P"),
        zero=machine.stated_uncertainty("zero"),
        u_cell_zero=() if own_tares else tuple(u for _, u in reduced.tare.u),
        pressure_Pa=reduced.info.pressure_Pa,
        machine=machine.name,
        test=identity_of(reduced),
        reversal=reduced.info.reversal,
        corrections=tuple(
            condition for condition in machine.corrections if condition.channel in ("FY", "MZ")
        ),
    )


def identity_of(reduced: ReducedTest) -> str:
    """Return what tells a test from every other: a hash of its files, whatever the folder's name."""
    text = "\n".join(
        sorted({f"{condition.file} {condition.file_sha256}" for condition in reduced.conditions})
    )
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def root_of(covariance: Array) -> Array:
    """Return the lower triangular L with L L^T = V of a semi-definite V (terms, terms).

    By columns, without pivoting: the same V gives the same variables in the same order on every machine,
    so that two tests name them alike. A column without a remainder is zero.

    >>> root_of(np.array([[4.0, 2.0], [2.0, 1.0]])).tolist()
    [[2.0, 0.0], [1.0, 0.0]]
    """
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(spread > 0, spread, 1.0)
    correlation = covariance / np.outer(safe, safe)
    size = len(correlation)
    lower = np.zeros((size, size))
    for j in range(size):
        pivot = correlation[j, j] - lower[j, :j] @ lower[j, :j]
        if pivot > _NO_PIVOT:
            lower[j, j] = np.sqrt(pivot)
            lower[j + 1 :, j] = (correlation[j + 1 :, j] - lower[j + 1 :, :j] @ lower[j, :j]) / lower[j, j]
    return np.asarray(lower * spread[:, None])
