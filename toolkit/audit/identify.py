"""Identify which calibration computed a file's own FY and MZ.

A candidate (see `candidates`) is accepted only if every row of FY and of MZ lies within the bound that the
printed digits explain, plus 1e-9 of the value; where none does, each coefficient may also move by half a
unit of its fifth significant digit. Candidates that the file cannot tell apart make it *ambiguous*.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from toolkit.audit.candidates import Group, describe, unfit
from toolkit.audit.columns import Columns
from toolkit.audit.model import Grade, Identification, Repair, Segment, Skipped, worst
from toolkit.audit.screen import Key, Screen, screen_of
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.units import si_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord

# Segments: which candidate fits which rows of a file that changes in the middle.


_LUCKY = 3  # rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """A candidate: ``group`` by its index, and the sign variant of each load by its index."""

    group: int
    signs: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Rows ``start`` to ``stop`` (0-based, stop excluded) and the candidates that fit all of them."""

    start: int
    stop: int
    hits: tuple[Hit, ...]


def whole_file(fits: Sequence[dict[str, NDArray[np.bool_]]]) -> tuple[Hit, ...]:
    """Return the candidates that fit every row; ``fits`` has (variants, rows) a load for each group."""
    hits: list[Hit] = []
    for index, by_load in enumerate(fits):
        choices = [[(load, int(v)) for v in np.flatnonzero(fit.all(axis=1))] for load, fit in by_load.items()]
        hits += _products(index, choices)
    return tuple(hits)


def partition(fits: Sequence[dict[str, NDArray[np.bool_]]], rows: int) -> tuple[Run, ...]:
    """Split a file into runs of rows that the same candidates fit."""
    lengths = [{load: _run_lengths(fit) for load, fit in by_load.items()} for by_load in fits]
    # A pair of variants fits as long as the shorter of the two; the longest pair is wanted.
    reaches = np.zeros((len(fits), rows), dtype=np.int64)
    for reach, by_load in zip(reaches, lengths, strict=True):
        if by_load:
            reach[:] = np.minimum.reduce([length.max(axis=0) for length in by_load.values()])
    runs: list[Run] = []
    row = 0
    while row < rows:
        reach_here = reaches[:, row]
        longest = int(reach_here.max(initial=0))
        hits: list[Hit] = []
        for index in np.flatnonzero(reach_here == longest).tolist() if longest else ():
            choices = [
                [(load, int(v)) for v in np.flatnonzero(length[:, row] >= longest)]
                for load, length in lengths[index].items()
            ]
            hits += _products(index, choices)
        if longest == 0 and runs and not runs[-1].hits:
            runs[-1] = Run(start=runs[-1].start, stop=row + 1, hits=())
        else:
            runs.append(Run(start=row, stop=row + max(longest, 1), hits=tuple(hits)))
        row += max(longest, 1)
    return tuple(runs)


