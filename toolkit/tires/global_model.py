"""The interface of tire models over all loads: rows in, FY, MZ (and FX) out, parameters as a table.

A model over all loads is one module ``toolkit/tires/models/<name>.py`` with one object ``MODEL``, a
`GlobalModel`; the catalogue finds it there and `toolkit fit --model <name>` fits it. The module holds, or
imports, a pure function

    forces(values, rows) -> Responses

- ``values`` is a sequence with one entry for each of ``parameters``, in their order and unit. An entry is a
  float or an array (copies, 1): the fitter asks for many parameter sets at once, and every result then
  has the shape (copies, rows). Written with plain numpy arithmetic this comes by itself; a further axis
  of bristles is appended last: ``value[..., None]``.
- ``rows`` are `Rows`: slips, load, camber, pressure and speed in SI, one entry a row, in the model's
  own ``axes`` (the fitter converts; a model never asks in which axes the table was).
- Results are finite everywhere within the bounds of the parameters, at zero slip and at zero load too.
- FY, MZ are 0 for FZ = 0. A model without FX, or without MZ, leaves it None.

A parameter has a start ``default``, hard bounds ``low`` and ``high``, and ``size``, a change that matters:
the search is scaled by it. ``default`` is also what the parameter is fixed at where the data cannot
support it, so that the parametrisation must make it neutral: write a dependence on load as a base value
at FNOMIN and a change with dfz = FZ/FNOMIN - 1 whose default is 0, never as values at two loads.
``needs`` names what must vary in the data before a parameter is searched at all.

``stage`` is the channel whose rows determine the parameter. A model is fitted stage by stage, FX, FY, MZ:
what an earlier stage has found is held in the later ones. A model whose parameters act on both
channels at once says ``joint``: then all are fitted to FY and MZ together, each weighted by its own size.

``starts(seeds)`` gives start values from what the Magic Formula finds at each load (`Seeds`): mappings of
name to value, absent names start at their default. The fitter adds deterministic variations of its own.

Parameters are written as a table of text, the one form of all models. A line has name, unit, default, low,
high, size, stage, needs, text; a table of one unit or one stage leaves that column out and names it.
``needs`` are marks, ``-`` for none: ``2`` and ``3`` loads, ``c`` camber, ``p`` pressure, ``P`` three
pressures, ``v`` speed, ``s`` both signs of slip, ``k`` longitudinal slip, ``K`` of both signs, ``a`` slip
angle and longitudinal slip together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array, taken
from toolkit.channels import Axes
from toolkit.estimate import Estimate
from toolkit.reduction.selection import Selection
from toolkit.tires.model import Parameter

_NEEDS: dict[str, str] = {
    "2": "two_loads", "3": "three_loads", "c": "camber", "p": "pressure", "P": "three_pressures",
    "v": "speed", "s": "both_signs", "k": "kappa", "K": "both_kappas", "a": "alpha_and_kappa",
}  # fmt: skip

SHIFT = """
SH    rad    0.0  -0.1   0.1   0.001  FY  s  equivalent slip angle of plysteer and steering zero
"""
CAMBER = """
K_IA  1      0.0  -0.5   1.0   0.02   FY  c  equivalent slip angle of camber, per rad
"""
OFFSETS = """
SV    1      0.0  -0.2   0.2   0.01   FY  s  offset of FY over load (conicity)
SM    m      0.0  -0.05  0.05  0.001  MZ  s  offset of MZ over load
"""
Channel = Literal["FX", "FY", "MZ"]
Need = Literal[
    "two_loads", "three_loads", "camber", "pressure", "three_pressures", "speed", "both_signs",
    "kappa", "both_kappas", "alpha_and_kappa",
]  # fmt: skip

_READ_BY: dict[Need, str] = {
    "camber": "IA", "pressure": "P", "three_pressures": "P", "speed": "V", "kappa": "KAPPA",
    "both_kappas": "KAPPA", "alpha_and_kappa": "KAPPA",
}  # fmt: skip


def parameters(
    text: str, *, stage: Channel | None = None, unit: str | None = None
) -> tuple[GlobalParameter, ...]:
    """Return the parameters of a table; ``stage`` or ``unit`` stand for the column that it leaves out.

    >>> one, = parameters("MU 1 1.0 0.05 5.0 0.05 FY 2c friction at FNOMIN")
    >>> one.low, one.needs, one.text
    (0.05, ('two_loads', 'camber'), 'friction at FNOMIN')
    """
    rows = []
    for line in filter(None, text.splitlines()):
        name, line = line.split(maxsplit=1)
        own_unit, line = (unit, line) if unit is not None else line.split(maxsplit=1)
        default, low, high, size, line = line.split(maxsplit=4)
        own_stage, line = (stage, line) if stage is not None else line.split(maxsplit=1)
        needs, words = line.split(maxsplit=1)
        rows.append(
            GlobalParameter(
                name=name,
                unit=own_unit,
                default=float(default),
                low=float(low),
                high=float(high),
                size=float(size),
                text=words,
                stage=cast("Channel", own_stage),
                needs=tuple(cast("Need", _NEEDS[mark]) for mark in needs.replace("-", "")),
            )
        )
    return tuple(rows)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """What a tire is asked: one entry a row (rows,), SI, with the nominal values that scale them.

    ``SA``, ``IA`` [rad] slip and inclination angle, ``FZ`` [N] load, not negative, ``P`` [Pa] pressure,
    ``V`` [m/s] speed, ``KAPPA`` [1] longitudinal slip. Where the data have no P, V it is the nominal value.
    ``FNOMIN`` [N], ``NOMPRES`` [Pa], ``LONGVL`` [m/s], ``UNLOADED_RADIUS`` [m] as a tire file names them.
    """

    SA: Array
    FZ: Array
    IA: Array
    P: Array
    V: Array
    KAPPA: Array
    FNOMIN: float
    NOMPRES: float = 200e3
    LONGVL: float = 16.7
    UNLOADED_RADIUS: float = 0.3

    def __len__(self) -> int:
        return len(self.SA)

    @property
    def dfz(self) -> Array:
        """FZ / FNOMIN - 1."""
        return self.FZ / self.FNOMIN - 1.0

    @property
    def dpi(self) -> Array:
        """P / NOMPRES - 1."""
        return self.P / self.NOMPRES - 1.0

    def take(self, index: NDArray[Any]) -> Rows:
        """Return some of the rows, by index or mask."""
        return taken(self, index)

    def other(self, SA: object, FZ: object, **columns: Any) -> Rows:
        """Return other rows, as `make_rows` has them, under the same nominal values."""
        nominal = ("FNOMIN", "NOMPRES", "LONGVL", "UNLOADED_RADIUS")
        return make_rows(SA, FZ, **columns, **{name: getattr(self, name) for name in nominal})


def make_rows(
    SA: object,
    FZ: object,
    *,
    FNOMIN: float,
    IA: object = 0.0,
    P: object = None,
    V: object = None,
    KAPPA: object = 0.0,
    NOMPRES: float = 200e3,
    LONGVL: float = 16.7,
    UNLOADED_RADIUS: float = 0.3,
) -> Rows:
    """Return rows of SA, IA [rad], FZ [N], P [Pa], V [m/s], KAPPA [1]; scalars are repeated.

    >>> len(make_rows([0.0, 0.1], 4000.0, FNOMIN=4000.0))
    2
    """
    columns = np.broadcast_arrays(
        *(
            np.atleast_1d(np.asarray(column, dtype=np.float64))
            for column in (SA, FZ, IA, NOMPRES if P is None else P, LONGVL if V is None else V, KAPPA)
        )
    )
    a, z, g, p, v, k = columns
    return Rows(
        SA=a, FZ=z, IA=g, P=p, V=v, KAPPA=k,
        FNOMIN=FNOMIN, NOMPRES=NOMPRES, LONGVL=LONGVL, UNLOADED_RADIUS=UNLOADED_RADIUS,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Responses:
    """FY [N], MZ [N·m] and FX [N] (rows,) or (copies, rows); None where a model has no such channel."""

    FY: Array | None = None
    MZ: Array | None = None
    FX: Array | None = None

    def __getitem__(self, channel: str) -> Array:
        """Return a channel that the model has."""
        response: Array | None = getattr(self, channel)
        if response is None:
            raise KeyError(channel)
        return response


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalParameter:
    """One row of a model's parameter table; see the module's text for ``default``, ``size``, ``needs``.

    ``unit`` is the unit of the value as `forces` takes it, in pint's spelling ("1" without dimension).
    """

    name: str
    unit: str
    default: float
    low: float
    high: float
    size: float
    text: str
    stage: Channel = "FY"
    needs: tuple[Need, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seeds:
    """What the Magic Formula finds at each load (loads,), ascending; positive for any tire, any axes.

    ``load`` [N]; ``stiffness`` -dFY/dSA in SAE and ISO [N/rad]; ``peak`` largest |FY| that the curve reaches
    within twice the measured angles [N]; ``peak_angle`` |SA| there [rad]; ``trail`` aligning over cornering
    stiffness [m], NaN without MZ; ``FNOMIN`` [N].
    """

    load: Array
    stiffness: Array
    peak: Array
    peak_angle: Array
    trail: Array
    FNOMIN: float

    def at_nominal(self, values: Array) -> tuple[float, float]:
        """Return value at FNOMIN and change with dfz (a straight line; no change from one load)."""
        good = np.isfinite(values)
        dfz = self.load[good] / self.FNOMIN - 1.0
        if good.sum() < 2:
            return (float(values[good][0]), 0.0) if good.any() else (float("nan"), 0.0)
        slope, base = np.polyfit(dfz, values[good], 1)
        return float(base), float(slope)

    def law(self, values: Array) -> tuple[float, float]:
        """Return base and change of values that are base exp(change dfz): `contact.with_load`."""
        base, change = self.at_nominal(np.log(values))
        return float(np.exp(base)), change


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """A factor of a model's equations whose bounds hold at every load, camber and pressure of the data.

    A factor that changes its sign between two measured loads leaves the model's curves at these loads as they
    are, where the equation is even in it, and makes something else of all loads between. ``low`` and ``high``
    are the bounds that its parameter has at the nominal load, ``size`` a change that matters.
    """

    name: str
    stage: Channel
    low: float
    high: float
    size: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """The largest departure of a channel: at ``load_N`` between two measured ones, as a share of its size."""

    channel: str
    load_N: float
    low_N: float
    high_N: float
    share: float
    limit: float

    @property
    def too_large(self) -> bool:
        """Whether the rows do not hold the model there."""
        return self.share > self.limit


Factors = Callable[[Sequence[Any], Rows], Mapping[str, Any]]
"""Values of a model's factors by name at rows, (rows,) or (copies, rows)."""

