"""Files from the machine: hostile until checked, then frozen recordings."""

from toolkit.recording.model import Recording, Series, TestInfo

__all__ = ["Recording", "Series", "TestInfo"]
