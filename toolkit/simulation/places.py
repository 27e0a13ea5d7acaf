"""Where an effect can act on the virtual machine, and what it does to the signals of the chain there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from toolkit.arrays import Array
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.forward import through
from toolkit.effects.signals import Setting
from toolkit.machine import Machine
from toolkit.simulation.cells import CELLS
from toolkit.units import from_si, to_si

# Units in which effects act on a signal; a cell is in the unit of the machine's own files.
_UNITS = {"FY": "N", "MZ": "N*m", "MX": "N*m", "FZ": "N", "SA": "deg"}
# Rolling forces, what reaches the cells beside the cells themselves, what the acquisition writes.
_ROLLING = ("FZ", "FY", "MZ")
_SENSED = (*CELLS, "FY", "MZ", "MX", "FZ")
_RECORDED = (*CELLS, "FZ", "SA", "FY", "MZ")


def unit_of(machine: Machine, channel: str) -> str:
    """Return the unit in which effects act on a signal."""
    return machine.column(channel).unit if channel in CELLS else _UNITS[channel]


def channels_of(effect: Effect) -> tuple[str, ...]:
    """Return the signals on which an effect can be put; none where it acts on the whole machine."""
    if effect.channel is None or effect.replaces_record:
        return ()
    if effect.stage in ("tire", "road"):
        return _ROLLING
    return _SENSED if effect.stage == "load_cells" else _RECORDED


def is_paired(effect: Effect) -> bool:
    """Tell whether an effect joins two signals."""
    return effect.on_channel is not None and effect.on_channel.paired


def can_join(effect: Effect, source: str, channel: str) -> bool:
    """Tell whether two signals are there at one stage: loads become cells, cells are computed into loads."""
    computed = ("FY", "MZ")
    if effect.exchanges:
        return (source in computed) == (channel in computed)
    return channel in CELLS or source not in CELLS


def sources_of(effect: Effect) -> tuple[str, ...]:
    """Return the signals that an effect of two signals can take."""
    return channels_of(effect) if is_paired(effect) else ()


def default_channels(effect: Effect) -> tuple[str, ...]:
    """Return where an effect acts when no signal is named: every cell, or the force that it is known by."""
    if not channels_of(effect) or is_paired(effect):
        return ()
    usual = None if effect.on_channel is None else effect.on_channel.usual
    return CELLS if usual is None else (usual,)


def through_machine(
    signals: Mapping[str, Array], effects: Iterable[AppliedEffect], setting: Setting, machine: Machine
) -> dict[str, Array]:
    """Return signals [SI] by name when effects have acted on them, each in the signal's own unit."""
    return through(
        signals,
        effects,
        setting,
        shown=lambda name, values: from_si(values, unit_of(machine, name)),
        stored=lambda name, values: to_si(values, unit_of(machine, name)),
    )
