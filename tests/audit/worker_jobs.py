"""Work that does to its worker what a hostile file does: told by the name of the file."""

from __future__ import annotations

import os
import signal
import time


def make():
    return work


def work(name):
    if name.startswith("die"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("hang"):
        time.sleep(600)
    return os.getpid() if name.startswith("who") else name.upper()
