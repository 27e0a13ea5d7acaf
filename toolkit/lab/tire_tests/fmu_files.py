"""Tires as FMU: of a fit over all loads, or of a tire file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError, FitError
from toolkit.files import same_file
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.lab.tire_tests.fit_models import Fitted
    from toolkit.tires.fmu.equations import TireEquations


def check_fmu(fmu: Path, source: Path, names: Sequence[str], fmi: str) -> str:
    """Return which of the models becomes the FMU; refuse what cannot, before anything is fitted.

    Raises
    ------
    ConfigError
        none of the models is over all loads, or more than one; ``fmi`` is no version; the file would replace
        the table
    """
    from toolkit.tires.fmu.description import VERSIONS
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find

    fitting = [name for name in names if isinstance(find(name), GlobalModel)]
    if len(fitting) != 1:
        raise ConfigError(
            "an FMU holds one model over all loads", where="--fmu", got=", ".join(names),
            expected="one model over all loads, such as mf61 or brush; single loads have no FMU",
            next_step=f"give --model {fitting[0] if fitting else 'mf61'}, and no second of them",
            rule="fmu-needs-global",
        )  # fmt: skip
    if fmi not in VERSIONS:
        raise ConfigError(
            f"unknown version of FMI {fmi!r}", where="--fmi", got=fmi, expected=" or ".join(VERSIONS),
            next_step="name one of those expected", rule="fmi-version",
        )  # fmt: skip
    if same_file(fmu, source):
        raise ConfigError(
            "the FMU would replace the table", where="--fmu", got=fmu, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
    return fitting[0]


def write_fit_fmu(
    path: Path, fitted: Fitted, model_name: str, *, source: Path, side: str, fmi: str
) -> tuple[Finding, ...]:
    """Write the FMU of one of the fits; return what should be known about it.

    A Magic Formula is taken as the tire file that ``--tir`` would write, so that both hold the same tire.

    Raises
    ------
    FitError
        the data have one load: its change would be invented
    ConfigError
        the model's equations have no C
    """
    from toolkit.publication import write_result
    from toolkit.tires.fmu.archive import fmu_of
    from toolkit.tires.fmu.equations import equations_of_file, equations_of_fit
    from toolkit.tires.global_data import what_varies
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find
    from toolkit.tires.tir import parse_tir
    from toolkit.tires.tir_write import FITTYP, tir_text, tire_fit

    fit = next(fit for fit in fitted.globals if fit.model == model_name)
    data, use = fitted.data.take(fit.selection.rows), fitted.use
    if "two_loads" not in what_varies(data):
        raise FitError(
            "an FMU needs two loads or more", where=source, got=f"one load, {data.loads[0]:.0f} N",
            expected="two loads or more, five for a load sensitivity to trust",
            next_step="measure more loads; without --fmu the model is fitted at this load", rule="one-load",
        )  # fmt: skip
    model = find(model_name)
    assert isinstance(model, GlobalModel)  # noqa: S101  `check_fmu` saw to it
    equations: TireEquations
    if model_name in FITTYP:
        text = tir_text(tire_fit(model, fit, data, side=side))
        equations = equations_of_file(parse_tir(text, where=str(path)))
    else:
        equations = equations_of_fit(model, fit, data)
    notes = [f"Fitted to {source.name}, {len(data)} rows, {len(data.loads)} loads"]
    if use is not None:
        notes += [f"calibration {use.id} {use.sha256}", *([use.mark] if use.mark else [])]
    fmu = fmu_of(equations, name=path.stem, fmi=fmi, notes="; ".join(notes))
    write_result(path, fmu.content)
    return fmu_findings(path, fmu.binary)


def file_fmu(source: Path, target: Path, *, fmi: str) -> tuple[bytes, tuple[Finding, ...]]:
    """Return the FMU of a tire file, and what should be known about it.

    Raises
    ------
    ToolkitError
        the file cannot be read or evaluated; ``fmi`` is no version
    """
    from toolkit.calibration.records.use import DRAFT_MARK
    from toolkit.tires.fmu.archive import fmu_of
    from toolkit.tires.fmu.equations import equations_of_file
    from toolkit.tires.tir import read_tir
    from toolkit.tires.tir_evaluate import lacking_findings

    file = read_tir(source)
    mark = file.comment(DRAFT_MARK)
    findings = (*file.findings(), *lacking_findings(file, file.coefficients()))
    fmu = fmu_of(
        equations_of_file(file), name=target.stem, fmi=fmi,
        notes="; ".join([f"Of {source.name}", *([mark] if mark else [])]),
    )  # fmt: skip
    return fmu.content, (*findings, *fmu_findings(target, fmu.binary))


def fmu_findings(path: Path, binary: str | None) -> tuple[Finding, ...]:
    """Return a note where an FMU holds sources alone."""
    if binary is not None:
        return ()
    text = (
        "no C compiler for this system was found (cc, gcc, clang on Linux): the FMU holds its sources alone, "
        "for tools that compile them"
    )
    return (Finding(rule="fmu-sources", where=str(path), message=text, level="note"),)
