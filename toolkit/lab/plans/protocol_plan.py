"""`toolkit plan test`: from an earlier test or a tire file to the plan, its protocol and its simulation."""

from __future__ import annotations

import dataclasses
import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from toolkit.declared import Entry
from toolkit.declared.answers import extended
from toolkit.errors import ConfigError
from toolkit.files import real_path
from toolkit.findings import FindingEntry
from toolkit.lab.answers import document_text
from toolkit.lab.plans.plan_sheets import SheetKey, TimingKey, untimed
from toolkit.lab.tire_tests.resolve import Basis, Resolved, resolve_test
from toolkit.listing import table
from toolkit.planning.demands import Demand, PrintedUnits, load_of, nominal_loads
from toolkit.planning.protocol_plan import PlannedValue, ProtocolPlan

if TYPE_CHECKING:
    from toolkit.machine import Machine
    from toolkit.planning.expectation import EarlierTest
    from toolkit.report.word.package import Template
    from toolkit.simulation.plan import Plan

_TIRE_FILES = (".tir", ".toml")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanTestAnswer(ProtocolPlan):
    """The plan of a test, and what was written of it."""

    out: Annotated[Path | None, Entry("folder of the plan's files; null where none was named")]
    files: Annotated[Mapping[str, str], Entry("by what they are for")]
    findings: Annotated[tuple[FindingEntry, ...], Entry("what is to be known of it")] = ()
    document: SheetKey = None
    timing: TimingKey = field(default_factory=untimed)


PROTOCOL, SIMULATION = "protocol.toml", "plan.toml"
DEMANDS = ("slope_cornering", "conicity", "plysteer", "peak")
LONGEST_PAUSE_S = 86400.0
"""From one recording of a test to the next: what takes longer is another test."""
_SIMULATED = 3  # tests of a tire file: the scatter of one alone is not sure


@dataclass(frozen=True, slots=True, kw_only=True)
class ProtocolOrder:
    """What `plan_test` is asked for: texts of demands, loads and spreads, earlier tests or tires, the time.

    Without ``like`` it is the published tire of the virtual machine, and with it the class of passenger tires
    where no ``spread`` is stated; ``between_files_s`` None is the virtual machine's pause.
    """

    like: tuple[Path, ...] = ()
    spread: tuple[str, ...] = ()
    demands: tuple[str, ...] = ()
    loads: tuple[str, ...] = ()
    minutes: float = math.inf
    between_files_s: float | None = None
    sliding_kJ: float = math.inf
    rise_K: float = math.inf
    basis: Basis = field(default_factory=Basis)


def plan_test(
    order: ProtocolOrder,
    out: Path | None = None,
    *,
    template: Template | None = None,
    tell: Callable[[str], None] = lambda _text: None,
) -> tuple[PlanTestAnswer, str]:
    """Return the answer of a plan and its text; write the files of a plan into ``out``, its
    sheet by a template too.

    Raises
    ------
    ConfigError
        ``plan-demand``, ``plan-load``, ``plan-like``; ``plan-infeasible`` with the nearest plan that is
        feasible: then nothing is written; ToolkitError: the earlier test cannot be used
    """
    from datetime import date

    from toolkit.lab.plans.plan_sheets import protocol_sheet, write_plan
    from toolkit.planning.demands import parse_demand, units_of
    from toolkit.planning.protocol_plan import plan_protocol
    from toolkit.planning.protocol_search import shared_loads
    from toolkit.planning.tire_class import parse_spread
    from toolkit.planning.tread import Tread

    spread = parse_spread(order.spread)
    demands = tuple(dict.fromkeys(parse_demand(text) for text in order.demands or DEMANDS))
    labels = [demand.label for demand in demands]
    _refuse_doubled(labels, where="--u", what="a characteristic has two demands")
    _refuse_doubled([str(like) for like in order.like], where="--like", what="a tire is named twice")
    _refuse_without_room(order)
    _refuse_before_a_test(order, demands)
    tell("the earlier test")
    tires, like, tire = _tires(order, spread)
    own = tires[0].machine
    tread = dataclasses.replace(
        Tread.of(own, tires, between_files_s=order.between_files_s),
        energy_J=1e3 * order.sliding_kJ, rise_K=order.rise_K,
    )  # fmt: skip
    plan = plan_protocol(
        tires, demands, nominal_loads(order.loads, shared_loads(tires)), machine=own, like=like,
        minutes=order.minutes, tread=tread, tell=tell,
    )  # fmt: skip
    if not plan.feasible:
        raise _beyond(plan, order) or _infeasible(plan, order.minutes)
    answer = extended(PlanTestAnswer, plan, out=out, files={})
    units = units_of(own.protocol)
    if out is not None:
        answer = dataclasses.replace(answer, files={"protocol": PROTOCOL, "simulation": SIMULATION})
        sheet = protocol_sheet(plan, date.today(), units)  # noqa: DTZ011
        written = write_plan(_files(plan, own, tire, out), out, sheet, template, answer)
        answer = dataclasses.replace(answer, document=written)
    return answer, plan_text(plan, answer.files, units) + document_text(answer.document)


