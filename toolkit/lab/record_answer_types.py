"""Answers on recordings and records, as types: `inspect`, `calibrate`, `calibration list, show, history`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NotRequired, TypedDict

from toolkit.declared.answers import merged
from toolkit.findings import FindingEntry


class SeriesEntry(TypedDict):
    """A column of a recording."""

    symbol: Annotated[str, "channel"]
    header: Annotated[str, "as the file has it"]
    unit: str
    role: Annotated[str, "indication, load, angle, ..."]


class Block(TypedDict):
    """Rows of one load and slip angle."""

    first_row: int
    last_row: int
    rows: int
    tare: Annotated[bool, "whether it is taken without load"]
    load_N: float
    load_lbf: float | None
    slip_angle_deg: Annotated[float, "measured"]


class BlockValues(TypedDict):
    """Fy and Mz of a block, as the file has them and as the record in force computes them."""

    first_row: int
    last_row: int
    FY_file_N: float | None
    FY_N: float | None
    FY_file_lbf: float | None
    FY_lbf: float | None
    MZ_file_Nm: float | None
    MZ_Nm: float | None
    MZ_file_lbf_ft: float | None
    MZ_lbf_ft: float | None


class Segment(TypedDict):
    """Rows that one record computed."""

    first_row: int
    last_row: int
    record: str | None
    variant: Annotated[str | None, "how the record was changed: E5 negative in FY, MZ"]
    grade: str
    candidates: NotRequired[Annotated[Sequence[str], "of an ambiguous segment"]]


class Repair(TypedDict):
    """The largest difference between the file and the record in force."""

    FY_max_abs_N: float | None
    MZ_max_abs_Nm: float | None


class SkippedRecord(TypedDict):
    """A record that could not be a candidate."""

    id: str
    reason: str


class RefusedRecord(TypedDict):
    """A record that does not hold what its hash says."""

    id: str
    rule: str
    reason: str


class Identified(TypedDict):
    """Which calibration computed the Fy and Mz of a file."""

    grade: Annotated[str, "exact, rounding, undated, stale, sign_variant, column_swap, ambiguous or unknown"]
    record: str | None
    variant: str | None
    issued_digits: Annotated[bool | None, "whether the coefficients were those of the certificate"]
    candidates: Annotated[Sequence[str], "of an ambiguous file"]
    withdrawn: Annotated[str | None, "why the record was withdrawn"]
    against_corrected_by: Annotated[str | None, "signs that differ from the record in force, in words"]
    void_always: bool | None
    segments: list[Segment]
    in_force: Annotated[str | None, "the record in force on the date of the test"]
    repair: Repair | None
    skipped: list[SkippedRecord]


class CoefficientInterval(TypedDict):
    """What the printed digits allow a coefficient."""

    load: str
    name: str
    low: float | None
    high: float | None
    sign: Annotated[int, "1 or -1 where the interval decides it, 0 where it does not"]


class UnreadFile(TypedDict):
    """A file of several that cannot be read."""

    file: Path
    error: Annotated[Mapping[str, str | None], "what, where, got, expected, next"]


class Inspected(TypedDict):
    """What a recording holds, and what computed it."""

    file: Path
    sha256: str
    format: str
    machine: Annotated[str, "name of the definition"]
    machine_source: Annotated[str, "option, test.toml, file or default"]
    simulated: bool
    date: str | None
    rows: int
    channels: list[SeriesEntry]
    blocks: list[Block]
    slip_angle_deg: float
    calibration: Annotated[Identified | None, "null where the file has no Fy and Mz"]
    corrected_by: Annotated[str | None, "record of the corrected values"]
    unverified: bool
    corrected_tared: Annotated[bool, "false: no zero is taken off here"]
    corrected: list[BlockValues]
    corrected_first_row: BlockValues
    intervals: list[CoefficientInterval]
    refused_records: list[RefusedRecord]
    findings: list[FindingEntry]


class InspectAnswer(TypedDict):
    """What recordings hold."""

    files: Annotated[list[Inspected | UnreadFile], "in the order of the command"]
    findings: list[FindingEntry]


InspectForms = merged(InspectAnswer, Inspected, name="SingleInspectAnswer") | InspectAnswer
"""Of a single file its entries stand at the top too."""


class RecordRow(TypedDict):
    """A record and what its ledger tells of it."""

    id: str
    instrument: str
    sha256: str
    status: Annotated[str, "candidate, approved, superseded, withdrawn, discarded or refused"]
    verified: Annotated[bool, "false of a legacy import"]
    date: Annotated[str, "of the session"]
    in_force_from: str | None
    void_from: str | None
    void_always: bool
    entered_by: str | None
    checked_by: str | None
    approved_by: str | None
    reason: str | None
    unverifiable: Annotated[list[str], "terms that no check load verifies"]
    recall: str | None
    signature: str


class RefusedRow(TypedDict):
    """A record that is refused: nothing that it says holds."""

    id: str
    status: str
    rule: str | None
    reason: str


class Head(TypedDict):
    """The end of an instrument's ledger."""

    count: Annotated[int, "entries"]
    sha256: str
    damage: Annotated[str | None, "what is wrong with the ledger"]


class ListAnswer(TypedDict):
    """The records of a registry."""

    records: Sequence[RecordRow | RefusedRow]
    heads: Annotated[Mapping[str, Head], "by instrument"]
    hidden: Annotated[int, "discarded records that are not listed"]


class CellEntry(TypedDict):
    """An indication of a record."""

    name: str
    unit: str
    serial: str | None
    minimum: float | None
    maximum: float | None


