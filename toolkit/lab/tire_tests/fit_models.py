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


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOrder:
    """What is fitted, and how: ``names`` of models, the ``loss`` of their rows, the ``weights`` of the loads.

    ``axes`` are those of a table's numbers, None for its own: SAE, of a file of the field by the sign of the
    load. ``rated_load_N`` and ``radius_m`` are of the tire, where the source does not tell them.
    """

    names: tuple[str, ...]
    axes: str | None = None
    loss: Loss = "linear"
    weights: str = "equal"
    rated_load_N: float | None = None
    radius_m: float | None = None


def fit_order(
    models: Sequence[str],
    *,
    axes: str | None = None,
    loss: str = "linear",
    weights: str = "equal",
    rated_load_N: float | None = None,
    radius_m: float | None = None,
) -> FitOrder:
    """Return an order as it was stated; refuse what no fit can use before anything is read.

    Raises
    ------
    ConfigError
        a loss or a weighting is unknown; a load [N] or a radius [m] is no positive number
    FitError
        no model of a name is built
    """
    import math

    from toolkit.tires.global_fit import WEIGHTS
    from toolkit.tires.model import LOSSES

    names = model_choice(models)
    for name, choice, choices in (("loss", loss, LOSSES), ("weights", weights, WEIGHTS)):
        refuse_unknown(name, choice, choices, where=f"--{name}", rule=f"unknown-{name}")
    for option, value, unit in (("--rated-load", rated_load_N, "N"), ("--radius", radius_m, "m")):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ConfigError(
                f"{option} is no positive number", where=option, got=value,
                expected=f"a number of {unit} above 0", next_step="mend the option", rule="wrong-value",
            )  # fmt: skip
    return FitOrder(
        names=names, axes=axes, loss="robust" if loss == "robust" else "linear", weights=weights,
        rated_load_N=rated_load_N, radius_m=radius_m,
    )  # fmt: skip


def fit_source(source: Path, order: FitOrder, *, machine: str | None, basis: Basis) -> Fitted:
    """Return the fits of a file or folder: of a machine's recording, of a test by ``basis``, of a table.

    Raises
    ------
    ConfigError
        ``fit-source``: a file of another kind; errors as those of `fit_recording`, `fit_test_models` and
        `fit_table_models`
    """
    from toolkit.tires.field_file import is_field_file

    if machine is not None:
        return fit_recording(source, machine, order)
    if source.suffix.lower() != ".csv" and not is_field_file(source):
        refuse_other_files(source)
        return fit_test_models(source, order, basis)
    return fit_table_models(source, order)


