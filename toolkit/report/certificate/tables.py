"""A certificate's tables and pictures, each declared with what builds it.

Numbers in tables are texts, rounded to their uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

from toolkit.estimate import round_to_uncertainty, round_uncertainty
from toolkit.files import reads_as_number
from toolkit.listing import or_dash
from toolkit.report.certificate.content import CERTIFICATE, GAP, signed
from toolkit.report.certificate.model import MOST_FIGURES, Certificate, LoadResult
from toolkit.report.certificate.statements import VERDICTS
from toolkit.report.content import Cell, Curve, Plot
from toolkit.report.document import DeclaredTable, Rows
from toolkit.report.style import Style
from toolkit.units import printed

# Columns of names: a serial number such as 12.5 stays what it is.
_NAMES = {"cell", "serial", "load", "term", "unit", "found_by", "row"}

Texts = Iterable[Sequence[str]]
Build = Callable[[Certificate], Texts]


def _table(name: str, description: str, columns: str) -> Callable[[Build], DeclaredTable[Certificate]]:
    """Declare a table whose numbers are texts: only the decimal sign is the organisation's."""

    def declare(build: Build) -> DeclaredTable[Certificate]:
        names = [line.strip().partition("|")[0] for line in columns.strip().splitlines()]

        def rows(c: Certificate, style: Style) -> Rows:
            return (_localised(row, names, style) for row in build(c))

        return CERTIFICATE.table(name, description, columns)(rows)

    return declare


def _localised(row: Sequence[str], names: Sequence[str], style: Style) -> tuple[Cell, ...]:
    return tuple(
        signed(cell, style) if name not in _NAMES and reads_as_number(cell) else cell
        for name, cell in zip(names, row, strict=True)
    )


def _dof(dof: float) -> str:
    return f"{dof:.0f}" if math.isfinite(dof) and dof < 1e4 else "∞"


@_table(
    "cells",
    "the indications: one row a cell",
    """
    cell|name
    serial|serial number
    unit|unit of its indication
    minimum|smallest indication of the fitted data
    maximum|largest indication of the fitted data
    resolution|resolution, where it was stated
    """,
)
def cells(c: Certificate) -> Texts:
    """Return the indications."""
    for cell in c.record.cells:
        ends = or_dash(cell.minimum, ".6g"), or_dash(cell.maximum, ".6g")
        resolution = c.statements.cell(cell.name).stated_resolution
        yield cell.name, cell.serial or GAP, printed(cell.unit), *ends, or_dash(resolution, ".6g")


@_table(
    "coefficients",
    "the equation of every load: one row a term",
    """
    load|load
    term|term
    full|coefficient in full precision
    issued|coefficient as issued
    standard_error|standard error
    unit|unit of the load for one unit of the term
    """,
)
def coefficients(c: Certificate) -> Texts:
    """Return the terms of every load."""
    for load in c.loads:
        for t in load.terms:
            error = round_uncertainty(t.standard_error)
            yield load.load, t.term, repr(t.full), t.issued, error, printed(t.unit)


@_table(
    "uncertainty",
    "expanded uncertainty at full scale and over the range",
    """
    load|load
    at|value of the load
    percent_fs|the same in percent of full scale
    U|expanded uncertainty, at most two significant digits
    unit|unit of load and uncertainty
    k|coverage factor
    p|coverage probability in percent
    dof|effective degrees of freedom
    """,
)
def uncertainty(c: Certificate) -> Texts:
    """Return the expanded uncertainty of every load over its range."""
    for load in c.loads:
        full = max(map(abs, load.ends))
        for at in load.range:
            yield (
                load.load, round_to_uncertainty(at.at, at.U), f"{100 * at.at / full:.0f}",
                round_uncertainty(at.U), printed(load.unit), f"{at.k:.2f}", f"{100 * at.probability:g}",
                _dof(at.dof),
            )  # fmt: skip


@_table(
    "budget",
    "components of the uncertainty at full scale",
    """
    load|load
    component|component
    evaluation|type A or B
    distribution|distribution
    u|standard uncertainty
    unit|unit
    dof|degrees of freedom
    share|share of the variance in percent
    source|what the figure comes from
    """,
)
def budget(c: Certificate) -> Texts:
    """Return the components that were stated or measured; the statement about U names the others."""
    for load in c.loads:
        for part in load.full_scale.components:
            share = 100 * load.full_scale.share(part)
            if part.stated:
                yield (
                    load.load, part.name, part.type, part.distribution, round_uncertainty(part.u),
                    printed(load.unit), _dof(part.dof), f"{share:.1f}", part.source,
                )  # fmt: skip


@_table(
    "fit",
    "the reference loads and the residuals of the fit: one row a load",
    """
    load|load
    unit|unit
    minimum|smallest reference load
    maximum|largest reference load
    n|number of reference loads
    dof|degrees of freedom
    residual_sd|residual standard deviation
    largest|largest residual, with sign
    """,
)
def fit(c: Certificate) -> Texts:
    """Return the reference loads and residuals of every load."""
    for load in c.loads:
        yield (
            load.load, printed(load.unit), *(f"{end:g}" for end in load.ends), str(len(load.references)),
            str(load.fit.dof or 0), f"{load.fit.residual_sd or 0.0:.3g}",
            f"{max(load.residuals, key=abs):+.3g}",
        )  # fmt: skip


