"""What a calibration certificate says, before it is a document: numbers in the record's units, and texts.

The items are those of ISO/IEC 17025:2017, 7.8.2.1 (every report), 7.8.4.1 (calibration certificates),
7.8.6.2 (conformity), 7.8.7 (opinions) and 7.8.8 (amendments). What nobody stated is None here and a
visible gap on paper.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Literal

from toolkit.calibration.records.record import DataFile, Indication
from toolkit.calibration.records.use import CalibrationUse
from toolkit.calibration.session.statements import DigitalSource
from toolkit.findings import Finding

# Loads of a certificate that have a picture.
MOST_FIGURES = 6

Verdict = Literal["pass", "conditionalPass", "conditionalFail", "fail"]
VERDICTS: dict[str, str] = {
    "pass": "pass",
    "conditionalPass": "conditional pass",
    "conditionalFail": "conditional fail",
    "fail": "fail",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Expanded:
    """An expanded uncertainty at a load: ``at`` and ``U`` in the load's unit, ``probability`` 0 to 1."""

    at: float
    U: float
    k: float
    probability: float
    dof: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One component of the budget at full scale: ``u`` in the load's unit, ``share`` of the variance."""

    name: str
    evaluation: str
    distribution: str
    u: float
    dof: float
    share: float
    source: str
    stated: bool


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
    uncertainty: Expanded
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
    found: Expanded
    as_left: float | None
    left: Expanded | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadResult:
    """The results of one load, in ``unit``.

    ``references`` and ``residuals`` (fitted - reference) are those of the fitted rows; ``range`` has the
    expanded uncertainty over the calibrated range, ``full_scale`` that at the end with the larger load.
    """

    load: str
    unit: str
    terms: tuple[TermLine, ...]
    method: str
    n: int
    dof: int
    residual_sd: float
    minimum: float
    maximum: float
    tolerance: float
    references: tuple[float, ...]
    residuals: tuple[float, ...]
    full_scale: Expanded
    range: tuple[Expanded, ...]
    parts: tuple[Part, ...]
    checks: tuple[CheckLine, ...]
    adjustment: Adjustment | None
    unverifiable: tuple[str, ...]

    @property
    def verdict(self) -> Verdict | None:
        """The least favourable statement of the check loads; None where none was made."""
        order = list(VERDICTS)
        stated = [check.verdict for check in self.checks]
        if not stated or None in stated:
            return None
        return max((verdict for verdict in stated if verdict), key=order.index)

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Components of the budget for which nothing was stated or measured."""
        return tuple(part.name for part in self.parts if not part.stated)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A calibration certificate's content.

    ``simulated``: the instrument is a virtual machine. ``draft_reasons``: why the record is not
    approved, and the paper no certificate. ``rule`` is ``simple``, ``guard_band`` or None where no decision
    rule was agreed: then no conformity is stated.
    ``gaps`` names what a certificate should say and nobody stated; ``findings`` has them too.
    """

    id: str
    issued: dt.date
    received: dt.date | None
    calibrated: dt.date
    approved_on: dt.date | None
    in_force_from: dt.date | None
    draft_reasons: tuple[str, ...]
    simulated: bool
    withdrawn: str | None
    replaces: str | None
    amendment: str | None
    laboratory: str | None
    address: str | None
    place: str | None
    country: str | None
    accreditation: str | None
    customer: str | None
    customer_address: str | None
    item: str
    instrument: str
    method: str | None
    model: str
    phase: str | None
    adjustment: str
    temperature_C: float | None
    reference: str | None
    reference_certificate: str | None
    reference_uncertainties: tuple[tuple[str, float, float, str], ...]
    reference_digital: DigitalSource | None
    rule: str | None
    interval: str | None
    opinions: str | None
    entered_by: str
    checked_by: str | None
    approved_by: str | None
    status: str
    record: str
    record_sha256: str
    record_software: tuple[tuple[str, str], ...]
    data: tuple[DataFile, ...]
    ledger_head: str
    signature: str
    cells: tuple[Indication, ...]
    resolutions: tuple[float | None, ...]
    loads: tuple[LoadResult, ...]
    gaps: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def draft(self) -> bool:
        """True where the record is not approved on the day of issue."""
        return bool(self.draft_reasons)

    @property
    def use(self) -> CalibrationUse:
        """The record with its standing, from which the marks of every page follow."""
        return CalibrationUse(
            id=self.record,
            sha256=self.record_sha256,
            unverified=False,
            draft_reasons=self.draft_reasons,
            since=(self.withdrawn,) if self.withdrawn else (),
            signature=self.signature,
        )

    @property
    def unverifiable(self) -> tuple[tuple[str, str], ...]:
        """Return (load, term) of every term that the check loads could not verify."""
        return tuple((load.load, term) for load in self.loads for term in load.unverifiable)
