"""The budget of a calibrated load: components, combined and expanded uncertainty, and what was not stated.

Symbols of JCGM 100:2008 (GUM). Every component is already in the load's unit: its sensitivity coefficient
has been applied, so that the shares u_i^2 / u^2 add up to one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from toolkit.arrays import Array

Evaluation = Literal["A", "B"]
Distribution = Literal["normal", "student", "rectangular"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One source of uncertainty.

    Attributes
    ----------
    name : short id such as ``reference``
    description : one sentence with the numbers that it follows from
    type : evaluation of type A (from observations) or B (from a statement), GUM 4.2 and 4.3
    distribution : what Monte Carlo draws; ``student`` is scaled and shifted, with ``dof``
    u : standard uncertainty in the load's unit
    dof : degrees of freedom; infinite where a type B statement is taken as certain
    source : where the figure comes from: data, session, conditions of use
    stated : False where nothing was stated or measured: u is then 0, and is no claim that it is small
    joint : True for what one estimate from the session's rows gives together; the degrees of freedom of
        their sum are `Budget.scatter_dof`, since each by itself is no independent estimate
    """

    name: str
    description: str
    type: Evaluation
    distribution: Distribution
    u: float
    dof: float
    source: str
    stated: bool = True
    joint: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contribution:
    """A component at many points, each with the ``u`` and ``dof`` of its own: (points,), or () of all alike.

    ``describe`` gives the description at a point; the rest is as in `Component`.
    """

    name: str
    describe: Callable[[int], str]
    type: Evaluation
    distribution: Distribution
    u: Array
    dof: Array
    source: str
    stated: bool
    joint: bool

    def at(self, point: int) -> Component:
        """Return the component at one of the points."""
        u, dof = (float(values.flat[point if values.size > 1 else 0]) for values in (self.u, self.dof))
        return Component(
            name=self.name, description=self.describe(point), type=self.type, distribution=self.distribution,
            u=u, dof=dof, source=self.source, stated=self.stated, joint=self.joint,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """The budget of one load at one value.

    ``at`` the load value, ``u`` combined standard and ``U`` expanded uncertainty, all in ``unit``; ``dof``
    effective (Welch-Satterthwaite), ``k`` from Student's t for ``probability``. ``scatter_dof`` are those of
    all components that are estimated together from the session's rows (`Component.joint`). ``indications``
    is the point, in the record's order and units, at which the equation's sensitivities were taken.
    """

    record: str
    load: str
    unit: str
    at: float
    indications: tuple[float, ...]
    components: tuple[Component, ...]
    u: float
    dof: float
    k: float
    U: float
    probability: float
    scatter_dof: float = math.inf

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Names of the components that nothing was stated or measured for."""
        return tuple(component.name for component in self.components if not component.stated)

    def component(self, name: str) -> Component:
        """Return one component."""
        return next(component for component in self.components if component.name == name)

    def share(self, component: Component) -> float:
        """Return a component's share of the combined variance, 0 to 1."""
        return (component.u / self.u) ** 2 if self.u else 0.0


# Conditions of use that no session states: they belong to the one who reads the instrument.


@dataclass(frozen=True, slots=True, kw_only=True)
class Temperature:
    """How far from the session's temperature the instrument is used.

    ``half_range_K`` [K] at most, either way; ``coefficient_per_K`` [1/K] relative change of the load with
    temperature, None where the cells' own stated coefficients are to be taken.
    """

    half_range_K: float
    coefficient_per_K: float | None = None
