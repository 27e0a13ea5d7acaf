"""From a registry's record to a certificate: who may have one, and what it says.

It also says what it lacks: gaps, conformity, state of the record.
"""

from __future__ import annotations

import datetime as dt
import json
import re

from toolkit.calibration.control.as_found import AsFound, as_found, as_found_before
from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.clock import check_begun
from toolkit.calibration.registry.gates import unverifiable
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import Reason, not_in_force, unapproved
from toolkit.calibration.registry.status import RecordStatus
from toolkit.calibration.registry.stored import stored_check, stored_loads
from toolkit.calibration.session.statements import Statements, statements_of
from toolkit.errors import ConfigError, RecordError, ToolkitError
from toolkit.findings import Finding
from toolkit.inputs import RECORD_FILE, read_input
from toolkit.machine import load_machine, machine_names
from toolkit.report.certificate.loads import FoundSession, load_results
from toolkit.report.certificate.model import MOST_FIGURES, Certificate, LoadResult
from toolkit.report.certificate.statements import Stated, read_stated
from toolkit.report.style import Style

_METHODS = {
    "ols": "ordinary least squares",
    "wls": "least squares weighted by the stated uncertainties of the reference loads",
    "gls": "generalised least squares, with the error that reference loads share",
    "odr": "orthogonal distance regression, with the stated uncertainties of loads and indications",
}
_AMENDED = re.compile(r"(?P<stem>.+)-A(?P<number>[1-9][0-9]*)\Z")


def collect(
    registry: Registry,
    record_id: str,
    style: Style,
    *,
    issued: dt.date | None = None,
    draft: bool = False,
    replaces: str | None = None,
    amendment: str | None = None,
) -> Certificate:
    """Return the certificate of a record.

    Parameters
    ----------
    registry : the laboratory's
    style : for the laboratory's own name, address and place
    issued : day of issue, and of what was known; default today
    draft : let a record pass that is not approved; the paper then says that it is no certificate
    replaces, amendment : the id of the certificate that this one replaces, and why

    Raises
    ------
    RegistryError, RecordError
        no such record, or one that fails a gate; ``certificate-unverified`` a legacy import;
        ``certificate-candidate`` not approved and no draft; ``certificate-withdrawn`` withdrawn; ``time``
        the day of issue has not begun
    ConfigError
        a statement that cannot be printed; a replacement without a reason, or the reverse
    """
    record = registry.load(record_id)
    ledger = registry.ledger(record.instrument)
    if issued is not None:
        check_begun(issued, "the day of issue", record.id)
    # What was decided is known, also by a clock that was set back; no decision moves the day of issue.
    day = issued or registry.today()
    status = registry.status(record_id, known_at=ledger.known_on(issued))
    reasons = _admit(registry, record, status, day, draft)
    later = registry.status(record_id)
    statements = statements_of(record)
    stated = read_stated(statements.certificate, style, recall=status.recall, where=record.id)
    loads, check = stored_loads(registry.folder, record), stored_check(registry.folder, record)
    if loads is None:
        raise _refused(record.id, "certificate-unverified", "no reference loads", "its reference loads")
    as_found_result = _found(registry, record, statements)
    results = load_results(
        record,
        loads,
        check,
        rule=stated.rule if check is not None else None,
        unverifiable=unverifiable(record, check, loads),
        found=None if as_found_result is None else _found_session(registry, as_found_result),
        as_left=statements.phase == "as_left",
    )
    gaps = gaps_of(record, statements, stated)
    titled = registry.people().history.titled
    return Certificate(
        id=_identity(record, stated, replaces, amendment),
        issued=day,
        record=record,
        statements=statements,
        stated=stated,
        approval=None if reasons else status,
        status=later,
        draft_reasons=reasons,
        simulated=_simulated(record.instrument),
        replaces=replaces,
        amendment=amendment,
        item=stated.get("item") or f"Load cells {', '.join(record.indications)} of {record.instrument}",
        model=_model(record),
        adjustment=_adjustment(statements, as_found_result),
        entered_by=titled(record.entered_by),
        checked_by=None if reasons or status.checked_by is None else titled(status.checked_by),
        approved_by=None if reasons or status.approved_by is None else titled(status.approved_by),
        ledger_head=ledger.decided,
        signature=registry.signature(record.id),
        loads=results,
        gaps=gaps,
        findings=(
            *stated.findings,
            *gap_findings(record, gaps),
            *result_findings(record, results, check is None, stated),
            *state_findings(record, reasons, later, _same_number(registry, record, stated)),
            *doubt_findings(ledger, record.instrument),
        ),
    )


def _simulated(instrument: str) -> bool:
    return instrument in machine_names() and load_machine(instrument).simulated


