"""A recording, a test, the same test processed, and its report, as a notebook uses them."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import counted
from toolkit.lab.arguments import checked
from toolkit.lab.faces import Face, Facts, as_path

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.findings import Finding
    from toolkit.lab.tire_tests.process_answer import ReducedTest
    from toolkit.lab.tire_tests.reports import MadeReport
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.lab.tire_tests.tires import TireFit
    from toolkit.recording import model
    from toolkit.recording.folder import TestFolder
    from toolkit.report.content import Plot
    from toolkit.report.deliver import Delivered


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Recording(Face):
    """One file of a test: its channels in the units of the file."""

    result: model.Recording

    @property
    def channels(self) -> dict[str, str]:
        """The channels with their units."""
        return {series.symbol: series.unit for series in self.result.series}

    @checked
    def to_dataframe(self, *, si: bool = False) -> pd.DataFrame:
        """Return a row a sample, ``D51 [mV/V]``; units of the file, or SI."""
        from pandas import DataFrame

        from toolkit.units import unit

        columns = {}
        for series in self.result.series:
            printed_unit = unit(series.unit).si if si else series.unit
            columns[f"{series.symbol} [{printed_unit}]"] = series.si if si else series.values  # noqa: PD011
        return DataFrame(columns)

    def _facts(self) -> Facts:
        return {
            "file": self.result.name,
            "machine": self.result.machine.name,
            "rows": f"{self.result.rows} rows",
            "channels": ", ".join(f"{symbol} [{unit}]" for symbol, unit in self.channels.items()),
            "simulated": "SIMULATED" if self.result.simulated else None,
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.content import Curve, Plot

        rows = tuple(float(row) for row in range(1, self.result.rows + 1))
        plots = {}
        for series in self.result.series:
            name, numbers = series.symbol, tuple(series.values.tolist())  # noqa: PD011
            plots[name] = Plot(
                name=name,
                x_label="row",
                y_label=f"{name} / {series.unit.replace('*', '·')}",
                curves=(Curve(label=name, x=rows, y=numbers, style="line"),),
                caption=f"{name} of every row.",
                alt=f"{name} over the rows of the recording.",
            )
        return plots


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Test(Face):
    """A test as it was recorded: a folder with ``test.toml``, or one that was reduced to a file.

    ``folder`` is what the folder says, None of a reduced test.
    """

    __test__ = False  # not a pytest class

    path: Path
    folder: TestFolder | None
    calibrations: Path | None = None
    home: Path | None = None

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The recordings, all or none; empty of a reduced test."""
        from toolkit.pipeline import read_test as read

        return (
            ()
            if self.folder is None
            else tuple(Recording(result=recording) for recording in read(self.folder))
        )

    @checked
    def process(
        self,
        *,
        calibration: str | None = None,
        known_at: dt.date | None = None,
        draft: bool = False,
        protocol: str | Path | None = None,
    ) -> ProcessedTest:
        """Return the test corrected, averaged and characterised, in SI and SAE J670 axes.

        Parameters
        ----------
        calibration : record id; default the one in force on the test's date
        known_at : the registry is judged as known on this day; default today
        draft : allow a record that is not approved and in force
        protocol : protocol file in place of the test's own

        Raises
        ------
        ToolkitError
            a recording cannot be read, no record is in force, or the test cannot be reduced
        """
        from toolkit.lab.tire_tests.resolve import Basis, resolve_test

        basis = Basis(
            calibration=calibration, calibrations=self.calibrations, home=self.home, known_at=known_at,
            draft=draft, protocol=as_path(protocol),
        )  # fmt: skip
        return ProcessedTest(path=self.path, result=resolve_test(self.path, basis))

    def to_dataframe(self) -> pd.DataFrame:
        """Return one recording a row: file, rows, channels with their units."""
        import pandas as pd

        return pd.DataFrame(
            [
                {"file": recording.result.name, "rows": recording.result.rows,
                 "channels": ", ".join(f"{s} [{u}]" for s, u in recording.channels.items())}
                for recording in self.recordings
            ]
        )  # fmt: skip

    def _facts(self) -> Facts:
        if self.folder is None:
            return {"test": self.path.name, "kind": "a reduced test"}
        info = self.folder.info
        return {
            "test": info.name,
            "date": info.date,
            "machine": info.machine,
            "tire": info.tire_size,
            "recordings": f"{len(self.folder.files)} recordings",
            "simulated": "SIMULATED" if info.simulated else None,
        }


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class ProcessedTest(Face):
    """A reduced and characterised test with the record that computed it, and every finding."""

    path: Path
    result: Resolved

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What should be known about it: rule, place, sentence."""
        return self.result.findings

    def to_dataframe(self) -> pd.DataFrame:
        """Return one condition a row; the headers end with the unit: ``FY_N``, ``MZ_Nm``, ``SA_rad``."""
        import pandas as pd

        return pd.DataFrame(self._answer["conditions"])

    def characteristics(self) -> pd.DataFrame:
        """Return one characteristic a row: name, load, direction, slip angle, value, U, k, unit."""
        import pandas as pd

        rows = []
        for group in self._answer["characteristics"].values():
            for entry in group:
                place = {key: entry.get(key) for key in ("load_N", "rotation", "SA_rad")}
                for name, estimate in entry.items():
                    if isinstance(estimate, dict) and "expanded_uncertainty" in estimate:
                        rows.append(
                            {"name": name, **place, "value": estimate["value"],
                             "U": estimate["expanded_uncertainty"], "k": estimate["k"],
                             "unit": estimate["unit"]}
                        )  # fmt: skip
        return pd.DataFrame(rows)

    @checked
    def fit(self, *models: str, **options: Any) -> TireFit:
        """Return `toolkit.fit_tire` of this test."""
        from toolkit.lab.tire_tests.tires import fit_tire

        return fit_tire(self.result, *models, **options)

    @checked
    def save(self, path: str | Path) -> str:
        """Write the whole test to one .xlsx file, and return the hash of its content.

        Raises
        ------
        OutputError
            the file cannot be written, or would replace an original
        """
        from toolkit.recording.marks import refuse_original
        from toolkit.testfile import write_test_file

        refuse_original(Path(path), suffix=".xlsx")
        return write_test_file(Path(path), self.result.result, dict(self.result.recordings))

    @cached_property
    def _answer(self) -> ReducedTest:
        from toolkit.lab.tire_tests.process_answer import process_payload

        return process_payload(self.result)

    def _facts(self) -> Facts:
        reduced = self.result.result.reduced
        use, info = reduced.calibration, reduced.info
        return {
            "test": info.name,
            "date": info.date,
            "conditions": f"{len(reduced.used())} conditions",
            "calibration": use.id,
            "mark": use.mark,
            "impossible": "IMPOSSIBLE VALUES" if reduced.impossible else None,
            "findings": counted(len(self.findings), "finding") if self.findings else None,
            "simulated": "SIMULATED" if info.simulated else None,
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.test.content import build_content

        return build_content(self.result.result, self.result.record, findings=self.findings).plots


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Report(Face):
    """A delivered report: the filled Word file and the PDF that shows every value and figure."""

    result: Delivered
    made: MadeReport

    @property
    def pdf(self) -> Path:
        """The verified PDF."""
        return self.result.pdf

    @property
    def docx(self) -> Path:
        """The filled Word file."""
        return self.result.docx

    def to_dataframe(self) -> pd.DataFrame:
        """Return the manifest: every tag that was filled, with its text and where it stands."""
        import pandas as pd

        return pd.DataFrame([entry.as_dict() for entry in self.result.filled.manifest])

    def _facts(self) -> Facts:
        return {
            "report": self.pdf,
            "pages": counted(self.result.pages, "page"),
            "values": f"{counted(len(self.result.filled.manifest), 'value')} verified",
            "figures": counted(len(self.result.filled.figures), "figure"),
            "warnings": counted(len(self.result.warnings), "warning") if self.result.warnings else None,
        }


@checked
def read_recording(path: str | Path, *, machine: str | None = None) -> Recording:
    """Read one recording.

    Parameters
    ----------
    machine : a packaged machine's name, or the path of a definition, None for the default one: it says what
        the columns are

    Raises
    ------
    ToolkitError
        the file cannot be read, or is none of this machine

    Examples
    --------
    >>> import toolkit
    >>> toolkit.read_recording(toolkit.example("fig4_4"))
    <Recording M15_fig4_4.xlsx | m15 | 10 rows | FZ [lbf], D52 [lbf], D51 [lbf], E5 [lbf], SA [deg], ...>
    """
    from toolkit.machine import load_machine
    from toolkit.machine.default import DEFAULT_MACHINE
    from toolkit.recording.read import read_recording as read

    return Recording(result=read(Path(path), load_machine(machine or DEFAULT_MACHINE)))


@checked
def read_test(
    path: str | Path, *, calibrations: str | Path | None = None, home: str | Path | None = None
) -> Test:
    """Read what a test is: a folder with ``test.toml`` and recordings, or a reduced test (.xlsx).

    Parameters
    ----------
    calibrations, home : the registry, or the laboratory, whose records compute it; default the nearest
        laboratory upward

    Raises
    ------
    ToolkitError
        the folder or its ``test.toml`` cannot be used
    """
    from toolkit.recording.folder import read_test_folder

    path = Path(path)
    return Test(
        path=path,
        folder=read_test_folder(path) if path.is_dir() else None,
        calibrations=as_path(calibrations),
        home=as_path(home),
    )