def _refuse_doubled(labels: Sequence[str], where: str, what: str) -> None:
    doubled = sorted({label for label in labels if labels.count(label) > 1})
    if doubled:
        raise ConfigError(
            what, where=where, got=", ".join(doubled), expected="each once",
            next_step="leave all but one out", rule="plan-demand" if where == "--u" else "plan-like",
        )  # fmt: skip


def _refuse_without_room(order: ProtocolOrder) -> None:
    limits = {
        "--minutes": (order.minutes, "minutes above 0"),
        "--sliding": (order.sliding_kJ, "kJ above 0"),
        "--rise": (order.rise_K, "kelvins above 0"),
    }
    wrong = {name: stated for name, stated in limits.items() if not stated[0] > 0}
    if order.between_files_s is not None and not 0 <= order.between_files_s <= LONGEST_PAUSE_S:
        wrong["--between-files"] = order.between_files_s, f"0 to {LONGEST_PAUSE_S:g} s, which is a day"
    for name, (size, expected) in wrong.items():
        raise ConfigError(
            "a limit is no number that a test can keep", where=name, got=size, expected=expected,
            next_step="state such a number, or leave the option out", rule="plan-infeasible",
        )  # fmt: skip


def _tires(
    order: ProtocolOrder, spread: Mapping[str, tuple[float, float]]
) -> tuple[tuple[EarlierTest, ...], str, Path | None]:
    """Return the earlier test of each tire of the class, what they are called, and the first's tire file."""
    from toolkit.planning.protocol_search import shared_loads
    from toolkit.planning.tire_class import PASSENGER, members

    known = [_earlier(order, like) for like in order.like or (None,)]
    if not order.like and not order.spread:
        spread = PASSENGER
    tires = tuple(member for earlier, _, _ in known for member in members(earlier, spread))
    machines = list(dict.fromkeys(earlier.machine.name for earlier in tires))
    if len(machines) > 1 or not shared_loads(tires):
        raise ConfigError(
            "the earlier tests have nothing in common", where="--like",
            got=", ".join(machines) if len(machines) > 1 else "no load that all of them measured",
            expected="tests on one machine, at common loads", next_step="plan from one of them",
            rule="plan-like",
        )  # fmt: skip
    return tires, "; ".join(name for _, name, _ in known), known[0][2]


def _earlier(order: ProtocolOrder, like: Path | None) -> tuple[EarlierTest, str, Path | None]:
    """Return an earlier test, what it is called, and the tire file that it was simulated from."""

    if like is None or like.suffix.lower() in _TIRE_FILES:
        what = "the published passenger tire (SAE 870421)" if like is None else f"the tire {like.name}"
        earlier = dataclasses.replace(_virtual(order, like), tire=what if like is None else str(like))
        return earlier, f"{_SIMULATED} simulated tests of {what} on the virtual machine", like
    resolved = resolve_test(like, order.basis)
    name = f"the test {resolved.result.reduced.info.name}"
    return dataclasses.replace(_of(resolved, str(like)), tire=str(like)), name, None


def _of(resolved: Resolved, where: str) -> EarlierTest:
    from toolkit.planning.expectation import earlier_test

    reduced = resolved.result.reduced
    if reduced.impossible:
        raise ConfigError(
            "the earlier test holds values that no tire has", where=f"--like {where}",
            got=", ".join(dict.fromkeys(finding.rule for finding in reduced.impossible)),
            expected="a test whose values are a tire's", next_step="'toolkit process' names the rows",
            rule="plan-like",
        )  # fmt: skip
    return earlier_test(resolved.result, machine=reduced.machine(), record=resolved.record)


