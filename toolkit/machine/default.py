"""The packaged machines where none is named: the only place of the code that names a machine."""

from typing import Final

DEFAULT_MACHINE: Final = "m15"
"""Where neither a command, a file nor a test names a machine."""

SIMULATED_MACHINE: Final = "m15-virtual"
"""Where a plan of a simulation names none."""
