"""The catalogue: every effect by its name, one file of this folder each, found and never listed by hand."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import get_args

from toolkit.effects.effect import Effect, Stage
from toolkit.effects.law import is_law, law_effect
from toolkit.errors import ConfigError
from toolkit.spelling import nearest

_ORDER = get_args(Stage)  # of the stages in a list: from the recording back to the road


@cache
def effects() -> dict[str, Effect]:
    """Return every effect of the catalogue by its name, in the catalogue's order.

    >>> list(effects())[:2], effects()["relaxation"].stage
    (['unit_error', 'channel_sign'], 'tire')
    """
    listed = [import_module(f"{__name__}.{module.name}").EFFECT for module in iter_modules(__path__)]
    listed.sort(key=lambda effect: (_ORDER.index(effect.stage), effect.rank, effect.name))
    return {effect.name: effect for effect in listed}


def effect(name: str, *, where: str = "--effect") -> Effect:
    """Return one effect: of the catalogue, or the law that a name is.

    Raises
    ------
    ConfigError
        no effect has that name; ``law-formula``: a law cannot be read
    """
    if is_law(name):
        return law_effect(name)
    listed = effects()
    if name in listed:
        return listed[name]
    near = nearest(name, listed)
    raise ConfigError(
        f"unknown effect {name!r}", where=where, got=name, expected=", ".join(listed),
        next_step=f"did you mean {near!r}?" if near else "use one of those expected",
        rule="unknown-effect",
    )  # fmt: skip