def _admit(
    registry: Registry, record: CalibrationRecord, status: RecordStatus, day: dt.date, draft: bool
) -> tuple[str, ...]:
    """Return why the paper is a draft, empty where it is none; refuse what may have no certificate at all."""
    if not record.verified:
        raise _refused(
            record.id, "certificate-unverified", "a legacy import, without its reference loads",
            "a record that reproduces from its own data",
        )  # fmt: skip
    if status.state == "withdrawn":
        raise _refused(
            record.id, "certificate-withdrawn", f"withdrawn: {status.reason or 'no reason stated'}",
            "a record that is not withdrawn, or the paper of an earlier day with --known-at",
        )  # fmt: skip
    if status.state == "discarded":
        raise _refused(
            record.id, "certificate-discarded", f"discarded: {status.reason or 'no reason stated'}",
            "a record that was approved",
        )  # fmt: skip
    if day < dt.date.fromisoformat(record.date):
        raise _refused(
            record.id, "certificate-date", f"an issue on {day.isoformat()}",
            f"a day not before the calibration on {record.date}",
        )  # fmt: skip
    reasons = unapproved(registry, record, status)
    if status.known_on is not None and status.known_on > day:
        text = f"not approved on {day.isoformat()}: the approval is of {status.known_on.isoformat()}"
        reasons = (Reason(text=text, next_step="name a later day of issue with --known-at"),)
    if reasons and not draft:
        expected = f"a record that is approved on {day.isoformat()}, the day of issue"
        raise not_in_force(
            record.id, reasons, where=record.id, expected=expected, rule="certificate-candidate"
        )
    return tuple(reason.text for reason in reasons)


def _identity(record: CalibrationRecord, stated: Stated, replaces: str | None, amendment: str | None) -> str:
    """Return the certificate's own id: its number as stated, else of the record; -A1 for an amendment."""
    if bool(replaces) != bool(amendment):
        raise ConfigError(
            "an amended certificate names the one that it replaces, and why",
            where="--replaces, --amendment-reason",
            got=f"--replaces {replaces}" if replaces else f"--amendment-reason {amendment!r}",
            expected="both options",
            next_step="give --replaces CERT-ID and --amendment-reason TEXT together",
            rule="usage",
        )
    certificate = stated.get("number") or f"CC-{record.id}-{record.sha256[:8].upper()}"
    if not replaces:
        return certificate
    match = _AMENDED.match(replaces)
    stem, number = (match["stem"], int(match["number"])) if match else (replaces, 0)
    return f"{certificate}-A{number + 1}" if stem == certificate else certificate


def _found(registry: Registry, record: CalibrationRecord, statements: Statements) -> AsFound | None:
    if statements.phase == "as_found":
        return as_found(registry, record)
    return as_found_before(registry, record) if statements.phase == "as_left" else None


def _found_session(registry: Registry, condition: AsFound) -> FoundSession | None:
    session = registry.load(condition.session_record)
    loads = stored_loads(registry.folder, session)
    if loads is None:
        return None
    return FoundSession(
        result=condition, session=session, loads=loads, check=stored_check(registry.folder, session)
    )


def _adjustment(statements: Statements, as_found: AsFound | None) -> str:
    if statements.phase is None:
        return "No adjustment or repair is stated: the results hold for the item as it was calibrated."
    if statements.phase == "as_found":
        text = "The results are those of the item as found, before any adjustment."
    else:
        text = "The results are those of the item as left, after adjustment."
    if as_found is None:
        return f"{text} There is no record of the results before the adjustment."
    if as_found.reason is not None:
        return f"{text} As found could not be judged: {as_found.reason}."
    return f"{text} As found is judged by {as_found.record}, the record in force when the item came in."


def _same_number(registry: Registry, record: CalibrationRecord, stated: Stated) -> str | None:
    """Return another record of the instrument that may have a certificate of the same number.

    A candidate has none: the as-found session of a pair is told on the certificate of the as-left one.
    """
    number = stated.get("number")
    if number is None:
        return None
    ledger = registry.ledger(record.instrument)
    for record_id in registry.ids(record.instrument):
        path = registry.folder / record.instrument / f"{record_id}.json"
        approved = any(entry.event == "approved" for entry in ledger.of(record_id))
        if record_id == record.id or not approved or not path.is_file():
            continue
        try:
            earlier = from_bytes(read_input(path, RECORD_FILE), where=path)
            table = json.loads(earlier.settings).get("certificate", {})
        except ToolkitError:
            continue  # 'verify' names a damaged record; this one is not concerned by it
        if str(table.get("number", "")) == number:
            return record_id
    return None


