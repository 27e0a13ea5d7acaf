"""A record and its session: what the gates say, what the fit shows, and the decision.

Every part is the answer of a command: `calibration show`, `history`, `report`, `budget`, `approve`.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from toolkit.calibration.registry.registry import ID
from toolkit.days import parse_day
from toolkit.errors import ConfigError, ToolkitError
from toolkit.lab.desk.chart import Chart, Series
from toolkit.lab.desk.pending import decide as settle_decision
from toolkit.lab.records.decisions import Order
from toolkit.trust.requested import Requested
from toolkit.workbench.bench import Bench, waiting
from toolkit.workbench.page import Routes, page

DECISIONS = ("approve", "withdraw", "discard")


def records(request: Request) -> Response:
    """Return every record by instrument, as the ledgers have it: no record is read."""
    registry = request.app.state.bench.registry
    instruments = []
    for name in registry.instruments():
        damage = registry.ledger(name).damage
        statuses = [] if damage else sorted(registry.statuses(name).values(), key=_newest_first)
        instruments.append((name, damage, statuses))
    return page(request, "records", instruments=instruments)


def _newest_first(status: Any) -> int:
    match = ID.match(status.id)
    return 0 if match is None else -int(match["number"])


def record(request: Request) -> Response:
    """Return a record's page: its state and coefficients, and a place for each part."""
    _, record_id = _requested(request)
    return record_page(request, record_id)


def record_page(
    request: Request,
    record_id: str,
    *,
    status: int = 200,
    outcome: Mapping[str, Any] | None = None,
    typed: Mapping[str, str] | None = None,
    refused: ToolkitError | None = None,
) -> Response:
    """Return the page of a record that a ledger knows; ``refused`` is told at the form of its decision."""
    from toolkit.lab.records.registry_answer import history, shown

    bench: Bench = request.app.state.bench
    instrument = ID.match(record_id)["instrument"]  # type: ignore[index]
    content, _ = shown(bench.registry, record_id, known_at=None)
    events, _ = history(bench.registry.ledger(instrument), instrument, record_id)
    version = bench.registry.people().history.now
    return page(
        request, "record", status=status, content=content, events=events["events"], outcome=outcome,
        parts=tuple(PARTS) if content["record"]["verified"] else ("gates", "responses"), typed=typed or {},
        people=() if version is None else version.people.person, today=bench.today.isoformat(),
        refused=None if refused is None else refused.as_dict(),
        **waiting(bench, record_id),
    )  # fmt: skip


def part(request: Request) -> Response:
    """Return one part of a record's page."""
    bench, record_id = _requested(request)
    name = request.path_params["part"]
    if name not in PARTS:
        raise HTTPException(404)
    instrument = ID.match(record_id)["instrument"]  # type: ignore[index]
    content = bench.remembered(f"{name} {record_id}", instrument, lambda: PARTS[name](bench, record_id))
    return page(request, f"part_{name}", record_id=record_id, **content)


def _gates(bench: Bench, record_id: str) -> dict[str, Any]:
    from toolkit.lab.records.gates_answer import gates_answer
    from toolkit.lab.rules import rules_catalogue

    return {"judged": gates_answer(bench.registry, record_id), "rules": rules_catalogue()}


def _responses(bench: Bench, record_id: str) -> dict[str, Any]:
    from toolkit.lab.records.gates_answer import responses_answer

    return {"compared": responses_answer(bench.registry, record_id)}


def _fit(bench: Bench, record_id: str) -> dict[str, Any]:
    from toolkit.calibration.fit.findings import session_findings
    from toolkit.calibration.fit.session_fit import fit_session
    from toolkit.calibration.registry.stored import stored_session
    from toolkit.lab.records.session_answer import fit_report

    stored = bench.registry.load(record_id)
    fit = fit_session(stored_session(bench.registry.folder, stored))
    loads = fit_report(fit, stored, full=True, figures=None).loads
    units = {load.load: load.unit for load in stored.loads}
    return {
        "loads": loads,
        "units": units,
        "charts": {name: residual_chart(load["rows"], units[name]) for name, load in loads.items()},
        "findings": [finding.as_dict() for finding in session_findings(fit)],
    }


def _budget(bench: Bench, record_id: str) -> dict[str, Any]:
    from toolkit.lab.records.budget import BudgetOrder, budget_answer

    payload, _, _ = budget_answer(bench.registry, record_id, BudgetOrder())
    charts = {name: budget_chart(name, budget) for name, budget in payload["loads"].items()}
    return {"budgets": payload["loads"], "charts": charts, "findings": payload["findings"]}


