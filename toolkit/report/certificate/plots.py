"""The picture of a load: residuals over the load, with tolerance, expanded uncertainty and check loads."""

from __future__ import annotations

from toolkit.estimate import round_uncertainty
from toolkit.report.certificate.model import Certificate, LoadResult
from toolkit.report.certificate.vocabulary import FIGURES
from toolkit.report.content import Curve, Plot

DRAFT = "DRAFT"


def build_plots(certificate: Certificate) -> dict[str, Plot]:
    """Return the pictures by name, one a load, in the units of the record."""
    mark = DRAFT if certificate.draft else "WITHDRAWN" if certificate.withdrawn else None
    if mark is None and certificate.simulated:
        mark = "SIMULATED"
    return {name: _plot(name, one, mark) for name, one in zip(FIGURES, certificate.loads, strict=False)}


def _plot(name: str, one: LoadResult, mark: str | None) -> Plot:
    unit = one.unit.replace("*", "·")
    ends = (one.minimum, one.maximum)
    # A cross-section of the budget between the loads at which it was told is straight enough to draw.
    at = tuple(e.at for e in one.range)
    curves = [
        Curve(label="fitted loads", x=one.references, y=one.residuals, group=0, style="points", open=True)
    ]
    if one.checks:
        curves.append(
            Curve(
                label="check loads",
                x=tuple(line.reference for line in one.checks),
                y=tuple(line.deviation for line in one.checks),
                group=1,
                style="points",
            )
        )
    for side in (1.0, -1.0):
        curves.append(
            Curve(
                label="± tolerance", x=ends, y=(side * one.tolerance,) * 2, group=3, style="line", open=True
            )
        )
        curves.append(Curve(label="± U", x=at, y=tuple(side * e.U for e in one.range), group=2, style="line"))
    largest = max(one.residuals, key=abs)
    checks = (
        f"; {len(one.checks)} check loads, largest deviation "
        f"{max((line.deviation for line in one.checks), key=abs):+.3g} {unit}"
        if one.checks
        else "; no check loads"
    )
    return Plot(
        name=name,
        x_label=f"{one.load} [{unit}]",
        y_label=f"deviation of {one.load} [{unit}]",
        curves=tuple(curves),
        caption=f"{one.load}: deviation of the equation from the reference loads and from the check loads, "
        f"with the tolerance and the expanded uncertainty U.",
        alt=f"Deviation of {one.load} over {one.load} from {one.minimum:g} to {one.maximum:g} {unit}: "
        f"{one.n} fitted loads, largest residual {largest:+.3g} {unit}{checks}; tolerance "
        f"{one.tolerance:.3g} {unit}, expanded uncertainty at full scale "
        f"{round_uncertainty(one.full_scale.U)} {unit}",
        watermark=mark,
    )
