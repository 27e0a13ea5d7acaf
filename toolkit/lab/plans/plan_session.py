"""`toolkit plan session`: from the record in force, or a session, to the next session's loads."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from toolkit.declared import Entry
from toolkit.declared.answers import extended
from toolkit.errors import ConfigError
from toolkit.files import number_of, reads_as_number
from toolkit.lab.answers import document_text, findings_text
from toolkit.lab.plans.plan_sheets import SheetKey, TimingKey, untimed
from toolkit.listing import one_line, or_dash, table
from toolkit.planning.session_plan import PlannedLoad, SessionPlan

if TYPE_CHECKING:
    from datetime import date
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.session.table import Table
    from toolkit.findings import Finding
    from toolkit.planning.fixtures import FeasibleLoads
    from toolkit.planning.row_exchange import Criterion
    from toolkit.report.word.package import Template


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanSessionAnswer(SessionPlan):
    """The plan of a session, and what was written of it."""

    fixtures_refused: Annotated[int, Entry("loads of the fixtures that are beyond a limit")]
    files: Annotated[tuple[str, ...], Entry("that were written")] = ()
    document: SheetKey = None
    timing: TimingKey = field(default_factory=untimed)


FILES = (
    "SESSION.toml",
    "loads.csv",
    "check.csv",
    "sheet.csv",
    "plan.txt",
    "plan.json",
    "plan.docx",
    "plan.pdf",
)
_QUANTITY = r"([-+0-9.eE]++)\s*(\S+)"
_DEMAND = re.compile(rf"\s*(\w+)\s*=\s*{_QUANTITY}\s*(?:\s+at\s+{_QUANTITY}\s*)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanOrder:
    """What a session's plan is asked for; ``demands`` are texts such as ``FY=20 N``.

    ``calibration`` names a record in place of the one in force, ``machine`` a definition that states what can
    be loaded, in place of the packaged one of the instrument's name.
    """

    instrument: str
    session: Path | None = None
    calibration: str | None = None
    draft: bool = False
    fixtures: Path | None = None
    machine: str | None = None
    demands: tuple[str, ...] = ()
    minutes: float | None = None
    loads: int | None = None
    criterion: Criterion = "D"
    two_levels: bool = False
    seed: int = 0
    on: date | None = None
    known_at: date | None = None
    out: Path | None = None
    template: Template | None = None


def session_plan_answer(registry: Registry, order: PlanOrder) -> tuple[PlanSessionAnswer, str, list[Finding]]:
    """Return a plan as an answer and as text, with its findings; the files of ``order.out`` are written.

    Raises
    ------
    ToolkitError
        nothing applies, fixtures or demands cannot be used, no plan keeps them; nothing is written
    """
    from toolkit.lab.plans.plan_sheets import session_sheet, write_plan
    from toolkit.planning.knowledge import Knowledge
    from toolkit.planning.session_plan import plan_session
    from toolkit.planning.session_search import Demand

    if order.out is not None:
        _refuse_filled(order.out)
    if order.minutes is not None and not order.minutes > 0:
        raise _wrong("a time cannot be used", "--minutes", order.minutes, "minutes above 0")
    record, loads, check, text, notes = _basis(registry, order)
    demands = [_demand(record, entry) for entry in order.demands]
    demand = Demand(
        U=tuple((load, U) for load, U, _ in demands),
        at=tuple((load, at) for load, _, at in demands if at is not None), minutes=order.minutes,
        loads=order.loads, criterion=order.criterion, seed=order.seed, two_levels=order.two_levels,
    )  # fmt: skip
    if len({name for name, _ in demand.U}) < len(demand.U):
        raise _wrong("a load is asked for twice", "--u", ", ".join(order.demands), "each load once")
    feasible = _feasible(record, loads, check, order)
    plan = plan_session(Knowledge.of(record, loads, check), feasible, demand)
    plan = dataclasses.replace(plan, findings=(*notes, *plan.findings))
    people = plan_text(plan, record)
    answer = extended(PlanSessionAnswer, plan, fixtures_refused=feasible.refused)
    if order.out is not None:
        files = _files(plan, record, text, people)
        sheet = session_sheet(plan, record, order.known_at or registry.today())
        written = write_plan(files, order.out, sheet, order.template, answer)
        paths = tuple(str(order.out / name) for name in files)
        answer = dataclasses.replace(answer, document=written, files=paths)
        people += "\n\n" + "\n".join(f"written: {one_line(path)}" for path in paths)
        people += document_text(written)
    return answer, people, list(plan.findings)


def _feasible(
    record: CalibrationRecord, loads: Table, check: Table | None, order: PlanOrder
) -> FeasibleLoads:
    """Return what can be loaded: by a file of fixtures, else by the machine's definition, else as before."""
    from toolkit.calibration.registry.judgement import machine_of
    from toolkit.declared import read
    from toolkit.machine.hub import LoadingFixtures
    from toolkit.planning.fixtures import loads_of_fixtures, loads_of_record

    machine = machine_of(record.instrument, order.machine)
    rated = {} if machine is None else dict(machine.rated_loads)
    if order.fixtures is not None:
        stated = read(LoadingFixtures, order.fixtures)
        if stated.instrument != record.instrument:
            raise _wrong(
                "the fixtures are another instrument's", order.fixtures, stated.instrument, record.instrument
            )
        return loads_of_fixtures(stated, record, order.fixtures, rated)
    if machine is not None and machine.loading is not None:
        where = order.machine or f"the machine definition {machine.name}"
        return loads_of_fixtures(machine.loading, record, where, rated)
    if order.machine is not None:
        raise _wrong(
            "the machine definition states no fixtures", order.machine, "no [loading]",
            "[loading] with one [[loading.fixture]] or more, as docs/formats/machine_definition.md has it",
        )  # fmt: skip
    return loads_of_record(record, [loads] + ([] if check is None else [check]))