def _virtual(order: ProtocolOrder, like: Path | None) -> EarlierTest:
    """Return the virtual machine's protocol on a tire, processed: what is expected of such a tire."""
    from toolkit.lab.home import packaged_home, registry_if_any
    from toolkit.lab.studies.simulate import simulate_plan
    from toolkit.machine.default import SIMULATED_MACHINE
    from toolkit.planning.expectation import pooled

    registry = registry_if_any(order.basis.calibrations, order.basis.home)
    known = registry is not None and (registry.folder / SIMULATED_MACHINE).is_dir()
    calibrations = registry.folder if registry is not None and known else packaged_home() / "calibrations"
    basis = dataclasses.replace(order.basis, calibrations=calibrations, home=None)
    plan = _virtual_plan(like)
    tests = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(_SIMULATED):
            test = Path(folder) / str(number)
            simulate_plan(dataclasses.replace(plan, seed=plan.seed + number), test, calibrations=calibrations)
            tests.append(_of(resolve_test(test, basis), str(like)))
    return pooled(tests)


def _virtual_plan(like: Path | None) -> Plan:
    """Return the virtual machine's test of a tire file, at the loads that it was made for."""
    from toolkit.simulation.plan import read_plan

    plan = read_plan(Path(__file__).parents[2] / "examples" / "virtual" / "test_plan.toml")
    return plan if like is None else _within_its_loads(_with_tire(plan, like), like)


def _with_tire(plan: Plan, tire: Path) -> Plan:
    """Return a plan with another tire, which brings its own nominal load and pressure."""
    from datetime import date

    from toolkit.declared import toml_text
    from toolkit.simulation.plan import read_plan

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.toml"
        text = {"schema": 1, "date": date.fromisoformat(plan.date), "tire": {"file": str(real_path(tire))}}
        path.write_text(toml_text(text), encoding="utf-8")
        own = read_plan(path)
    return dataclasses.replace(own, seed=plan.seed, label=plan.label)


def _within_its_loads(plan: Plan, like: Path) -> Plan:
    """Return a plan at those of its loads that the tire's file was made for."""
    from toolkit.tires.tir import si_number
    from toolkit.units import in_both

    if plan.tire_file is None:
        return plan
    tir = plan.tire_file.tir
    low, high = si_number(tir, "FZMIN", 0.0), si_number(tir, "FZMAX", math.inf)
    loads = tuple(load for load in plan.loads_N if low <= load <= high)
    if not loads:
        raise ConfigError(
            "the tire file says nothing of the machine's loads", where=f"--like {like}",
            got=f"FZMIN {low:g} N, FZMAX {high:g} N",
            expected=f"{plan.machine.name} loads a tire with {in_both(list(plan.loads_N), 'lbf', '.0f')}",
            next_step="name a tire of the machine's range, or an earlier test of this one", rule="plan-like",
        )  # fmt: skip
    return dataclasses.replace(plan, loads_N=loads)


def _refuse_before_a_test(order: ProtocolOrder, demands: Sequence[Demand]) -> None:
    """Refuse loads that cannot be read, or that no test simulated for the plan has, slip angles and sweeps
    that its machine does not make, and a time that holds no test: before any is simulated.
    """
    from toolkit.planning.design import pace_of, steps_of
    from toolkit.planning.protocol_search import refuse_too_short, refuse_unmeasured
    from toolkit.planning.sweep_search import RELAXATION, sweeping_for

    for text in order.loads:
        load_of(text)
    known: list[set[float]] = []
    for like in order.like or (None,):
        if like is not None and like.suffix.lower() not in _TIRE_FILES:
            continue
        plan = _virtual_plan(like)
        refuse_unmeasured(demands, steps_of(plan.machine))
        for demand in demands:
            if demand.name == RELAXATION:
                sweeping_for(demand, plan.machine)
        known.append(set(nominal_loads(order.loads, plan.loads_N)))
        if len(known) == max(len(order.like), 1) and (shared := set.intersection(*known)):
            pace = pace_of(plan.machine, between_files_s=order.between_files_s)
            refuse_too_short(demands, sorted(shared), pace, order.minutes)


