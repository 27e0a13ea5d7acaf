"""The tests between the last good as-found result and the one that failed, and what the drift did to them.

Nobody knows when between the two an instrument moved. As an estimate, the change that the failing session
found is taken to have grown in proportion to the days: a test has that share of the difference between the
record that the failing session led to and the record that was in force (ISO/IEC 17025:2017, 7.10: the extent
of a nonconformity is evaluated; the interpolation is ours, not the standard's).
"""

from __future__ import annotations

import datetime as dt
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np

from toolkit.audit.candidates import cannot_correct
from toolkit.audit.cluster import run_on_cluster
from toolkit.audit.context import context_of
from toolkit.audit.identify import recompute
from toolkit.audit.inspection import Choices
from toolkit.audit.model import columns_of
from toolkit.audit.workers import Lost, run_isolated
from toolkit.calibration.control.as_found import AsFound, as_found, as_found_history, phase_of
from toolkit.calibration.registry.registry import Registry, instrument_of
from toolkit.declared import Entry, OrNan
from toolkit.errors import ConfigError, ToolkitError
from toolkit.recording.read import read_recording
from toolkit.reduction.prepare_rows import split_blocks

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.calibration.records.record import CalibrationRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """What lies between: ``good`` is the id that was named, ``failed`` the as-found result that failed.

    ``later_good`` are as-found results between the two that were within tolerance.
    """

    instrument: str
    good: str
    good_date: dt.date
    failed: AsFound
    later_good: tuple[str, ...]

    def share(self, day: dt.date) -> float | None:
        """Return which part of the change a test of that day has; None outside of the stretch."""
        span = (self.failed.date - self.good_date).days
        since = (day - self.good_date).days
        return since / span if 0 < since <= span else None

    @property
    def statement(self) -> str:
        """What the failing session found, in words."""
        off = ", ".join(
            f"{o.load} off by {o.max_error:+.4g} {o.unit} (tolerance {o.tolerance:.4g} {o.unit})"
            for o in self.failed.loads
            if not o.within
        )
        return f"on {self.failed.date}, {self.failed.session_record} found {self.failed.record}: {off}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftedConditions:
    """The share of the change in a load block."""

    first_row: int
    last_row: int
    FY_N: OrNan
    MZ_Nm: OrNan


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftedFile:
    """A recording since the last good check: its share of the days, and its share of the change."""

    path: str
    date: dt.date
    share: float
    FY_N: Annotated[float | None, Entry("the largest of any row", key="FY_max_abs_N")] = None
    MZ_Nm: Annotated[float | None, Entry("the largest of any row", key="MZ_max_abs_Nm")] = None
    conditions: tuple[DriftedConditions, ...] = ()
    reason: Annotated[str | None, Entry("why nothing could be computed")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftedTest:
    """A test since the last good check."""

    test: Annotated[str, Entry("folder of its test.toml, relative to the archive")]
    date: dt.date
    share: float
    files: int
    left_out: Annotated[int, Entry("files of which nothing could be computed")]
    FY_N: Annotated[float | None, Entry("the largest of any row", key="FY_max_abs_N")]
    MZ_Nm: Annotated[float | None, Entry("the largest of any row", key="MZ_max_abs_Nm")]


def drifted_tests(audit: ArchiveAudit, files: Sequence[DriftedFile]) -> tuple[DriftedTest, ...]:
    """Return the tests that recordings of the stretch belong to, by date and folder."""
    by_path = {file.path: file for file in files}
    tests: dict[str, list[DriftedFile]] = {}
    for plain in audit.files.plain():
        if plain["path"] in by_path:
            tests.setdefault(plain["test"], []).append(by_path[plain["path"]])
    return tuple(
        DriftedTest(
            test=name,
            date=files_of_test[0].date,
            share=files_of_test[0].share,
            files=len(files_of_test),
            left_out=sum(file.reason is not None for file in files_of_test),
            FY_N=max((file.FY_N for file in files_of_test if file.FY_N is not None), default=None),
            MZ_Nm=max((file.MZ_Nm for file in files_of_test if file.MZ_Nm is not None), default=None),
        )
        for name, files_of_test in sorted(tests.items(), key=lambda pair: (pair[1][0].date, pair[0]))
    )


def drift_since(registry: Registry, good: str) -> Drift:
    """Return the stretch from a good record to the next as-found result that failed.

    ``good`` is the as-found session that was within tolerance, or the record that the instrument was
    calibrated to.

    Raises
    ------
    ConfigError
        ``since-good``: the record is an as-found session that failed itself, or none failed after it
    RegistryError, RecordError
        there is no such record, or it fails a gate
    """
    instrument = instrument_of(good)
    record = registry.load(good)
    date = dt.date.fromisoformat(record.date)
    if phase_of(record) == "as_found" and as_found(registry, record).within is not True:
        raise _refused(good, "an as-found session that was out of tolerance itself", "one that was within")
    after = [session for session in as_found_history(registry, instrument) if session.date > date]
    failed = next((session for session in after if session.within is False), None)
    if failed is None:
        reason = f"{len(after)} as-found sessions after {record.date}, none of them out of tolerance"
        raise _refused(good, reason, "a later as-found session out of tolerance")
    between = tuple(
        session.session_record for session in after if session.date < failed.date and session.within
    )
    return Drift(instrument=instrument, good=good, good_date=date, failed=failed, later_good=between)


def drifted_files(
    audit: ArchiveAudit,
    registry: Registry,
    drift: Drift,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    step: Callable[[str], None] = lambda _: None,
) -> Iterator[DriftedFile]:
    """Yield the recordings of the stretch, in the order in which they are done."""
    days: dict[str, dt.date] = {}
    for plain in audit.files.plain():
        if plain["instrument"] == drift.instrument and plain["date"] is not None:
            day = dt.date.fromisoformat(plain["date"])
            if drift.share(day) is not None:
                days[plain["path"]] = day
    # A worker may have another working folder.
    archive, records = (Path(os.path.abspath(folder)) for folder in (audit.archive, registry.folder))  # noqa: PTH100
    make = partial(_Drifted, archive, Registry(records), audit.known_at, drift)
    names = tuple(days)
    for name, result in (
        run_isolated(make, names, workers=workers)
        if scheduler is None
        else run_on_cluster(make, names, address=scheduler)
    ):
        if isinstance(result, Lost):
            share = drift.share(days[name]) or 0.0
            yield DriftedFile(path=name, date=days[name], share=share, reason=result.reason)
        else:
            yield result
        step(name)


class _Drifted:
    """Computes one file's share after another."""

    def __init__(self, archive: Path, registry: Registry, known_at: dt.date, drift: Drift) -> None:
        self.archive, self.drift = archive, drift
        self.choices = Choices(registry=registry, known_at=known_at)
        self.true: CalibrationRecord = registry.load(drift.failed.session_record)

    def __call__(self, name: str) -> DriftedFile:
        path = self.archive / name
        context = context_of(path)
        day = context.date or self.drift.good_date
        share = self.drift.share(day) or 0.0
        file = DriftedFile(path=name, date=day, share=share)
        try:
            recording = read_recording(path, context.machine)
            blocks = () if context.is_tare else split_blocks(recording, context.machine)[0]
        except ToolkitError as error:
            return DriftedFile(path=name, date=day, share=share, reason=f"{error.rule}: {error.what}")
        columns = columns_of(recording)
        record = self.choices.on(context.machine.name, context.date).in_force
        why = (
            "no record was in force"
            if record is None
            else cannot_correct(record, columns) or cannot_correct(self.true, columns)
        )
        if record is None or why is not None or columns.loads != ("FY", "MZ"):
            reason = why or "the file has not both Fy and Mz"
            return DriftedFile(path=name, date=day, share=share, reason=reason)
        old, new = recompute(columns, record), recompute(columns, self.true)
        FY, MZ = (share * (new[load] - old[load]) for load in ("FY", "MZ"))
        return DriftedFile(
            path=file.path,
            date=day,
            share=share,
            FY_N=float(np.abs(FY).max()),
            MZ_Nm=float(np.abs(MZ).max()),
            conditions=tuple(
                DriftedConditions(
                    first_row=b.start + 1,
                    last_row=b.stop,
                    FY_N=float(FY[b.rows].mean()),
                    MZ_Nm=float(MZ[b.rows].mean()),
                )
                for b in blocks
            ),
        )


def _refused(good: str, actual: str, expected: str) -> ConfigError:
    return ConfigError(
        "there is no period to examine",
        where="--since-good",
        got=f"{good}: {actual}",
        expected=expected,
        next_step="see 'toolkit calibration chart' for the as-found results of the instrument",
        rule="since-good",
    )
