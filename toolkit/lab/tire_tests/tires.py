"""Tire models fitted to a test or a table, and tire property files evaluated, as a notebook uses them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from toolkit.lab.answers import counted
from toolkit.lab.arguments import checked
from toolkit.lab.faces import Face, Facts
from toolkit.lab.quantities import tire_table

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.channels import Axes
    from toolkit.findings import Finding
    from toolkit.lab.quantities import Columns
    from toolkit.lab.tire_tests.fit_models import Fitted
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.report.content import Plot
    from toolkit.tires.global_model import GlobalFit
    from toolkit.tires.model import CurveFit, Loss
    from toolkit.tires.slip import Angles
    from toolkit.tires.tir import TirFile


class Processed(Protocol):
    """A test that was processed (`toolkit.ProcessedTest`)."""

    @property
    def result(self) -> Resolved:
        """The test with the record that computed it."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class TireFit(Face):
    """Tire models fitted to one source, every load by itself or all of them at once."""

    result: Fitted
    source: str

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What should be known about the data and the fits."""
        return self.result.findings

    def to_dataframe(self) -> pd.DataFrame:
        """Return one parameter a row: model, channel, load, direction, value, standard error, unit."""
        import pandas as pd

        fitted = self.result
        fits: list[tuple[CurveFit | GlobalFit, str | None]] = [
            *zip(fitted.curves, fitted.rotations, strict=True),
            *((fit, None) for model in fitted.globals for fit in model.fits),
        ]
        return pd.DataFrame(
            [
                {"model": fit.model, "channel": fit.channel, "load_N": fit.load_N, "rotation": rotation,
                 "parameter": parameter.name, "value": parameter.value,
                 "standard_error": parameter.standard_error, "unit": parameter.unit,
                 "error_percent": fit.error_percent, "converged": fit.converged}
                for fit, rotation in fits
                for parameter in fit.parameters
            ]
        )  # fmt: skip

    def comparison(self) -> pd.DataFrame:
        """Return the models side by side: error in percent by channel, loads left out, the floor."""
        import pandas as pd

        return pd.DataFrame(self.result.comparison.as_dict()["rows"])

    @checked
    def write_tir(self, path: str | Path, *, model: str | None = None, side: str = "UNKNOWN") -> Path:
        """Write the tire property file of a model over all loads; return its path.

        Parameters
        ----------
        model : mf52, mf61 or mf62; default the one of them that was fitted
        side : TYRESIDE as tested: LEFT, RIGHT, SYMMETRIC, UNKNOWN

        Raises
        ------
        ToolkitError
            no such model was fitted, or the data have one load
        """
        from toolkit.lab.tire_tests.tire_files import check_tir, write_fit

        names = [model] if model else [fit.model for fit in self.result.globals]
        surfaces = check_tir(Path(path), Path(self.source), names)
        fit = next(fit for fit in self.result.globals if fit.model == surfaces)
        write_fit(
            Path(path), fit, self.result.data, source=Path(self.source), side=side.upper(),
            radius_m=self.result.radius_m, use=self.result.use, road=self.result.road,
        )  # fmt: skip
        return Path(path)

    def _facts(self) -> Facts:
        rows = self.result.comparison.rows
        return {
            "source": self.source,
            "models": ", ".join(self.result.comparison.models),
            "errors": ", ".join(f"{row.channel} {row.error_percent:.2f} %" for row in rows),
            "mark": self.result.use.mark if self.result.use else None,
            "findings": counted(len(self.findings), "finding") if self.findings else None,
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.test.models import fit_plots

        fitted = self.result
        word = fitted.use.word if fitted.use else None
        return {
            plot.name: replace(plot, watermark=word)
            for plot in fit_plots(fitted.data, fitted.curves, fitted.globals)
        }


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Tire(Face):
    """A tire property file, MF 5.2 or 6.x."""

    result: TirFile

    @checked
    def evaluate(
        self,
        data: Columns,
        *,
        units: Mapping[str, str] | None = None,
        axes: Axes = "ISO-W",
        angles: Angles = "star",
    ) -> pd.DataFrame:
        """Return ``FX [N]``, ``FY [N]``, ``MZ [N*m]`` at every row of slip angles and loads.

        What should be known of them stands in ``attrs["findings"]``, as ``toolkit evaluate --json`` has it.

        Parameters
        ----------
        data : ``SA`` and ``FZ`` of one sign, optional ``IA``, ``KAPPA``, ``P``, ``V``, with their units
        units : unit by column name, for columns without
        axes : of the data and of the answer
        angles : ``star`` for tan(alpha) and sin(gamma), ``raw`` for MF-Tyre's

        Raises
        ------
        ColumnError, UnitError
            a column is unknown or missing, or has no unit or one of another dimension
        CellError
            a value that no tire can have, loads of both signs
        ToolkitError
            the file cannot be evaluated there
        """
        import pandas as pd

        from toolkit.lab.tire_tests.evaluate import COMPUTED, evaluate_grid

        table = tire_table(data, units=units, axes=axes, measured=False)
        values, findings = evaluate_grid(self.result, table, angles=angles)
        forces = pd.DataFrame(
            {header: values[name] for name, header in COMPUTED.items()}, index=getattr(data, "index", None)
        )
        forces.attrs["findings"] = [finding.as_dict() for finding in findings]
        return forces

    def to_dataframe(self) -> pd.DataFrame:
        """Return the entries of the file: section, key, value as written."""
        import pandas as pd

        return pd.DataFrame(
            [
                {"section": section, "key": key, "value": value}
                for section, entries in self.result.sections
                for key, value in entries
            ]
        )

    def _facts(self) -> Facts:
        from toolkit.calibration.records.use import DRAFT_MARK

        return {
            "file": Path(self.result.where).name,
            "model": f"Magic Formula {self.result.version}",
            "mark": self.result.comment(DRAFT_MARK),
        }

    def _plots(self) -> Mapping[str, Plot]:
        import numpy as np

        from toolkit.report.content import Curve, Plot
        from toolkit.tires.tir import si_number

        angles, nominal = np.linspace(-12.0, 12.0, 97), si_number(self.result, "FNOMIN")
        loads = [round(share * nominal) for share in (0.5, 1.0, 1.5)]
        plots = {}
        for header, label in (("FY [N]", "lateral force FY / N"), ("MZ [N*m]", "aligning moment MZ / (N·m)")):
            curves = []
            for group, load in enumerate(loads):
                forces = self.evaluate({"SA [deg]": angles, "FZ [N]": np.full(angles.size, load)})
                curve = tuple(forces[header].tolist())
                curves.append(
                    Curve(label=f"{load} N", x=tuple(angles.tolist()), y=curve, group=group, style="line")
                )
            name = header.partition(" ")[0]
            plots[name] = Plot(
                name=name, x_label="slip angle SA / deg", y_label=label, curves=tuple(curves), zero_x=True,
                caption=f"{name} of the tire file.", alt=f"{name} over the slip angle, ISO-W axes.",
                legend_title="FZ",
            )  # fmt: skip
        return plots


@checked
def fit_tire(
    source: Processed | Resolved | Columns | str | Path,
    *models: str,
    axes: str | None = None,
    units: Mapping[str, str] | None = None,
    loss: Loss = "linear",
    weights: str = "equal",
    rated_load_N: float | None = None,
    radius_m: float | None = None,
) -> TireFit:
    """Fit tire models, without start values.

    Parameters
    ----------
    source : a test that was processed; a table (.csv), a continuous test (.mat, .dat), a DataFrame or a
        mapping with ``SA``, ``FZ``, and
        ``FY`` or ``MZ``, with units
    models : names such as ``mf61``; default ``magic_formula``, every load by itself; ``all`` is every one
    axes : of a table's numbers; default SAE, of a .mat or .dat file by the sign of its load
    units : unit by column name, for columns without
    loss, weights : ``linear`` or ``robust``; ``equal`` or ``noise``
    rated_load_N, radius_m : of a table's tire, for its tire file

    Raises
    ------
    ToolkitError
        the source cannot be read, or a model cannot be fitted to it
    """
    from toolkit.lab.tire_tests.fit_models import fit_order, fit_resolved, fit_table_models
    from toolkit.lab.tire_tests.resolve import Resolved

    order = fit_order(
        models or ("magic_formula",), axes=axes, loss=loss, weights=weights, rated_load_N=rated_load_N,
        radius_m=radius_m,
    )  # fmt: skip
    resolved = source if isinstance(source, Resolved) else getattr(source, "result", None)
    if isinstance(resolved, Resolved):
        name = resolved.result.reduced.info.name
        return TireFit(result=fit_resolved(resolved, order, where=name), source=name)
    if isinstance(source, str | Path):
        return TireFit(result=fit_table_models(Path(source), order), source=str(source))
    table = tire_table(source, units=units, axes=axes or "SAE")  # type: ignore[arg-type]
    return TireFit(result=fit_table_models(table, order), source=str(table.path))


@checked
def read_tire(path: str | Path) -> Tire:
    """Read a tire property file.

    Raises
    ------
    ToolkitError
        the file cannot be read, or is of a kind that cannot be evaluated

    Examples
    --------
    >>> import toolkit
    >>> toolkit.read_tire(toolkit.example("tire"))
    <Tire tire.tir | Magic Formula 6.x>
    """
    from toolkit.tires.tir import read_tir

    file = read_tir(Path(path))
    _ = file.version  # a kind that cannot be evaluated is refused at once
    return Tire(result=file)
