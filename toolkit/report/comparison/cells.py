"""How a comparison's numbers are written: value and expanded uncertainty in the unit of choice."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import by_name
from toolkit.estimate import Estimate, plus_minus
from toolkit.units import printed

if TYPE_CHECKING:
    from toolkit.comparison.model import Comparison, Difference, FactorSpread, Section
    from toolkit.report.style import Style

# A table of more rows is for programs.
MOST_ROWS = 90


def shown_unit(name: str, style: Style) -> tuple[str, float]:
    """Return a quantity's unit as it is shown, and the factor from SI."""
    declared = by_name()[name]
    unit, factor = style.unit(declared.printed_unit)
    return printed(str(unit)), factor * declared.factor


def with_U(estimate: Estimate, factor: float, style: Style) -> str:
    """Return ``45.0 ± 0.6``: two digits of U, and the value to the same place."""
    scaled = estimate.scaled(factor, "")
    return plus_minus(scaled.value, scaled.expanded()[0], decimal_comma=style.decimal_comma)


def p_text(p: float | None, style: Style) -> str:
    """Return a p value; a dash where none was decided."""
    return "-" if p is None else style.decimal("< 0.0001" if p < 1e-4 else f"{p:.4f}")


def named(name: str, rotation: str, SA_rad: float | None = None, *, title: bool = False) -> str:
    """Return what a row is about: the quantity, its slip angle, its direction.

    >>> named("FY", "forward", math.radians(-2)), named("PRAT", "both", title=True)
    ('FY at -2 deg, forward', 'PRAT at 0 deg')
    """
    text = by_name()[name].title if title else name
    angle = "" if SA_rad is None else f" at {math.degrees(SA_rad):+.0f} deg".replace("+0 ", "0 ")
    return f"{text}{angle}" + ("" if rotation == "both" else f", {rotation}")


def shown_rows(comparison: Comparison, part: Section) -> tuple[tuple[Difference, ...], str]:
    """Return the rows of a table that people are shown, and in words which they are.

    Characteristics: all of them while they are few. Forces at slip angles: the significant ones.
    """
    mine = tuple(difference for difference in comparison.differences if difference.part == part)
    certain = tuple(difference for difference in mine if difference.significant)
    if part == "characteristics" and len(mine) <= MOST_ROWS:
        return mine, f"all {len(mine)} rows"
    extent = f"the {len(certain)} significant" if certain else "none is significant"
    return certain, f"{extent} of {len(mine)} rows; the JSON answer holds all"


def factor_text(spread: FactorSpread, factor: float, style: Style) -> str:
    """Return an intermediate precision; a star where its factor adds significantly."""
    return style.decimal(f"{spread.s * factor:.3g}") + (" *" if spread.significant else "")


def conclusion(comparison: Comparison) -> str:
    """Return what a comparison found, in sentences that its numbers alone make."""
    parts = []
    for part, title in (
        ("characteristics", "characteristics"),
        ("curves", "forces and moments at slip angles"),
    ):
        mine = [
            difference
            for difference in comparison.differences
            if difference.part == part and difference.p is not None
        ]
        if not mine:
            continue
        counts: dict[str, list[int]] = {}
        for entry in mine:
            count = counts.setdefault(by_name()[entry.name].title, [0, 0])
            count[0] += entry.significant
            count[1] += 1
        certain = sum(n for n, _ in counts.values())
        listed = "; ".join(f"{name}: {n} of {of}" for name, (n, of) in counts.items() if n)
        parts.append(
            f"{certain} of {len(mine)} differences in {title} are significant"
            + (f" ({listed})." if listed else ".")
        )
    parts.append(
        "The chance of even one false decision in either table is at most "
        f"{100 * comparison.level:g} % (Holm)."
    )
    return " ".join(parts)
