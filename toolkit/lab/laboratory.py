"""A laboratory: its home folder with the registry of calibrations and the templates of its reports."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.lab.arguments import checked
from toolkit.lab.faces import Face, Facts, as_path
from toolkit.lab.home import calibrations_folder, find_home, home_template, open_registry
from toolkit.lab.records.record import Record, Records

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.verify import VerifiedRecord
    from toolkit.lab.archives.audit import Audit
    from toolkit.lab.tire_tests.test import ProcessedTest, Report, Test


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Laboratory(Face):
    """An open laboratory; its records are read from the disk as they are asked for.

    ``home`` is its folder, None where only a registry was named; ``calibrations`` is the registry's folder.
    """

    home: Path | None
    calibrations: Path

    @property
    def registry(self) -> Registry:
        """The registry of the calibration records."""
        return open_registry(self.calibrations)

    @property
    def instruments(self) -> tuple[str, ...]:
        """The instruments that have records."""
        return self.registry.instruments()

    @property
    def records(self) -> Records:
        """The records that pass every gate, candidates and withdrawn ones among them."""
        registry = self.registry
        return Records(
            tuple(
                Record(result=record, registry=registry)
                for instrument in registry.instruments()
                for record in registry.usable(instrument)[0]
            )
        )

    @checked
    def record(self, record_id: str, *, on: dt.date | None = None, known_at: dt.date | None = None) -> Record:
        """Return a record by its id, to be judged for a day (default: today).

        Raises
        ------
        RecordError
            it is missing, or fails a gate: its hash, its data, its refit
        RegistryError
            the text is no record id
        """
        registry = self.registry
        return Record(result=registry.load(record_id), registry=registry, on=on, known_at=known_at)

    @checked
    def in_force(
        self, instrument: str, *, on: dt.date | None = None, known_at: dt.date | None = None
    ) -> Record:
        """Return the record in force for an instrument on a day, as known on another (default: today).

        Raises
        ------
        RegistryError
            none is in force on that day
        RecordError
            the one that is fails a gate
        """
        registry, day = self.registry, on or dt.date.today()  # noqa: DTZ011
        record = registry.in_force(instrument, on=day, known_at=known_at)
        return Record(result=record, registry=registry, on=day, known_at=known_at)

    @checked
    def verify(self, head: str | None = None) -> Verification:
        """Refit every record from its stored data, and name every file that is not as it was entered.

        ``head`` is a ledger's hash that was printed earlier.
        """
        from toolkit.calibration.registry.verify import verify_registry

        return Verification(tuple(verify_registry(self.registry, head)))

    @checked
    def read_test(self, path: str | Path) -> Test:
        """Return `toolkit.read_test` of a test that this laboratory's records compute."""
        from toolkit.lab.tire_tests.test import read_test

        return read_test(path, calibrations=self.calibrations)

    @checked
    def write_report(
        self,
        test: ProcessedTest,
        out: str | Path,
        *,
        template: str | Path | None = None,
        models: Sequence[str] = (),
        hand_over: bool = False,
        allow_missing: bool = False,
        step: Callable[[str], None] = lambda _text: None,
    ) -> Report:
        """Fill a Word template with a test and deliver it with its verified PDF, or deliver nothing.

        Parameters
        ----------
        out : the report's folder, new or an earlier report's
        template : default ``org.docx`` of this laboratory
        models : tire models that the report compares
        hand_over : test.xlsx, test.tdx and tire.tir too
        allow_missing : print n/a for a value that the test has not
        step : told what is done

        Raises
        ------
        ToolkitError
            the template cannot be used, or the PDF does not show every value and figure
        """
        from toolkit.lab.tire_tests.fit_models import model_choice
        from toolkit.lab.tire_tests.reports import Options, make_reports
        from toolkit.lab.tire_tests.test import Report
        from toolkit.report.word.package import read_template

        options = Options(
            template=read_template(Path(template) if template else self.template("org.docx")),
            resolve=lambda _path: test.result,
            models=model_choice(models) if models else (),
            xlsx=hand_over, tydex=hand_over, tir=hand_over, allow_missing=allow_missing,
        )  # fmt: skip
        (report,) = make_reports([test.path], options, Path(out), step=step)
        if isinstance(report.outcome, Exception):
            raise report.outcome
        return Report(result=report.outcome, made=report)

    @checked
    def audit_archive(
        self,
        archive: str | Path,
        *,
        out: str | Path | None = None,
        known_at: dt.date | None = None,
        workers: int = 1,
        repair: str | Path | None = None,
        reports: str | Path | None = None,
    ) -> Audit:
        """Tell for every file of an archive which calibration computed its forces, and what it changes.

        Parameters
        ----------
        archive : a folder of recordings, in any depth
        out : folder for the page and the lines; an audit goes on where it was ended; None writes nothing
        known_at : the registry is judged as known on this day; default today
        workers : processes that read files
        repair : folder for corrected copies; the originals are never touched
        reports : reports of past years, a folder or a CSV

        Raises
        ------
        ToolkitError
            the archive, the registry or a folder cannot be used
        """
        from toolkit.lab.archives.audit import Audit, AuditOrder, audit
        from toolkit.lab.tire_tests.resolve import Basis

        order = AuditOrder(
            archive=Path(archive), basis=Basis(known_at=known_at, calibrations=self.calibrations),
            workers=workers, out=as_path(out), repair=as_path(repair), reports=as_path(reports),
        )  # fmt: skip
        answer, written = audit(order)
        return Audit(result=answer, written=written)

    @checked
    def template(self, name: str) -> Path:
        """Return a template of ``report_templates/``; the packaged one where the laboratory has none."""
        return home_template(name, self.home)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the records, one a row."""
        return self.records.to_dataframe()

    def _facts(self) -> Facts:
        registry = self.registry
        return {
            "laboratory": self.home or self.calibrations,
            "records": f"{sum(len(registry.ids(name)) for name in registry.instruments())} records",
            "instruments": ", ".join(registry.instruments()) or "no instrument yet",
        }


@dataclass(frozen=True, slots=True, repr=False)
class Verification(Face):
    """The registry verified: ``rows`` has one entry for every record and every file that belongs to none."""

    rows: tuple[VerifiedRecord, ...]

    @property
    def ok(self) -> bool:
        """Whether everything is as it was entered."""
        return all(row.ok for row in self.rows)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one row a record or stray file: id, ok, verified, reason."""
        import pandas as pd

        return pd.DataFrame(
            [{"id": r.id, "ok": r.ok, "verified": r.verified, "reason": r.reason} for r in self.rows]
        )

    def _facts(self) -> Facts:
        sound = sum(row.ok for row in self.rows)
        return {
            "records": f"{sound} of {len(self.rows)} ok",
            "not ok": ", ".join(f"{row.id}: {row.reason}" for row in self.rows if not row.ok) or None,
        }


