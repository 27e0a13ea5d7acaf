"""A laboratory's home: the nearest folder upward that holds ``calibrations/``."""

from __future__ import annotations

import os
from pathlib import Path

from toolkit.errors import ConfigError

_PACKAGE = Path(__file__).resolve().parents[1]


def packaged_home() -> Path:
    """Return the home that comes with the package: its copy in a wheel, the checkout otherwise."""
    inside = _PACKAGE / "_home"
    return inside if inside.is_dir() else _PACKAGE.parent


def find_home(given: Path | None = None) -> Path:
    """Return the laboratory's home: ``--home``, ``TOOLKIT_HOME``, or the nearest folder upward.

    Raises
    ------
    ConfigError
        there is none; the message names ``toolkit init``
    """
    named = given or (Path(os.environ["TOOLKIT_HOME"]) if os.environ.get("TOOLKIT_HOME") else None)
    if named is not None:
        if not (named / "calibrations").is_dir():
            raise _no_home(named)
        return named.resolve()
    here = Path.cwd().resolve()
    for folder in (here, *here.parents):
        if (folder / "calibrations").is_dir():
            return folder
    raise _no_home(here)


def calibrations_folder(calibrations: Path | None = None, home: Path | None = None) -> Path:
    """Return the registry folder: ``--calibrations DIR``, else that of the home."""
    if calibrations is None:
        return find_home(home) / "calibrations"
    if not calibrations.is_dir():
        raise ConfigError(
            "the registry folder does not exist",
            where=calibrations,
            got="no folder",
            expected="a folder with one sub-folder an instrument",
            next_step="check --calibrations, or make a home with 'toolkit init DIR'",
            rule="no-registry",
        )
    return calibrations.resolve()


def registry_to_write(calibrations: Path | None = None, home: Path | None = None) -> Path:
    """Return the registry folder of a command that enters a record: one that was named may yet be made."""
    if calibrations is not None and not calibrations.exists():
        return calibrations.absolute()
    return calibrations_folder(calibrations, home)


def _no_home(where: Path) -> ConfigError:
    return ConfigError(
        "no laboratory home was found",
        where=where,
        got="no folder calibrations/ here or above",
        expected="a folder that holds calibrations/",
        next_step="run inside the laboratory's home, name it with --home or TOOLKIT_HOME, "
        "or make one with 'toolkit init DIR'",
        rule="no-home",
    )
