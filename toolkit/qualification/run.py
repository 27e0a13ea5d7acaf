"""The whole qualification, offline, and the record of it.

The golden vectors of a registry's records, values computed exactly and apart from the coefficients, are
checked here; certified sets, published examples and gates have modules of their own.
"""

from __future__ import annotations

import platform
from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np

from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.registry.refit import GOLDEN
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.terms import term_matrix
from toolkit.errors import ToolkitError
from toolkit.qualification import numbers
from toolkit.qualification.gates import check_gates
from toolkit.qualification.model import Check, NotCovered, QualificationRecord, not_run
from toolkit.qualification.numbers import check_certified, check_e74, check_lines
from toolkit.version import __version__

GROUP = "golden vectors"


def check_golden(calibrations: Path) -> tuple[list[Check], list[NotCovered]]:
    """Check every record of a registry; a record that a load-time gate refuses is a failed check."""
    registry = Registry(calibrations)
    checks: list[Check] = []
    not_covered: list[NotCovered] = []
    for instrument in registry.instruments():
        try:
            good, bad = registry.usable(instrument)
        except ToolkitError as error:
            checks.append(not_run(GROUP, instrument, str(error)))
            continue
        checks += [
            not_run(GROUP, refusal.id, f"refused, {refusal.rule}: {refusal.reason}") for refusal in bad
        ]
        for record in good:
            if record.golden.inputs:
                checks += [_check(record, at) for at in range(len(record.loads))]
            else:
                not_covered.append(NotCovered(name=record.id, reason="a legacy import has no golden vectors"))
    if not checks:
        checks.append(not_run(GROUP, "registry", "no record with golden vectors was found"))
    return checks, not_covered


def _check(record: CalibrationRecord, at: int) -> Check:
    load: LoadFit = record.loads[at]
    inputs = np.asarray(record.golden.inputs)
    matrix = term_matrix(load.terms, dict(zip(record.indications, inputs.T, strict=True)))
    coefficients = np.asarray(load.coefficients)
    off = np.abs(matrix @ coefficients - np.asarray(record.golden.outputs[at]))
    # The rounding of the sum itself is allowed for, as at load time.
    rounding = 64 * np.finfo(float).eps * (np.abs(matrix) @ np.abs(coefficients))
    worst = int((off - rounding).argmax())
    return Check(
        group=GROUP, name=record.id, quantity=load.load, measure="share of the largest load",
        required=GOLDEN + float(rounding[worst]) / load.largest, reached=float(off[worst]) / load.largest,
        passed=bool((off <= GOLDEN * load.largest + rounding).all()),
        note=f"{len(inputs)} vectors; the record refits from its own data",
    )  # fmt: skip


PACKAGES = ("numpy", "scipy", "statsmodels", "odrpack")


def qualify(*, calibrations: Path, on: date, folder: Path | None = None) -> QualificationRecord:
    """Run every check and return the record; what cannot be run is a failed check.

    Parameters
    ----------
    calibrations : registry whose golden vectors are checked
    on : day of the qualification
    folder : packaged numbers; default: those of the package
    """
    folder = folder or numbers.FOLDER
    golden, not_covered = check_golden(calibrations)
    return QualificationRecord(
        software=__version__,
        python=platform.python_version(),
        packages=tuple((name, version(name)) for name in PACKAGES),
        platform=f"{platform.system()} {platform.machine()}",
        date=on,
        numbers_sha256=numbers.identity(folder),
        checks=(
            numbers.check_whole(folder),
            *check_certified(folder),
            *check_lines(folder),
            *check_e74(folder),
            *golden,
            *check_gates(folder),
        ),
        not_covered=tuple(not_covered),
    )
