"""The plan of a test: what it will reach, beside the machine's own protocol, and what it gives up."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Any

from toolkit.channels import Rotation
from toolkit.characteristics.scatter import of_one_block
from toolkit.declared import Entry, toml_text
from toolkit.machine import Machine, Protocol
from toolkit.planning.demands import Demand, PrintedUnits, Reach, units_of
from toolkit.planning.design import Design, ordered, standard
from toolkit.planning.expectation import EarlierTest
from toolkit.planning.protocol_search import Judged, ProtocolSearch, Question, least_plan, shared_loads
from toolkit.planning.sweep_plan import (
    TO_LOAD_S,
    PlannedSweeps,
    planned_sweeps,
    refuse_beyond,
    sweep_assumptions,
)
from toolkit.planning.sweep_search import RELAXATION, least_sweeps
from toolkit.planning.tread import Tread, tread_statement
from toolkit.tires.fit import MIN_POINTS

_SEED = 25  # of the order in which the slip angles are measured


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedValue:
    """One characteristic at one load, in the direction in which the plan knows it least."""

    name: Annotated[str, Entry("of the catalogue, or peak")]
    load_N: Annotated[float, Entry("nominal load")]
    rotation: Annotated[str, Entry("forward, reverse or both")]
    SA_deg: Annotated[float | None, Entry("slip angle; null for what is at none")]
    unit: Annotated[str, Entry("SI, of the values and uncertainties")]
    tire: Annotated[int, Entry("of the class, the one that is nearest to its limit: its place, from 1")]
    value: Annotated[float, Entry("by the earlier test")]
    demanded_U: Annotated[float, Entry("largest expanded uncertainty, 95 %")]
    planned_U: Annotated[float, Entry("by the plan")]
    planned_U_in_nine_of_ten: Annotated[float, Entry("no more in nine of ten tests")]
    planned_U_low: Annotated[float, Entry("where the scatter is one standard uncertainty smaller")]
    planned_U_high: Annotated[float, Entry("where it is one larger")]
    protocol_U: Annotated[float | None, Entry("by the machine's protocol")]
    same_time_U: Annotated[float | None, Entry("by the best design of the protocol's time")]
    sources: Annotated[
        tuple[tuple[str, float], ...], Entry("the plan's budget: source and standard uncertainty")
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedDesign:
    """A design in the units of people, slip angles in the order in which they are to be measured."""

    slip_angles_deg: Annotated[
        tuple[float, ...],
        Entry("each direction's recordings, in their order; in the axes of the machine"),
    ]
    loads_N: Annotated[tuple[float, ...], Entry("in each recording")]
    rotations: Annotated[tuple[Rotation, ...], Entry("directions of the drum")]
    rows: Annotated[int, Entry("conditions of the reduced test")]
    minutes: Annotated[float, Entry("time on the machine, pauses among it")]
    sliding_kJ: Annotated[float, Entry("energy that slides away in it, to which the tread's wear goes")]
    rise_K: Annotated[float, Entry("of a cold tread over the room, by the recording that warms it most")]
    pauses_s: Annotated[tuple[float, ...], Entry("before each direction's recordings, in their order")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProtocolPlan:
    """The answer of ``toolkit plan test``.

    ``feasible`` False says that no design meets the demands: ``plan`` is then the nearest.
    """

    feasible: Annotated[bool, Entry("whether every demand is met")]
    machine: Annotated[str, Entry("its name")]
    like: Annotated[str, Entry("the tests that the plan goes by")]
    tires: Annotated[tuple[str, ...], Entry("of the class, each of which the plan serves")]
    calibration: Annotated[str | None, Entry("record of that test; null without")]
    plan: Annotated[PlannedDesign, Entry("the plan")]
    protocol: Annotated[PlannedDesign, Entry("the machine's own protocol")]
    alike: Annotated[PlannedDesign | None, Entry("the shortest test with the protocol's uncertainties")]
    same_time: Annotated[PlannedDesign | None, Entry("the best test of the protocol's time")]
    sweeps: Annotated[PlannedSweeps | None, Entry("recordings in time; null where no demand takes them")]
    values: Annotated[tuple[PlannedValue, ...], Entry("what is demanded, and what it will be")]
    assumptions: Annotated[tuple[str, ...], Entry("what the plan rests on")]
    gives_up: Annotated[tuple[str, ...], Entry("what the protocol would have given and the plan will not")]


def plan_protocol(
    tires: tuple[EarlierTest, ...],
    demands: tuple[Demand, ...],
    loads_N: tuple[float, ...],
    *,
    machine: Machine,
    tread: Tread,
    like: str,
    minutes: float = math.inf,
    tell: Callable[[str], None] = lambda _text: None,
) -> ProtocolPlan:
    """Return the plan of a test.

    Parameters
    ----------
    tires : what is known of each tire of the class, the machine and their scatter; the first stands for it
    demands, loads_N : what is asked for, at which nominal loads of the earlier tests
    machine : the machine with its own protocol, which the plan is compared with
    tread : what the tire's tread may be put to
    minutes : the time on the machine at most

    Raises
    ------
    ConfigError
        ``plan-infeasible``: the time does not hold the smallest design
    """
    units = units_of(machine.protocol)
    protocol = protocol_design(tires, machine)
    # What is read off sweeps in time asks nothing of the settled steps.
    in_time_demands = [demand for demand in demands if demand.name == RELAXATION]
    demands = tuple(demand for demand in demands if demand.name != RELAXATION)
    choice, sweeps, whole = None, None, tread
    if in_time_demands:
        choice = least_sweeps(
            tires, in_time_demands[0], loads_N, machine=machine,
            between_files_s=tread.pace.between_files_s, to_load_s=TO_LOAD_S, tell=tell,
        )  # fmt: skip
        sweeps = planned_sweeps(choice, tires, tread)
        refuse_beyond(sweeps, tread, minutes)
        minutes -= sweeps.minutes
        tread = dataclasses.replace(tread, energy_J=tread.energy_J - 1e3 * sweeps.sliding_kJ)
    question = Question.beside(protocol, tires=tires, demands=demands, loads_N=loads_N)
    tell("the protocol")
    # The protocol itself has no limits, and so no pauses but its own.
    free = dataclasses.replace(tread, energy_J=math.inf, rise_K=math.inf)
    of_protocol = Judged(design=protocol, reaches=question.reaches(protocol), minutes=free.minutes(protocol))
    plan = least_plan(
        question, tread, minutes=minutes, beside=0.0 if sweeps is None else sweeps.minutes, tell=tell
    )
    asked = bool(demands) and plan.feasible
    alike, same_time = (plan, in_time(question, free, protocol)) if asked else (None, None)
    open_demands = tuple(Demand(name=demand.name, SA_rad=demand.SA_rad) for demand in demands)
    limited = not all(map(math.isinf, (minutes, tread.energy_J, tread.rise_K)))
    if alike is not None and (open_demands != demands or limited):
        tell("the protocol's uncertainties in fewer rows")
        as_protocol = Question.beside(protocol, tires=tires, demands=open_demands, loads_N=loads_N)
        alike = least_plan(as_protocol, free, tell=tell)
    (earlier, *others) = tires
    return ProtocolPlan(
        feasible=plan.feasible and (choice is None or choice.feasible),
        machine=machine.name,
        like=like,
        tires=tuple(tire.tire for tire in tires),
        calibration=None if earlier.shared.record is None else earlier.shared.record.id,
        plan=_shown(plan.design, tread, machine=machine),
        protocol=_shown(protocol, free, machine=machine, in_order=True),
        alike=None if alike is None or not alike.feasible else _shown(alike.design, free, machine=machine),
        same_time=None if same_time is None else _shown(same_time.design, free, machine=machine),
        sweeps=sweeps,
        values=_values(question, plan, of_protocol, same_time, () if choice is None else choice.reaches),
        assumptions=(
            *_assumptions(earlier, others, whole, units),
            *_of_conicity(demands, loads_N, earlier, units),
            *(sweep_assumptions(sweeps, machine.sweeping, tires) if sweeps and machine.sweeping else ()),
        ),
        gives_up=_gives_up(plan.design, protocol, units),
    )


def protocol_design(tires: Sequence[EarlierTest], machine: Machine) -> Design:
    """Return the design of the machine's protocol, at the earlier tests' loads where these are others."""
    design, loads_N = standard(machine, machine.rotations), shared_loads(tires)
    known = set(design.loads_N) <= set(loads_N)
    return design if known else dataclasses.replace(design, loads_N=loads_N)


def in_time(question: Question, tread: Tread, protocol: Design) -> Judged | None:
    """Return the best design at the protocol's loads that takes no longer; None where it has no curve."""
    search = ProtocolSearch(question, tread, tuple(sorted(protocol.loads_N)))
    most = search.most_within(tread.minutes(protocol))
    return search.best(most) if most >= MIN_POINTS else None


