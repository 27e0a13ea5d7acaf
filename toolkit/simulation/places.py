"""Where an effect can act on the virtual machine: the signals of the chain, and the unit of each."""

from __future__ import annotations

from toolkit.effects.effect import Effect
from toolkit.machine import Machine
from toolkit.simulation.cells import CELLS

# Units in which effects act on a signal; a cell is in the unit of the machine's own files.
_UNITS = {"FY": "N", "MZ": "N*m", "MX": "N*m", "FZ": "N", "SA": "deg"}
# Rolling forces, what reaches the cells beside the cells themselves, what the acquisition writes.
_ROLLING = ("FZ", "FY", "MZ")
_SENSED = (*CELLS, "FY", "MZ", "MX", "FZ")
_RECORDED = (*CELLS, "FZ", "SA", "FY", "MZ")
_PAIRED = ("crosstalk", "channel_swap")
_SOURCES = {"crosstalk": (*CELLS, "FY", "MZ", "MX", "FZ"), "channel_swap": _RECORDED}


def unit_of(machine: Machine, channel: str) -> str:
    """Return the unit in which effects act on a signal."""
    return machine.column(channel).unit if channel in CELLS else _UNITS[channel]


def channels_of(effect: Effect) -> tuple[str, ...]:
    """Return the signals on which an effect can be put; none where it acts on the whole machine."""
    if effect.channel is None or effect.name == "wrong_calibration":
        return ()
    if effect.stage in ("tire", "road"):
        return _ROLLING
    return _SENSED if effect.stage == "load_cells" else _RECORDED


def is_paired(effect: Effect) -> bool:
    """Tell whether an effect joins two signals."""
    return effect.name in _PAIRED


def can_join(effect: Effect, source: str, channel: str) -> bool:
    """Tell whether two signals are there at one stage: loads become cells, cells are computed into loads."""
    computed = ("FY", "MZ")
    if effect.name == "channel_swap":
        return (source in computed) == (channel in computed)
    return channel in CELLS or source not in CELLS


def sources_of(effect: Effect) -> tuple[str, ...]:
    """Return the signals that an effect of two signals can take."""
    return _SOURCES.get(effect.name, ())


def default_channels(effect: Effect) -> tuple[str, ...]:
    """Return where an effect acts when no signal is named: every cell, or the force that it is known by."""
    if not channels_of(effect) or is_paired(effect):
        return ()
    if effect.name == "drum_runout":
        return ("FZ",)
    return ("FY",) if effect.stage == "tire" else CELLS
