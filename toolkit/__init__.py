"""Calibration and standards toolkit for a tire force-and-moment laboratory.

The public names are loaded when they are first used, so that ``import toolkit`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "Estimate": "toolkit.estimate",
    "Machine": "toolkit.machine",
    "Recording": "toolkit.recording",
    "ToolkitError": "toolkit.errors",
    "load_machine": "toolkit.machine",
}


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'toolkit' has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return sorted(["__version__", *_PUBLIC])
