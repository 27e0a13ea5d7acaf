"""What a plan of a test is asked for, as texts and as numbers, and how near a design comes to it.

A demand is the largest expanded uncertainty of a characteristic, named as in the catalogue; people read it in
the units in which their machine's protocol has the loads.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import by_name
from toolkit.declared import Quantity
from toolkit.errors import ConfigError, UnitError
from toolkit.spelling import nearest
from toolkit.units import from_si, in_both, si_scale, unit

if TYPE_CHECKING:
    from toolkit.characteristics.model import Row
    from toolkit.estimate import Estimate
    from toolkit.machine import Protocol


PEAK = "peak"
LARGEST = 1e9
"""A demand, of any unit: no tire and no machine makes as much."""
_FORM = re.compile(
    r"\s*(?P<name>\w+)\s*(?:@\s*(?P<angle>[-+]?[\d.]+)\s*deg)?\s*"
    r"(?:=\s*(?P<size>[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>\S.*?)?\s*)?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """The largest expanded uncertainty (95 %) that a characteristic may have.

    ``name`` of the catalogue, or ``peak``: FY at the step on either side at which it is largest; ``U`` [SI],
    or ``share`` of the value; both None for what the machine's own protocol reaches; ``SA_rad`` of a
    characteristic at slip angles.
    """

    name: str
    U: float | None = None
    share: float | None = None
    SA_rad: float | None = None

    def limit(self, value: float) -> float:
        """Return the largest expanded uncertainty at a value [SI]."""
        return self.U if self.U is not None else (self.share or 0.0) * abs(value)

    @property
    def open(self) -> bool:
        """Tell whether it states no size: the machine's protocol is the measure."""
        return self.U is None and self.share is None

    @property
    def characteristic(self) -> str:
        """The name in the catalogue."""
        return "FY" if self.name == PEAK else self.name

    @property
    def label(self) -> str:
        """As it is written."""
        return self.name if self.SA_rad is None else f"{self.name}@{math.degrees(self.SA_rad):g}deg"


def parse_demand(text: str) -> Demand:
    """Return the demand that a text states.

    Raises
    ------
    ConfigError
        ``plan-demand``: no such form or name, a unit of another dimension, a size of zero

    Examples
    --------
    >>> parse_demand("conicity = 5 N").U, parse_demand("peak=1 %").share
    (5.0, 0.01)
    >>> demand = parse_demand("FY@8deg=40N")
    >>> demand.label, demand.U
    ('FY@8deg', 40.0)
    >>> parse_demand("plysteer").open
    True
    """
    match = _FORM.fullmatch(text)
    size = _number(match["size"]) if match and match["size"] is not None else 1.0
    if match is None or not 0 < size <= LARGEST:
        expected = f"NAME=NUMBER UNIT, above 0 and at most {LARGEST:g}: 'conicity=5 N', 'peak=1 %'"
        raise _wrong("a demand cannot be read", text, expected)
    name, written = match["name"], match["unit"]
    known = (PEAK, *by_name())
    if name not in known:
        near = nearest(name, known)
        hint = f"did you mean {near!r}?" if near else ""
        raise _wrong(f"no characteristic is named {name!r}", text, ", ".join(known), hint)
    declared = by_name()["FY" if name == PEAK else name]
    angle = None if match["angle"] is None else math.radians(_number(match["angle"]))
    at_angles = declared.scope == "angle" and name != PEAK
    if at_angles != (angle is not None) or (angle is not None and not abs(angle) < math.pi / 2):
        expected = f"{name}@ANGLEdeg=NUMBER UNIT" if at_angles else f"{name}=NUMBER UNIT"
        raise _wrong("a demand has a slip angle where it is one at slip angles", text, expected)
    if match["size"] is None:
        return Demand(name=name, SA_rad=angle)
    if written == "%":
        return Demand(name=name, share=size / 100, SA_rad=angle)
    factor = None if written is None else factor_to(declared.unit, written)
    if factor is None:
        raise _wrong("a demand has no unit that fits", text, f"{declared.printed_unit}, or %")
    return Demand(name=name, U=size * factor, SA_rad=angle)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def factor_to(declared: str, written: str) -> float | None:
    """Return the factor from a written unit to a declared one; None where they are not of one kind.

    A stiffness is a force or a moment per angle, and no force.

    >>> factor_to("N/rad", "kN/rad"), factor_to("N", "kN/deg"), factor_to("lbf", "lbf")
    (1000.0, None, 1.0)
    """
    wanted, parts = declared.split("/"), written.split("/")
    if len(wanted) != len(parts):
        return None
    try:
        pairs = [(unit(a.strip()), unit(b)) for a, b in zip(parts, wanted, strict=True)]
    except UnitError:
        return None
    if any(a.dimension != b.dimension or a.offset for a, b in pairs):
        return None
    over, *under = (a.factor / b.factor for a, b in pairs)
    return over / math.prod(under)


