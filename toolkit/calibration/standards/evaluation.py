"""A session evaluated by a standard: ASTM E74 or ISO 376, with the class or the reasons against one."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from toolkit.calibration.standards.cell_rows import CellRows, CellSource, cell_rows
from toolkit.calibration.standards.e74 import E74Result, evaluate_e74
from toolkit.calibration.standards.iso376 import Iso376Result, evaluate_iso376
from toolkit.calibration.standards.iso376_input import iso376_runs
from toolkit.errors import SessionError

if TYPE_CHECKING:
    from toolkit.calibration.fit.session_fit import SessionFit

Standard = Literal["e74", "iso376"]
STANDARDS: tuple[Standard, ...] = ("e74", "iso376")
COMBINED = (
    "the standard calibrates one indication to one force; the load of several indications is no such "
    "instrument. The load's 'llf' is 2.4 s of the inverse fit and no class can follow from it; one "
    "indication under one load can be evaluated by itself"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """One indication under one load by one standard.

    ``sense`` is that of the force, ``direction`` (E74) of its change: decreasing forces have a curve of
    their own. ``result`` is None where the rows could not be evaluated, and ``reasons`` says why; else they
    are what the session lacks for a class, beyond the result's own reasons. ``left_out`` counts rows that
    do not belong to it.
    """

    standard: Standard
    load: str
    load_unit: str
    indication: str | None
    indication_unit: str | None
    sense: str | None
    direction: str | None
    result: E74Result | Iso376Result | None
    reasons: tuple[str, ...]
    left_out: int

    @property
    def class_name(self) -> str | None:
        """The class, None where there is none or something speaks against one."""
        return None if self.result is None or self.reasons else self.result.class_name

    @property
    def all_reasons(self) -> tuple[str, ...]:
        """Why there is no better class: the session's reasons, then the result's."""
        reasons: tuple[str, ...] = ()
        if isinstance(self.result, Iso376Result):
            reasons = self.result.reasons
        elif isinstance(self.result, E74Result):
            reasons = tuple(f"class {c.name}: {r}" for c in self.result.classes for r in c.reasons)
        return (*self.reasons, *reasons)

    def as_dict(self) -> dict[str, Any]:
        """Return the evaluation as JSON values, with ``class`` and every reason against a better one."""
        content = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "result"}
        figures = None if self.result is None else dataclasses.asdict(self.result)
        return {**content, "class": self.class_name, "reasons": list(self.all_reasons), "result": figures}


def evaluations(fit: SessionFit) -> tuple[Evaluation, ...]:
    """Return a session's evaluations by both standards; for several indications the reason why not."""
    session = fit.session
    source = source_of(fit)
    if len(source.loads) == 1 and len(source.indications) == 1:
        return tuple(
            evaluation
            for standard in STANDARDS
            for evaluation in evaluate_source(
                source, standard=standard, load=source.loads[0], indication=source.indications[0]
            )
        )
    return tuple(
        Evaluation(
            standard=standard,
            load=load.name,
            load_unit=load.unit,
            indication=None,
            indication_unit=None,
            sense=None,
            direction=None,
            result=None,
            reasons=(COMBINED,),
            left_out=session.table.rows,
        )
        for standard in STANDARDS
        for load in session.loads
    )


def source_of(fit: SessionFit) -> CellSource:
    """Return the data of a fitted session."""
    from toolkit.calibration.fit.session_fit import session_statements

    session = fit.session
    return CellSource(
        table=session.table,
        statements=session_statements(session),
        zero=session.zero,
        loads=tuple(load.name for load in session.loads),
        indications=session.indications,
        where=str(session.path),
    )


def evaluate_source(
    source: CellSource,
    *,
    standard: Standard,
    load: str,
    indication: str,
    preloads: int | None = None,
    degree: int | None = None,
) -> tuple[Evaluation, ...]:
    """Evaluate one indication under one load; one result a sense, for E74 also one a direction.

    ``preloads`` are those of the session (``[standard] preloads``) unless given: without them ISO 376 gives
    figures and no class. ``degree`` of the curve: None lets E74 choose by its annex, and is 3 for ISO 376.

    Raises
    ------
    SessionError
        ``standard``: no such load or indication, or no row in which the load acts alone
    """
    preloads = source.statements.preloads if preloads is None else preloads
    evaluations: list[Evaluation] = []
    for rows in cell_rows(source, load, indication):
        if standard == "iso376":
            evaluations.append(_iso376(source, rows, preloads, degree))
        else:
            evaluations += [
                _e74(rows, direction, degree)
                for direction in ("up", "down")
                if any((run.up == (direction == "up")).any() for run in rows.runs)
            ]
    return tuple(evaluations)


def _e74(rows: CellRows, direction: str, degree: int | None) -> Evaluation:
    mine = [run.up == (direction == "up") for run in rows.runs]
    force = np.concatenate([run.force[at] for run, at in zip(rows.runs, mine, strict=True)])
    result, reasons = None, _zero_reasons(rows)
    try:
        result = evaluate_e74(
            force=force,
            indication=np.concatenate([run.deflection[at] for run, at in zip(rows.runs, mine, strict=True)]),
            run=np.concatenate(
                [np.full(at.sum(), run.number) for run, at in zip(rows.runs, mine, strict=True)]
            ),
            resolution=rows.resolution,
            degree=degree,
        )
    except SessionError as error:
        reasons = (*reasons, f"{error.what}: {error.got}")
    return _evaluation("e74", rows, direction, result, reasons)


def _iso376(source: CellSource, rows: CellRows, preloads: int | None, degree: int | None) -> Evaluation:
    stated = source.statements.reference.of(rows.load)
    sequence = iso376_runs(rows.runs, stated=stated)
    result, reasons = None, (*_zero_reasons(rows), *sequence.reasons)
    try:
        result = evaluate_iso376(
            force=sequence.force,
            runs=sequence.runs,
            force_uncertainty=sequence.force_uncertainty,
            resolution=rows.resolution,
            creep=rows.creep,
            preloads=preloads,
            degree=3 if degree is None else degree,
        )
    except SessionError as error:
        reasons = (*reasons, f"{error.what}: {error.got}")
    return _evaluation("iso376", rows, None, result, reasons)


def _zero_reasons(rows: CellRows) -> tuple[str, ...]:
    return () if rows.zero_read else ("the zero before a run was not read: the indication stands for it",)


def _evaluation(
    standard: Standard,
    rows: CellRows,
    direction: str | None,
    result: E74Result | Iso376Result | None,
    reasons: tuple[str, ...],
) -> Evaluation:
    return Evaluation(
        standard=standard,
        load=rows.load,
        load_unit=rows.load_unit,
        indication=rows.indication,
        indication_unit=rows.indication_unit,
        sense=rows.sense,
        direction=direction,
        result=result,
        reasons=reasons,
        left_out=rows.left_out,
    )