def _basis(
    registry: Registry, order: PlanOrder
) -> tuple[CalibrationRecord, Table, Table | None, bytes, tuple[Finding, ...]]:
    """Return record, reference and check loads, the session's text, and what is said against the record."""
    from toolkit.calibration.control.calibrate import rehearse
    from toolkit.calibration.registry.standing import standing
    from toolkit.calibration.registry.stored import stored_check, stored_loads, stored_session
    from toolkit.findings import Finding

    if order.session is not None and order.calibration is not None:
        raise _wrong(
            "a plan starts from a session or from a record", "--session, --calibration",
            f"{order.session}, {order.calibration}", "one of them",
        )  # fmt: skip
    if order.session is not None:
        candidate = rehearse(order.session, registry)
        session = candidate.fit.session
        if session.instrument != order.instrument:
            raise _wrong(
                "the session is another instrument's", order.session, session.instrument, order.instrument
            )
        return candidate.record, session.table, session.check, session.session_bytes, ()
    stands = standing(
        registry, order.instrument, on=order.on or registry.today(), known_at=order.known_at,
        named=order.calibration,
    )  # fmt: skip
    # A session is planned from a record that has expired too: that is when it is due.
    reasons = () if order.calibration is None else stands.use(draft=order.draft).draft_reasons
    record = stands.record
    notes = tuple(Finding(rule="draft", where=record.id, level="note", message=text) for text in reasons)
    loads = stored_loads(registry.folder, record)
    if loads is None:
        raise ConfigError(
            "the record has no data to plan from", where=record.id, got="a legacy import",
            expected="a record that was fitted from reference loads",
            next_step="plan from a session of its kind with --session", rule="plan-record",
        )  # fmt: skip
    session = stored_session(registry.folder, record)
    return record, loads, stored_check(registry.folder, record), session.session_bytes, notes