def fit_table_models(table: Path | TireTable, order: FitOrder) -> Fitted:
    """Return the fits of a table, or of a file of the field, which is split by condition and direction.

    ``table`` is its path, or what a notebook gave in place of a file.

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
    sweeps = split_file(table, order.axes) if isinstance(table, Path) and is_field_file(table) else None
    if sweeps is not None:
        measured = sweeps.table
    else:
        measured = read_table(table, axes=order.axes or "SAE") if isinstance(table, Path) else table
    data = of_table(measured, rated_load_N=order.rated_load_N, radius_m=order.radius_m or STAND_IN_RADIUS)
    single, over_loads = _split(order.names)
    curves: tuple[CurveFit, ...] = ()
    findings: tuple[Finding, ...] = (*measured.mark_findings, *repeat_findings(measured))
    seconds: dict[str, float] = {}
    for model in single:
        started = time.perf_counter()
        result = fit_table(measured, model, loss=order.loss)
        seconds[model.name] = time.perf_counter() - started
        curves += result.fits
        findings += tuple(finding for finding in result.findings if finding not in findings)
    fits, fit_findings, seeds = _global(data, over_loads, order, str(path), seconds)
    if not single:
        findings += (
            *row_findings(measured),
            *axes_findings(measured, seeds),
            *size_findings(seeds, path.name),
        )
    return _fitted(
        data, [(fit, None) for fit in curves], fits, seconds,
        findings=(*findings, *fit_findings), radius_m=order.radius_m, sweeps=sweeps,
    )  # fmt: skip


def fit_recording(path: Path, machine: str, order: FitOrder) -> Fitted:
    """Return the fits of a machine's recording by its own forces; ``machine`` is a name or a definition.

    Raises
    ------
    ConfigError
        ``usage``: axes beside the definition's; errors as those of a recording and `fit_table_models`
    """
    from toolkit.machine import load_machine

    definition = load_machine(machine)
    if order.axes is not None:
        raise ConfigError(
            "a recording is in the axes of its machine", where="--axes", got=order.axes,
            expected=f"--machine alone; its axes are {definition.axes}", next_step="leave --axes out",
            rule="usage",
        )  # fmt: skip
    return replace(fit_table_models(_table_of_recording(path, definition), order), road=definition.drum)


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


def fit_test_models(test: Path, order: FitOrder, basis: Basis) -> Fitted:
    """Return the fits of a test: single loads in both directions, models over all loads of the forward run.

    Raises
    ------
    ToolkitError
        the test cannot be resolved; a model cannot be fitted to it
    """
    from toolkit.lab.tire_tests.resolve import resolve_test

    if order.axes not in (None, "SAE"):
        raise ConfigError(
            "a test is reduced to SAE axes", where="--axes", got=order.axes, expected="SAE for a test",
            next_step="leave --axes away; it declares the axes of a table", rule="axes-of-test",
        )  # fmt: skip
    return fit_resolved(resolve_test(test, basis), order, where=str(test))


def fit_resolved(resolved: Resolved, order: FitOrder, *, where: str) -> Fitted:
    """Return the fits of a test that was read already; ``where`` names it.

    Raises
    ------
    FitError
        a model cannot be fitted to it
    """
    import numpy as np

    from toolkit.characteristics.groups import CHANNELS, group
    from toolkit.lab.tire_tests.tire_files import STAND_IN_RADIUS, columns_of_run
    from toolkit.reduction.averaging import free_radius_m
    from toolkit.tires.fit import Curve, why_not
    from toolkit.tires.global_data import measured
    from toolkit.tires.models import fit_model
    from toolkit.tires.table_fit import fit_findings

    reduced = resolved.result.reduced
    groups, info = group(reduced), reduced.info
    single, over_loads = _split(order.names)
    curves: list[tuple[CurveFit, str | None]] = []
    seconds: dict[str, float] = {}
    for model in single:
        measured_curves = [
            (Curve(SA=g.SA, y=g.values(channel), channel=channel, load_N=g.load_N), g.rotation)
            for g in groups
            for channel in CHANNELS
        ]
        fitting = [(curve, rotation) for curve, rotation in measured_curves if why_not(curve) is None]
        started = time.perf_counter()
        fits = fit_model(model, [curve for curve, _ in fitting], loss=order.loss)
        seconds[model.name] = time.perf_counter() - started
        curves += list(zip(fits, [rotation for _, rotation in fitting], strict=True))
    notes = [finding for finding in fit_findings([fit for fit, _ in curves]) if finding.level == "note"]
    radius = order.radius_m or free_radius_m(info.tire_size)
    forward = [g for g in groups if g.rotation == "forward"]
    columns = columns_of_run(forward or groups)
    if info.pressure_Pa:
        columns["P"] = np.full(len(columns["SA"]), info.pressure_Pa)
    if info.speed_m_s:
        columns["V"] = np.full(len(columns["SA"]), info.speed_m_s)
    data = measured(
        columns, axes="SAE", rated_load_N=order.rated_load_N or info.rated_load_N,
        unloaded_radius_m=radius or STAND_IN_RADIUS,
    )  # fmt: skip
    model_fits, global_findings, _ = _global(data, over_loads, order, where, seconds)
    roads = [recording.machine.drum for _, recording in resolved.recordings]
    return _fitted(
        data, curves, model_fits, seconds, findings=(*resolved.findings, *notes, *global_findings),
        radius_m=radius, use=reduced.calibration, road=roads[0] if roads else None,
    )  # fmt: skip


def _split(names: Sequence[str]) -> tuple[tuple[TireModel, ...], tuple[GlobalModel, ...]]:
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find

    models = [find(name) for name in names]
    over_loads = tuple(model for model in models if isinstance(model, GlobalModel))
    return tuple(model for model in models if not isinstance(model, GlobalModel)), over_loads


def _global(
    data: Measured, models: Sequence[GlobalModel], order: FitOrder, where: str, seconds: dict[str, float]
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
        model_fits.append(fit_global(model, data, loss=order.loss, weights=order.weights, seeds=known))
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
    curves: Sequence[tuple[CurveFit, str | None]],
    fits: tuple[ModelFit, ...],
    seconds: dict[str, float],
    **known: Any,
) -> Fitted:
    """Return what was fitted, with the comparison of all; ``curves`` with the direction of their runs."""
    from toolkit.tires.comparison import compare

    forward = [fit for fit, turn in curves if turn in (None, "forward")]
    return Fitted(
        data=data, curves=tuple(fit for fit, _ in curves), rotations=tuple(turn for _, turn in curves),
        globals=fits, comparison=compare(data, forward, fits, seconds=seconds), **known,
    )  # fmt: skip


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


def write_figures(fitted: Fitted, stage: Path) -> list[str]:
    """Write the figures of all fits into a staging folder; return their names."""
    from toolkit.report.test.models import fit_figures

    word = fitted.use.word if fitted.use else None
    pictures = fit_figures(fitted.data, fitted.curves, fitted.globals, fitted.comparison, word)
    for name, picture in pictures.items():
        (stage / name).write_bytes(picture)
    return sorted(pictures)
