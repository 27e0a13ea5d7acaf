"""`toolkit fit`: tire models without start values."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import (
    CalibrationId,
    Calibrations,
    Draft,
    Home,
    Json,
    KnownAt,
    Quiet,
    answer,
    day,
    exit_code,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.cli.fit_models import Fitted
    from toolkit.tires.model import Loss

NAME = "fit"


def command(
    source: Annotated[
        Path, typer.Argument(metavar="TEST|TABLE.csv", help="A test (folder or reduced .xlsx) or a table.")
    ],
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            help="Tire model; may be repeated: magic_formula (per load, the default), pacejka94, mf52, mf61, "
            "mf62, tmeasy, treadsim, lugre, brush; 'all' is every one.",
        ),
    ] = None,
    tir: Annotated[
        Path | None, typer.Option("--tir", help="Write a tire file of mf52, mf61 or mf62.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", help="Folder for figures: curves, residuals, comparison.")
    ] = None,
    axes: Annotated[
        str, typer.Option("--axes", help="Axes of the table: SAE, adapted-SAE, ISO-W, machine.")
    ] = "SAE",
    loss: Annotated[str, typer.Option("--loss", help="linear (least squares) or robust.")] = "linear",
    weights: Annotated[
        str,
        typer.Option("--weights", help="Of global models: equal, or noise (each load by its own residuals)."),
    ] = "equal",
    rated_load: Annotated[
        float | None, typer.Option("--rated-load", help="Rated load [N] of a table's tire: FNOMIN.")
    ] = None,
    radius: Annotated[
        float | None, typer.Option("--radius", help="Free radius [m] of a table's tire: UNLOADED_RADIUS.")
    ] = None,
    side: Annotated[
        str, typer.Option("--side", help="TYRESIDE as tested: LEFT, RIGHT, SYMMETRIC, UNKNOWN.")
    ] = "UNKNOWN",
    calibration: CalibrationId = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fit tire models to a test or a table, every load by itself or all of them at once; no start values.

    Example: toolkit fit tire.csv --model magic_formula --model mf61 --model brush --figures figures
    """
    from toolkit.cli.fit_models import fit_table_models, fit_test_models
    from toolkit.cli.fit_text import payload, text
    from toolkit.cli.fit_tir import check_tir, write_fit

    started = time.perf_counter()
    names = model_choice(model or ["magic_formula"])
    chosen = _options(loss, weights, rated_load, radius)
    into = check_tir(tir, source, names) if tir is not None else None
    if figures is not None:
        from toolkit.cli.fit_report import check_folder

        check_folder(figures)
    if source.is_dir() or source.suffix.lower() != ".csv":
        fitted = fit_test_models(
            source, names, axes=axes, loss=chosen, weights=weights, rated_load_N=rated_load, radius_m=radius,
            calibration=calibration, calibrations=calibrations, home=home, known_at=day(known_at),
            draft=draft,
        )  # fmt: skip
    else:
        fitted = fit_table_models(
            source, names, axes=axes, loss=chosen, weights=weights, rated_load_N=rated_load, radius_m=radius
        )
    findings = fitted.findings
    if tir is not None:
        one = next(fit for fit in fitted.globals if fit.model == into)
        findings += write_fit(
            tir, one, fitted.data, source=source, side=side.upper(), radius_m=fitted.radius_m,
            use=fitted.use,
        )  # fmt: skip
    written = _draw(fitted, figures) if figures is not None else []
    told: dict[str, Any] = {
        **payload(fitted),
        "tir": None if tir is None else str(tir),
        "figures": written,
        "findings": [finding.as_dict() for finding in findings],
        "timing": {
            "seconds": time.perf_counter() - started,
            "models": dict(fitted.comparison.seconds),
        },
    }
    lines = text(fitted, findings)
    if tir is not None:
        lines += f"\n\n{tir} written: {into}"
    if written:
        lines += f"\n\n{len(written)} figures in {figures}"
    answer(told, lines, as_json=json, quiet=quiet)
    return exit_code(findings)


def model_choice(given: Sequence[str]) -> tuple[str, ...]:
    """Return the models named, ``all`` being every one.

    Raises
    ------
    FitError
        no model of a name is built: to be told before anything is read
    """
    from toolkit.tires.catalog import find, model_names

    names = [name for one in given for name in (model_names() if one == "all" else (one,))]
    for name in names:
        find(name)
    return tuple(dict.fromkeys(names))


def _options(loss: str, weights: str, rated_load: float | None, radius: float | None) -> Loss:
    import math

    from toolkit.errors import ConfigError
    from toolkit.tires.global_fit import WEIGHTS
    from toolkit.tires.model import LOSSES

    for name, got, known in (("loss", loss, LOSSES), ("weights", weights, WEIGHTS)):
        if got not in known:
            raise ConfigError(
                f"unknown {name} {got!r}", where=f"--{name}", got=got, expected=", ".join(known),
                next_step="name one of those expected", rule=f"unknown-{name}",
            )  # fmt: skip
    for option, value, unit in (("--rated-load", rated_load, "N"), ("--radius", radius, "m")):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ConfigError(
                f"{option} is no positive number", where=option, got=value,
                expected=f"a number of {unit} above 0", next_step="mend the option", rule="wrong-value",
            )  # fmt: skip
    return "robust" if loss == "robust" else "linear"


def _draw(fitted: Fitted, folder: Path) -> list[str]:
    from toolkit.files import write_atomic
    from toolkit.report.fit_figures import fit_figures

    word = fitted.use.word if fitted.use else None
    made = fit_figures(fitted.data, fitted.curves, fitted.globals, fitted.comparison, word)
    for name, data in made.items():
        write_atomic(folder / name, data)
    return sorted(made)