class RecordLoad(TypedDict):
    """The equation of one load."""

    unit: str
    coefficients: Annotated[Mapping[str, float], "in full, by term"]
    issued: Annotated[Mapping[str, float], "in the digits of the certificate"]
    standard_errors: Annotated[Mapping[str, float | None] | None, "null of a legacy import"]
    covariance_model: str | None
    scatter: Annotated[Mapping[str, Any] | None, "parts of the scatter, where runs differ"]
    residual_sd: float | None
    dof: float | None
    n: int | None
    method: str | None
    minimum: float | None
    maximum: float | None
    check_tolerance: float | None
    check_max: Annotated[float | None, "largest error of a check load"]


class StoredFile(TypedDict):
    """A file that lies beside a record."""

    role: str
    file: str
    sha256: str


class RecordContent(TypedDict):
    """What a record holds."""

    zero: str
    indication_units: Mapping[str, str]
    indications: list[CellEntry]
    loads: Annotated[Mapping[str, RecordLoad], "by load"]
    data: list[StoredFile]


class Gate(TypedDict):
    """A gate of an approval."""

    rule: str
    state: Annotated[str, "fail, asks, note, pass, not judged"]
    where: str
    message: str


class JudgedMachine(TypedDict):
    """A machine definition."""

    name: str
    version: int


class Judged(TypedDict):
    """What an approval meets today."""

    id: str
    compared_with: Annotated[str | None, "the last approved record"]
    blocked: bool
    gates: list[Gate]
    evidence: Annotated[list[str], "of its signs"]
    machine: Annotated[JudgedMachine | None, "definition that states its signs"]


class Response(TypedDict):
    """The response of a load to an indication."""

    load: str
    indication: str
    unit: str
    value: Annotated[float, "in SI"]
    u: Annotated[float | None, "standard uncertainty"]
    before: Annotated[float | None, "that of the last approved record"]
    unit_before: str | None
    change_percent: float | None


class Responses(TypedDict):
    """Responses in SI beside those of the last approved record."""

    record: str
    before: str | None
    responses: list[Response]


class FoundLoad(TypedDict):
    """The errors of a session's rows by the record that was in force before it."""

    load: str
    unit: str
    reference: Annotated[Sequence[float], "of each row"]
    error: Annotated[Sequence[float], "fitted minus reference of each row"]
    tolerance: float
    full_scale: float
    max_error: Annotated[float, "the largest one, with its sign"]
    max_percent_fs: float
    worst_row: Annotated[int, "from 1"]
    within: bool


class Found(TypedDict):
    """As found."""

    phase: Annotated[str | None, "as_found or as_left, where the session states it"]
    session: Annotated[str | None, "record of the session that was judged"]
    record: Annotated[str | None, "in force before it"]
    within: bool | None
    reason: Annotated[str | None, "why nothing could be compared"]
    loads: list[FoundLoad]


class ShowAnswer(RecordContent):
    """One record; with --full what an approval meets."""

    record: RecordRow
    head: Annotated[str, "of the ledger"]
    judged: NotRequired[Judged]
    responses: NotRequired[Responses]
    as_found: NotRequired[Annotated[Found | None, "null where no session stands behind the record"]]


class Event(TypedDict):
    """An entry of the ledger."""

    seq: int
    id: str
    event: str
    time: str
    by: str | None
    approved_by: str | None
    known_on: str | None
    since: str | None
    reason: str | None
    note: str | None
    recall: str | None
    unverifiable: list[str]
    evidence: list[str]
    sha256: str
    clock: NotRequired[Annotated[str, "state of the computer's clock"]]
    signed_by: NotRequired[list[str]]


class HistoryAnswer(TypedDict):
    """What happened to an instrument's records."""

    events: list[Event]
    head: str
    damage: str | None


class EnteredRecord(TypedDict):
    """The record of a session."""

    id: str
    sha256: str
    status: str
    existing: Annotated[bool, "whether it was recorded before, and nothing was written"]
    path: str


class SessionLoad(TypedDict):
    """The fit of one load, in the units of the session."""

    unit: str
    indication_units: Mapping[str, str]
    coefficients: Mapping[str, float]
    issued: Mapping[str, float]
    standard_errors: Mapping[str, float]
    covariance_model: str | None
    scatter: Mapping[str, Any] | None
    residual_sd: float
    dof: float
    condition_number: Annotated[float, "of the indications, centred and scaled"]
    condition_number_terms: float
    vif: Annotated[Mapping[str, float], "variance inflation by indication"]
    llf: Annotated[float, "lower limit factor, 2.4 residual_sd"]
    check_max_percent_fs: float | None
    press: Annotated[float | None, "root mean square of the rows predicted without themselves"]
    reversibility: float | None
    outlier_rows: list[int]
    report: NotRequired[Annotated[Mapping[str, Any], "with --full"]]


class FittedSession(TypedDict):
    """A session, fitted, and its record."""

    record: EnteredRecord
    signature: Annotated[str, "who signed the record's decisions, or unsigned"]
    findings: list[FindingEntry]
    readings: Annotated[Mapping[str, Any], "zero, creep and shunt readings, evaluated"]
    residual_correlation: Mapping[str, Mapping[str, float]]
    loads: Mapping[str, SessionLoad]


class CalibrateAnswer(FittedSession):
    """A session, fitted and entered as a candidate."""

    dry_run: Annotated[bool, "whether nothing was entered"]
    standards: Annotated[list[Mapping[str, Any]], "evaluations by ASTM E74 and ISO 376"]
    balance: NotRequired[Annotated[Mapping[str, Any] | None, "the form of AIAA R-091, of a balance"]]
    figures: NotRequired[Annotated[list[str], "files that were written"]]
