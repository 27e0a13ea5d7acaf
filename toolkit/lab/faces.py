"""Faces: what a notebook sees of a result.

The floors below return results that know of no table, no page and no figure, and what draws lies above them,
in `report`. So the front door hands out *faces*: thin frozen objects of this layer, one around each result,
which stands as it is under ``result``. A face says itself in a line, and in a notebook as a small table; it
turns into a DataFrame; and its figures are those that a report prints, drawn by the same code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError
from toolkit.lab.arguments import checked

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from toolkit.report.content import Plot

Facts = Mapping[str, object]


class Face:
    """A result as a notebook sees it."""

    __slots__ = ()

    def _facts(self) -> Facts:
        """Return what is worth saying, by name; the first says which result it is."""
        raise NotImplementedError

    def _plots(self) -> Mapping[str, Plot | Callable[[], Figure]]:
        """Return the figures of the report by name, not yet drawn; the first is the one to look at."""
        return {}

    def to_dataframe(self) -> pd.DataFrame:
        """Return the result as a table; the headers carry the units."""
        raise NotImplementedError

    @property
    def figures(self) -> tuple[str, ...]:
        """The names that `plot` knows."""
        return tuple(self._plots())

    @checked
    def plot(self, name: str | None = None) -> Figure:
        """Return a figure of the report, as a matplotlib figure; ``name`` is one of `figures`.

        Raises
        ------
        ConfigError
            there is no figure of that name, or none at all
        """
        from toolkit.report.figures import figure_of

        plots = self._plots()
        chosen = next(iter(plots), None) if name is None else name
        if chosen is None or chosen not in plots:
            raise ConfigError(
                "there is no such figure", where=type(self).__name__, got=name,
                expected=", ".join(plots) or "nothing here can be drawn", rule="no-figure",
                next_step="see `figures` for the names",
            )  # fmt: skip
        drawing = plots[chosen]
        return drawing() if callable(drawing) else figure_of(drawing)

    def __repr__(self) -> str:
        texts = [_text(value) for value in self._facts().values()]
        return f"<{type(self).__name__} {' | '.join(text for text in texts if text)}>"

    def _repr_html_(self) -> str:
        from toolkit.report.pages.kit import facts

        return facts(type(self).__name__, {name: _text(value) for name, value in self._facts().items()})


def _text(value: object) -> str:
    return "" if value is None else str(value)


def as_path(name: str | Path | None) -> Path | None:
    """Return what a notebook writes as text as a path."""
    return None if name is None else Path(name)
