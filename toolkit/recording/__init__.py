"""Files from the machine: hostile until checked, then frozen recordings."""

from toolkit.recording.marks import is_own_output, machine_of
from toolkit.recording.model import Recording, Series, TestInfo
from toolkit.recording.read import read_recording

__all__ = ["Recording", "Series", "TestInfo", "is_own_output", "machine_of", "read_recording"]
