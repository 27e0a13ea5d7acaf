"""The uncertainty budget of a record's loads: at a load or at indications, over the range, by trials."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

from toolkit.calibration.uncertainty.monte_carlo import MonteCarloCheck
from toolkit.declared.answers import entry_of
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import number_of
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import finding_lines
from toolkit.listing import table

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.session.table import Table
    from toolkit.calibration.uncertainty.model import Budget, Temperature


class BudgetComponent(TypedDict):
    """A component of a load's uncertainty."""

    name: str
    description: str
    type: Annotated[str, "A or B"]
    distribution: str
    u: Annotated[float, "standard uncertainty, in the load's unit"]
    dof: Annotated[float | None, "null where it is known beforehand"]
    share: Annotated[float, "of the combined variance"]
    source: str
    stated: Annotated[bool, "false where nobody stated it"]


class RangePoint(TypedDict):
    """The uncertainty at one load of the range."""

    value: float
    u: float
    k: float
    U: float


class LoadBudget(TypedDict):
    """The uncertainty of one load at one value."""

    unit: str
    value: float
    indications: list[float]
    components: list[BudgetComponent]
    u: float
    dof: float | None
    k: float
    U: float
    U_rounded: str
    probability: float
    not_stated: list[str]
    range: list[RangePoint]
    monte_carlo: MonteCarloCheck | None


class BudgetAnswer(TypedDict):
    """The uncertainty of a record's loads."""

    record: str
    sha256: str
    loads: Annotated[Mapping[str, LoadBudget], "by load"]
    figure: Path | None
    findings: list[FindingEntry]


RANGE_POINTS = 11


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetOrder:
    """What a budget is asked for: one ``load`` or all, ``at`` a load value or at ``indications``.

    ``trials`` of Monte Carlo check it, 0 until they settle, None without; ``digits`` of u count then.
    ``figure`` takes shares and U over the range.
    """

    load: str | None = None
    at: str | None = None
    indications: str | None = None
    temperature: Temperature | None = None
    trials: int | None = None
    seed: int = 0
    digits: int = 2
    figure: Path | None = None


def budget_answer(
    registry: Registry, record_id: str, order: BudgetOrder
) -> tuple[BudgetAnswer, str, list[Finding]]:
    """Return the budgets of a record's loads as JSON, as text, and their findings.

    Raises
    ------
    ToolkitError
        the record has no data; the load, the value or the indications cannot be used
    """
    from toolkit.calibration.registry.stored import stored_check, stored_loads

    record = registry.load(record_id)
    rows, check = stored_loads(registry.folder, record), stored_check(registry.folder, record)
    if rows is None:
        raise _wrong(
            "the record has no data to make a budget of",
            record_id,
            "a legacy import",
            "a record that was fitted from reference loads",
            "calibrate the instrument from a session",
        )
    load, at, indications = order.load, order.at, order.indications
    if at is not None and (indications is not None or (load is None and len(record.loads) > 1)):
        raise _wrong("--at needs one load, and no --indications", "--at", at, "--load NAME --at VALUE")
    names = [load] if load is not None else [fit.load for fit in record.loads]
    if order.figure is not None and len(names) > 1:
        raise _wrong("a figure shows one load", "--figure", ", ".join(names), "--load NAME")
    budgets = []
    findings: list[Finding] = []
    for name in names:
        budget, own_findings = _budget(record, rows, check, name, at, indications, order.temperature)
        result = None
        if order.trials is not None:
            from toolkit.calibration.uncertainty.monte_carlo import monte_carlo

            result = monte_carlo(
                record, rows, budget, trials=order.trials or None, seed=order.seed, digits=order.digits
            )
            own_findings += _not_validated(record, budget, result)
        budgets.append((budget, _over_range(record, rows, check, name, order.temperature), result))
        findings += own_findings
    written = None
    if order.figure is not None:
        from toolkit.report.calibration.chart_figures import write_figure

        written = write_figure(order.figure, budgets[0][0], budgets[0][1])
    payload: BudgetAnswer = {
        "record": record_id,
        "sha256": record.sha256,
        "loads": {budget.load: _payload(budget, curve, result) for budget, curve, result in budgets},
        "figure": written,
        "findings": [finding.as_dict() for finding in findings],
    }
    lines = [line for budget, curve, result in budgets for line in _lines(budget, curve, result)]
    lines += [*finding_lines(findings), *([f"written: {written}"] if written else [])]
    return payload, "\n".join(lines), findings


def _budget(
    record: CalibrationRecord,
    rows: Table,
    check: Table | None,
    name: str,
    at: str | None,
    indications: str | None,
    temperature: Temperature | None,
) -> tuple[Budget, list[Finding]]:
    from toolkit.calibration.uncertainty.budget import calibration_budget, predict

    if indications is None:
        value = None if at is None else _value(at, record.load(name))
        return calibration_budget(record, rows, check, name, value, temperature=temperature), []
    prediction = predict(record, rows, check, name, values_of(indications), temperature=temperature)
    findings = [
        Finding(rule="beyond-range", where=f"{record.id}, {cell}",
                message="the indication lies beyond those of the calibration: the record extrapolates")
        for cell in prediction.beyond
    ]  # fmt: skip
    return prediction.budget, findings


def _over_range(
    record: CalibrationRecord, rows: Table, check: Table | None, name: str, temperature: Temperature | None
) -> tuple[Budget, ...]:
    from toolkit.calibration.uncertainty.budget import calibration_budget

    fit = record.load(name)
    low, high = fit.interval
    # The ends as they are: a rounded one could lie outside the range.
    steps = [low + (high - low) * i / (RANGE_POINTS - 1) for i in range(RANGE_POINTS - 1)] + [high]
    return tuple(calibration_budget(record, rows, check, name, x, temperature=temperature) for x in steps)


