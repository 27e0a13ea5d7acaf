"""What a calibration certificate says, before it is a document: numbers in the record's units, and texts.

The items are those of ISO/IEC 17025:2017, 7.8.2.1 (every report), 7.8.4.1 (calibration certificates),
7.8.6.2 (conformity), 7.8.7 (opinions) and 7.8.8 (amendments). It holds what it is of, the record and what its
session stated, and repeats nothing of them. What nobody stated is None there and a visible gap on paper.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.calibration.records.use import CalibrationUse
from toolkit.report.certificate.statements import VERDICTS

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.registry.status import RecordStatus
    from toolkit.calibration.session.statements import Statements
    from toolkit.calibration.uncertainty.model import Budget
    from toolkit.findings import Finding
    from toolkit.report.certificate.statements import Stated, Verdict

# Loads of a certificate that have a picture.
MOST_FIGURES = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class TermLine:
    """One coefficient: ``full`` precision, ``issued`` digits, ``standard_error``, all in ``unit``."""

    term: str
    full: float
    issued: str
    standard_error: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckLine:
    """One check load: ``deviation`` = ``result`` - ``reference``, in the load's unit.

    ``beyond`` names indications outside the range of the fitted data: no conformity is stated there.
    """

    row: int
    reference: float
    result: float
    uncertainty: Budget
    beyond: tuple[str, ...]
    verdict: Verdict | None

    @property
    def deviation(self) -> float:
        """Result minus reference."""
        return self.result - self.reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Adjustment:
    """Before and after adjustment, in the load's unit: largest deviations with their signs.

    ``found`` and ``left`` are the uncertainties of the two deviations: of a load told by the as-found session
    and by this one, at the reference loads ``found.at`` and ``left.at``. Without an adjustment ``as_left``
    and ``left`` are None.
    """

    found_by: str
    as_found: float
    found: Budget
    as_left: float | None
    left: Budget | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadResult:
    """The results of one load, in the unit of its ``fit``, the record's equation.

    ``references`` and ``residuals`` (fitted - reference) are those of the fitted rows; ``range`` has the
    budgets over the calibrated range, ``full_scale`` that at the end with the larger load.
    """

    fit: LoadFit
    terms: tuple[TermLine, ...]
    tolerance: float
    references: tuple[float, ...]
    residuals: tuple[float, ...]
    full_scale: Budget
    range: tuple[Budget, ...]
    checks: tuple[CheckLine, ...]
    adjustment: Adjustment | None
    unverifiable: tuple[str, ...]

    @property
    def load(self) -> str:
        """Name of the load."""
        return self.fit.load

    @property
    def unit(self) -> str:
        """Unit of the load, and of every value here."""
        return self.fit.unit

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest reference load."""
        return min(self.references), max(self.references)

    @property
    def verdict(self) -> Verdict | None:
        """The least favourable statement of the check loads; None where none was made."""
        order = list(VERDICTS)
        stated = [check.verdict for check in self.checks]
        if not stated or None in stated:
            return None
        return max((verdict for verdict in stated if verdict), key=order.index)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A calibration certificate's content.

    ``approval`` is the record's status on the day of issue, None where it is not approved:
    ``draft_reasons`` say why, and the paper is no certificate. ``status`` is what is known today.
    ``simulated``: the instrument is a virtual machine.
    ``gaps`` names what a certificate should say and nobody stated; ``findings`` has them too.
    """

    id: str
    issued: dt.date
    record: CalibrationRecord
    statements: Statements
    stated: Stated
    approval: RecordStatus | None
    status: RecordStatus
    draft_reasons: tuple[str, ...]
    simulated: bool
    replaces: str | None
    amendment: str | None
    item: str
    model: str
    adjustment: str
    entered_by: str
    checked_by: str | None
    approved_by: str | None
    ledger_head: str
    signature: str
    loads: tuple[LoadResult, ...]
    gaps: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def draft(self) -> bool:
        """True where the record is not approved on the day of issue."""
        return bool(self.draft_reasons)

    @property
    def withdrawn(self) -> str | None:
        """Why and from when the record is void; None for one that is not withdrawn."""
        status = self.status
        if status.state != "withdrawn":
            return None
        from_day = status.void_from and not status.void_always
        void = f"void from {status.void_from}" if from_day else "void on every day"
        day = status.known_on or "an unknown day"
        return f"{status.id} was withdrawn on {day}, {void}: {status.reason or 'no reason stated'}"

    @property
    def use(self) -> CalibrationUse:
        """The record with its standing, from which the marks of every page follow."""
        return CalibrationUse(
            id=self.record.id,
            sha256=self.record.sha256,
            unverified=False,
            draft_reasons=self.draft_reasons,
            since=(self.withdrawn,) if self.withdrawn else (),
            signature=self.signature,
        )

    @property
    def unverifiable(self) -> tuple[tuple[str, str], ...]:
        """Return (load, term) of every term that the check loads could not verify."""
        return tuple((load.load, term) for load in self.loads for term in load.unverifiable)
