"""A record's stored rows evaluated by a standard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.standards.cell_rows import CellSource
from toolkit.calibration.standards.evaluation import COMBINED, Evaluation, Standard, evaluate_source
from toolkit.errors import SessionError

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry


def evaluate_record(
    registry: Registry,
    record_id: str,
    *,
    standard: Standard,
    load: str | None = None,
    indication: str | None = None,
    preloads: int | None = None,
    degree: int | None = None,
) -> tuple[Evaluation, ...]:
    """Evaluate one indication under one load of a record; both may be left out where there is only one.

    Raises
    ------
    SessionError
        ``standard``: several loads or indications and none was named, or one that the record does not have
    RegistryError, RecordError
        the record may not be used
    """
    record = registry.load(record_id)
    table = stored_loads(registry.folder, record)
    if table is None:
        raise _refused(
            record_id,
            "the record has no reference-load data",
            "a legacy import",
            "a fitted record",
            "calibrate the instrument from a session",
        )
    loads = tuple(load.load for load in record.loads)
    if (load is None and len(loads) > 1) or (indication is None and len(record.indications) > 1):
        raise _refused(
            record_id,
            f"the load and the indication are not stated: {COMBINED}",
            f"loads {', '.join(loads)}; indications {', '.join(record.indications)}",
            "--load and --indication",
        )
    return evaluate_source(
        CellSource(
            table=table,
            statements=statements_of(record),
            zero=record.zero,
            loads=loads,
            indications=record.indications,
            where=record_id,
        ),
        standard=standard,
        load=load or loads[0],
        indication=indication or record.indications[0],
        preloads=preloads,
        degree=degree,
    )


def _refused(
    where: str,
    problem: str,
    actual: object,
    expected: object,
    next_step: str = "name one of each with --load and --indication",
) -> SessionError:
    return SessionError(
        problem, where=where, got=actual, expected=expected, next_step=next_step, rule="standard"
    )
