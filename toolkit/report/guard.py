"""A guard that outlives its parent: after a kill -9 no LibreOffice runs on, and no folder is left behind.

A process that is killed cannot clean up; LibreOffice has a session of its own and would go on for ever, with
its profile in the folder of temporary files. The guard waits at a pipe that only its parent holds open.
"""

from __future__ import annotations

import contextlib
import subprocess
from pathlib import Path

# The folder's random name is in the command line of everything that was started with the profile in it. A
# process that was started in the last moment has no command line until its program is loaded, so the guard
# looks again for two seconds, and for as long as it finds something.
_WAIT_AND_CLEAN = """
read -r folder || exit
cat >/dev/null
quiet=0
while [ "$quiet" -lt 20 ]; do
    quiet=$((quiet + 1))
    for told in $(grep -lsF -- "${folder##*/}" /proc/[0-9]*/cmdline); do
        one=${told#/proc/}
        kill -KILL "${one%/cmdline}" 2>/dev/null && quiet=0
    done
    rm -rf -- "$folder"
    sleep 0.1
done
"""


class Guard:
    """Watches over a folder of temporary files until `dismiss`."""

    def __init__(self, folder: Path) -> None:
        """Start the guard; ``folder`` must have a name that no other process is called with."""
        self._process = subprocess.Popen(
            ["/bin/sh", "-c", _WAIT_AND_CLEAN],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # an interrupt at the keyboard ends the parent, which then cleans up
        )
        if self._process.stdin is not None:
            self._process.stdin.write(f"{folder}\n".encode())
            self._process.stdin.flush()

    def dismiss(self) -> None:
        """Send the guard away: the parent has cleaned up itself."""
        self._process.kill()
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        self._process.wait()