Forces = Callable[[Sequence[Any], Rows], Responses]
Starts = Callable[[Seeds], Sequence[Mapping[str, float]]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GlobalModel:
    """A model over all loads as the catalogue holds it; ``forces`` and ``starts`` as the module says.

    ``valid`` states in words where the model holds; ``axes`` are those of its parameters and forces.
    ``grid`` is how many inner points (bristles) a row costs: it bounds how much is asked at once.
    ``moment_alone`` says that MZ does not use what FY's rows determine, so that MZ can be fitted without.
    ``reads`` names what the equations read beside slip angle and load whatever the parameters are: KAPPA, V,
    IA; what they read by parameters alone follows from those (`variables`). ``bounded`` are the factors whose
    values ``factors`` gives; a model whose factors cannot leave their bounds has none.
    """

    name: str
    title: str
    reference: str
    valid: str
    axes: Axes
    channels: tuple[Channel, ...]
    parameters: tuple[GlobalParameter, ...]
    forces: Forces
    starts: Starts
    joint: bool = False
    grid: int = 1
    moment_alone: bool = False
    reads: tuple[str, ...] = ()
    bounded: tuple[Factor, ...] = ()
    factors: Factors | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names in their order."""
        return tuple(parameter.name for parameter in self.parameters)

    def variables(self, varies: Collection[str]) -> frozenset[str]:
        """Return what the model reads beside slip angle and load, fitted to rows in which so much varies.

        A parameter that cannot be fitted stands at its default, where it reads nothing.
        """
        by_parameters = {
            _READ_BY[need]
            for parameter in self.parameters
            if set(parameter.needs) <= set(varies)
            for need in parameter.needs
            if need in _READ_BY
        }
        return frozenset({*self.reads, *by_parameters})

    def values(self, given: Mapping[str, float]) -> Array:
        """Return a parameter set from names and values, defaults for the rest.

        Raises
        ------
        KeyError
            a name that the model does not have
        """
        if unknown := set(given) - set(self.names):
            raise KeyError(sorted(unknown)[0])
        return np.array([given.get(parameter.name, parameter.default) for parameter in self.parameters])


# GlobalFit: one channel of a model fitted over all loads, with what the data could and could not say.


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadShare:
    """How a model over all loads does at one load block.

    ``stiffness`` is the slope at SA = 0 in the table's axes [N/rad or N·m/rad], None for FX;
    ``prediction_error_percent`` is that of a fit that never saw this load, None where there is none.
    """

    load_N: float
    n: int
    error_percent: float
    stiffness: Estimate | None
    prediction_error_percent: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalFit:
    """One channel of a model over all loads; ``load_N`` is None as the files contract wants it.

    ``axes`` are the table's, in which stiffness and errors are; ``parameter_axes`` those of the model, in
    which its parameters are defined. ``fixed`` names parameters that stand at a value which the data did not
    choose, with the reason in words; they count among ``not_determined``, and ``covariance`` holds the
    others, in their order. ``nominal_load_N`` is FNOMIN, at which ``slope_at_zero`` is given.
    ``starts_agreeing`` ended at the lowest cost. ``departure`` is the largest one between the measured loads.
    """

    model: str
    channel: str
    axes: str
    parameter_axes: str
    n: int
    dof: int
    parameters: tuple[Parameter, ...]
    covariance: tuple[tuple[float, ...], ...]
    not_determined: tuple[str, ...]
    fixed: tuple[tuple[str, str], ...]
    at_bound: tuple[str, ...]
    error_percent: float
    prediction_error_percent: float | None
    scatter_floor_percent: float | None
    slope_at_zero: Estimate | None
    nominal_load_N: float
    loads: tuple[LoadShare, ...]
    loss: str
    weights: str
    starts: int
    starts_agreeing: int
    converged: bool
    message: str
    departure: Departure | None = None

    @property
    def load_N(self) -> None:
        """None: the fit is over all loads."""

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the channel's parameters in their order."""
        return tuple(parameter.value for parameter in self.parameters)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelFit:
    """A model fitted to a table: ``values`` of all its parameters, and one `GlobalFit` a channel.

    ``selection`` are the rows of the data that were fitted, those that differ in nothing which the model does
    not read; ``curves`` (channel, model at every one of them, in the table's axes).
    """

    model: str
    values: Array
    fits: tuple[GlobalFit, ...]
    curves: tuple[tuple[str, Array], ...]
    selection: Selection

    def at_rows(self, channel: str) -> Array:
        """Return the model at every row that was fitted [N or N·m], in the table's axes."""
        return dict(self.curves)[channel]

    def fit(self, channel: str) -> GlobalFit | None:
        """Return the fit of a channel, None where there is none."""
        return next((fit for fit in self.fits if fit.channel == channel), None)


def pooled_percent(residual: Array, y: Array) -> float:
    """Return 100 sqrt(sum residual^2 / sum y^2); NaN where every y is zero."""
    size = float(np.sum(y**2))
    return float(100 * np.sqrt(np.sum(residual**2) / size)) if size else float("nan")