def _shown(design: Design, tread: Tread, *, machine: Machine, in_order: bool = False) -> PlannedDesign:
    angles = design.slip_angles_rad if in_order else ordered(design.slip_angles_rad, seed=_SEED)
    design = dataclasses.replace(design, slip_angles_rad=angles)
    return PlannedDesign(
        slip_angles_deg=tuple(round(math.degrees(machine.SA_to_SAE * a), 6) + 0.0 for a in angles),
        loads_N=tuple(float(load) for load in design.loads_N),
        rotations=design.rotations,
        rows=design.rows,
        minutes=tread.minutes(design),
        sliding_kJ=float(tread.energies_J(design).sum()) / 1e3,
        rise_K=float(tread.rises_K(design).max()),
        pauses_s=tuple(tread.pauses_s(design).tolist()),
    )


def _values(
    question: Question,
    plan: Judged,
    protocol: Judged,
    same_time: Judged | None,
    of_sweeps: Sequence[Reach],
) -> tuple[PlannedValue, ...]:
    low = {_key(reach): reach.U for reach in question.reaches(plan.design, shift=-1.0)}
    high = {_key(reach): reach.U for reach in question.reaches(plan.design, shift=1.0)}
    by_protocol = {_key(reach): reach.U for reach in protocol.reaches}
    in_same_time = {} if same_time is None else {_key(reach): reach.U for reach in same_time.reaches}
    names = [earlier.tire for earlier in question.tires]
    nearest: dict[tuple[str, float], Reach] = {}
    for reach in (*plan.reaches, *of_sweeps):
        known = nearest.get((reach.demand.label, reach.load_N), reach)
        nearest[reach.demand.label, reach.load_N] = max(known, reach, key=lambda one: one.ratio)
    return tuple(
        PlannedValue(
            name=reach.demand.label,
            load_N=float(reach.load_N),
            rotation=reach.rotation,
            SA_deg=None if reach.SA_rad is None else round(math.degrees(reach.SA_rad), 6),
            unit=reach.unit,
            tire=names.index(reach.tire) + 1,
            value=reach.value,
            demanded_U=reach.limit,
            planned_U=reach.U,
            planned_U_in_nine_of_ten=_in_nine_of_ten(
                reach, low.get(_key(reach), reach.U), high.get(_key(reach), reach.U)
            ),
            planned_U_low=low.get(_key(reach), reach.U),
            planned_U_high=high.get(_key(reach), reach.U),
            protocol_U=by_protocol.get(_key(reach)),
            same_time_U=in_same_time.get(_key(reach)),
            sources=reach.sources,
        )
        for reach in nearest.values()
    )