def _demand(record: CalibrationRecord, text: str) -> tuple[str, float, float | None]:
    """Read ``FY=20 N`` or ``FY=20 N at 4 kN`` into the load, U and the load of it, in the record's unit."""
    from toolkit.planning.demands import LARGEST, factor_to

    match = _DEMAND.fullmatch(text)
    names = [fit.load for fit in record.loads]
    if match is None or match[1] not in names:
        raise _wrong(
            "an uncertainty cannot be read",
            "--u",
            text,
            f'LOAD=NUMBER UNIT or LOAD=NUMBER UNIT at NUMBER UNIT, such as "{names[0]}=1 '
            f'{record.loads[0].unit}", of {", ".join(names)}',
        )
    fit = record.load(match[1])

    def in_own(number: str, name: str) -> float:
        factor = factor_to(fit.unit, name)
        if factor is None:
            raise _wrong("a demand has no unit that fits", "--u", text, f"{fit.unit}, or one like it")
        value = number_of(number)
        return math.nan if value is None else value * factor

    value = in_own(match[2], match[3])
    if not 0 < value <= LARGEST:
        raise _wrong("an uncertainty cannot be used", "--u", text, f"a number above 0, {LARGEST:g} at most")
    at = None if match[4] is None else in_own(match[4], match[5])
    if at is not None and not (math.isfinite(at) and at):
        raise _wrong("a load cannot be used", "--u", text, "a finite load other than 0")
    return fit.load, value, at


def _refuse_filled(out: Path) -> None:
    present = [name for name in FILES if (out / name).exists()]
    if present:
        raise ConfigError(
            "the folder has a plan, and perhaps its readings", where=out, got=", ".join(present),
            expected="a folder without these files", next_step="name another folder with --out",
            rule="plan-exists",
        )  # fmt: skip


def plan_text(plan: SessionPlan, record: CalibrationRecord) -> str:
    """Return a plan for people: what it is expected to give, the loads in their order, what it rests on."""
    from toolkit.estimate import round_uncertainty

    time = "" if plan.minutes is None else f", {plan.minutes:.0f} minutes with the check loads"
    lines = [
        f"{plan.instrument}: {len(plan.rows)} loads in {plan.runs} runs, {len(plan.check)} check loads{time}",
        f"from {plan.source}; {plan.record} took {plan.rows_today} loads and {plan.check_today} check loads",
        "",
        table(
            ["load", "at", "U today", "repeated", "U asked", "U expected", "U planned", "in 9 of 10",
             "reached in", ""],
            [
                [load.load, f"{load.at:.5g}", round_uncertainty(load.U_today),
                 round_uncertainty(load.U_repeated),
                 or_dash(load.U_asked, ".3g"),
                 round_uncertainty(load.U_expected), round_uncertainty(load.U),
                 round_uncertainty(load.U_in_nine_of_ten),
                 "-" if load.share is None else f"{100 * load.share:.0f} %", load.unit]
                for load in plan.outlook
            ],
            align="<>>>>>>>><",
        ),
        "'expected': runs differ as the record says; 'planned': by a standard error more, as for 'repeated', "
        "what the last session's loads are to give another time",
        "U at the load of column 'at', k for 95 %; 'in 9 of 10', 'reached in': of "
        f"{plan.simulated} simulations",
        "",
        table(
            ["", "run", "mount", "load", "direction", *(f"{fit.load} [{fit.unit}]" for fit in record.loads)],
            [_row(number, row) for number, row in enumerate(plan.rows, start=1)],
            align="><<<<" + ">" * len(record.loads),
        ),
        "",
        "check loads, after the runs:",
        table(
            ["", "mount", "load", *(f"{fit.load} [{fit.unit}]" for fit in record.loads)],
            [[str(number), row.mount, row.label, *(f"{value:.5g}" for value in row.loads)]
             for number, row in enumerate(plan.check, start=1)],
            align="><<" + ">" * len(record.loads),
        ),
        "",
        "it assumes:", *(f"  {text}" for text in plan.assumptions),
        "it gives up:", *(f"  {text}" for text in plan.gives_up),
    ]  # fmt: skip
    told = findings_text(plan.findings)
    return "\n".join([*lines, *([told] if told else [])])