@checked
def open_laboratory(home: str | Path | None = None, *, calibrations: str | Path | None = None) -> Laboratory:
    """Open a laboratory's home: the folder named, else ``TOOLKIT_HOME``, else the nearest folder upward.

    Parameters
    ----------
    home : folder that holds ``calibrations/`` and, where it likes, ``report_templates/``
    calibrations : a registry in place of the home's

    Raises
    ------
    ConfigError
        there is no such folder; the message names ``toolkit init``

    Examples
    --------
    >>> laboratory = open_laboratory(example("home"))
    >>> [record.id for record in laboratory.records]
    ['m15-r1', 'm15-r2', 'm15-virtual-r1']
    """
    folder = None if home is None else Path(home)
    if calibrations is not None:
        return Laboratory(home=folder, calibrations=calibrations_folder(Path(calibrations)))
    nearest = find_home(folder)
    return Laboratory(home=nearest, calibrations=nearest / "calibrations")


@checked
def example(name: str) -> Path:
    """Return a packaged example to try things on: nothing in it is written to.

    ``home`` is a laboratory with its records and templates; ``test_plan``, ``session_plan`` and
    ``continuous_plan`` are plans of the virtual machine, ``tire`` its tire property file; ``fig4_4`` is a
    real recording of the default machine.

    Raises
    ------
    ConfigError
        there is no example of that name

    >>> example("tire").name
    'tire.tir'
    """
    from toolkit.errors import ConfigError
    from toolkit.examples import packaged_fig4_4
    from toolkit.lab.home import packaged_home

    virtual = Path(__file__).parents[1] / "examples" / "virtual"
    examples = {"home": packaged_home(), "tire": virtual / "tire.tir", "fig4_4": packaged_fig4_4()[0]}
    examples |= {plan.stem: plan for plan in sorted(virtual.glob("*.toml"))}
    if name not in examples:
        raise ConfigError(
            f"there is no example {name!r}", where="example", got=name, expected=", ".join(examples),
            next_step="name one of those expected", rule="wrong-value",
        )  # fmt: skip
    return examples[name]