def _beyond(plan: ProtocolPlan, order: ProtocolOrder) -> ConfigError | None:
    """Return the error of limits of the tread that the nearest plan does not keep; None where it does."""
    design = plan.plan
    asked = {
        "--sliding": (order.sliding_kJ, design.sliding_kJ, "kJ"),
        "--rise": (order.rise_K, design.rise_K, "K"),
    }
    beyond = {name: entry for name, entry in asked.items() if entry[1] > entry[0]}
    if not beyond and design.minutes <= order.minutes:
        return None
    if not beyond:
        beyond = {"--minutes": (order.minutes, design.minutes, "min")}
    return ConfigError(
        "no test spares the tread so far", where=", ".join(beyond),
        got=", ".join(f"{name} {limit:g} {unit}" for name, (limit, _, unit) in beyond.items()),
        expected="nearest: " + ", ".join(f"{_up(size)} {unit}" for _, size, unit in beyond.values()),
        next_step="allow as much, or ask for fewer or smaller loads", rule="plan-infeasible",
    )  # fmt: skip


def _up(size: float) -> str:
    return f"{math.ceil(10 * size) / 10:g}"


def _infeasible(plan: ProtocolPlan, minutes: float) -> ConfigError:
    """Return the error of demands that no design meets, with the nearest plan."""
    from toolkit.estimate import round_uncertainty

    missed = [value for value in plan.values if value.planned_U > value.demanded_U]
    by_name: dict[str, list[PlannedValue]] = {}
    for value in missed:
        by_name.setdefault(value.name, []).append(value)
    nearest = [
        f"{name}: {round_uncertainty(max(v.planned_U * 1.05 for v in values))} {values[0].unit} at "
        + ", ".join(f"{v.load_N:.0f} N" for v in values)
        + f" ({_largest(values[0].sources)})"
        for name, values in by_name.items()
    ]
    limit = "" if math.isinf(minutes) else f" in {minutes:g} min"
    if not missed:
        asked = ", ".join(dict.fromkeys(value.name for value in plan.values))
        return ConfigError(
            f"no test{limit} within the limits knows its curves between the slip angles",
            where="--minutes, --sliding, --rise",
            got=f"{asked}; {len(plan.plan.slip_angles_deg)} slip angles are nearest",
            expected="slip angles that leave no part of a curve open",
            next_step="allow more of what is limited, or ask for fewer loads", rule="plan-infeasible",
        )  # fmt: skip
    angles = ", ".join(f"{angle:g}" for angle in sorted(plan.plan.slip_angles_deg))
    swept = "" if plan.sweeps is None else f" and {len(plan.sweeps.recordings)} sweeps"
    return ConfigError(
        f"no test{limit} reaches what is demanded", where="--u",
        got="; ".join(
            f"{value.name} U = {value.demanded_U:.4g} {value.unit} at {value.load_N:.0f} N"
            for value in missed
        ),
        expected=f"at least: {'; '.join(nearest)}",
        next_step=f"demand what is feasible{', or allow more time' * (limit != '')}; the nearest plan has "
        f"slip angles {angles} deg at {len(plan.plan.loads_N)} loads: {plan.plan.rows} rows in "
        f"{plan.plan.minutes:.1f} min{swept}",
        rule="plan-infeasible",
    )  # fmt: skip


def _largest(sources: Sequence[tuple[str, float]]) -> str:
    return f"mostly {max(sources, key=lambda source: source[1])[0]}"


def _files(plan: ProtocolPlan, own: Machine, tire: Path | None, out: Path) -> dict[str, str]:
    """Return the protocol, and what the virtual machine runs of it, by the names of their files."""
    from datetime import date

    from toolkit.machine import load_machine, machine_names
    from toolkit.machine.default import SIMULATED_MACHINE
    from toolkit.planning.protocol_plan import protocol_text, simulation_text

    # A plan file names its machine; one of its own definition has no name that could be found again.
    twin = own.name if own.simulated and own.name in machine_names() else SIMULATED_MACHINE
    turn = own.SA_to_SAE * load_machine(twin).SA_to_SAE
    own_tire = None if tire is None else Path(os.path.relpath(real_path(tire), real_path(out))).as_posix()
    return {
        PROTOCOL: protocol_text(plan, own.protocol),
        SIMULATION: simulation_text(plan, machine=twin, on=date(2026, 3, 17), tire=own_tire, turn=turn),
    }