def _row(number: int, row: PlannedLoad) -> list[str]:
    return [str(number), str(row.run), row.mount, row.label, row.direction, *(f"{v:.5g}" for v in row.loads)]


def _files(plan: SessionPlan, record: CalibrationRecord, session: bytes, people: str) -> dict[str, str]:
    return {
        "SESSION.toml": _session_text(session, plan),
        "loads.csv": _data_text(record, plan.rows, runs=True),
        "check.csv": _data_text(record, plan.check, runs=False),
        "sheet.csv": _sheet_text(record, plan),
        "plan.txt": people + "\n",
    }


def _session_text(session: bytes, plan: SessionPlan) -> str:
    """Return the next session's file: the last one's statements, without what is read anew."""
    from toolkit.declared import toml_text
    from toolkit.files import parse_toml

    entries = parse_toml(session, where=plan.record, entered=True)
    for key in ("creep", "certificate", "phase"):
        entries.pop(key, None)
    if isinstance(entries.get("zero"), list):
        entries.pop("zero")
    elif isinstance(entries.get("zero"), dict):
        entries["zero"] = entries["zero"].get("fit", "included")
    check = entries.get("check")
    entries["check"] = {**check, "file": "check.csv"} if isinstance(check, dict) else "check.csv"
    entries |= {"date": "", "operator": "", "data": "loads.csv"}
    kept = [name for name in ("temperature", "polarity") if name in entries]
    return (
        f"# Planned from {plan.record}. Fill in date and operator, the readings in loads.csv and check.csv,\n"
        "# and the loads where others were put on; then: toolkit calibrate SESSION.toml\n"
        + (
            f"# {' and '.join(kept)}: as {plan.record} has it; state what this session finds\n"
            if kept
            else ""
        )
        + toml_text(entries)
    )


def _data_text(record: CalibrationRecord, rows: Sequence[PlannedLoad], *, runs: bool) -> str:
    cells = [f"{cell.name} [{cell.column_unit or cell.unit}]" for cell in record.cells]
    loads = [f"{fit.load} [{fit.unit}]" for fit in record.loads]
    lines = [
        [*("" for _ in cells), *(_number(value) for value in row.loads),
         *([str(row.run), row.direction] if runs else []), f"{row.mount} {row.label}".strip()]
        for row in rows
    ]  # fmt: skip
    return _csv([[*cells, *loads, *(["run", "direction"] if runs else []), "comment"], *lines])


def _sheet_text(record: CalibrationRecord, plan: SessionPlan) -> str:
    """Return the operator's sheet: every step in its order, with room for the readings."""
    from toolkit.lab.plans.plan_sheets import operator_steps

    cells = [f"{cell.name} [{cell.column_unit or cell.unit}]" for cell in record.cells]
    head = [
        "step",
        "run",
        "what to do",
        *(f"{fit.load} [{fit.unit}]" for fit in record.loads),
        *cells,
        "time",
    ]
    lines = []
    for number, (run, action, row) in enumerate(operator_steps(plan), start=1):
        loads = [""] * len(record.loads) if row is None else [_number(value) for value in row.loads]
        lines.append([str(number), run, action, *loads, *("" for _ in cells), ""])
    return _csv([head, *lines])


def _number(value: float) -> str:
    return repr(float(f"{value:.7g}") + 0.0)


def _csv(rows: Sequence[Sequence[str]]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(
        # A text that a spreadsheet would take for a formula is none: a direction such as +FY.
        [
            f" {cell}"
            if cell[:1] in ("=", "@", "+") or (cell[:1] == "-" and not reads_as_number(cell))
            else cell
            for cell in row
        ]
        for row in rows
    )
    return stream.getvalue()


def _wrong(problem: str, where: object, actual: object, expected: str) -> ConfigError:
    return ConfigError(
        problem, where=where, got=actual, expected=expected, next_step="correct it; nothing was written",
        rule="plan-demand",
    )  # fmt: skip
