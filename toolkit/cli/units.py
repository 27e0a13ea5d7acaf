"""The units that people are shown by a command's own tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toolkit.report.style import Style


def unit_choice(units: str) -> Style:
    """Return the units of text and figures: N and N·m, or lbf and lbf·ft."""
    from toolkit.errors import ConfigError
    from toolkit.report.style import Style

    choices = {"SI": Style(), "lbf": Style(force="lbf", moment="lbf*ft")}
    if units not in choices:
        raise ConfigError(
            f"unknown units {units!r}", where="--units", got=units, expected=", ".join(choices),
            next_step="name one of those expected", rule="unknown-units",
        )  # fmt: skip
    return choices[units]
