"""One LibreOffice for all documents of a run of the tests, where each command would start one of its own."""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

from docx import Document

from toolkit.report.word.office import Guard, find_soffice
from toolkit.system import can_fork

# A start costs 1.2 s of processor time, a short document 0.1 s. LibreOffice hands a job over to the instance
# that has its profile, and that instance stays for as long as it has a document open; the lock beside the
# document tells that it has. The toolkit's own instance, which waits for a job, has nothing to do. One job at
# a time; who asks for anything but a conversion gets LibreOffice itself. A test may
# kill the script that starts it: the instance itself writes down who it is, or nobody would end or find again
# what was started; whoever comes next waits until it is ready; a process that is dead and not reaped is gone.
_SCRIPT = """#!/bin/sh
folder={folder} office={office} profile=-env:UserInstallation=file://{folder}/profile
case "$1$*" in
    -env:*--convert-to*) shift ;;
    -env:*) exec sleep 3600 ;;
    *) exec "$office" "$@" ;;
esac
exec 9>"$folder/lock"
flock 9
lives() {{ case "$(cat "/proc/$(cat pid || echo none)/stat" 2>&-)" in ""|*") Z "*) return 1 ;; esac; }} 2>&-
cd "$folder"
if ! lives; then
    rm -f pid ".~lock.open.docx#"
    env -i PATH="$PATH" HOME={home} TMPDIR="$folder" LC_ALL=C.UTF-8 SAL_USE_VCLPLUGIN=svp \\
        setsid sh -c 'echo $$ >pid; exec "$@"' sh \\
        "$office" "$profile" --headless --norestore --nologo --nodefault open.docx \\
        </dev/null >/dev/null 2>&1 9>&- &
    while kill -0 $! 2>&- && ! test -s pid; do sleep 0.02; done
fi
while lives && ! test -e ".~lock.open.docx#"; do sleep 0.05; done
cd "$OLDPWD"
"$office" "$profile" "$@" 9>&-
"""


@contextlib.contextmanager
def kept_office() -> Iterator[None]:
    """Have one LibreOffice do every conversion, started with the first; nothing where there is none."""
    if not (can_fork() and shutil.which("soffice") and shutil.which("flock") and shutil.which("setsid")):
        yield
        return
    folder = Path(tempfile.mkdtemp(prefix="toolkit-office-"))
    guard = Guard(folder)  # a run that is killed leaves no LibreOffice behind
    Document().save(str(folder / "open.docx"))
    places = {"folder": str(folder), "office": find_soffice(), "home": str(Path.home())}
    program = folder / "soffice"
    program.write_text(_SCRIPT.format(**{name: shlex.quote(place) for name, place in places.items()}))
    program.chmod(0o755)
    os.environ["TOOLKIT_SOFFICE"] = str(program)
    try:
        yield
    finally:
        os.environ.pop("TOOLKIT_SOFFICE", None)
        with contextlib.suppress(OSError, ValueError):
            os.killpg(int((folder / "pid").read_text()), signal.SIGKILL)
        shutil.rmtree(folder, ignore_errors=True)
        guard.dismiss()
