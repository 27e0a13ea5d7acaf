"""A machine as data: channels and their units, geometry, drum, protocol, limits."""

from toolkit.machine.definition import Column, Drum, Machine, Protocol, TypeB, load_machine, machine_names

__all__ = ["Column", "Drum", "Machine", "Protocol", "TypeB", "load_machine", "machine_names"]