def _wrong(what: str, got: str, expected: str, hint: str = "") -> ConfigError:
    return ConfigError(
        what, where="--u", got=got, expected=expected,
        next_step=hint or "see 'toolkit plan test --help', and docs/characteristics.md for the names",
        rule="plan-demand",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """The uncertainty that a design has of one demand at one load, in the direction in which it is largest.

    ``value``, ``u``, ``U`` [unit], ``dof``; ``limit`` is what was demanded; ``sources`` the budget; ``tire``
    that of a class.
    """

    demand: Demand
    load_N: float
    rotation: str
    SA_rad: float | None
    value: float
    u: float
    U: float
    dof: float
    unit: str
    limit: float
    sources: tuple[tuple[str, float], ...]
    tire: str = ""

    @property
    def ratio(self) -> float:
        """U over what was demanded."""
        return self.U / self.limit if self.limit > 0 else math.inf


def is_of(row: Row, demand: Demand, load_N: float) -> bool:
    """Tell whether a row is what a demand names, at the load of its curve [N]."""
    if row.name != demand.characteristic or row.load_N != load_N:
        return False
    return demand.SA_rad is None or (row.SA_rad is not None and abs(row.SA_rad - demand.SA_rad) < 1e-9)


def worst(demand: Demand, rows: Sequence[Row], load_N: float, otherwise: float) -> Reach | None:
    """Return the row of a demand that is furthest from it; None where there is none.

    Parameters
    ----------
    load_N : the nominal load
    otherwise : the limit of a demand that states none
    """
    read = [(row, row.estimate) for row in rows if row.estimate is not None]
    if demand.name == PEAK:
        read = _peaks(read)
    reaches = [
        Reach(
            demand=demand, load_N=load_N, rotation=row.rotation, SA_rad=row.SA_rad, value=estimate.value,
            u=estimate.u, U=estimate.expanded()[0], dof=estimate.dof, unit=estimate.unit,
            limit=otherwise if demand.open else demand.limit(estimate.value), sources=row.number.by_source(),
        )
        for row, estimate in read
    ]  # fmt: skip
    return max(reaches, key=lambda reach: (reach.ratio, reach.U), default=None)


def _peaks(read: Sequence[tuple[Row, Estimate]]) -> list[tuple[Row, Estimate]]:
    """Return of each direction and side of zero the row with the largest force."""
    peaks: dict[tuple[str, bool], tuple[Row, Estimate]] = {}
    for row, estimate in read:
        key = (row.rotation, (row.SA_rad or 0.0) > 0)
        if row.SA_rad and (key not in peaks or abs(estimate.value) > abs(peaks[key][1].value)):
            peaks[key] = (row, estimate)
    return list(peaks.values())


_MOMENTS = {"lbf": "lbf*ft"}  # of a force's unit; N*m of any other
_DEGREE = math.radians(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedUnits:
    """Units of forces and moments; angles are in degrees, lengths in millimetres.

    >>> units = PrintedUnits(force="lbf", moment="lbf*ft")
    >>> units.shown(4448.2216, "N/rad")
    (17.4532..., 'lbf/deg')
    """

    force: str = "N"
    moment: str = "N*m"

    def shown(self, value: float, unit: str) -> tuple[float, str]:
        """Return an SI value as it is printed, with its unit."""
        if unit == "m":
            return 1e3 * value, "mm"
        quantity, _, angle = unit.partition("/")
        names = {"N": self.force, "N*m": self.moment, "rad": "deg"}
        if quantity not in names or angle not in ("", "rad"):
            return value, unit
        size = value / _DEGREE if quantity == "rad" else float(from_si(value, names[quantity]))
        if angle:
            return size * _DEGREE, f"{names[quantity]}/deg"
        return size, names[quantity]


def units_of(protocol: Protocol) -> PrintedUnits:
    """Return the units of a protocol: force as its loads are written."""
    written = {load.unit for load in protocol.loads_N if isinstance(load, Quantity)}
    force = written.pop() if len(written) == 1 else "N"
    force = "lbf" if force == "lb" else force
    return PrintedUnits(force=force, moment=_MOMENTS.get(force, "N*m"))


def title_of(label: str) -> str:
    """Return what a demand is called: its characteristic's title, with the slip angle of one at an angle.

    >>> title_of("slope_cornering"), title_of("FY@8deg"), title_of("peak")
    ('cornering stiffness, slope at 0 deg', 'lateral force at 8 deg', 'peak lateral force')
    """
    name, _, angle = label.partition("@")
    if name == PEAK:
        return f"peak {by_name()['FY'].term}"
    declared = by_name()[name]
    return f"{declared.term} at {angle.removesuffix('deg')} deg" if angle else declared.title


_NEAR = 0.15  # a load that is asked for is the nominal one within this part of it


def nominal_loads(texts: Sequence[str], known_N: Sequence[float]) -> tuple[float, ...]:
    """Return the nominal loads that are asked for, of those that are known [N]; all by default.

    Raises
    ------
    ConfigError
        ``plan-load``: one that cannot be read, or is none of them
    """
    if not texts:
        return tuple(known_N)
    loads = []
    for text in texts:
        asked = load_of(text)
        nearest = min(known_N, key=lambda load: abs(load - asked))
        if abs(nearest - asked) > _NEAR * nearest:
            raise _wrong_load(text, in_both(list(known_N), "lbf", ".0f"))
        loads.append(nearest)
    return tuple(sorted(set(loads)))


def load_of(text: str) -> float:
    """Return a load [N] that a text states with its unit.

    Raises
    ------
    ConfigError
        ``plan-load``
    """
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(\S.*?)\s*", text)
    if match is None:
        raise _wrong_load(text, "a number with its unit: '833 lbf', '3700 N'")
    try:
        return float(match[1]) * si_scale(match[2], "force", where="--load")
    except UnitError as error:
        raise _wrong_load(text, "a force with its unit: '833 lbf', '3700 N'") from error


def _wrong_load(actual: str, expected: str) -> ConfigError:
    return ConfigError(
        "a load cannot be planned", where="--load", got=actual, expected=expected,
        next_step="name a load that the earlier test measured, or another test", rule="plan-load",
    )  # fmt: skip
