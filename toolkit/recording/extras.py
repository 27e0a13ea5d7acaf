"""Libraries that only some laboratories need: imported where they are used, named where they are absent."""

from __future__ import annotations

import importlib
from types import ModuleType

from toolkit.errors import ConfigError
from toolkit.version import DISTRIBUTION


def needed(module: str, *, extra: str, to: str, where: object) -> ModuleType:
    """Import a library of an extra.

    Raises
    ------
    ConfigError
        rule ``missing-extra``: it is not installed

    Examples
    --------
    >>> needed("no_such_library", extra="tdms", to="read a TDMS file", where="run 1")
    Traceback (most recent call last):
    toolkit.errors.ConfigError: a library that is needed to read a TDMS file is not installed
      where:    run 1
      got:      no module no_such_library
      expected: the extra 'tdms'
      next:     pip install "tire-lab-toolkit[tdms]"
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"a library that is needed to {to} is not installed",
            where=where,
            got=f"no module {error.name}",
            expected=f"the extra {extra!r}",
            next_step=f'pip install "{DISTRIBUTION}[{extra}]"',
            rule="missing-extra",
        ) from error