def _sweeps(plan: ProtocolPlan, units: PrintedUnits) -> list[str]:
    from toolkit.planning.sweep_plan import sweep_lines

    if plan.sweeps is None:
        return []
    loads = ", ".join(f"{units.shown(load, 'N')[0]:.0f}" for load in plan.sweeps.recordings[0].loads_N)
    return [
        f"and {len(plan.sweeps.recordings)} recordings in time in {plan.sweeps.minutes:.1f} min, each at "
        f"{loads} {units.force}:",
        *(f"  sweep        {line}" for line in sweep_lines(plan.sweeps)),
    ]


def plan_text(plan: ProtocolPlan, files: Mapping[str, str], units: PrintedUnits) -> str:
    """Return a plan for people: what to measure, what it reaches, what it rests on and gives up."""
    from toolkit.estimate import plus_minus, round_uncertainty
    from toolkit.planning.demands import title_of

    own, design, several = plan.protocol, plan.plan, len(plan.tires) > 1

    def row(value: PlannedValue) -> list[str]:
        def U(size: float | None) -> str:
            return "" if size is None else round_uncertainty(units.shown(size, value.unit)[0])

        size, unit = units.shown(value.value, value.unit)
        return [
            title_of(value.name), *([str(value.tire)] if several else []),
            f"{units.shown(value.load_N, 'N')[0]:.0f}",
            f"{plus_minus(size, units.shown(value.planned_U, value.unit)[0])} {unit}", U(value.demanded_U),
            U(value.planned_U_in_nine_of_ten), U(value.protocol_U),
            U(value.same_time_U),
        ]  # fmt: skip

    swept = plan.sweeps
    slides = design.sliding_kJ + (0.0 if swept is None else swept.sliding_kJ)
    warms = max(design.rise_K, 0.0 if swept is None else swept.rise_K)
    rows = [row(value) for value in plan.values]
    head = [
        "",
        *(["tire"] if several else []),
        f"FZ [{units.force}]",
        "expected, ± U",
        "U demanded",
        "in 9 of 10",
        "U by protocol",
        "U in its time",
    ]
    directions = " and ".join(design.rotations)
    waits = ", ".join(f"{pause:.0f}" for pause in design.pauses_s)
    pauses = [f"  pauses       {waits} s before each"] if max(design.pauses_s) > max(own.pauses_s) else []
    loads = [units.shown(load, "N")[0] for load in design.loads_N]
    lines = [
        f"{design.rows} rows in {design.minutes:.1f} min: {len(design.slip_angles_deg)} slip angles at "
        f"{len(design.loads_N)} loads, drum {directions}",
        f"  slip angles  {', '.join(f'{angle:g}' for angle in design.slip_angles_deg)} deg, in this order",
        f"  loads        {', '.join(f'{load:.0f}' for load in loads)} {units.force}",
        *pauses,
        *_sweeps(plan, units),
        f"  like         {plan.like}"
        + (f", record {plan.calibration}" if plan.calibration is not None else ""),
        *(f"  tire {place}       {name}" for place, name in enumerate(plan.tires, start=1) if several),
        "",
        table(head, rows, align="<" + ">" * (len(head) - 1)),
        "",
        f"protocol of {plan.machine}: {own.rows} rows in {own.minutes:.1f} min",
        f"tread: {slides:.0f} kJ slide away, by the protocol {own.sliding_kJ:.0f} kJ; a recording "
        f"warms it by {warms:.1f} K at most",
    ]
    settled = any(value.protocol_U is not None for value in plan.values)
    if not settled:
        lines.append("it gives none of what is demanded")
    elif plan.alike is not None:
        lines.append(
            f"its uncertainties, within 5 %, in {plan.alike.rows} rows and {plan.alike.minutes:.1f} min "
            f"({100 * plan.alike.rows / own.rows:.0f} % of the rows)"
        )
    else:
        lines.append("its uncertainties are not reached by fewer slip angles")
    lines += ["", "assumed:", *(f"  {text}" for text in plan.assumptions)]
    if plan.gives_up:
        lines += ["", "given up:", *(f"  {text}" for text in plan.gives_up)]
    if files:
        lines += ["", *(f"written: {name}" for name in files.values())]
    return "\n".join(lines)
