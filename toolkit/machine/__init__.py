"""A machine as data: channels and their units, geometry, drum, protocol, limits."""

from toolkit.machine.correction import Correction
from toolkit.machine.definition import Column, Drum, Machine, TypeB, load_machine, machine_names, own_text
from toolkit.machine.hub import Hub
from toolkit.machine.protocol import Delay, Protocol, Sweeping, read_protocol

__all__ = [
    "Column",
    "Correction",
    "Delay",
    "Drum",
    "Hub",
    "Machine",
    "Protocol",
    "Sweeping",
    "TypeB",
    "load_machine",
    "machine_names",
    "own_text",
    "read_protocol",
]
