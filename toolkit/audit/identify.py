"""Identify which calibration computed a file's own FY and MZ.

A candidate (see `candidates`) is accepted only if every row of FY and of MZ lies within the bound that the
printed digits explain, plus 1e-9 of the value; where none does, each coefficient may also move by half a
unit of its fifth significant digit. Candidates that the file cannot tell apart make it *ambiguous*.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.audit.candidates import Group, cannot_correct, describe, group_of, shared
from toolkit.audit.model import Columns, Grade, Identification, Repair, Segment, SkippedRecord, worst
from toolkit.audit.runs import Hit, Partition, Reach, Runs, products, reach_of, without_chance
from toolkit.audit.screen import Key, Screen, probe_rows, screen_of
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.units import si_scale

ROWS = 1 << 15
"""Rows on which candidates are evaluated at a time."""

_FIRST_ROWS = 1 << 9
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
    new: Mapping[str, Array] | None = None,
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
        skipped=tuple(SkippedRecord(id=i, reason=r) for i, r in judge.screen.reasons if r is not None),
    )


def recompute(columns: Columns, record: CalibrationRecord) -> dict[str, Array]:
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
    columns: Columns, record: CalibrationRecord, new: Mapping[str, Array] | None = None
) -> Repair | None:
    """Return what a record would change at most; None where it cannot be applied to the file."""
    if new is None and cannot_correct(record, columns) is not None:
        return None
    values = recompute(columns, record) if new is None else new
    largest = {
        load: float(np.max(np.abs(values[load] - columns.y[load] * si_scale(columns.y_units[load]))))
        for load in columns.loads
    }
    return Repair(FY_max_abs_N=largest.get("FY"), MZ_max_abs_Nm=largest.get("MZ"))


@dataclass(slots=True, kw_only=True, eq=False)
class _Judge:
    # Groups are evaluated on some thousand rows at a time, and only as long as they may still be accepted.
    columns: Columns
    screen: Screen
    on: date | None
    in_force: CalibrationRecord | None
    void: frozenset[str]
    groups: list[Group] = field(default_factory=list)  # those that were looked at so far, on no rows
    _places: dict[Key, int] = field(default_factory=dict)
    _small: dict[tuple[int, str, float], bool] = field(default_factory=dict)

    def segments(self) -> tuple[tuple[Segment, ...], tuple[_Answer | None, ...]]:
        """Return the file's segments and the answer of each: the whole file first, parts only if it must."""
        usual = self._usual()
        if usual is not None:
            return usual
        everywhere = [self._place(key) for key in self.screen.for_all_rows(self.columns)]
        for slack in (False, True):
            hits = self._whole_file(everywhere, slack=slack)
            if hits:
                answers = self._answers(hits, slack=slack)
                if len(answers) == 1:  # and does nothing else come near?
                    rivals = self._rivals(hits[0], everywhere, slack=slack)
                    answers = self._answers(rivals, slack=slack)
                return self._conclusion([(0, self.columns.rows, answers)])
        parts = [
            (slack, without_chance(runs)) for slack, runs in zip((False, True), self._runs(), strict=True)
        ]
        slack, runs = min(parts, key=lambda part: (part[1].unknown, part[1].parts, part[0]))
        answered: dict[bytes, tuple[_Answer, ...]] = {}
        signatures = runs.signatures()
        for place, signature in enumerate(signatures):
            if signature not in answered:
                answered[signature] = self._answers(runs.hits(place), slack=slack)
        return self._conclusion(
            [
                (start, stop, () if place is None else answered[signatures[place]])
                for start, stop, place in runs.bounds()
            ]
        )

    def _usual(self) -> tuple[tuple[Segment, ...], tuple[_Answer | None, ...]] | None:
        # Most files are what they should be: by the record in force, as it is, and by nothing else.
        if self.in_force is None:
            return None
        ids = [record.id for record in self.screen.records]
        if self.in_force.id not in ids or not self.columns.loads:
            return None
        plain = tuple(range(len(self.in_force.indications)))
        place = self._place((ids.index(self.in_force.id), False, plain))
        for part in self._parts():
            for load, family in self._on(place, part).families.items():
                if not bool(np.all(np.abs(family.predicted[0] - part.y[load]) <= family.bound)):
                    return None
        hit = Hit(group=place, signs=tuple((load, 0) for load in self.columns.loads))
        answers = self._answers(self._rivals(hit, [], slack=False), slack=False)
        if len(answers) > 1:
            return None
        return self._conclusion([(0, self.columns.rows, answers)])

    def _place(self, key: Key) -> int:
        if key not in self._places:
            self._places[key] = len(self.groups)
            self.groups.append(self.screen.group(key, self.columns.part(slice(0, 0))))
        return self._places[key]

    def _on(self, place: int, part: Columns) -> Group:
        group = self.groups[place]
        return group_of(group.record, part, order=group.order, issued=group.issued)

    def _parts(self) -> Iterator[Columns]:
        # Short parts first: most candidates are refused by a few rows.
        start, size = 0, _FIRST_ROWS
        while start < self.columns.rows:
            yield self.columns.part(slice(start, start + size))
            start, size = start + size, min(4 * size, ROWS)

    def _whole_file(self, places: Sequence[int], *, slack: bool) -> tuple[Hit, ...]:
        # The candidates that fit every row.
        def fits(place: int, part: Columns) -> dict[str, NDArray[np.bool_]]:
            return _fits(self._on(place, part), part, slack=slack)

        return self._lasting(places, fits)

    def _rivals(self, accepted: Hit, others: Sequence[int], *, slack: bool) -> tuple[Hit, ...]:
        """Return the candidates that this file cannot tell from the accepted one, itself included.

        Two candidates are told apart where their predictions differ, in some row of FY or MZ, by more than
        the sum of their two bounds (twice the bound): then not both could fit.
        """
        signs = dict(accepted.signs)
        probe = self.columns.part(probe_rows(self.columns.rows))
        close = self.screen.close_to(self._on(accepted.group, probe), probe, signs)
        places = dict.fromkeys([accepted.group, *others, *(self._place(key) for key in close)])
        mine: dict[str, tuple[Array, Array]] = {}
        seen: Columns | None = None

        def alike(place: int, part: Columns) -> dict[str, NDArray[np.bool_]]:
            nonlocal seen
            if part is not seen:
                seen = part
                for load, family in self._on(accepted.group, part).families.items():
                    bound = family.bound + family.slack if slack else family.bound
                    mine[load] = family.predicted[signs[load]], bound
            close: dict[str, NDArray[np.bool_]] = {}
            for load, rival in self._on(place, part).families.items():
                predicted, limit = mine[load]
                limit = limit + (rival.bound + rival.slack if slack else rival.bound)
                close[load] = ~(np.abs(rival.predicted - predicted) > limit)
            return close

        return self._lasting(tuple(places), alike)

    def _lasting(
        self, places: Sequence[int], fits: Callable[[int, Columns], dict[str, NDArray[np.bool_]]]
    ) -> tuple[Hit, ...]:
        # The candidates of these groups that fit part after part, to the last row.
        lasting: dict[int, dict[str, NDArray[np.bool_]]] = {place: {} for place in places}
        for part in self._parts():
            for place, before in list(lasting.items()):
                now = {load: np.asarray(fit.all(axis=1)) for load, fit in fits(place, part).items()}
                for load, fit in before.items():
                    now[load] &= fit
                if all(fit.any() for fit in now.values()):
                    lasting[place] = now
                else:
                    del lasting[place]
            if not lasting:
                break
        return tuple(hit for place, variants in lasting.items() for hit in products(place, variants))

    def _runs(self) -> tuple[Runs, Runs]:
        # Without and with a unit of the coefficients' fifth digit.
        variants = 2 ** (len(self.columns.names) + 1)
        parted = Partition(self.columns.loads, variants), Partition(self.columns.loads, variants)
        for start in range(0, self.columns.rows, ROWS):
            part = self.columns.part(slice(start, start + ROWS))
            reaches: tuple[list[Reach], list[Reach]] = [], []
            for key, rows in self.screen.anywhere(part):
                few = part.part(rows)
                place = self._place(key)
                group = self._on(place, few)
                for slack, of_slack in zip((False, True), reaches, strict=True):
                    of_slack.append(reach_of(place, rows + start, _fits(group, few, slack=slack)))
            for partition, of_slack in zip(parted, reaches, strict=True):
                partition.add(start + part.rows, of_slack)
        return parted[0].runs(), parted[1].runs()

    def _conclusion(
        self, parts: Sequence[tuple[int, int, tuple[_Answer, ...]]]
    ) -> tuple[tuple[Segment, ...], tuple[_Answer | None, ...]]:
        # Of each part its first row, its stop, and what explains it.
        segments, single = [], []
        for start, stop, answer in parts:
            only = answer[0] if len(answer) == 1 else None
            segments.append(
                Segment(
                    first_row=start + 1,
                    last_row=stop,
                    record=only.record if only else None,
                    # What all candidates of an ambiguous file share is known of it.
                    variant=shared([candidate.variant for candidate in answer]) if answer else None,
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
            members, queue = set(), [next(hit for hit in hits if hit in remaining)]
            while queue:
                hit = queue.pop()
                if hit in members:
                    continue
                members.add(hit)
                for key in (self._coefficients(hit), self._variant(hit)):
                    queue += by_key[key]
            remaining -= members
            answers.append(self._simplest(members, slack=slack))
        return tuple(answers)

    def _simplest(self, hits: set[Hit], *, slack: bool) -> _Answer:
        def rank(hit: Hit) -> tuple[object, ...]:
            group = self.groups[hit.group]
            not_in_force = self.in_force is None or group.record.id != self.in_force.id
            return (
                self._changes(hit), not_in_force, group.record.id in self.void, group.record.id,
                not group.issued, group.order, hit.signs,
            )  # fmt: skip

        hit = min(hits, key=rank) if len(hits) > 1 else next(iter(hits))
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
        size = abs(_constant(self.groups[hit.group].record, load, family.coefficients[variant]))
        place = hit.group, load, size
        if place not in self._small:
            self._small[place] = all(
                bool(np.all(size <= self._on(hit.group, part).families[load].bound)) for part in self._parts()
            )
        if self._small[place]:
            signs[-1] = 1
        return tuple(signs)

    def _variant(self, hit: Hit) -> object:
        # Of two that both explain the rows, and differ in the sign of a constant, that sign says nothing.
        group = self.groups[hit.group]
        return (group.record.id, group.order, tuple(self._signs(hit, *sign)[:-1] for sign in hit.signs))

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
        r"[A-Za-z_]\w*", lambda m: names[group.order[names.index(m[0])]] if m[0] in names else m[0], term
    )


def _scale(group: Group, columns: Columns, term: str) -> float:
    # From the record's indication units to the file's, so that records in other units compare.
    from toolkit.calibration.terms import evaluate, parse_term

    have = dict(zip(columns.names, columns.units, strict=True))
    units = group.record.units
    ratios = {name: si_scale(have[name]) / si_scale(text) for name, text in units.items()}
    return float(evaluate(parse_term(term), ratios, 1.0))


def _constant(record: CalibrationRecord, load: str, coefficients: Array) -> float:
    terms = record.load(load).terms
    return float(coefficients[terms.index(INTERCEPT)]) if INTERCEPT in terms else 0.0


def _moved(order: tuple[int, ...]) -> int:
    return sum(i != image for i, image in enumerate(order))


def _fits(group: Group, part: Columns, *, slack: bool) -> dict[str, NDArray[np.bool_]]:
    # By load, (variants, rows).
    return {
        load: np.abs(family.predicted - part.y[load])
        <= (family.bound + family.slack if slack else family.bound + 0.0)
        for load, family in group.families.items()
    }
