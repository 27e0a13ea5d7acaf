"""The whole qualification, offline, and the record of it."""

from __future__ import annotations

import platform
from datetime import date
from importlib.metadata import version
from pathlib import Path

from toolkit.qualification import numbers
from toolkit.qualification.certified import check_certified
from toolkit.qualification.examples import check_e74, check_lines
from toolkit.qualification.gates.run import check_gates
from toolkit.qualification.golden import check_golden
from toolkit.qualification.model import QualificationRecord
from toolkit.version import __version__

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
