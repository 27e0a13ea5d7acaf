"""`toolkit fit`: tire models without start values."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import (
    INTO_FILE,
    INTO_FOLDER,
    CalibrationId,
    Draft,
    KnownAt,
    Output,
    RegistryOptions,
)

NAME = "fit"


@answers("toolkit.lab.tire_tests.fit_answer:FitAnswer")
def command(
    source: Annotated[
        Path,
        "A test (folder or reduced .xlsx), a table (.csv), a continuous belt test (.mat, .dat).",
        ARGUMENT,
        Mark(metavar="TEST|TABLE"),
    ],
    model: Annotated[
        list[str] | None,
        "Tire model; may be repeated: magic_formula (per load, the default), pacejka94, mf52, mf61, mf62, "
        "tmeasy, treadsim, lugre, brush; 'all' is every one.",
    ] = None,
    tir: Annotated[Path | None, "Write a tire file of mf52, mf61 or mf62.", INTO_FILE] = None,
    fmu: Annotated[
        Path | None, "Write an FMU of a model over all loads; runs without Python.", INTO_FILE
    ] = None,
    fmi: Annotated[str, "Version of FMI of the FMU: 2 or 3."] = "2",
    figures: Annotated[Path | None, "Folder for figures: curves, residuals, comparison.", INTO_FOLDER] = None,
    axes: Annotated[
        str | None,
        "Axes of the table: SAE (its default), adapted-SAE, ISO-W, machine; a belt test says them by the "
        "sign of its load.",
    ] = None,
    machine: Annotated[
        str | None,
        "Machine whose recording the file is, or its definition; the file's own forces are fitted.",
    ] = None,
    loss: Annotated[str, "linear (least squares) or robust."] = "linear",
    weights: Annotated[str, "Of global models: equal, or noise (each load by its own residuals)."] = "equal",
    rated_load: Annotated[float | None, "Rated load [N] of a table's tire: FNOMIN."] = None,
    radius: Annotated[float | None, "Free radius [m] of a table's tire: UNLOADED_RADIUS."] = None,
    side: Annotated[str, "TYRESIDE as tested: LEFT, RIGHT, SYMMETRIC, UNKNOWN."] = "UNKNOWN",
    calibration: CalibrationId = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Fit tire models to a test or a table, every load by itself or all of them at once; no start values.

    A continuous belt test, a Tire Test Consortium .mat or a Calspan .dat, is split by
    inclination, pressure, load and direction of its sweeps; with --tir or --fmu alone mf61 is fitted to it.

    Example: toolkit fit tire.csv --model magic_formula --model mf61 --model brush --figures figures
    """
    from toolkit.lab.answers import counted
    from toolkit.lab.tire_tests.convert import check_fmu, write_fit_fmu
    from toolkit.lab.tire_tests.fit_answer import fit_payload, fit_text
    from toolkit.lab.tire_tests.fit_models import fit_order, fit_source, write_figures
    from toolkit.lab.tire_tests.tire_files import check_tir, write_fit
    from toolkit.publication import publication
    from toolkit.tires.field_file import is_field_file
    from toolkit.tires.tir_write import check_side

    over_loads = (tir is not None or fmu is not None) and is_field_file(source)
    order = fit_order(
        model or ["mf61" if over_loads else "magic_formula"], axes=axes, loss=loss, weights=weights,
        rated_load_N=rated_load, radius_m=radius,
    )  # fmt: skip
    into = check_tir(tir, source, order.names) if tir is not None else None
    modelled = check_fmu(fmu, source, order.names, fmi) if fmu is not None else None
    if into is not None or modelled is not None:
        check_side(side.upper())
    basis = place.basis(calibration=calibration, known_at=known_at, draft=draft)
    fitted = fit_source(source, order, machine=machine, basis=basis)
    findings = fitted.findings
    with nullcontext() if figures is None else publication(figures) as stage:
        written = [] if stage is None else write_figures(fitted, stage)
        if fmu is not None and modelled is not None:
            findings += write_fit_fmu(fmu, fitted, modelled, source=source, side=side.upper(), fmi=fmi)
        if tir is not None:
            fit = next(fit for fit in fitted.globals if fit.model == into)
            findings += write_fit(
                tir, fit, fitted.data, source=source, side=side.upper(), radius_m=fitted.radius_m,
                use=fitted.use, road=fitted.road,
            )  # fmt: skip
    payload: dict[str, Any] = {
        **fit_payload(fitted),
        "tir": None if tir is None else str(tir),
        "fmu": None if fmu is None else str(fmu),
        "figures": written,
        "findings": [finding.as_dict() for finding in findings],
        "timing": {**output.timing, "models": dict(fitted.comparison.seconds)},
    }
    text = fit_text(fitted, findings)
    if tir is not None:
        text += f"\n\n{tir} written: {into}"
    if fmu is not None:
        text += f"\n\n{fmu} written: {modelled}, FMI {fmi}"
    if written:
        text += f"\n\n{counted(len(written), 'figure')} in {figures}"
    output.answer(payload, text)
    return exit_code(findings)
