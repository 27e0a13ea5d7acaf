"""An effect that a plan switches on: which one, where it acts, how large, in which runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.effects.effect import STAGES, Effect, Stage

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, slots=True, kw_only=True)
class Switched:
    """One effect of the catalogue, switched on.

    ``channel`` is the signal that it acts on, ``source`` the other signal that it takes (crosstalk, swap);
    ``values`` are its parameters in their own units (``units``); ``record`` is the registry id of a wrong
    calibration; ``only`` a condition's key and the values of the runs in which it acts, None for all.
    """

    effect: Effect
    channel: str | None = None
    source: str | None = None
    values: tuple[tuple[str, float], ...] = ()
    units: tuple[tuple[str, str], ...] = ()
    record: str | None = None
    only: tuple[str, tuple[str, ...]] | None = None

    @property
    def parameters(self) -> dict[str, float]:
        """The values by name."""
        return dict(self.values)

    def acts_in(self, conditions: Mapping[str, str]) -> bool:
        """Tell whether it acts in a run of these conditions."""
        return self.only is None or conditions.get(self.only[0]) in self.only[1]

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON values."""
        units = dict(self.units)
        made: dict[str, Any] = {
            "name": self.effect.name,
            "stage": self.effect.stage,
            "channel": self.channel,
            "parameters": [{"name": n, "value": v, "unit": units[n]} for n, v in self.values],
        }
        if self.source is not None:
            made["with" if self.effect.name == "channel_swap" else "from"] = self.source
        if self.record is not None:
            made["record"] = self.record
        if self.only is not None:
            made["only"] = {self.only[0]: list(self.only[1])}
        return made


def here(
    effects: Iterable[Switched], conditions: Mapping[str, str], stage: Stage | None = None
) -> Sequence[Switched]:
    """Return the effects that act in a run, in the order of the stages, of one ``stage`` or of all.

    Within a stage they act in the order in which they were given.
    """
    chosen = [one for one in effects if one.acts_in(conditions) and stage in (None, one.effect.stage)]
    return sorted(chosen, key=lambda one: STAGES.index(one.effect.stage))
