"""Tire models fitted to a test or a table: their fits, findings, comparison and figures."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError, FitError, refuse_unknown
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.lab.tire_tests.resolve import Basis, Resolved
    from toolkit.machine.definition import Drum, Machine
    from toolkit.tires.comparison import Comparison
    from toolkit.tires.global_data import Measured
    from toolkit.tires.global_model import GlobalModel, ModelFit
    from toolkit.tires.model import CurveFit, Loss, TireModel
    from toolkit.tires.sweeps import Sweeps
    from toolkit.tires.table import TireTable


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """Everything that was fitted to one source.

    ``curves`` are the fits of single loads with their ``rotations``; ``globals`` those over all loads, of the
    rows in ``data``; ``radius_m`` the tire's free radius where it is known; ``use`` the calibration record
    that computed the forces, None for a table; ``sweeps`` what a continuous test was split into; ``road``
    what the tire rolled on, None where only a table tells of the test.
    """

    data: Measured
    curves: tuple[CurveFit, ...]
    rotations: tuple[str | None, ...]
    globals: tuple[ModelFit, ...]
    comparison: Comparison
    findings: tuple[Finding, ...]
    radius_m: float | None
    use: CalibrationUse | None = None
    sweeps: Sweeps | None = None
    road: Drum | None = None


def fit_table_models(
    table: Path | TireTable,
    names: Sequence[str],
    *,
    axes: str | None,
    loss: Loss,
    weights: str,
    rated_load_N: float | None,
    radius_m: float | None,
) -> Fitted:
    """Return the fits of a table, or of a file of the field, which is split by condition and direction.

    ``table`` is its path, or what a notebook gave in place of a file.
    ``axes`` are None for those of the file: SAE for a table, by the sign of the load for a file of the field.

    Raises
    ------
    ToolkitError
        the table cannot be read; no curve of it can be fitted; a model cannot be fitted to it
    """
    from toolkit.lab.tire_tests.tire_files import STAND_IN_RADIUS
    from toolkit.tires.field_file import is_field_file
    from toolkit.tires.global_data import of_table
    from toolkit.tires.plausibility import size_findings
    from toolkit.tires.sweeps import split_file
    from toolkit.tires.table import read_table
    from toolkit.tires.table_fit import axes_findings, fit_table, repeat_findings, row_findings

    path = table if isinstance(table, Path) else table.path
    sweeps = split_file(table, axes) if isinstance(table, Path) and is_field_file(table) else None
    if sweeps is not None:
        measured = sweeps.table
    else:
        measured = read_table(table, axes=axes or "SAE") if isinstance(table, Path) else table
    data = of_table(measured, rated_load_N=rated_load_N, radius_m=radius_m or STAND_IN_RADIUS)
    single, over_loads = _split(names)
    curves: tuple[CurveFit, ...] = ()
    findings: tuple[Finding, ...] = (*measured.mark_findings, *repeat_findings(measured))
    seconds: dict[str, float] = {}
    for model in single:
        started = time.perf_counter()
        result = fit_table(measured, model, loss=loss)
        seconds[model.name] = time.perf_counter() - started
        curves += result.fits
        findings += tuple(finding for finding in result.findings if finding not in findings)
    fits, fit_findings, seeds = _global(data, over_loads, loss, weights, str(path), seconds)
    if not single:
        findings += (
            *row_findings(measured),
            *axes_findings(measured, seeds),
            *size_findings(seeds, path.name),
        )
    fitted = _fitted(data, curves, (None,) * len(curves), fits, (*findings, *fit_findings), radius_m, seconds)
    return replace(fitted, sweeps=sweeps)


def fit_recording(
    path: Path, machine: str, names: Sequence[str], *, axes: str | None, **options: Any
) -> Fitted:
    """Return the fits of a machine's recording by its own forces; ``machine`` is a name or a definition.

    Raises
    ------
    ConfigError
        ``usage``: axes beside the definition's; errors as those of a recording and `fit_table_models`
    """
    from toolkit.machine import load_machine

    definition = load_machine(machine)
    if axes is not None:
        raise ConfigError(
            "a recording is in the axes of its machine", where="--axes", got=axes,
            expected=f"--machine alone; its axes are {definition.axes}", next_step="leave --axes out",
            rule="usage",
        )  # fmt: skip
    fitted = fit_table_models(_table_of_recording(path, definition), names, axes=None, **options)
    return replace(fitted, road=definition.drum)


def _table_of_recording(path: Path, machine: Machine) -> TireTable:
    """Return a machine's recording as a table, in the axes of its definition and with its corrections.

    The forces are those that the file has: what computed them is the machine's own affair.

    Raises
    ------
    ToolkitError
        the file is no recording of this machine, or has not the columns of a table
    """
    from toolkit.channels import CHANNELS
    from toolkit.recording.read import read_recording
    from toolkit.reduction.corrections import corrected
    from toolkit.tires.table import table_of

    recording = read_recording(path, machine)
    columns = {series.symbol: series.si for series in recording.series if series.symbol in CHANNELS}
    if machine.corrections:
        columns |= corrected(machine, {name: recording[name].si for name in ("SA", "FZ", "FY", "MZ")})
    return table_of(
        [f"{symbol} [{CHANNELS[symbol].si}]" for symbol in columns], list(columns.values()), path=path,
        axes=machine.axes, measured=True,
    )  # fmt: skip


_NEXT_STEPS = {
    ".tdx": "make a table of it: toolkit convert {name} {stem}.csv",
    ".tir": "a tire file is a fit already: toolkit evaluate {name} GRID.csv",
    ".txt": "give a table the name {stem}.csv",
    ".tsv": "give a table the name {stem}.csv",
}


def refuse_other_files(source: Path) -> None:
    """Refuse a file that is neither a test nor a table, with the way to one.

    Raises
    ------
    ConfigError
        ``fit-source``
    """
    step = _NEXT_STEPS.get(source.suffix.lower())
    if step is not None and source.is_file():
        raise ConfigError(
            "models are not fitted to a file of this kind", where=source, got=f"a {source.suffix} file",
            expected="a test (its folder, or reduced as .xlsx), a table (.csv), a belt test (.mat, .dat)",
            next_step=step.format(name=source.name, stem=source.stem), rule="fit-source",
        )  # fmt: skip


def fit_test_models(
    test: Path,
    names: Sequence[str],
    *,
    axes: str | None,
    loss: Loss,
    weights: str,
    rated_load_N: float | None,
    radius_m: float | None,
    basis: Basis,
) -> Fitted:
    """Return the fits of a test: single loads in both directions, models over all loads of the forward run.

    Raises
    ------
    ToolkitError
        the test cannot be resolved; a model cannot be fitted to it
    """
    from toolkit.lab.tire_tests.resolve import resolve_test

    if axes not in (None, "SAE"):
        raise ConfigError(
            "a test is reduced to SAE axes", where="--axes", got=axes, expected="SAE for a test",
            next_step="leave --axes away; it declares the axes of a table", rule="axes-of-test",
        )  # fmt: skip
    return fit_resolved(
        resolve_test(test, basis), names, where=str(test), loss=loss, weights=weights,
        rated_load_N=rated_load_N, radius_m=radius_m,
    )  # fmt: skip


def fit_resolved(
    resolved: Resolved,
    names: Sequence[str],
    *,
    where: str,
    loss: Loss = "linear",
    weights: str = "equal",
    rated_load_N: float | None = None,
    radius_m: float | None = None,
) -> Fitted:
    """Return the fits of a test that was read already; ``where`` names it.

    Raises
    ------
    FitError
        a model cannot be fitted to it
    """
    import numpy as np

    from toolkit.characteristics.groups import group
    from toolkit.lab.tire_tests.tire_files import STAND_IN_RADIUS
    from toolkit.reduction.averaging import free_radius_m
    from toolkit.tires.fit import Curve, why_not
    from toolkit.tires.global_data import measured
    from toolkit.tires.models import fit_model
    from toolkit.tires.table_fit import fit_findings

    groups = group(resolved.result.reduced)
    single, over_loads = _split(names)
    rows: list[tuple[CurveFit, str]] = []
    seconds: dict[str, float] = {}
    for model in single:
        curves = [
            (Curve(SA=g.SA, y=g.values(channel), channel=channel, load_N=g.load_N), g.rotation)
            for g in groups
            for channel in ("FY", "MZ")
        ]
        curves = [(curve, rotation) for curve, rotation in curves if why_not(curve) is None]
        started = time.perf_counter()
        fits = fit_model(model, [curve for curve, _ in curves], loss=loss)
        seconds[model.name] = time.perf_counter() - started
        rows += list(zip(fits, [rotation for _, rotation in curves], strict=True))
    notes = [finding for finding in fit_findings([fit for fit, _ in rows]) if finding.level == "note"]
    info = resolved.result.reduced.info
    radius = radius_m or free_radius_m(info.tire_size)
    run = [
        g
        for g in groups
        if g.rotation == ("forward" if any(g.rotation == "forward" for g in groups) else g.rotation)
    ]
    columns = {
        "SA": np.concatenate([g.SA for g in run]),
        "FZ": np.concatenate([np.full(len(g.SA), g.load_N) for g in run]),
        "FY": np.concatenate([g.values("FY") for g in run]),
        "MZ": np.concatenate([g.values("MZ") for g in run]),
    }
    if info.pressure_Pa:
        columns["P"] = np.full(len(columns["SA"]), info.pressure_Pa)
    if info.speed_m_s:
        columns["V"] = np.full(len(columns["SA"]), info.speed_m_s)
    data = measured(
        columns, axes="SAE", rated_load_N=rated_load_N or info.rated_load_N,
        unloaded_radius_m=radius or STAND_IN_RADIUS,
    )  # fmt: skip
    fits_all, global_findings, _ = _global(data, over_loads, loss, weights, where, seconds)
    findings = (*resolved.findings, *notes, *global_findings)
    fitted = _fitted(
        data, tuple(fit for fit, _ in rows), tuple(turn for _, turn in rows), fits_all, findings, radius,
        seconds,
    )  # fmt: skip
    roads = [recording.machine.drum for _, recording in resolved.recordings]
    return replace(fitted, use=resolved.result.reduced.calibration, road=roads[0] if roads else None)


def _split(names: Sequence[str]) -> tuple[tuple[TireModel, ...], tuple[GlobalModel, ...]]:
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find

    models = [find(name) for name in names]
    over_loads = tuple(model for model in models if isinstance(model, GlobalModel))
    return tuple(model for model in models if not isinstance(model, GlobalModel)), over_loads


def _global(
    data: Measured,
    models: Sequence[GlobalModel],
    loss: Loss,
    weights: str,
    where: str,
    seconds: dict[str, float],
) -> tuple[tuple[ModelFit, ...], tuple[Finding, ...], tuple[CurveFit, ...]]:
    from toolkit.tires.global_fit import fit_global, global_findings, not_varied, selection_of
    from toolkit.tires.global_seeds import seeds_of, why_not_global

    if not models:
        return (), (), ()
    whole = []
    for model in models:
        selection = selection_of(data, model)
        whole.append(not selection.left_out)
        if (problem := why_not_global(data.take(selection.rows), model)) is not None:
            raise FitError(
                problem.what, where=f"{where}, {problem.where}", got=problem.got, expected=problem.expected,
                next_step=problem.next_step, rule=problem.rule,
            )  # fmt: skip
    seeds = seeds_of(data)
    model_fits = []
    for model, all_rows in zip(models, whole, strict=True):
        started = time.perf_counter()
        known = seeds.seeds if all_rows else None
        model_fits.append(fit_global(model, data, loss=loss, weights=weights, seeds=known))
        seconds[model.name] = time.perf_counter() - started
    fits = tuple(model_fits)
    findings = [*_apart(fits, where), *not_varied(fits, where)]
    findings += [finding for fit in fits for finding in global_findings(fit)]
    return fits, tuple(findings), seeds.fits


def _apart(fits: Sequence[ModelFit], where: str) -> list[Finding]:
    """Return which rows were left out, once for all models that leave out the same."""
    groups: dict[tuple[str, ...], list[ModelFit]] = {}
    for fit in fits:
        groups.setdefault((*fit.selection.apart, *fit.selection.stands), []).append(fit)
    return [
        finding
        for alike in groups.values()
        for finding in alike[0].selection.findings(models=[fit.model for fit in alike], where=where)
    ]


def _fitted(
    data: Measured,
    curves: tuple[CurveFit, ...],
    rotations: tuple[str | None, ...],
    fits: tuple[ModelFit, ...],
    findings: tuple[Finding, ...],
    radius_m: float | None,
    seconds: dict[str, float],
) -> Fitted:
    from toolkit.tires.comparison import compare

    forward = [fit for fit, turn in zip(curves, rotations, strict=True) if turn in (None, "forward")]
    return Fitted(
        data=data,
        curves=curves,
        rotations=rotations,
        globals=fits,
        comparison=compare(data, forward, fits, seconds=seconds),
        findings=findings,
        radius_m=radius_m,
    )


def model_choice(choices: Sequence[str]) -> tuple[str, ...]:
    """Return the models named, ``all`` being every one.

    Raises
    ------
    FitError
        no model of a name is built: to be told before anything is read
    """
    from toolkit.tires.models import find, model_names

    names = [name for choice in choices for name in (model_names() if choice == "all" else (choice,))]
    for name in names:
        find(name)
    return tuple(dict.fromkeys(names))


def fit_options(loss: str, weights: str, rated_load: float | None, radius: float | None) -> Loss:
    """Return the loss that is named; refuse options that no fit can use.

    Raises
    ------
    ConfigError
        a loss or a weighting is unknown; a load [N] or a radius [m] is no positive number
    """
    import math

    from toolkit.tires.global_fit import WEIGHTS
    from toolkit.tires.model import LOSSES

    for name, choice, choices in (("loss", loss, LOSSES), ("weights", weights, WEIGHTS)):
        refuse_unknown(name, choice, choices, where=f"--{name}", rule=f"unknown-{name}")
    for option, value, unit in (("--rated-load", rated_load, "N"), ("--radius", radius, "m")):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ConfigError(
                f"{option} is no positive number", where=option, got=value,
                expected=f"a number of {unit} above 0", next_step="mend the option", rule="wrong-value",
            )  # fmt: skip
    return "robust" if loss == "robust" else "linear"


def write_figures(fitted: Fitted, stage: Path) -> list[str]:
    """Write the figures of all fits into a staging folder; return their names."""
    from toolkit.report.test.models import fit_figures

    word = fitted.use.word if fitted.use else None
    pictures = fit_figures(fitted.data, fitted.curves, fitted.globals, fitted.comparison, word)
    for name, picture in pictures.items():
        (stage / name).write_bytes(picture)
    return sorted(pictures)
