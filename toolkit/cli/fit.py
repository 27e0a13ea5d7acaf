"""`toolkit fit`: tire models without start values."""

from __future__ import annotations

import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import (
    CalibrationId,
    Calibrations,
    Home,
    Json,
    KnownAt,
    Quiet,
    answer,
    day,
    exit_code,
    finding_lines,
    table,
)

if TYPE_CHECKING:
    from toolkit.findings import Finding
    from toolkit.tires.model import Curve, CurveFit, Loss, TireModel

NAME = "fit"
MODEL = "mf61"  # the model over all loads that a tire file can hold


def command(
    source: Annotated[
        Path, typer.Argument(metavar="TEST|TABLE.csv", help="A test (folder or reduced .xlsx) or a table.")
    ],
    model: Annotated[
        list[str] | None, typer.Option("--model", help="Tire model; may be repeated. Default: magic_formula.")
    ] = None,
    tir: Annotated[Path | None, typer.Option("--tir", help="Write a tire file of a global model.")] = None,
    axes: Annotated[
        str, typer.Option("--axes", help="Axes of the table: SAE, adapted-SAE, ISO-W, machine.")
    ] = "SAE",
    loss: Annotated[str, typer.Option("--loss", help="linear (least squares) or robust.")] = "linear",
    calibration: CalibrationId = None,
    known_at: KnownAt = None,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fit tire models to every load of a test or a table; no start values.

    Example: toolkit fit tire.csv --axes ISO-W --json
    """
    from toolkit.errors import ConfigError
    from toolkit.tires.catalog import model as find
    from toolkit.tires.model import LOSSES

    started = time.perf_counter()
    names = list(dict.fromkeys(model or ["magic_formula"]))
    models = tuple(find(name) for name in names if name != MODEL)
    if loss not in LOSSES:
        raise ConfigError(
            f"unknown loss {loss!r}", where="--loss", got=loss, expected=", ".join(LOSSES),
            next_step="name one of those expected", rule="unknown-loss",
        )  # fmt: skip
    if tir is not None and MODEL not in names:
        raise ConfigError(
            "a tire file needs a model over all loads",
            where="--tir",
            got=", ".join(names),
            expected="a global model: a .tir file has no place for curves of single loads",
            next_step=f"add --model {MODEL}",
            rule="tir-needs-global",
        )
    if tir is not None and tir.resolve() == source.resolve():
        raise ConfigError(
            "the tire file would replace the table", where="--tir", got=tir, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
    if MODEL in names and loss != "linear":
        raise ConfigError(
            f"{MODEL} is fitted by least squares only", where="--loss", got=loss, expected="linear",
            next_step="leave --loss away for this model", rule="unknown-loss",
        )  # fmt: skip
    chosen: Loss = "robust" if loss == "robust" else "linear"
    if source.is_dir() or source.suffix.lower() != ".csv":
        rows, findings, curves, radius = _of_test(
            source, models, axes=axes, loss=chosen, calibration=calibration,
            calibrations=calibrations, home=home, known_at=known_at,
        )  # fmt: skip
    else:
        from toolkit.tires.table import read_table
        from toolkit.tires.table_fit import fit_table, table_curves

        measured = read_table(source, axes=axes)
        curves, radius, rows, findings = table_curves(measured), None, [], ()
        if models:
            result = fit_table(measured, models, loss=chosen)
            rows, findings = [(fit, None) for fit in result.fits], result.findings
    entries: list[dict[str, Any]] = []
    shown = ""
    if MODEL in names:
        from toolkit.cli.fit_tir import fit_global

        entries, more, shown = fit_global(curves, radius_m=radius, source=source, tir=tir)
        findings = (*findings, *more)
    payload = {
        "fits": [*(fit_payload(fit, rotation) for fit, rotation in rows), *entries],
        "tir": None if tir is None else str(tir),
        "findings": [finding.as_dict() for finding in findings],
        "timing": {"seconds": time.perf_counter() - started},
    }
    answer(payload, "\n\n".join(filter(None, (shown, _text(rows, findings)))), as_json=json, quiet=quiet)
    return exit_code(findings)


def _of_test(
    test: Path,
    models: Sequence[TireModel],
    *,
    axes: str,
    loss: Loss,
    calibration: str | None,
    calibrations: Path | None,
    home: Path | None,
    known_at: datetime | None,
) -> tuple[list[tuple[CurveFit, str | None]], tuple[Finding, ...], Sequence[Curve], float | None]:
    # Fits with their rotation, findings, the forward run's curves and the tire's free radius [m].
    from toolkit.characteristics.groups import group
    from toolkit.cli.resolve import resolve_test
    from toolkit.errors import ConfigError
    from toolkit.reduction.averaging import free_radius_m
    from toolkit.tires.fit import Curve, why_not
    from toolkit.tires.table_fit import fit_findings

    if axes != "SAE":
        raise ConfigError(
            "a test is reduced to SAE axes", where="--axes", got=axes, expected="SAE for a test",
            next_step="leave --axes away; it declares the axes of a table", rule="axes-of-test",
        )  # fmt: skip
    resolved = resolve_test(
        test,
        calibration=calibration,
        calibrations=calibrations,
        home=home,
        known_at=day(known_at),
    )
    rows: list[tuple[CurveFit, str | None]] = []
    for one in models:
        if one.name == "magic_formula" and loss == "linear":
            # The characteristics stand on these fits already.
            for direction in resolved.result.characteristics.fits:
                rows += [(fit, direction.rotation) for fit in (direction.FY, direction.MZ) if fit is not None]
            continue
        from toolkit.tires.catalog import fit_model

        made = [
            (Curve(SA=g.SA, y=g.values(channel), channel=channel, load_N=g.load_N), g.rotation)
            for g in group(resolved.result.reduced)
            for channel in ("FY", "MZ")
        ]
        made = [(curve, rotation) for curve, rotation in made if why_not(curve) is None]
        fits = fit_model(one, [curve for curve, _ in made], loss=loss)
        rows += list(zip(fits, [rotation for _, rotation in made], strict=True))
    own = [finding for finding in fit_findings([fit for fit, _ in rows]) if finding.level == "note"]
    reduced = resolved.result.reduced
    forward = [
        Curve(SA=g.SA, y=g.values(channel), channel=channel, load_N=g.load_N)
        for g in group(reduced)
        if g.rotation == "forward"
        for channel in ("FY", "MZ")
    ]
    return rows, (*resolved.findings, *own), forward, free_radius_m(reduced.info.tire_size)


def fit_payload(fit: CurveFit, rotation: str | None = None) -> dict[str, Any]:
    """Return one fit as the JSON answer of the files contract."""
    from toolkit.tires.table_fit import slope_sign

    stiffness = None
    if fit.slope_at_zero is not None:
        sign = slope_sign(fit.axes, fit.channel)  # type: ignore[arg-type]
        stiffness = {"value": sign * fit.slope_at_zero.value, "standard_error": fit.slope_at_zero.u}
    return {
        "model": fit.model,
        "channel": fit.channel,
        "load_N": fit.load_N,
        "rotation": rotation,
        "axes": fit.axes,
        "n": fit.n,
        "dof": fit.dof,
        "parameters": {p.name: p.value for p in fit.parameters},
        "standard_errors": {p.name: p.standard_error for p in fit.parameters},
        "units": {p.name: p.unit for p in fit.parameters},
        "not_determined": list(fit.not_determined),
        "at_bound": list(fit.at_bound),
        "error_percent": fit.error_percent,
        "scatter_floor_percent": fit.scatter_floor_percent,
        "cornering_stiffness_N_per_rad": stiffness if fit.channel == "FY" else None,
        "aligning_stiffness_Nm_per_rad": stiffness if fit.channel == "MZ" else None,
        "loss": fit.loss,
        "converged": fit.converged,
        "message": fit.message,
    }


def _text(rows: Sequence[tuple[CurveFit, str | None]], findings: Sequence[Finding]) -> str:
    parts = []
    for channel, factor_name in (("FY", "C_FY [N/deg]"), ("MZ", "C_MZ [N·m/deg]")):
        lines = [_line(fit, rotation) for fit, rotation in rows if fit.channel == channel]
        if lines:
            names = [p.name for p in next(f for f, _ in rows if f.channel == channel).parameters]
            head = ["model", "FZ [N]", "drum", "n", "error %", "floor %", factor_name, *names, "converged"]
            parts.append(f"{channel}\n{table(head, lines)}")
    text = "\n\n".join(parts)
    if rows:
        axes = ", ".join(dict.fromkeys(fit.axes for fit, _ in rows))
        text += (
            f"\n\naxes {axes}; parameters in SI (B 1/rad, Sh rad, D and Sv in N or N·m); "
            "± is one standard error, (value) is not determined by the data"
        )
    if findings:
        text += "\n\nfindings (toolkit explain RULE tells more):\n" + "\n".join(finding_lines(findings))
    return text


def _line(fit: CurveFit, rotation: str | None) -> list[str]:
    stiffness = "-"
    if fit.slope_at_zero is not None:
        from toolkit.tires.table_fit import slope_sign

        sign = slope_sign(fit.axes, fit.channel)  # type: ignore[arg-type]
        per_degree = 3.141592653589793 / 180
        stiffness = (
            f"{sign * fit.slope_at_zero.value * per_degree:.4g} ± {fit.slope_at_zero.u * per_degree:.2g}"
        )
    shown = [
        f"({p.value:.4g})" if p.standard_error is None else f"{p.value:.4g} ± {p.standard_error:.2g}"
        for p in fit.parameters
    ]
    return [
        fit.model,
        "all" if fit.load_N is None else f"{fit.load_N:.0f}",
        rotation or "-",
        str(fit.n),
        f"{fit.error_percent:.2f}",
        "-" if fit.scatter_floor_percent is None else f"{fit.scatter_floor_percent:.2f}",
        stiffness,
        *shown,
        "yes" if fit.converged else "no",
    ]
