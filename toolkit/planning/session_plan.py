"""The plan of a calibration session: its loads in their order, its check loads, and what they will give.

Loads are ordered against drift and creep: mounts in turn, each loaded up and then down. Least squares takes a
drift for a slope where loads rise with time, and creep after a large load for a part of the next one. Neither
needs a term where the order is such that the coefficients do not answer to it.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.session.table import Table
from toolkit.calibration.standards.cell_rows import e74_points
from toolkit.calibration.standards.e74 import MIN_POINTS
from toolkit.declared import Entry
from toolkit.findings import Finding
from toolkit.planning.check_loads import Verification, choose_check_loads
from toolkit.planning.exchange import Alternatives, best_of, exchanged
from toolkit.planning.fixtures import FeasibleLoads
from toolkit.planning.knowledge import Knowledge
from toolkit.planning.row_exchange import Criterion, loss
from toolkit.planning.session_search import Demand, Design, SessionSearch

_LARGE = 0.5  # of one repeatability: an answer to drift or creep that a reader should know of


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedLoad:
    """A row: its run, mount, what hangs there, the loads in the record's order and units."""

    run: Annotated[int, Entry("from 1; check loads stand in the run after the last")]
    mount: Annotated[str, Entry("what is mounted; empty without fixtures")]
    label: Annotated[str, Entry("what hangs there")]
    direction: Annotated[str, Entry("up: reached from below; down: from above")]
    loads: Annotated[tuple[float, ...], Entry("in the record's order and units")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """What is expected of one load: U at ``at`` today, as asked, as planned, and in nine of ten sessions.

    ``at`` lies inside of what is calibrated and of what is loaded.

    ``U`` takes runs to differ by a standard error more than the record says: by it the demand is kept.
    ``U_expected`` takes them as the record says, and is what sessions have on average.
    ``U_repeated`` is what the last session's own loads are expected to give another time.
    ``share`` of simulated sessions reach what was asked. ``floor`` is U without the part that more rows can
    lower; ``visible_misfit`` the misfit that four of five sessions would show; ``drift`` and ``creep``
    what one repeatability of each makes of the load. All in ``unit``.
    """

    load: Annotated[str, Entry("symbol of the load")]
    unit: Annotated[str, Entry("of every number of it")]
    at: Annotated[
        float, Entry("load at which every U of it is stated: the largest that is reached, or as asked")
    ]
    U_today: Annotated[float, Entry("by the record")]
    U_repeated: Annotated[float, Entry("expected of the last session's own loads another time")]
    U_asked: Annotated[float | None, Entry("demanded; null where nothing is")]
    U_expected: Annotated[
        float, Entry("by the plan where runs differ as the record says: what sessions have on average")
    ]
    U: Annotated[
        float, Entry("by the plan where they differ by a standard error more: by it the demand is kept")
    ]
    U_in_nine_of_ten: Annotated[float, Entry("no more in nine of ten sessions")]
    share: Annotated[float | None, Entry("of simulated sessions that reach what was asked; null without")]
    floor: Annotated[float, Entry("of U, which no more rows lower")]
    visible_misfit: Annotated[
        float | None, Entry("of the equation that four of five sessions would show; null where none is seen")
    ]
    drift: Annotated[float, Entry("of the load by a drift of one repeatability over each run")]
    creep: Annotated[float, Entry("of the load by a creep of one repeatability after the largest load")]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionPlan:
    """A planned session: rows in their order, check loads after them, and what it is expected to give."""

    record: Annotated[str, Entry("id of the record that the plan goes by")]
    instrument: Annotated[str, Entry("its name")]
    source: Annotated[str, Entry("what the feasible loads are taken from")]
    criterion: Annotated[Criterion, Entry("of which the loads are optimal")]
    criterion_value: Annotated[float, Entry("what it comes to")]
    runs: Annotated[int, Entry("without the check loads")]
    rows: Annotated[tuple[PlannedLoad, ...], Entry("in their order")]
    check: Annotated[tuple[PlannedLoad, ...], Entry("check loads, after the runs")]
    outlook: Annotated[tuple[Outlook, ...], Entry("what is expected of each load")]
    verification: Annotated[tuple[Verification, ...], Entry("what the check loads show of each term")]
    minutes: Annotated[float | None, Entry("time of all; null where nobody states times")]
    rows_today: Annotated[int, Entry("of the record's session")]
    check_today: Annotated[int, Entry("check loads of that session")]
    replicates: Annotated[int, Entry("rows that repeat another of the plan")]
    simulated: Annotated[int, Entry("sessions behind the shares")]
    assumptions: Annotated[tuple[str, ...], Entry("what the plan rests on")]
    gives_up: Annotated[tuple[str, ...], Entry("what the last session had and the plan has not")]
    findings: Annotated[tuple[Finding, ...], Entry("on the record and the plan")]


def plan_session(knowledge: Knowledge, feasible: FeasibleLoads, demand: Demand) -> SessionPlan:
    """Return the plan of a session.

    With a demand of U it is the shortest plan that is expected to keep it (by minutes where they are stated,
    else by loads); with minutes alone the one of least U in them; without either the shortest that keeps
    today's U within a twentieth.

    Raises
    ------
    ConfigError
        ``plan-infeasible``: no plan keeps the demand; the message has the nearest one
        ``plan-fixtures``: the feasible loads cannot tell the coefficients
    """
    search = SessionSearch(knowledge, feasible.few(), demand)
    return _Finished(search).plan(search.best())


class _Finished:
    """What a design comes to: its order, its check loads, what is expected, what it rests on."""

    def __init__(self, search: SessionSearch) -> None:
        self.search, self.demand = search, search.demand
        self.knowledge, self.feasible = search.knowledge, search.feasible
        self.asked = search.asked

    def plan(self, design: Design) -> SessionPlan:
        """Return the plan of a design."""
        knowledge, feasible = self.knowledge, self.feasible
        rng = np.random.default_rng([self.demand.seed, 1])
        load, up = self.search.place[design.points], self.search.up[design.points]
        table = self.search.table(design.points, design.run)
        runs = [
            visits(np.flatnonzero(design.run == number), load, feasible, up) for number in range(design.runs)
        ]
        order, answers = in_order(runs, knowledge.weights(table), knowledge.relative(table), rng)
        check, verified, minutes = self._check_loads(design, load)
        check = np.array(
            sorted(check.tolist(), key=lambda at: (feasible.mount[at], feasible.amount[at])), dtype=np.intp
        )
        drawn = np.array(
            [[budget.U for budget in knowledge.simulated(table, rng)] for _ in range(self.demand.simulated)]
        )
        outlook = self._outlook(design, table, drawn, answers)
        return SessionPlan(
            record=knowledge.record.id,
            instrument=knowledge.record.instrument,
            source=feasible.source,
            criterion=self.demand.criterion,
            criterion_value=loss(self.search.responses, design.points, design.run, self.demand.criterion),
            runs=design.runs,
            rows=tuple(
                self._row(int(load[at]), int(design.run[at]) + 1, bool(up[at])) for at in order.tolist()
            ),
            check=tuple(self._row(at, design.runs + 1, True) for at in check.tolist()),
            outlook=outlook,
            verification=verified,
            minutes=minutes,
            rows_today=knowledge.loads.rows,
            check_today=0 if knowledge.check is None else knowledge.check.rows,
            replicates=self.search.repeats(design.points),
            simulated=self.demand.simulated,
            assumptions=self._assumptions(),
            gives_up=self._gives_up(design, outlook),
            findings=self._findings(verified, outlook),
        )

    def _check_loads(
        self, design: Design, load: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], tuple[Verification, ...], float | None]:
        """Return check loads, what they verify, all minutes; none of the fit where that takes no longer."""
        search = self.search
        apart, verified = choose_check_loads(self.knowledge, self.feasible.loads, frozenset(load.tolist()))
        minutes = search.minutes(design.points, design.run, apart)
        if minutes is not None and design.minutes is not None and minutes > design.minutes:
            return search.check, search.verified, design.minutes
        return apart, verified, minutes

    def _row(self, at: int, run: int, up: bool) -> PlannedLoad:
        return PlannedLoad(
            run=run, mount=self.feasible.mount[at], label=self.feasible.label[at],
            direction="up" if up else "down", loads=tuple(self.feasible.loads[at].tolist()),
        )  # fmt: skip

    def _outlook(self, design: Design, table: Table, drawn: Array, answers: Array) -> tuple[Outlook, ...]:
        knowledge = self.knowledge
        misfits, likely = knowledge.visible_misfit(table), knowledge.likely(table)
        return tuple(
            Outlook(
                load=fit.load, unit=fit.unit, at=budget.at, U_today=budget.U,
                U_repeated=float(self.search.today[at]),
                U_asked=float(self.asked[at]) if math.isfinite(self.asked[at]) else None,
                U_expected=likely[at].U, U=float(design.U[at]),
                U_in_nine_of_ten=float(np.quantile(drawn[:, at], 0.9)),
                share=float(np.mean(drawn[:, at] <= self.asked[at] * (1 + 1e-9)))
                if math.isfinite(self.asked[at]) else None,
                floor=knowledge.floor(at), visible_misfit=misfits[at],
                drift=float(answers[at, 0]) * noise.runs.within,
                creep=float(answers[at, 1]) * noise.runs.within,
            )
            for at, (fit, noise, budget) in enumerate(
                zip(knowledge.record.loads, knowledge.scatter, knowledge.today, strict=True)
            )
        )  # fmt: skip

    def _assumptions(self) -> tuple[str, ...]:
        knowledge, record = self.knowledge, self.knowledge.record
        between = ", ".join(
            f"{fit.load} {size.within:.3g} / {size.zero:.3g} / {size.gain:.3g} {fit.unit.replace('*', '·')}"
            for fit, size in zip(record.loads, knowledge.runs, strict=True)
        )
        groups = knowledge.scatter[0].runs.groups
        return (
            f"readings scatter as in {record.id}, runs by a standard error more (within a run / its zero / "
            "its gain): "
            f"{between}" + (f", from {groups} runs" if groups > 1 else "; one run tells nothing of the next"),
            f"the equations are those of {record.id}, and the cells answer as they did then",
            "readings are independent of each other but for the zero and the gain of their run",
            "what the record's budget takes from statements (reference, resolution, creep, zero) stays",
            "a misfit, a difference of the directions, a zero and a gain of each run are allowed for with "
            "one repeatability at least, also where the last session showed none; a misfit with more where "
            "the loads would otherwise not show it",
        )

    def _gives_up(self, design: Design, outlook: tuple[Outlook, ...]) -> tuple[str, ...]:
        fewer = self.knowledge.loads.rows - len(design.run)
        wider = [
            f"{load.load} +{100 * (load.U / load.U_repeated - 1):.1f} %"
            for load in outlook
            if load.U_repeated < load.U
        ]
        seen = ", ".join(
            f"{load.load} {load.visible_misfit:.3g} {load.unit.replace('*', '·')}"
            for load in outlook
            if load.visible_misfit is not None
        )
        blind = ", ".join(load.load for load in outlook if load.visible_misfit is None)
        lines = (
            [f"a misfit of the equation below {seen} passes unseen in one of five sessions"] if seen else []
        )
        if blind:
            lines.append(f"no misfit of the equation of {blind} can be seen: the loads have too few levels")
        lines += self._fewer_points(design)
        lines += [
            f"loads beyond {reach.text} of {reach.load}: the next record's range ends there"
            for reach in self.search.reach
            if reach.short
        ]
        if fewer > 0:
            lines.append(f"{fewer} readings fewer than {self.knowledge.record.id}: an outlier weighs more")
        if self.feasible.refused:
            lines.append(f"{self.feasible.refused} loads of the fixtures, each beyond a limit")
        if self.feasible.mounts_left_out:
            count = self.feasible.mounts_left_out
            lines.append(f"{count} mounts of the fixtures, much like those that were weighed")
        if wider:
            lines.append(f"U is wider than by the last session's loads: {', '.join(wider)}")
        return tuple(lines)

    def _fewer_points(self, design: Design) -> list[str]:
        """Return the loads of which ASTM E74 counts too few points, where it counted enough before."""
        planned, last = self.search.table(design.points, design.run), self.knowledge.loads
        names = self.knowledge.names
        counts = [(name, e74_points(planned, name, names), e74_points(last, name, names)) for name in names]
        return [
            f"a class by ASTM E74 of {name}: {now} points as it counts them (loaded, ascending), {before} by "
            f"the last session, {MIN_POINTS} are needed"
            for name, now, before in counts
            if now < MIN_POINTS <= before
        ]

    def _findings(
        self, verified: tuple[Verification, ...], outlook: tuple[Outlook, ...]
    ) -> tuple[Finding, ...]:
        record = self.knowledge.record
        findings = [
            Finding(
                rule="plan-unverified", where=f"{record.id}, {entry.load}",
                message=f"no feasible load moves {entry.load} by {entry.term} as much as five tolerances "
                f"({entry.movement:.2g} at most): its sign stays unverified"
                if entry.movement is not None
                else f"the feasible check loads do not tell the intercept of {entry.load} from its slopes",
            )
            for entry in verified
            if not entry.verified
        ]  # fmt: skip
        findings += [
            Finding(
                rule="plan-range", where=f"{record.id}, {reach.load}",
                message=f"{reach.load} is loaded from {reach.low:.5g} to {reach.high:.5g} {reach.unit}, "
                f"where {record.id} is calibrated from "
                f"{reach.calibrated[0]:.5g} to {reach.calibrated[1]:.5g} {reach.unit}: the next record gives "
                "no U beyond what is loaded",
            )
            for reach in self.search.reach
            if reach.short
        ]  # fmt: skip
        for load, noise in zip(outlook, self.knowledge.scatter, strict=True):
            sizes = {"drift": load.drift, "creep": load.creep}
            findings += [
                Finding(
                    rule="plan-order", where=f"{record.id}, {load.load}", level="note",
                    message=f"a {name} of one repeatability in every run moves {load.load} by {size:.2g} "
                    f"{load.unit}: read the zeros before and after each run",
                )
                for name, size in sizes.items()
                if size > _LARGE * noise.runs.within
            ]  # fmt: skip
        return tuple(findings)


