"""Whether a time server keeps this computer's clock, by its kernel: ``adjtimex``, which sets nothing here."""

from __future__ import annotations

import ctypes
import os
from typing import Literal

ClockState = Literal["synchronised", "not synchronised", "unknown"]

_SIZE = 512  # bytes, more than any kernel's struct timex; its first word, modes, is 0: nothing is set
_ERROR = 5  # TIME_ERROR, timex.h: the clock is not synchronised


def clock_state() -> ClockState:
    """Return whether the clock is kept; ``unknown`` where the system does not tell.

    A container has the clock of its host, and some are not allowed to ask.
    """
    library = ctypes.CDLL(None, use_errno=True)
    ask = getattr(library, "adjtimex", None)
    if ask is None or os.name != "posix":
        return "unknown"
    answer = ask(ctypes.create_string_buffer(_SIZE))
    if answer < 0:
        return "unknown"
    return "not synchronised" if answer == _ERROR else "synchronised"
