"""The search for a session's loads: the shortest design that keeps a stated U, or the best one in a time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.findings import FEW_POINTS
from toolkit.calibration.session.table import Table
from toolkit.errors import ConfigError
from toolkit.planning.check_loads import choose_check_loads
from toolkit.planning.fixtures import FeasibleLoads
from toolkit.planning.knowledge import RANK_TOLERANCE, Knowledge
from toolkit.planning.row_exchange import Criterion, Price, Response, Span, exchange, loss
from toolkit.planning.session_reach import AS_READ, reach_of, refuse_beyond, stated_loads

FEWEST_RUNS, MOST_RUNS = 3, 10
MOST_ROWS = 160
SLACK = 1.05
"""Today's U times this is asked for where nothing else is: a twentieth is no second digit of U."""
_SEARCH_STARTS, _FINAL_STARTS = 1, 4
_LARGE = 0.5  # of the largest load
_SAME = 1e-9
_SHARES = (1.0, 0.3, 0.1)  # of what a minute is worth: as few mounts as the runs' differences allow
FEWEST_LEVELS, FEWEST_REPEATS = 3, 3
_MISFITS = (1.0, 3.0, 10.0, 30.0)  # times the misfit that is allowed for, until it is seen


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """What a plan is asked for: U [the record's unit] by load; minutes and loads at most.

    U is asked for at the largest load of the record's range, or at the load that ``at`` has for it.
    The check loads count in the minutes, not in the loads. ``simulated`` sessions tell how sure U is.
    ``two_levels`` allows plans at which no misfit of the equations can be seen.
    """

    U: tuple[tuple[str, float], ...] = ()
    at: tuple[tuple[str, float], ...] = ()
    minutes: float | None = None
    loads: int | None = None
    criterion: Criterion = "D"
    seed: int = 0
    simulated: int = 40
    two_levels: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """Chosen candidates of the doubled list (up, then down) and the run of each row."""

    points: NDArray[np.intp]
    run: NDArray[np.intp]
    U: Array
    minutes: float | None

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self.run.max()) + 1

    @property
    def text(self) -> str:
        """How many loads, runs and minutes it takes."""
        time = "" if self.minutes is None else f", {math.ceil(self.minutes - _SAME)} minutes"
        return f"{len(self.run)} loads in {self.runs} runs{time}"