def without_chance(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Return the runs without those that a file of unknown origin has by chance.

    Thousands of candidates meet a few rows of any file. Where over half of the rows have no candidate, a run
    of one to three rows counts only if one of its candidates explains three rows and a fiftieth of the file.
    """
    unknown = sum(run.stop - run.start for run in runs if not run.hits)
    if 2 * unknown <= runs[-1].stop:
        return tuple(runs)
    explained: Counter[Hit] = Counter()
    for run in runs:
        explained.update(dict.fromkeys(run.hits, run.stop - run.start))
    enough = max(_LUCKY, runs[-1].stop / 50)
    kept_runs: list[Run] = []
    for run in runs:
        lucky = run.stop - run.start <= _LUCKY and all(explained[hit] < enough for hit in run.hits)
        if run.hits and not lucky:
            kept_runs.append(run)
        elif kept_runs and not kept_runs[-1].hits:
            kept_runs[-1] = Run(start=kept_runs[-1].start, stop=run.stop, hits=())
        else:
            kept_runs.append(Run(start=run.start, stop=run.stop, hits=()))
    return tuple(kept_runs)


def _run_lengths(fit: NDArray[np.bool_]) -> NDArray[np.int64]:
    # How many rows from this one on fit without a break, variants x rows.
    rows = fit.shape[1]
    position = np.arange(rows)
    breaks = np.where(fit, rows, position)
    next_break = np.minimum.accumulate(breaks[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(next_break - position)


def _products(index: int, choices: list[list[tuple[str, int]]]) -> list[Hit]:
    import itertools

    if not choices:
        return []
    return [Hit(group=index, signs=signs) for signs in itertools.product(*choices)]


def distinct_rivals(groups: Sequence[Group], accepted: Hit, *, slack: bool) -> tuple[Hit, ...]:
    """Return the candidates that this file cannot tell from the accepted one, itself included.

    Two candidates are told apart where their predictions differ, in some row of FY or MZ, by more than the
    sum of their two bounds (twice the bound): then not both could fit.
    """
    accepted_group = groups[accepted.group]
    close: list[Hit] = []
    for index, group in enumerate(groups):
        choices = []
        for load, variant in accepted.signs:
            mine, rival = accepted_group.families[load], group.families[load]
            limit = mine.bound + rival.bound
            if slack:
                limit = limit + mine.slack + rival.slack
            apart = np.abs(rival.predicted - mine.predicted[variant]) > limit
            choices.append([(load, int(v)) for v in np.flatnonzero(~apart.any(axis=1))])
        close += _products(index, choices)
    return tuple(close)


_ALIKE = "{:.12g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Answer:
    # Candidates with equal coefficients, under the name of the simplest.
    record: str
    variant: str | None
    swapped: bool
    issued: bool
    slack: bool


def identify_columns(
    columns: Columns,
    records: Sequence[CalibrationRecord],
    *,
    on: date | None,
    in_force: CalibrationRecord | None,
    void: Collection[str] = (),
    screen: Screen | None = None,
    new: Mapping[str, NDArray[np.float64]] | None = None,
) -> Identification:
    """Identify which of the records computed a recording.

    Parameters
    ----------
    columns : those of the file, as its header names them
    records : those of its instrument that the registry lets be used
    on : the test's date, None where it is not known
    in_force : the record in force on that date, None where there is none
    void : ids of records that are void on every day
    screen : that of the records for files of this layout, where the caller keeps it for many files
    new : what `recompute` gives by the record in force, where the caller has it
    """
    judge = _Judge(
        columns=columns,
        screen=screen or screen_of(records, columns),
        on=on,
        in_force=None if on is None else in_force,
        void=frozenset(void),
    )
    segments, answers = judge.segments()
    deciding = worst(tuple(segment.grade for segment in segments))
    at = next(i for i, segment in enumerate(segments) if segment.grade == deciding)
    answer = answers[at]
    return Identification(
        grade=deciding,
        record=segments[at].record,
        variant=segments[at].variant,
        issued=answer.issued if answer is not None else None,
        candidates=segments[at].candidates,
        segments=segments,
        in_force=None if judge.in_force is None else judge.in_force.id,
        repair=None if judge.in_force is None else repair(columns, judge.in_force, new),
        skipped=tuple(Skipped(id=i, reason=r) for i, r in judge.screen.reasons if r is not None),
    )


def recompute(columns: Columns, record: CalibrationRecord) -> dict[str, NDArray[np.float64]]:
    """Return FY [N] and MZ [N·m] (rows,) by a record's full coefficients, columns as named by the header."""
    scale = {
        name: si_scale(columns.units[columns.names.index(name)]) / si_scale(text)
        for name, text in zip(record.indications, record.indication_units, strict=True)
    }
    x = {name: columns.x[:, columns.names.index(name)] * factor for name, factor in scale.items()}
    return {
        load: term_matrix(fit.terms, x) @ np.array(fit.coefficients) * si_scale(fit.unit)
        for load, fit in ((load, record.load(load)) for load in columns.loads)
    }


def repair(
    columns: Columns, record: CalibrationRecord, new: Mapping[str, NDArray[np.float64]] | None = None
) -> Repair | None:
    """Return what a record would change at most; None where it cannot be applied to the file."""
    if new is None and unfit(record, columns) is not None:
        return None
    values = recompute(columns, record) if new is None else new
    most = {
        load: float(np.max(np.abs(values[load] - columns.y[load] * si_scale(columns.y_units[load]))))
        for load in columns.loads
    }
    return Repair(FY_max_abs_N=most.get("FY"), MZ_max_abs_Nm=most.get("MZ"))


@dataclass(slots=True, kw_only=True, eq=False)
class _Judge:
    columns: Columns
    screen: Screen
    on: date | None
    in_force: CalibrationRecord | None
    void: frozenset[str]
    groups: list[Group] = field(default_factory=list)  # those that the screen let through so far
    _keys: set[Key] = field(default_factory=set)

    def segments(self) -> tuple[tuple[Segment, ...], tuple[_Answer | None, ...]]:
        """Return the file's segments and the answer of each: the whole file first, parts only if it must."""
        usual = self._usual()
        if usual is not None:
            return usual
        self._let_in(self.screen.for_all_rows(self.columns))
        for slack in (False, True):
            hits = whole_file(self._fits(slack=slack))
            if hits:
                answers = self._answers(hits, slack=slack)
                if len(answers) == 1:  # and does nothing else come near?
                    accepted = self.groups[hits[0].group]
                    self._let_in(self.screen.close_to(accepted, self.columns, dict(hits[0].signs)))
                    answers = self._answers(distinct_rivals(self.groups, hits[0], slack=slack), slack=slack)
                return self._conclusion([Run(start=0, stop=self.columns.rows, hits=hits)], [answers])
        self._let_in(self.screen.anywhere(self.columns))
        parts = [
            (slack, without_chance(partition(self._fits(slack=slack), self.columns.rows)))
            for slack in (False, True)
        ]
        slack, runs = min(parts, key=lambda part: (_unknown_rows(part[1]), len(part[1]), part[0]))
        return self._conclusion(runs, [self._answers(run.hits, slack=slack) for run in runs])

    def _usual(self) -> tuple[tuple[Segment, ...], tuple[_Answer | None, ...]] | None:
        # Most files are what they should be: by the record in force, as it is, and by nothing else.
        if self.in_force is None:
            return None
        ids = [record.id for record in self.screen.records]
        if self.in_force.id not in ids or not self.columns.loads:
            return None
        plain = tuple(range(len(self.in_force.indications)))
        self._let_in([(ids.index(self.in_force.id), False, plain)])
        for load, family in self.groups[0].families.items():
            if not bool(np.all(np.abs(family.predicted[0] - self.columns.y[load]) <= family.bound)):
                return None
        hit = Hit(group=0, signs=tuple((load, 0) for load in self.groups[0].families))
        self._let_in(self.screen.close_to(self.groups[0], self.columns, dict(hit.signs)))
        answers = self._answers(distinct_rivals(self.groups, hit, slack=False), slack=False)
        if len(answers) > 1:
            return None
        return self._conclusion([Run(start=0, stop=self.columns.rows, hits=(hit,))], [answers])

    def _let_in(self, keys: Sequence[Key]) -> None:
        new = [key for key in keys if key not in self._keys]
        self._keys.update(new)
        self.groups += [self.screen.group(key, self.columns) for key in new]

    def _fits(self, *, slack: bool) -> list[dict[str, NDArray[np.bool_]]]:
        return [
            {
                load: np.abs(family.predicted - self.columns.y[load])
                <= family.bound + (family.slack if slack else 0.0)
                for load, family in group.families.items()
            }
            for group in self.groups
        ]

    def _conclusion(
        self, runs: Sequence[Run], answers: Sequence[tuple[_Answer, ...]]
    ) -> tuple[tuple[Segment, ...], tuple[_Answer | None, ...]]:
        segments, single = [], []
        for run, answer in zip(runs, answers, strict=True):
            only = answer[0] if len(answer) == 1 else None
            # What all candidates of an ambiguous file share is known of it.
            variants = {a.variant for a in answer}
            segments.append(
                Segment(
                    first_row=run.start + 1,
                    last_row=run.stop,
                    record=only.record if only else None,
                    variant=variants.pop() if len(variants) == 1 else None,
                    grade=self._grade(only) if only else "ambiguous" if answer else "unknown",
                    candidates=tuple(sorted({a.record for a in answer})) if len(answer) > 1 else (),
                )
            )
            single.append(only)
        return tuple(segments), tuple(single)

    def _grade(self, answer: _Answer) -> Grade:
        if answer.swapped:
            return "column_swap"
        if answer.variant is not None:
            return "sign_variant"
        if answer.record in self.void:
            return "stale"
        if self.on is None:
            return "undated"
        if self.in_force is None or answer.record != self.in_force.id:
            return "stale"
        return "rounding" if answer.slack else "exact"

    def _answers(self, hits: Sequence[Hit], *, slack: bool) -> tuple[_Answer, ...]:
        # Equal coefficients are one candidate, named after the plain record or the one with fewest changes;
        # full and issued digits of one record and variant are one candidate too.
        if len(hits) == 1:
            return (self._simplest(set(hits), slack=slack),)
        by_key: dict[object, set[Hit]] = {}
        for hit in hits:
            for key in (self._coefficients(hit), self._variant(hit)):
                by_key.setdefault(key, set()).add(hit)
        answers: list[_Answer] = []
        remaining = set(hits)
        while remaining:
            same, queue = set(), [next(hit for hit in hits if hit in remaining)]
            while queue:
                hit = queue.pop()
                if hit in same:
                    continue
                same.add(hit)
                for key in (self._coefficients(hit), self._variant(hit)):
                    queue += by_key[key]
            remaining -= same
            answers.append(self._simplest(same, slack=slack))
        return tuple(answers)

    def _simplest(self, same: set[Hit], *, slack: bool) -> _Answer:
        def rank(hit: Hit) -> tuple[object, ...]:
            group = self.groups[hit.group]
            not_in_force = self.in_force is None or group.record.id != self.in_force.id
            return (
                self._changes(hit), not_in_force, group.record.id in self.void, group.record.id,
                not group.issued, group.order, hit.signs,
            )  # fmt: skip

        hit = min(same, key=rank) if len(same) > 1 else next(iter(same))
        group = self.groups[hit.group]
        signs = {load: self._signs(hit, load, variant) for load, variant in hit.signs}
        return _Answer(
            record=group.record.id,
            variant=describe(group.record, group.order, signs),
            swapped=_moved(group.order) > 0,
            issued=group.issued,
            slack=slack,
        )

    def _changes(self, hit: Hit) -> int:
        turned = sum(self._signs(hit, load, variant).count(-1) for load, variant in hit.signs)
        return turned + _moved(self.groups[hit.group].order)

    def _signs(self, hit: Hit, load: str, variant: int) -> tuple[int, ...]:
        # The sign of a constant that is smaller than what rounding hides says nothing: it counts as right.
        family = self.groups[hit.group].families[load]
        signs = [int(s) for s in family.signs[variant]]
        constant = _constant(self.groups[hit.group].record, load, family.coefficients[variant])
        if bool(np.all(abs(constant) <= family.bound)):
            signs[-1] = 1
        return tuple(signs)

    def _variant(self, hit: Hit) -> object:
        group = self.groups[hit.group]
        return (group.record.id, group.order, tuple(self._signs(hit, *sign) for sign in hit.signs))

    def _coefficients(self, hit: Hit) -> object:
        # By load: what each column, and the constant, is multiplied by in the file's units.
        group = self.groups[hit.group]
        texts = []
        for load, variant in hit.signs:
            fit = group.record.load(load)
            names = [_in_columns(group, term) for term in fit.terms]
            values = group.families[load].coefficients[variant].tolist()
            texts.append(
                (
                    load,
                    tuple(
                        sorted(
                            (n, _ALIKE.format(v * _scale(group, self.columns, t)))
                            for n, v, t in zip(names, values, fit.terms, strict=True)
                            if v
                        )
                    ),
                )
            )
        return tuple(texts)


def _in_columns(group: Group, term: str) -> str:
    # A term's name when each channel is called after the column that it was read from.
    import re

    names = group.record.indications
    return re.sub(
        r"[A-Za-z_]\w*",
        lambda m: names[group.order[names.index(m[0])]] if m[0] in names else m[0],
        term,
    )


def _scale(group: Group, columns: Columns, term: str) -> float:
    # From the record's indication units to the file's, so that records in other units compare.
    from toolkit.calibration.terms import parse_term

    have = dict(zip(columns.names, columns.units, strict=True))
    units = dict(zip(group.record.indications, group.record.indication_units, strict=True))
    factor = 1.0
    parsed = parse_term(term)
    for name, power in (*parsed.powers, *((name, 1) for name in parsed.absolutes)):
        factor *= (si_scale(have[name]) / si_scale(units[name])) ** power
    return factor


def _constant(record: CalibrationRecord, load: str, coefficients: NDArray[np.float64]) -> float:
    terms = record.load(load).terms
    return float(coefficients[terms.index(INTERCEPT)]) if INTERCEPT in terms else 0.0


def _moved(order: tuple[int, ...]) -> int:
    return sum(i != image for i, image in enumerate(order))


def _unknown_rows(runs: Sequence[Run]) -> int:
    return sum(run.stop - run.start for run in runs if not run.hits)
