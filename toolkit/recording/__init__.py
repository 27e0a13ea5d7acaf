"""Files from the machine: hostile until checked, then frozen recordings."""

from toolkit.recording.model import Recording, Series

__all__ = ["Recording", "Series"]