def _in_nine_of_ten(reach: Reach, low: float, high: float) -> float:
    """Return the U that nine of ten tests keep.

    A variance of n degrees of freedom scatters with twice its square over n; n is that of the test's own
    residuals (Welch and Satterthwaite), less where the earlier test leaves the scatter itself in doubt.
    """
    from scipy.special import chdtri

    doubt = (high**2 - low**2) / (2 * reach.U**2) if reach.U > 0 else 0.0
    relative = 2 / reach.dof + doubt**2
    if relative <= 0:
        return reach.U
    freedoms = 2 / relative
    return reach.U * math.sqrt(float(chdtri(freedoms, 0.1)) / freedoms)


def _key(reach: Reach) -> tuple[str, str, float]:
    return reach.tire, reach.demand.label, reach.load_N


def _assumptions(
    earlier: EarlierTest, others: Sequence[EarlierTest], tread: Tread, units: PrintedUnits
) -> tuple[str, ...]:
    variances = of_one_block(earlier.variances)

    def scatter(place: int, unit: str) -> str:
        size, printed = units.shown(math.sqrt(variances[place]), unit)
        return f"{size:.2g} {printed.replace('*', '·')}"

    pace = tread.pace
    angle = math.degrees(math.sqrt(variances[3]))
    statements = [
        "the tire is like that of the earlier test: its curves say where the slip angles are needed"
        if not others
        else f"the tire is one of a class, of which {len(others) + 1} are looked at: every demand is met on "
        "each of them, and each line is of the one that is nearest to its limit",
        "blocks scatter about the curves as in that test: "
        f"{scatter(0, 'N')} in FY, {scatter(1, 'N*m')} in MZ, {scatter(2, 'N')} in the load and "
        f"{angle:.2g} deg in the slip angle (one standard deviation), "
        f"and their loads stand {100 * earlier.load_spread:.2g} % off the common one",
        "every curve is a Magic Formula; a form that it misses shows only where residuals are left",
        "what the machine definition states of slip angle, load, pressure and zeros holds",
        f"a condition takes {pace.condition_s:.1f} s, the next recording {pace.between_files_s:g} s more; "
        "the time to turn the drum's direction or the tire is not counted",
    ]
    if earlier.mirrored:
        statements.append(
            f"no run of the earlier test has the drum {' and '.join(earlier.mirrored)}: its curves are taken "
            "for those of the other direction"
        )
    if not math.isinf(tread.energy_J):
        statements.append(
            "the tread wears by the energy that slides away: |FY| V sin|SA|, as at the earlier test"
        )
    if not math.isinf(tread.rise_K):
        statements.append(tread_statement())
    if earlier.shared.record is None:
        statements.append("no calibration record is at hand: its share of the uncertainty is left out")
    return tuple(statements)


