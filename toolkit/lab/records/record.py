"""A calibration record as a notebook uses it: its coefficients, its budget, loads from columns of data."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, overload

from toolkit.errors import ConfigError, RecordError
from toolkit.lab.answers import counted
from toolkit.lab.arguments import checked
from toolkit.lab.faces import Face, Facts
from toolkit.units import printed

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.status import RecordStatus
    from toolkit.calibration.session.table import Table
    from toolkit.calibration.uncertainty.model import Budget
    from toolkit.findings import Finding
    from toolkit.lab.quantities import Columns
    from toolkit.report.content import Plot


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Record(Face):
    """A calibration record that passed every gate of the registry.

    ``result`` is the record itself; ``on`` the day that it is judged for, None for today; ``known_at`` the
    day of knowledge, None for today.
    """

    result: CalibrationRecord
    registry: Registry = field(compare=False)
    on: dt.date | None = None
    known_at: dt.date | None = None

    @property
    def id(self) -> str:
        """Its id, such as ``rig-r2``."""
        return self.result.id

    @property
    def indications(self) -> dict[str, str]:
        """The indications that it needs, with their units."""
        return self.result.units

    @property
    def loads(self) -> dict[str, str]:
        """The loads that it gives, with the units of its coefficients."""
        return {fit.load: fit.unit for fit in self.result.loads}

    @property
    def status(self) -> RecordStatus:
        """Its state by the ledger: candidate, approved, withdrawn, discarded."""
        return self.registry.status(self.id, known_at=self.known_at)

    @checked
    def apply(
        self,
        data: Columns,
        *,
        units: Mapping[str, str] | None = None,
        tare: Mapping[str, Any] | None = None,
        draft: bool = False,
        uncertainty: bool = True,
        step: Callable[[str], None] = lambda _text: None,
    ) -> Loads:
        """Return the loads of every row of a DataFrame, each with its expanded uncertainty.

        Parameters
        ----------
        data : a DataFrame or a mapping with a column for every indication; the unit of each stands in its
            header, ``D51 [mV/V]``, in ``units``, or in its values (pint quantities)
        units : unit by column name
        tare : the unloaded indications, by name, in the units of the columns or as quantities; None without
        draft : allow a record that may not make a number on this day (`result` is then marked)
        uncertainty : the budget of every row, some microseconds for a row and a load
        step : is told how far it is, some thousand rows at a time

        Returns
        -------
        Loads
            in N and N·m; U at 95 %, not determined for a legacy import. Indications beyond the calibrated
            range and a missing tare stand in its findings; zeros as ``tare`` state indications that are
            tared already. Of a record whose zero is ``included``
            the budget with a tare is that without: the part that the tare takes away stays in it.

        Raises
        ------
        ColumnError, UnitError
            a column is missing, or has no unit or one of another dimension
        RecordError
            ``not-in-force``: the record may not make a number on this day, and no draft was asked for
        """
        import numpy as np

        from toolkit.calibration.apply import apply_record
        from toolkit.calibration.registry.clock import today
        from toolkit.calibration.registry.standing import standing
        from toolkit.calibration.uncertainty.common_errors import reference_findings
        from toolkit.lab.quantities import columns_of, tare_of
        from toolkit.units import unit

        record = self.result
        stands = standing(
            self.registry, record.instrument, on=self.on or today(), known_at=self.known_at, named=self.id
        )
        use = stands.use(draft=draft)
        columns = columns_of(data, self.indications, units=units)
        values = {name: columns[name].to(text, where=name) for name, text in self.indications.items()}
        zero = None
        if tare is not None:
            unloaded = tare_of(tare, columns)
            zero = {
                name: float(unloaded[name].to(text, where=f"tare of {name}")[0])
                for name, text in self.indications.items()
            }
        loads = apply_record(record, values, units=self.indications, tare=zero)
        # A record fitted to indications from their zero is asked at indications from their zero.
        moved = zero if zero is not None and record.zero != "included" else dict.fromkeys(values, 0.0)
        points = np.column_stack([values[name] - moved[name] for name in record.indications])
        return Loads(
            value=loads,
            units={fit.load: unit(fit.unit).si for fit in record.loads},
            U=self._expanded(points, step) if uncertainty else {},
            extrapolated=np.sum(self._outside(points), axis=0),
            index=getattr(data, "index", None),
            use=use,
            findings=(
                *self._untared(zero is not None),
                *self._beyond(points),
                *(reference_findings(record) if uncertainty else ()),
            ),
        )

    @checked
    def budget(self, load: str, at: float | None = None) -> Budget:
        """Return the budget of a load at a value [the record's unit]; default: the largest."""
        from toolkit.calibration.uncertainty.budget import calibration_budget

        rows, check = self._stored()
        return calibration_budget(self.result, rows, check, load, at)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one coefficient a row: load, term, coefficient, issued digits, standard error, unit."""
        import pandas as pd

        from toolkit.calibration.uncertainty.common_errors import standard_errors

        return pd.DataFrame(
            [
                {"load": fit.load, "term": term, "coefficient": value, "issued": issued,
                 "standard_error": error, "unit": fit.unit}
                for fit in self.result.loads
                for term, value, issued, error in zip(
                    fit.terms, fit.coefficients, fit.issued,
                    standard_errors(self.result, fit.load) or (float("nan"),) * len(fit.terms), strict=True,
                )
            ]
        )  # fmt: skip

    def _facts(self) -> Facts:
        status = self.status
        since = f", in force from {status.in_force_from}" if status.in_force_from else ""
        return {
            "record": self.id,
            "state": status.state + since,
            "verified": "verified" if self.result.verified else "UNVERIFIED",
            "loads": f"{', '.join(self.loads)} from {', '.join(self.indications)}",
            "session": self.result.date,
            "sha256": self.result.sha256[:12],
        }

    def _plots(self) -> Mapping[str, Plot | Callable[[], Figure]]:
        from toolkit.calibration.fit.report import report_session
        from toolkit.calibration.fit.session_fit import fit_session
        from toolkit.calibration.registry.stored import stored_session
        from toolkit.calibration.uncertainty.common_errors import record_covariance
        from toolkit.report.calibration.figures import open_figures

        if not self.result.verified:  # a legacy import has no rows to draw
            return {}
        figures: dict[str, Plot | Callable[[], Figure]] = {}
        fit = fit_session(stored_session(self.registry.folder, self.result))
        for report in report_session(fit, record_covariance(self.result)):
            figures |= open_figures(report, title=self.id)
        return figures

    def _expanded(self, points: Array, step: Callable[[str], None]) -> dict[str, Array]:
        import numpy as np

        from toolkit.calibration.uncertainty.budget import expanded_of_rows
        from toolkit.units import si_scale

        record = self.result
        if not record.verified:
            return {fit.load: np.full(len(points), np.nan) for fit in record.loads}
        rows, check = self._stored()

        def expanded(load: str) -> Array:
            def done(count: int) -> None:
                step(f"U({load}), row {count} of {len(points)}")

            return expanded_of_rows(record, rows, check, load, points, step=done)

        return {fit.load: si_scale(fit.unit) * expanded(fit.load) for fit in record.loads}

    def _stored(self) -> tuple[Table, Table | None]:
        """Return the reference and check loads that the record was fitted to."""
        from toolkit.calibration.registry.stored import stored_check, stored_loads

        rows = stored_loads(self.registry.folder, self.result)
        if rows is None:
            raise RecordError(
                "the record has no data to make a budget of", where=self.id, got="a legacy import",
                expected="a record that was fitted from reference loads", rule="budget",
                next_step="calibrate the instrument from a session",
            )  # fmt: skip
        return rows, stored_check(self.registry.folder, self.result)

    def _untared(self, tared: bool) -> tuple[Finding, ...]:
        """Return what a test without a tare is told, of indications without one.

        A record of tared indications was never fitted to others: a warning. One whose zero is included holds
        that of its session, which may have moved since: a note.
        """
        from toolkit.findings import Finding

        if tared:
            return ()
        zero_included = self.result.zero == "included"
        message = "no tare was stated: the zero of the cells stays in the loads, and no uncertainty holds it"
        if not zero_included:
            message += "; the record was fitted on tared indications"
        return (
            Finding(
                rule="no-tare", where=self.id, message=message, level="note" if zero_included else "warning"
            ),
        )

    def _beyond(self, points: Array) -> tuple[Finding, ...]:
        from toolkit.findings import Finding

        findings = []
        for cell, outside in zip(self.result.cells, self._outside(points), strict=True):
            if count := int(outside.sum()):
                text = f"{count} of {len(points)} rows lie beyond the calibrated indications: extrapolated"
                findings.append(Finding(rule="beyond-range", where=f"{self.id}, {cell.name}", message=text))
        return tuple(findings)

    def _outside(self, points: Array) -> NDArray[np.bool_]:
        """Tell which points (indications, points) lie beyond the calibrated range of each indication."""
        import numpy as np

        low, high = (
            np.array([[unlimited if end is None else end] for end in ends])
            for unlimited, ends in (
                (-np.inf, [cell.minimum for cell in self.result.cells]),
                (np.inf, [cell.maximum for cell in self.result.cells]),
            )
        )
        return np.asarray((low > points.T) | (high < points.T))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Loads(Face):
    """Loads of every row of some data: ``value`` and expanded uncertainty ``U`` (rows,) by load, in SI.

    ``units`` of each load; ``U`` is empty where no uncertainty was asked for; ``extrapolated`` (rows,) counts
    the indications of each row that lie beyond their calibrated range; ``use`` says how the record stood.
    """

    value: Mapping[str, Array]
    units: Mapping[str, str]
    U: Mapping[str, Array]
    extrapolated: NDArray[np.int64]
    use: CalibrationUse
    findings: tuple[Finding, ...]
    index: Any = None

    def to_dataframe(self) -> pd.DataFrame:
        """Return a column a load, ``FY [N]``, and beside it its expanded uncertainty, ``U(FY) [N]``."""
        import pandas as pd

        columns: dict[str, Array] = {}
        for name, values in self.value.items():
            columns[f"{name} [{self.units[name]}]"] = values
            if name in self.U:
                columns[f"U({name}) [{self.units[name]}]"] = self.U[name]
        return pd.DataFrame(columns, index=self.index)

    @checked
    def quantity(self, load: str) -> Any:
        """Return a load as a pint quantity (rows,) of the toolkit's registry."""
        from toolkit.units import registry

        if load not in self.units:
            raise ConfigError(
                "the record gives no such load", where="Loads.quantity, load", got=load,
                expected=", ".join(self.units), next_step="name one of those expected", rule="wrong-argument",
            )  # fmt: skip
        return registry().Quantity(self.value[load], self.units[load].replace("*", " * "))

    def _facts(self) -> Facts:
        rows = len(next(iter(self.value.values())))
        return {
            "rows": f"{rows} rows",
            "loads": ", ".join(f"{name} [{self.units[name]}]" for name in self.value),
            "record": self.use.id,
            "mark": self.use.mark,
            "findings": counted(len(self.findings), "finding") if self.findings else None,
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.content import Curve, Plot

        def plot(name: str, values: Array) -> Plot:
            rows = tuple(float(row) for row in range(1, len(values) + 1))
            curve = Curve(label=name, x=rows, y=tuple(values.tolist()), style="line")
            unit = printed(self.units[name])
            return Plot(
                name=name, x_label="row", y_label=f"{name} / ({unit})" if "·" in unit else f"{name} / {unit}",
                curves=(curve,), caption=f"{name} of every row.", alt=f"{name} over the rows.",
                watermark=self.use.word,
            )  # fmt: skip

        return {name: plot(name, values) for name, values in self.value.items()}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Records(Face, Sequence[Record]):
    """The records of a laboratory that may be used, instrument by instrument, oldest first."""

    items: tuple[Record, ...]

    @overload
    def __getitem__(self, index: int) -> Record: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Record, ...]: ...
    def __getitem__(self, index: int | slice) -> Record | tuple[Record, ...]:
        return self.items[index]

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Record]:
        return iter(self.items)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one record a row, as `toolkit calibration list` does."""
        import pandas as pd

        from toolkit.lab.records.registry_answer import record_row

        return pd.DataFrame(
            [
                record_row(record.result, record.status, record.registry.signature(record.id))
                for record in self.items
            ]
        )

    def _facts(self) -> Facts:
        return {record.id: f"{record.id} {record.status.state}" for record in self.items}