def _model(record: CalibrationRecord) -> str:
    terms = record.loads[0].terms
    fit = _METHODS.get(record.loads[0].method, record.loads[0].method)
    zero = {
        "tared": "indications tared before each run",
        "run": "indications from the zero of each run",
        "included": "zero of the cells included",
    }[record.zero]
    return f"load = sum of coefficient x term, {len(terms)} terms a load, fitted by {fit}; {zero}"


def _refused(where: str, rule: str, got: str, expected: str) -> RecordError:
    return RecordError(
        f"{where} has no calibration certificate",
        where=where,
        got=got,
        expected=expected,
        next_step="see 'toolkit calibration show' and 'history'; nothing was written",
        rule=rule,
    )


_GAPS = (
    ("laboratory", "name of the laboratory"),
    ("address", "address of the laboratory"),
    ("place", "place of the calibration"),
    ("customer", "customer"),
    ("method", "method of the calibration"),
    ("decision_rule", "decision rule: no conformity is stated"),
)


def gaps_of(record: CalibrationRecord, statements: Statements, stated: Stated) -> tuple[str, ...]:
    """Return what a certificate should say and nobody stated, in words."""
    gaps = [text for key, text in _GAPS if stated.get(key) is None]
    if statements.temperature_C is None:
        gaps.append("temperature during the calibration")
    if statements.reference.standard is None:
        gaps.append("reference standard")
    if statements.reference.certificate is None:
        gaps.append("certificate of the reference standard")
    gaps += [
        f"uncertainty of the reference standard for {load.load}"
        for load in record.loads
        if statements.reference.u(load.load) is None
    ]
    gaps += [f"serial number of {cell.name}" for cell in record.cells if cell.serial is None]
    return tuple(gaps)


def gap_findings(record: CalibrationRecord, gaps: tuple[str, ...]) -> list[Finding]:
    """Return a finding for each gap."""
    return [Finding(rule="certificate-gap", where=record.id, message=f"not stated: {gap}") for gap in gaps]


def result_findings(
    record: CalibrationRecord, results: tuple[LoadResult, ...], no_check: bool, stated: Stated
) -> list[Finding]:
    """Return the findings about the results: conformity, budget, pictures."""
    findings = []
    if no_check and stated.rule is not None:
        findings.append(
            Finding(
                rule="certificate-conformity",
                where=record.id,
                message="a decision rule is stated, but the session has no check loads to apply it to",
            )
        )
    for result in results:
        if result.verdict in ("conditionalFail", "fail"):
            worst = max(result.checks, key=lambda line: abs(line.deviation))
            findings.append(
                Finding(
                    rule="certificate-conformity",
                    where=result.load,
                    message=f"{result.verdict}: check load {worst.row} deviates by {worst.deviation:+.4g} "
                    f"{result.unit}, tolerance {result.tolerance:.4g} {result.unit}",
                )
            )
        findings += [
            Finding(
                rule="certificate-conformity",
                where=f"{result.load}, check row {line.row}",
                message=f"{', '.join(line.beyond)} lies beyond the fitted range: no conformity is stated",
            )
            for line in result.checks
            if line.beyond
        ]
        if absent := result.full_scale.not_stated:
            findings.append(
                Finding(
                    rule="certificate-budget",
                    where=result.load,
                    message=f"the uncertainty holds no contribution of {', '.join(absent)}: "
                    "nothing was stated or measured",
                    level="note",
                )
            )
    if len(results) > MOST_FIGURES:
        findings.append(
            Finding(
                rule="certificate-figures",
                where=record.id,
                message=f"{len(results)} loads, of which the first {MOST_FIGURES} have a picture",
            )
        )
    return findings


def state_findings(
    record: CalibrationRecord, reasons: tuple[str, ...], later: RecordStatus, same: str | None
) -> list[Finding]:
    """Return the findings about the record's state and the uniqueness of the certificate's number."""
    findings = []
    if reasons:
        message = f"the paper says DRAFT and is no certificate: {'; '.join(reasons)}"
        findings.append(Finding(rule="certificate-draft", where=record.id, message=message))
    if later.state == "withdrawn":
        message = f"withdrawn since the day asked for: {later.reason or 'no reason stated'}"
        findings.append(Finding(rule="certificate-withdrawn", where=record.id, message=message))
    if same is not None:
        message = f"{same} states the same certificate number: an id must be unique"
        findings.append(Finding(rule="certificate-number", where=record.id, message=message))
    return findings


def doubt_findings(ledger: Ledger, instrument: str) -> list[Finding]:
    """Return the finding about a ledger that a computer whose clock was fast has written to."""
    if ledger.doubt is None:
        return []
    return [Finding(rule="ledger-time", where=instrument, message=f"of the ledger {ledger.doubt}")]