def _of_conicity(
    demands: Sequence[Demand], loads_N: Sequence[float], earlier: EarlierTest, units: PrintedUnits
) -> list[str]:
    """Return at which loads conicity is planned, by what is turned, and what no budget parts from it then.

    What the machine adds to FY by itself points to one side of the machine. With the drum reversed conicity
    does too; with the tire turned round on its hub it changes its sign.
    """
    if all(demand.name != "conicity" for demand in demands):
        return []
    loads = _printed(sorted(loads_N), units)
    if earlier.shared.reversal == "tire":
        return [
            f"conicity at {loads} is by turning the tire round on its hub, as in the earlier test: camber of "
            "the wheel, crosstalk of the load into FY and zeros of the cells drop out of it, and the zeros "
            "are whole in plysteer"
        ]
    return [
        f"conicity at {loads} is by reversing the drum, the tire not turned round on its hub: camber of the "
        "wheel and crosstalk of the load into FY are taken for conicity and are in no U; as many rows with "
        "the tire turned round would part them, and leave zeros of the cells whole in plysteer"
    ]


def _printed(loads_N: Sequence[float], units: PrintedUnits) -> str:
    return ", ".join(f"{units.shown(load, 'N')[0]:.0f}" for load in loads_N) + f" {units.force}"


def _gives_up(design: Design, protocol: Design, units: PrintedUnits) -> tuple[str, ...]:
    lost = []
    loads = [load for load in protocol.loads_N if load not in design.loads_N]
    if loads:
        lost.append(f"every characteristic at {_printed(loads, units)}")
    if set(design.rotations) < set(protocol.rotations):
        lost.append("the reversed runs: conicity, plysteer, CRAT and PRAT")
    steps = sorted(set(protocol.slip_angles_rad) - set(design.slip_angles_rad))
    if steps:
        lost.append(f"FY and MZ as measured at {', '.join(f'{math.degrees(a):.4g}' for a in steps)} deg")
    if any(math.isclose(abs(a), math.radians(1)) for a in steps):
        lost.append("the ±1 deg secants")
    spare, usual = (len(d.slip_angles_rad) - MIN_POINTS + 1 for d in (design, protocol))
    if spare < usual:
        lost.append(
            f"{usual - spare} of the {usual} residual degrees of freedom of each curve, by which a wrong "
            "block or a curve of another form is seen"
        )
    return tuple(lost)


def protocol_text(plan: ProtocolPlan, standard_protocol: Protocol) -> str:
    """Return the protocol file of a plan, as ``process --protocol`` and ``test.toml`` read it."""
    lines = "# Planned by `toolkit plan test`: measure the slip angles in this order, in each direction.\n"
    protocol = dataclasses.replace(
        standard_protocol,
        source=f"planned from {plan.like}; all else as in: {standard_protocol.source}",
        slip_angles_rad=tuple(math.radians(a) for a in plan.plan.slip_angles_deg),
        loads_N=_written(plan.plan.loads_N, standard_protocol.loads_N),
        rotations=plan.plan.rotations,
        repeats=1,
    )
    return lines + toml_text(protocol)


def _written(loads_N: Sequence[float], as_in: Sequence[float]) -> tuple[float, ...]:
    """Return loads as the machine's protocol writes them, in its unit."""
    by_size = {float(load): load for load in as_in}
    return tuple(by_size.get(load, load) for load in loads_N)


def simulation_text(plan: ProtocolPlan, *, machine: str, on: date, tire: str | None, turn: int = 1) -> str:
    """Return the plan file that ``toolkit simulate`` runs; ``turn`` is the plan's slip angles' sign there."""
    angles = [turn * angle + 0.0 for angle in plan.plan.slip_angles_deg]
    table: dict[str, Any] = {
        "schema": 1,
        "kind": "test",
        "title": "planned test",
        "date": on,
        "machine": machine,
        "seed": _SEED,
        "rotations": list(plan.plan.rotations),
        "slip_angles": {"value": angles, "unit": "deg"},
        "loads": {"value": list(plan.plan.loads_N), "unit": "N"},
        "acquisition": {"negated": []},
    }
    if plan.sweeps is not None:
        # Runs that are stated replace those of the protocol: the settled ones have to be stated too.
        settled = [
            {"rotation": rotation, "slip_angles": {"value": [angle], "unit": "deg"}}
            for rotation in plan.plan.rotations
            for angle in angles
        ]
        table["run"] = [*settled, *plan.sweeps.runs()]
    if tire is not None:
        table["tire"] = {"file": tire}
    return toml_text(table)