@_table(
    "check",
    "the check loads: reference, result and deviation",
    """
    load|load
    row|number of the check load
    reference|reference load
    result|load from the equation
    deviation|result minus reference
    U|expanded uncertainty of the deviation
    tolerance|tolerance
    unit|unit
    verdict|statement of conformity by the decision rule
    """,
)
def check(c: Certificate) -> Texts:
    """Return the check loads."""
    for load in c.loads:
        for line in load.checks:
            U = line.uncertainty.U
            unstated = "beyond the range" if line.beyond else "not stated"
            yield (
                load.load, str(line.row), f"{line.reference:.10g}", round_to_uncertainty(line.result, U),
                round_to_uncertainty(line.deviation, U), round_uncertainty(U), f"{load.tolerance:.4g}",
                printed(load.unit), VERDICTS[line.verdict] if line.verdict else unstated,
            )  # fmt: skip


@_table(
    "adjustment",
    "before and after adjustment",
    """
    load|load
    found_by|record that was in force when the instrument came in
    as_found|largest deviation as found, by that record
    at|reference load of the largest deviation as found
    as_left|largest deviation of the new equation, check loads where there are some
    tolerance|tolerance
    unit|unit
    U_found|expanded uncertainty of the deviation as found, by the as-found session
    U_left|expanded uncertainty of the deviation as left
    """,
)
def adjustment(c: Certificate) -> Texts:
    """Return the deviations as found and as left, of the loads that have them."""
    for load in c.loads:
        if (change := load.adjustment) is None:
            continue
        as_left, left_U = "not measured", "-"
        if change.as_left is not None and change.left is not None:
            as_left, left_U = (
                round_to_uncertainty(change.as_left, change.left.U),
                round_uncertainty(change.left.U),
            )
        U = change.found.U
        yield (
            load.load, change.found_by, round_to_uncertainty(change.as_found, U), f"{change.found.at:.6g}",
            as_left, f"{load.tolerance:.4g}", printed(load.unit), round_uncertainty(U), left_U,
        )  # fmt: skip


@_table(
    "unverifiable",
    "terms that the check loads could not verify",
    """
    load|load
    term|term
    """,
)
def unverifiable(c: Certificate) -> Texts:
    """Return the load and the term of each."""
    return c.unverifiable


FIGURES = {
    f"residuals_{at}": f"residuals of load {at} over the load, with tolerance, uncertainty and check loads"
    for at in range(1, MOST_FIGURES + 1)
}


@CERTIFICATE.figures(FIGURES)
def residuals(c: Certificate, _style: Style) -> Iterator[Plot]:
    """Return the pictures of the loads, in the units of the record."""
    mark = "DRAFT" if c.draft else "WITHDRAWN" if c.withdrawn else "SIMULATED" if c.simulated else None
    for name, load in zip(FIGURES, c.loads, strict=False):
        yield _plot(name, load, mark)


def _plot(name: str, load: LoadResult, mark: str | None) -> Plot:
    unit = printed(load.unit)
    ends = load.ends
    # A cross-section of the budget between the loads at which it was told is straight enough to draw.
    at = tuple(e.at for e in load.range)
    curves = [
        Curve(label="fitted loads", x=load.references, y=load.residuals, group=0, style="points", open=True)
    ]
    if load.checks:
        curves.append(
            Curve(
                label="check loads",
                x=tuple(line.reference for line in load.checks),
                y=tuple(line.deviation for line in load.checks),
                group=1,
                style="points",
            )
        )
    for side in (1.0, -1.0):
        curves.append(
            Curve(
                label="± tolerance", x=ends, y=(side * load.tolerance,) * 2, group=3, style="line", open=True
            )
        )
        curves.append(
            Curve(label="± U", x=at, y=tuple(side * e.U for e in load.range), group=2, style="line")
        )
    largest = max(load.residuals, key=abs)
    checks = (
        f"; {len(load.checks)} check loads, largest deviation "
        f"{max((line.deviation for line in load.checks), key=abs):+.3g} {unit}"
        if load.checks
        else "; no check loads"
    )
    return Plot(
        name=name,
        x_label=f"{load.load} [{unit}]",
        y_label=f"deviation of {load.load} [{unit}]",
        curves=tuple(curves),
        caption=f"{load.load}: deviation of the equation from the reference loads and from the check loads, "
        f"with the tolerance and the expanded uncertainty U.",
        alt=f"Deviation of {load.load} over {load.load} from {ends[0]:g} to {ends[1]:g} {unit}: "
        f"{len(load.references)} fitted loads, largest residual {largest:+.3g} {unit}{checks}; tolerance "
        f"{load.tolerance:.3g} {unit}, expanded uncertainty at full scale "
        f"{round_uncertainty(load.full_scale.U)} {unit}",
        watermark=mark,
    )