def _not_validated(record: CalibrationRecord, budget: Budget, result: MonteCarloCheck) -> list[Finding]:
    if result.validated:
        return []
    off = max(result.low_difference, result.high_difference)
    why = f"the ends of the intervals differ by {off:.3g} {budget.unit}, the tolerance is {result.delta:g}"
    if not result.stable:
        why += "; the trials did not settle"
    return [Finding(rule="monte-carlo", where=f"{record.id}, {budget.load}", message=why)]


def _payload(budget: Budget, curve: tuple[Budget, ...], result: MonteCarloCheck | None) -> LoadBudget:
    from toolkit.estimate import round_uncertainty

    return entry_of(
        LoadBudget, budget,
        value=budget.at, U_rounded=round_uncertainty(budget.U), monte_carlo=result,
        components=[
            entry_of(BudgetComponent, component, share=budget.share(component))
            for component in budget.components
        ],
        range=[entry_of(RangePoint, point, value=point.at) for point in curve],
    )  # fmt: skip


def _lines(budget: Budget, curve: tuple[Budget, ...], result: MonteCarloCheck | None) -> list[str]:
    from toolkit.estimate import dof_text, round_to_uncertainty, round_uncertainty

    unit = budget.unit
    stated = [component for component in budget.components if component.stated]
    largest = max((component.u for component in budget.components), default=0.0)
    lines = [
        f"{budget.record}  {budget.load} = {round_to_uncertainty(budget.at, budget.U)} {unit}",
        "",
        table(
            ["component", "type", "distribution", f"u [{unit}]", "dof", "share", "", "from"],
            [
                [component.name, component.type, component.distribution, f"{component.u:.3g}",
                 dof_text(component.dof), f"{100 * budget.share(component):.1f} %",
                 _bar(component.u, largest), component.description]
                for component in stated
            ],
            align="<<<>>><<",
        ),
        "",
        f"combined standard uncertainty  u = {round_uncertainty(budget.u)} {unit}, "
        f"effective dof {dof_text(budget.dof)}",
        f"expanded uncertainty           U = {round_uncertainty(budget.U)} {unit}, k = {budget.k:.2f}, "
        f"coverage probability {100 * budget.probability:.0f} %",
    ]  # fmt: skip
    silent = [component for component in budget.components if not component.stated]
    if silent:
        lines += ["", "not stated, and therefore not in U:"]
        lines += [f"  {component.name:<16}{component.description}" for component in silent]
    if result is not None:
        verdict = "validated" if result.validated else "NOT VALIDATED"
        lines += [
            "",
            f"Monte Carlo, {result.trials} trials, seed {result.seed}: "
            f"u = {round_uncertainty(result.u)} {unit}",
            f"  interval {result.low:.7g} to {result.high:.7g}, budget {result.budget_low:.7g} to "
            f"{result.budget_high:.7g}",
            f"  ends differ by {result.low_difference:.2g} and {result.high_difference:.2g}, tolerance "
            f"{result.delta:g} ({result.digits} digits of u): {verdict}",
        ]
    over = [
        [f"{point.at:.6g}", round_uncertainty(point.u), f"{point.k:.2f}", round_uncertainty(point.U)]
        for point in curve
    ]
    head = [f"{budget.load} [{unit}]", "u", "k", f"U [{unit}]"]
    return [*lines, "", "over the range:", table(head, over, align=">>>>"), ""]


def _bar(u: float, largest: float) -> str:
    return "" if not largest else "#" * max(round(12 * u / largest), 1 if u else 0)


def _value(text: str, fit: LoadFit) -> float:
    """Read ``VALUE`` or ``VALUEunit`` into the load's unit."""
    import re

    from toolkit.units import si_scale, unit

    match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*)?", text)
    if match is None:
        raise _wrong(
            "a load value cannot be read", "--at", text, f"a number, or one with a unit: 500{fit.unit}"
        )
    value = float(match[1])
    if match[2] is None:
        return value
    load_unit = unit(fit.unit)
    return value * si_scale(match[2].strip(), load_unit.dimension, where="--at") / load_unit.factor


def values_of(text: str, where: str = "--indications") -> dict[str, float]:
    """Return numbers by name from the words ``A=1,B=-2`` of a command line."""
    indications: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = part.partition("=")
        value = number_of(number)
        if value is None:
            raise _wrong(
                "an indication cannot be read", where, part, "NAME=NUMBER,...",
                "write each number with a decimal point, and a comma between them alone",
            )  # fmt: skip
        if name.strip() in indications:
            raise _wrong("an indication is given twice", where, name.strip(), "each of them once")
        indications[name.strip()] = value
    return indications


def temperature_of(span: float | None, coefficient: float | None) -> Temperature | None:
    """Return the temperature conditions of use, None where no range is given [K, 1/K]."""
    from toolkit.calibration.uncertainty.model import Temperature

    if span is None:
        if coefficient is not None:
            raise _wrong("a temperature coefficient needs the range of use", "--temperature-coefficient",
                         coefficient, "--temperature-range K beside it")  # fmt: skip
        return None
    if not (math.isfinite(span) and span >= 0 and math.isfinite(coefficient or 0.0)):
        raise _wrong("a temperature cannot be used", "--temperature-range", span, "a number, zero or more")
    return Temperature(half_range_K=span, coefficient_per_K=coefficient)


def _wrong(
    problem: str,
    where: str,
    actual: object,
    expected: str,
    next_step: str = "see 'toolkit calibration budget --help'",
) -> ToolkitError:
    return ConfigError(
        problem, where=where, got=actual, expected=expected, next_step=next_step, rule="budget"
    )