def _as_found(bench: Bench, record_id: str) -> dict[str, Any]:
    from toolkit.lab.records.gates_answer import as_found_answer

    return {"found": as_found_answer(bench.registry, record_id)}


PARTS: dict[str, Callable[[Bench, str], dict[str, Any]]] = {
    "gates": _gates,
    "responses": _responses,
    "fit": _fit,
    "budget": _budget,
    "as_found": _as_found,
}


def decide(request: Request) -> Response:
    """Decide about a record as the command line does: by name, behind its gates.

    Where people are enrolled the decision is requested: it is signed by their keys, which never come here.
    """
    bench, record_id = _requested(request)
    decision = request.path_params["decision"]
    if decision not in DECISIONS:
        raise HTTPException(404)
    form = {name: value.strip() for name, value in request.state.form.items()}
    try:
        order = _order(decision, record_id, form)
        decision_made = settle_decision(bench.home, bench.registry, record_id, order)
    except Requested:
        return RedirectResponse(f"{bench.keys.place}/record/{record_id}#decision", 303)
    except ToolkitError as error:
        return record_page(request, record_id, status=400, typed=form, refused=error)
    if findings := getattr(decision_made, "findings", ()):
        told = {"findings": [finding.as_dict() for finding in findings]}
        return record_page(request, record_id, status=422, outcome=told, typed=form)
    return RedirectResponse(f"{bench.keys.place}/record/{record_id}", 303)


def _order(decision: str, record_id: str, form: Mapping[str, str]) -> Order:
    if decision == "approve":
        return Order(
            action="approve", record=record_id, since=_day(form, "in_force_from"),
            by=form.get("checked_by", ""), approved_by=form.get("approved_by") or None,
            reason=form.get("reason") or None, recall=form.get("recall") or None,
        )  # fmt: skip
    by, reason = form.get("by", ""), form.get("reason", "")
    if decision == "withdraw":
        return Order(action="withdraw", record=record_id, on=_day(form, "on"), by=by, reason=reason)
    return Order(action="discard", record=record_id, by=by, reason=reason)


def _day(form: Mapping[str, str], name: str) -> dt.date:
    try:
        return parse_day(form.get(name, ""))
    except ValueError as error:
        raise ConfigError(
            "a day cannot be read", where=name.replace("_", " "), got=form.get(name) or "nothing",
            expected="YYYY-MM-DD", next_step="write it as in 2026-03-31; nothing was changed", rule="usage",
        ) from error  # fmt: skip


def _requested(request: Request) -> tuple[Bench, str]:
    """Return the bench and the record of an address: an id that a ledger knows; nothing else has one."""
    bench: Bench = request.app.state.bench
    record_id = request.path_params["record"]
    match = ID.match(record_id)
    if match is None or match["instrument"] not in bench.registry.instruments():
        raise HTTPException(404)
    ledger = bench.registry.ledger(match["instrument"])
    # A damaged ledger knows nothing for sure: the registry refuses the record, and says why.
    if ledger.damage is None and record_id not in ledger.entered():
        raise HTTPException(404)
    return bench, record_id


ROUTES: Routes = (
    ("GET", "/records", records),
    ("GET", "/record/{record}", record),
    ("GET", "/record/{record}/part/{part}", part),
    ("POST", "/record/{record}/decide/{decision}", decide),
)


def residual_chart(rows: Mapping[str, Any], unit: str) -> Chart:
    """Return residuals over the reference load, by direction where the session states it.

    >>> rows = {"reference": [2.0, 1.0, 0.0], "residual": [0.1, -0.1, 0.2], "direction": ["up", "down", "up"]}
    >>> [(series["label"], series["x"], series["y"]) for series in residual_chart(rows, "N")["series"]]
    [('up', [0.0, 2.0], [0.2, 0.1]), ('down', [1.0], [-0.1])]
    """
    senses = rows["direction"] or ["residual"] * len(rows["reference"])
    points = sorted(zip(rows["reference"], rows["residual"], senses, strict=True))
    series: list[Series] = [
        {"label": name, "x": [x for x, _, sense in points if sense == name],
         "y": [y for _, y, sense in points if sense == name]}
        for name in sorted(set(senses), reverse=True)
    ]  # fmt: skip
    return {"x_label": f"reference [{unit}]", "y_label": f"residual [{unit}]", "series": series}


def budget_chart(load: str, budget: Mapping[str, Any]) -> Chart:
    """Return U over the range of a load."""
    unit, points = budget["unit"], budget["range"]
    U: Series = {"label": "U", "x": [p["value"] for p in points], "y": [p["U"] for p in points], "line": True}
    return {"x_label": f"{load} [{unit}]", "y_label": f"U [{unit}]", "series": [U]}