_STARTS = 16


def visits(
    rows: NDArray[np.intp], points: NDArray[np.intp], feasible: FeasibleLoads, up: NDArray[np.bool_]
) -> list[NDArray[np.intp]]:
    """Return the rows of a run by mount, each loaded from the smallest up and then down again.

    No load is reached from below before a mount's loads and from above after them: by itself it has no side.

    ``points`` (rows of the session,) is the candidate of each row, ``up`` (rows,) its direction.
    """
    by_mount: dict[str, list[int]] = {}
    for row in rows.tolist():
        by_mount.setdefault(feasible.mount[points[row]], []).append(row)
    size = feasible.amount[points]
    empty = by_mount.pop("", [])
    if empty:
        by_mount.setdefault(max(by_mount, key=lambda mount: len(by_mount[mount]), default=""), []).extend(
            empty
        )
    return [
        np.array(sorted(group, key=lambda row: (not up[row], size[row] if up[row] else -size[row])))
        for group in by_mount.values()
    ]


def in_order(
    runs: list[list[NDArray[np.intp]]], weights: Array, relative: Array, rng: np.random.Generator
) -> tuple[NDArray[np.intp], Array]:
    """Return the rows of a session in the order that its results answer least to, and what they answer.

    Parameters
    ----------
    runs : of each run its visits, as `visits` makes them
    weights : (results, rows) what a unit error of each row makes of each result
    relative : (results, rows) the load of each row that creeps, by the largest

    The answers (results, 2) are those to a drift of one unit over a run and to a creep of one unit after the
    largest load, the sizes of different runs independent of each other.
    """
    sequences = [_best_order(groups, weights, relative, rng) for groups in runs]
    answers = np.sum([_squares(rows, weights, relative) for rows in sequences], axis=0)
    return np.concatenate(sequences), np.sqrt(answers)


