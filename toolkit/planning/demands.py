"""What a plan has to reach: expanded uncertainties of characteristics, each by its name in the catalogue."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from toolkit.characteristics.catalogue import by_name
from toolkit.errors import ConfigError, UnitError
from toolkit.spelling import nearest
from toolkit.units import unit

PEAK = "peak"
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
    if match is None or not (math.isfinite(size) and size > 0):
        raise _wrong("a demand cannot be read", text, "NAME=NUMBER UNIT: 'conicity=5 N', 'peak=1 %'")
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
    factor = None if written is None else _factor(written, declared.unit)
    if factor is None:
        raise _wrong("a demand has no unit that fits", text, f"{declared.printed_unit}, or %")
    return Demand(name=name, U=size * factor, SA_rad=angle)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _factor(written: str, declared: str) -> float | None:
    """Return the factor to the declared SI unit; a stiffness is a force or moment per angle, written so."""
    wanted, parts = declared.split("/"), written.split("/")
    if len(wanted) != len(parts):
        return None
    try:
        units = [unit(part.strip()) for part in parts]
    except UnitError:
        return None
    if [part.dimension for part in units] != [unit(part).dimension for part in wanted]:
        return None
    return units[0].factor / (units[1].factor if len(units) > 1 else 1.0)


def _wrong(what: str, got: str, expected: str, hint: str = "") -> ConfigError:
    return ConfigError(
        what, where="--u", got=got, expected=expected,
        next_step=hint or "see 'toolkit plan test --help', and docs/characteristics.md for the names",
        rule="plan-demand",
    )  # fmt: skip