class SessionSearch:
    """The search over runs and rows: one exchange for each, their U as the record's own budget has it."""

    def __init__(self, knowledge: Knowledge, feasible: FeasibleLoads, demand: Demand) -> None:
        self.feasible, self.demand = feasible, demand
        self.reach = reach_of(knowledge.record, feasible.loads)
        self.stated = stated_loads(self.reach, feasible.loads, dict(demand.at))
        self.knowledge = knowledge = knowledge.stated_at(self.stated)
        down = feasible.unloadable()
        self.place = np.concatenate([np.arange(len(feasible.loads)), down])
        self.loads = feasible.loads[self.place]
        self.up = np.arange(len(self.place)) < len(feasible.loads)
        self._bent = [
            knowledge.responses(self.loads, self.up, misfits=size)
            for size in _MISFITS[: 1 if demand.two_levels else None]
        ]
        self.responses = self._bent[0]
        self.asked = np.array([dict(demand.U).get(name, math.inf) for name in knowledge.names])
        self.today = np.array([budget.U for budget in knowledge.repeated()])
        if not demand.U and not self.limited:
            self.asked = SLACK * self.today
        self.check, self.verified = choose_check_loads(knowledge, feasible.loads, frozenset())
        self._designs: dict[tuple[int, int], Design] = {}
        if demand.loads is not None and demand.loads < FEW_POINTS:
            raise ConfigError(
                "too few loads for a session", where="--loads", got=demand.loads,
                expected=f"{FEW_POINTS} loads at least: fewer tell scatter and misfit badly",
                next_step=f"nearest: --loads {FEW_POINTS}", rule="plan-infeasible",
            )  # fmt: skip
        if demand.minutes is not None and feasible.minutes is None:
            raise ConfigError(
                "nobody stated how long a load takes", where="--minutes", got=feasible.source,
                expected="fixtures with minutes and setup_minutes",
                next_step="state them in a file of fixtures: --fixtures FILE", rule="plan-fixtures",
            )  # fmt: skip
        self._refuse_what_cannot_be_told()
        refuse_beyond(self.reach, self.stated, dict(demand.U), dict(demand.at))
        self.spans = self._spans()
        self._refuse_what_shows_no_misfit()

    def _refuse_what_cannot_be_told(self) -> None:
        for fit, response in zip(self.knowledge.record.loads, self.responses, strict=True):
            terms = response.common[:, : response.wanted]
            if np.linalg.matrix_rank(terms, tol=RANK_TOLERANCE) < response.wanted:
                absent = [
                    self.knowledge.names[at]
                    for at in range(self.feasible.loads.shape[1])
                    if not self.feasible.loads[:, at].any()
                ]
                if not absent and (unnamed := self.knowledge.beside_the_loads(fit)) is not None:
                    raise self._follows_an_unnamed_load(*unnamed)
                lacking = f", none of {', '.join(absent)}" if absent else f" for the terms of {fit.load}"
                raise ConfigError(
                    "the feasible loads cannot tell the coefficients apart", where=self.feasible.source,
                    got=f"{len(self.feasible.loads)} loads{lacking}",
                    expected="loads that move every term by itself",
                    next_step="add a fixture that loads "
                    + (" and ".join(absent) or "the cells in another combination"),
                    rule="plan-fixtures",
                )  # fmt: skip

    def _follows_an_unnamed_load(self, indication: str, share: float) -> ConfigError:
        record, names = self.knowledge.record, ", ".join(self.knowledge.names)
        return ConfigError(
            "the indications follow a load that the session does not name", where=record.id,
            got=f"{100 * share:.0f} % of the range of {indication} in its rows does not follow {names}",
            expected=f"indications that {names} explain: a plan can only put on what is named",
            next_step="enter what was put on beside them, most often MX at a hub, as a load of the session "
            "(a column of its data, a name in loads), calibrate, and plan from that record",
            rule="plan-record",
        )  # fmt: skip

    def _spans(self) -> list[Span]:
        """Return what runs must reach: where U is stated in as many as tell them apart, the ends in one."""
        spans = []
        for at, (reach, stated) in enumerate(zip(self.reach, self.stated, strict=True)):
            for end, runs in ((stated, FEWEST_RUNS), (reach.low, 1), (reach.high, 1)):
                if abs(end) <= AS_READ * reach.largest:
                    continue
                spans.append(Span(among=np.sign(end) * self.loads[:, at] >= abs(end), runs=runs))
        return spans

    def _refuse_what_shows_no_misfit(self) -> None:
        """Refuse feasible loads of too few levels, unless that is asked for."""
        every = np.tile(np.arange(len(self.place)), FEWEST_RUNS)
        blind = self._blind(every, np.repeat(np.arange(FEWEST_RUNS), len(self.place)))
        if blind and not self.demand.two_levels:
            raise ConfigError(
                "the feasible loads have too few levels to show a misfit", where=self.feasible.source,
                got=f"no misfit of the equation of {', '.join(blind)} can be seen",
                expected=f"{FEWEST_LEVELS} levels of each load at least, more for equations with powers",
                next_step="add weights between; nearest: --two-levels plans with these loads, and no misfit "
                "of an equation will be seen",
                rule="plan-infeasible",
            )  # fmt: skip

    def _blind(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> list[str]:
        """Return the loads of which rows show no misfit of the equation."""
        visible = self.knowledge.visible_misfit(self.table(points, run))
        levels = [len(np.unique(column)) for column in self.loads[points].T]
        named = zip(self.knowledge.names, visible, levels, strict=True)
        return [name for name, size, count in named if size is None or count < FEWEST_LEVELS]

    def repeats(self, points: NDArray[np.intp]) -> int:
        """Return how many rows repeat another run's: by these a misfit is told from scatter."""
        return len(points) - len(np.unique(points))

    def _shows_misfit(self, design: Design) -> bool:
        """Tell whether a misfit can be seen: levels enough, and repeats that say what scatter is."""
        if self.demand.two_levels:
            return True
        return self.repeats(design.points) >= FEWEST_REPEATS and not self._blind(design.points, design.run)

    def design(self, runs: int, per_run: int, starts: int = _SEARCH_STARTS) -> Design:
        """Return the design of a number of runs and rows in each."""
        key = (runs, per_run)
        if starts == _SEARCH_STARTS and key in self._designs:
            return self._designs[key]
        run = np.repeat(np.arange(runs), per_run)
        rng = np.random.default_rng([self.demand.seed, runs, per_run])
        for responses in self._bent:
            points = self._points(responses, run, rng, starts)
            design = Design(
                points=points, run=run, U=self._expected(points, run),
                minutes=self.minutes(points, run, self.check),
            )  # fmt: skip
            if self._shows_misfit(design):
                break
        self._designs[key] = design
        return design

    def _expected(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> Array:
        """Return U of each load; infinite of rows that do not span the loads at which it is stated."""
        if any(span.lacking(points, run) for span in self.spans):
            return np.full(len(self.asked), np.inf)
        return np.array([budget.U for budget in self.knowledge.expected(self.table(points, run))])

    def _points(
        self, responses: Sequence[Response], run: NDArray[np.intp], rng: np.random.Generator, starts: int
    ) -> NDArray[np.intp]:
        """Return the rows of an exchange; where time is stated, with as few mounts as the runs allow."""

        def exchanged(price: Price | None) -> NDArray[np.intp]:
            return exchange(
                responses,
                run,
                self.demand.criterion,
                rng,
                starts=starts,
                price=price,
                once=True,
                spans=self.spans,
            )

        points = exchanged(None)
        if self.feasible.setup_minutes is None:
            return points
        price = self._price(points, run)
        for share in _SHARES:
            cheaper = exchanged(dataclasses.replace(price, weight=share * price.weight))
            if self._seen_in_runs(cheaper, run):
                return cheaper
        return points

    def _seen_in_runs(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> bool:
        """Tell whether every load is large in as many runs as tell how runs differ."""
        largest = np.abs(self.feasible.loads).max(axis=0)
        large = np.abs(self.loads[points]) >= _LARGE * largest
        return all(len(np.unique(run[column])) >= FEWEST_RUNS for column in large.T)

    def _price(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> Price:
        """Return what a minute is worth: as much as it brings where it is spent on further rows."""
        feasible, by = self.feasible, self.demand.criterion
        setup = feasible.setup_minutes or {}
        minutes = np.zeros(len(feasible.loads)) if feasible.minutes is None else feasible.minutes
        mounts = {mount: number for number, mount in enumerate(setup)}
        price = Price(
            mount=np.array([mounts.get(mount, -1) for mount in feasible.mount])[self.place],
            minutes=minutes[self.place],
            setup=np.array([setup.get(mount, 0.0) for mount in feasible.mount])[self.place],
            weight=1.0,
        )
        # n rows have a determinant as n^p and variances as 1/n: d(loss) for a share of n.
        worth = loss(self.responses, points, run, by)
        if by == "D":
            worth = float(sum(response.wanted for response in self.responses))
        return dataclasses.replace(price, weight=worth / max(price.total(points, run), 1e-9))

    def table(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> Table:
        """Return a design as a session's table."""
        return self.knowledge.table(self.loads[points], run, self.up[points])

    def minutes(
        self, points: NDArray[np.intp], run: NDArray[np.intp], check: NDArray[np.intp]
    ) -> float | None:
        """Return how long readings, mountings, runs and check loads take; None where nobody stated it."""
        feasible = self.feasible
        if feasible.minutes is None or feasible.setup_minutes is None or feasible.run_minutes is None:
            return None
        load = self.place[points]
        mounted = {(r, feasible.mount[at]) for r, at in zip(run.tolist(), load.tolist(), strict=True)}
        mounted |= {(-1, feasible.mount[at]) for at in check.tolist()}
        setup = sum(feasible.setup_minutes.get(mount, 0.0) for _, mount in mounted)
        readings = feasible.minutes[load].sum() + feasible.minutes[check].sum()
        return float(readings + setup + (int(run.max()) + 1) * feasible.run_minutes)

    def best(self) -> Design:
        """Return the design that the demand asks for."""
        if math.isfinite(self.asked.min()):
            return self._shortest()
        return self._least_within_limits()

    def _cost(self, design: Design) -> float:
        return len(design.run) if design.minutes is None else design.minutes

    def _fewest(self, runs: int) -> int:
        terms = max(response.wanted for response in self.responses)
        return max(math.ceil(FEW_POINTS / runs), math.ceil((terms + 2) / runs), 3)

    def _most(self, runs: int) -> int:
        """Return the rows that a run can have: no load twice in the same direction."""
        return min(MOST_ROWS // runs, len(self.place))

    def _shortest(self) -> Design:
        keeping: list[Design] = []
        floors = np.array([self.knowledge.floor(at) for at in range(len(self.asked))])
        if (self.asked < floors).any():  # not even known coefficients would do
            for runs in (FEWEST_RUNS, MOST_RUNS):
                self.design(runs, self._most(runs))
            self._refuse_uncertainty()
        for runs in range(FEWEST_RUNS, MOST_RUNS + 1):
            least = self._fewest(runs)
            if least > self._most(runs):
                continue
            if self.feasible.minutes is None and keeping and min(map(self._cost, keeping)) <= runs * least:
                continue
            design = self._shortest_of(runs, least)
            keeping += [] if design is None else [design]
        if not keeping:
            self._refuse_uncertainty()
        best = min(keeping, key=self._cost)
        if not self._within(best):
            nearest = self._least_within_limits(refuse=False)
            raise ConfigError(
                "the uncertainty cannot be reached within the limits", where=f"--u, --{self._limit_word}",
                got=f"{self._asked_text()} in {self._limit_text()}",
                expected=f"nearest: {best.text} for this U; or {nearest.text} for {self._U_text(nearest)}",
                next_step="allow one of the two; nothing was written", rule="plan-infeasible",
            )  # fmt: skip
        final = self.design(best.runs, len(best.run) // best.runs, _FINAL_STARTS)
        return final if self._keeps(final) and self._within(final) else best

    def _shortest_of(self, runs: int, least: int) -> Design | None:
        """Return the shortest design of a number of runs that keeps the demand; None where none does."""
        low = high = least
        while not self._keeps(self.design(runs, high)):
            if high >= self._most(runs):
                return None
            low, high = high + 1, min(math.ceil(1.6 * high), self._most(runs))
        while low < high:  # U falls with rows, but for the chances of an exchange
            middle = (low + high) // 2
            low, high = (low, middle) if self._keeps(self.design(runs, middle)) else (middle + 1, high)
        return self.design(runs, high)

    def _keeps(self, design: Design) -> bool:
        return self._shows_misfit(design) and bool(np.all(self.asked * (1 + 1e-9) - design.U >= 0))

    def _refuse_uncertainty(self) -> None:
        best = min(
            self._designs.values(),
            key=lambda design: (not self._shows_misfit(design), float(np.max(design.U / self.asked))),
        )
        worst = int(np.argmax(best.U / self.asked))
        budget = self.knowledge.today[worst]
        holding = max(
            budget.components, key=lambda component: 0.0 if component.name == "fit" else component.u
        )
        raise ConfigError(
            "no number of loads reaches the uncertainty", where="--u",
            got=self._asked_text() + ("" if self.demand.U else ": today's, within a twentieth"),
            expected=f"nearest: {self._U_text(best)} by {best.text}",
            next_step=f"allow that, or lower what more loads cannot: of {budget.load} it is the "
            f"{holding.name}, {100 * budget.share(holding):.0f} % of the variance",
            rule="plan-infeasible",
        )  # fmt: skip

    def _within(self, design: Design) -> bool:
        minutes, loads = self.demand.minutes, self.demand.loads
        slow = minutes is not None and design.minutes is not None and design.minutes > minutes
        return not slow and (loads is None or len(design.run) <= loads)

    @property
    def limited(self) -> bool:
        """Whether time or loads are limited."""
        return self.demand.minutes is not None or self.demand.loads is not None

    @property
    def _limit_word(self) -> str:
        return "loads" if self.demand.minutes is None else "minutes"

    def _limit_text(self) -> str:
        limits = {"minutes": self.demand.minutes, "loads": self.demand.loads}
        return " and ".join(f"{limit:g} {name}" for name, limit in limits.items() if limit is not None)

    def _least_within_limits(self, *, refuse: bool = True) -> Design:
        inside: list[Design] = []
        shortest: list[Design] = []
        for runs in range(FEWEST_RUNS, MOST_RUNS + 1):
            low, high = self._fewest(runs), self._most(runs)
            if self.demand.loads is not None:
                high = min(high, self.demand.loads // runs)
            if low > high:
                continue
            shortest.append(self.design(runs, low))
            if self._within(shortest[-1]):
                inside.append(self._longest_of(runs, low, high))
        inside = [design for design in inside if self._shows_misfit(design)] or inside
        if not inside:
            nearest = min(shortest, key=self._cost)
            if not refuse:
                return nearest
            raise ConfigError(
                "the limits are too tight for a session", where=f"--{self._limit_word}",
                got=self._limit_text(),
                expected=f"nearest: {nearest.text}, for {self._U_text(nearest)}",
                next_step="allow as much, or state fixtures that take less; nothing was written",
                rule="plan-infeasible",
            )  # fmt: skip
        best = min(inside, key=lambda design: float(np.max(design.U / self.today)))
        if refuse and not self._shows_misfit(best):
            raise ConfigError(
                "no session within the limits shows a misfit", where=f"--{self._limit_word}",
                got=self._limit_text(),
                expected=f"{FEWEST_LEVELS} levels of each load, and {FEWEST_REPEATS} repeats",
                next_step=f"allow more; nearest: {best.text} with --two-levels, at which no misfit is seen",
                rule="plan-infeasible",
            )  # fmt: skip
        final = self.design(best.runs, len(best.run) // best.runs, _FINAL_STARTS) if refuse else best
        return final if self._within(final) and self._shows_misfit(final) else best

    def _longest_of(self, runs: int, low: int, high: int) -> Design:
        """Return the longest design of a number of runs within the limits; ``low`` rows a run are within."""
        if self.demand.minutes is None:  # ``high`` keeps the number of loads
            return self.design(runs, high)
        reach = low
        while reach < high and self._within(self.design(runs, reach)):
            low, reach = reach, min(math.ceil(1.6 * reach), high)
        high = reach if self._within(self.design(runs, reach)) else reach - 1
        while low < high:
            middle = (low + high + 1) // 2
            low, high = (middle, high) if self._within(self.design(runs, middle)) else (low, middle - 1)
        return self.design(runs, low)

    def _U_text(self, design: Design) -> str:
        """Return what a design reaches, rounded up: who asks for that has it."""
        return ", ".join(
            f"{fit.load} {_up(U):.3g} {fit.unit}"
            for fit, U in zip(self.knowledge.record.loads, design.U.tolist(), strict=True)
        )

    def _asked_text(self) -> str:
        return ", ".join(
            f"{fit.load} {U:.3g} {fit.unit}"
            for fit, U in zip(self.knowledge.record.loads, self.asked.tolist(), strict=True)
            if math.isfinite(U)
        )


def _up(U: float) -> float:
    """Return an uncertainty rounded up to three digits.

    >>> _up(0.30021), _up(0.3), _up(1234.0)
    (0.301, 0.3, 1240.0)
    """
    step = 10.0 ** (math.floor(math.log10(U)) - 2)
    return round(math.ceil(U / step - _SAME) * step, 12)