def _best_order(
    groups: list[NDArray[np.intp]], weights: Array, relative: Array, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Return a run's rows by exchange of its visits' places, the best of a few starts."""
    places = range(len(groups))

    @functools.cache  # an exchange comes to most orders by both of the visits that change places
    def answers(order: tuple[int, ...]) -> float:
        return float(_squares(_sequence(groups, order), weights, relative).sum())

    def alternatives(order: tuple[int, ...], place: int) -> Alternatives[tuple[int, ...]]:
        def swapped(other: int) -> tuple[int, ...]:
            swap = {place: order[other], other: order[place]}
            return tuple(swap.get(at, visit) for at, visit in enumerate(order))

        losses = np.array([answers(swapped(other)) for other in places])
        return Alternatives(losses=losses, present=place, design=swapped)

    starts = (tuple(rng.permutation(len(groups)).tolist()) for _ in range(_STARTS if len(groups) > 2 else 1))
    best = best_of(starts, lambda start: exchanged(start, alternatives, lambda: places), answers)
    return _sequence(groups, best)


def _sequence(groups: list[NDArray[np.intp]], order: tuple[int, ...]) -> NDArray[np.intp]:
    return np.concatenate([groups[at] for at in order])


def _squares(rows: NDArray[np.intp], weights: Array, relative: Array) -> Array:
    """Return the squared answers (results, 2) of a run's rows in their order."""
    drift, each = _drift(len(rows)), weights[:, rows]
    creep = np.diff(relative[:, rows], axis=1, prepend=0.0)  # what the load before leaves
    return np.stack([(each @ drift) ** 2, np.sum(each * creep, axis=1) ** 2], axis=1)


@functools.cache
def _drift(count: int) -> Array:
    """Return a drift of one unit over a run (rows,), zero in the mean."""
    drift = np.linspace(-0.5, 0.5, count)
    drift -= drift.mean()
    drift.flags.writeable = False
    return drift
