"""Word to PDF by LibreOffice: a profile of its own per job, a time limit, and no trust in exit codes."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import tempfile
import time
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from toolkit.errors import RenderError
from toolkit.inputs import PDF_FILE, read_regular
from toolkit.system import can_fork, end_group

# A guard that outlives its parent: after a kill -9 no LibreOffice runs on, and no folder is left behind.


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
        self._process = (
            None
            if not can_fork()
            else subprocess.Popen(
                ["/bin/sh", "-c", _WAIT_AND_CLEAN],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # an interrupt at the keyboard ends the parent, which then cleans up
            )
        )
        if self._process is not None and self._process.stdin is not None:
            self._process.stdin.write(f"{folder}\n".encode())
            self._process.stdin.flush()

    def dismiss(self) -> None:
        """Send the guard away: the parent has cleaned up itself."""
        if self._process is None:  # a system without shells that outlive their parent
            return
        self._process.kill()
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        self._process.wait()


# ruff: noqa: E501  the profile is written as LibreOffice writes it


# PDF/A-2b and PDF/UA-1, pictures as they are. LibreOffice ignores options that are not typed like this.
_OPTIONS = (
    'pdf:writer_pdf_Export:{"SelectPdfVersion":{"type":"long","value":"2"},'
    '"UseTaggedPDF":{"type":"boolean","value":"true"},'
    '"PDFUACompliance":{"type":"boolean","value":"true"},'
    '"UseLosslessCompression":{"type":"boolean","value":"true"},'
    '"ReduceImageResolution":{"type":"boolean","value":"false"},'
    '"ExportBookmarks":{"type":"boolean","value":"true"}}'
)
_FILTER = "MS Word 2007 XML"
# Without this LibreOffice fetches what a document names; templates that do are refused before as well.
_PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<oor:items xmlns:oor="http://openoffice.org/2001/registry" xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
<item oor:path="/org.openoffice.Office.Common/Security/Scripting"><prop oor:name="BlockUntrustedRefererLinks" oor:op="fuse"><value>true</value></prop></item>
<item oor:path="/org.openoffice.Office.Common/Security/Scripting"><prop oor:name="MacroSecurityLevel" oor:op="fuse"><value>3</value></prop></item>
<item oor:path="/org.openoffice.Office.Common/Save/Document"><prop oor:name="CreateBackup" oor:op="fuse"><value>false</value></prop></item>
<item oor:path="/org.openoffice.Office.Common/Misc"><prop oor:name="FirstRun" oor:op="fuse"><value>false</value></prop></item>
<item oor:path="/org.openoffice.Setup/L10N"><prop oor:name="ooLocale" oor:op="fuse"><value>en-US</value></prop></item>
<item oor:path="/org.openoffice.Setup/Office"><prop oor:name="ooSetupInstCompleted" oor:op="fuse"><value>true</value></prop></item>
</oor:items>
"""
SOFFICE = "TOOLKIT_SOFFICE"
TIMEOUT_S = 180.0
_ROOM = 64 * 2**20  # a profile takes some 10 MB, a long report with its PDF some more
_MOST, _WORTH = 2, 2  # instances at once (200 MB each), and documents for which one more is started
_STANDS, _BUSY, _LOOK_S = 0.02, 6, 10.0  # share of a core that is no work, patience of limits, seconds
_SMALL, _SECONDS_PER_BYTE = 2 * 2**20, 100 / 2**20  # of the parts as they are unpacked
_SECONDS_PER_ROW_2 = 3e-6  # three times what a table of 22 000 rows takes


class Office:
    """LibreOffice with a fresh profile, started in the background while figures are drawn.

    The instance waits without a document; the conversion's own call hands its job over to it through the
    profile they share, so that the start-up is already paid for. Use as a context manager: the instance
    and the profile go with it.
    """

    def __init__(self, *, timeout_s: float = TIMEOUT_S) -> None:
        """Write the profile and start the waiting instance.

        Raises
        ------
        RenderError
            there is no soffice
        """
        self.timeout_s = timeout_s
        self.program = find_soffice()
        self.folder = Path(tempfile.mkdtemp(prefix="toolkit-office-"))
        self._guard = Guard(self.folder)
        user = self.folder / "profile" / "user"
        user.mkdir(parents=True)
        (user / "registrymodifications.xcu").write_text(_PROFILE)
        self._warm: subprocess.Popen[bytes] | None = self._start([])
        self._beside: list[Office] = []

    def __enter__(self) -> Office:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End what still runs and remove the profile."""
        self._end_warm()
        for office in self._beside:
            office.close()
        self._beside = []
        shutil.rmtree(self.folder, ignore_errors=True)
        self._guard.dismiss()

    def expect(self, documents: int) -> None:
        """Start one more LibreOffice for each further core, where there are documents enough to share out.

        One lays out on one core only; two with profiles of their own convert ten reports in half the time.
        """
        instances = min(_MOST, os.cpu_count() or 1, documents // _WORTH)
        while len(self._beside) + 1 < instances:
            self._beside.append(Office(timeout_s=self.timeout_s))

    def convert(self, documents: Sequence[Path], out: Path) -> list[Path]:
        """Convert Word files to PDF; return the PDFs in the same order.

        Raises
        ------
        RenderError
            LibreOffice took too long, or a PDF is not there or is no PDF
        """
        outcomes = self.convert_each(documents, out)
        for outcome in outcomes:
            if isinstance(outcome, RenderError):
                raise outcome
        return [outcome for outcome in outcomes if isinstance(outcome, Path)]

    def convert_each(self, documents: Sequence[Path], out: Path) -> list[Path | RenderError]:
        """Convert Word files to PDF; return each PDF, or why there is none.

        What `expect` started beside takes its share; without it this is one call.
        """
        count = min(1 + len(self._beside), max(1, len(documents)))
        shares = [documents[i::count] for i in range(count)]
        with ThreadPoolExecutor(count) as pool:
            outcomes = pool.map(
                lambda office, share: office._convert(share, out), [self, *self._beside], shares
            )
            pdfs = {
                source: pdf
                for share, converted in zip(shares, outcomes, strict=True)
                for source, pdf in zip(share, converted, strict=True)
            }
        return [pdfs[document] for document in documents]

    def _convert(self, documents: Sequence[Path], out: Path) -> list[Path | RenderError]:
        targets = [out / f"{document.stem}.pdf" for document in documents]
        late: RenderError | None = None
        try:
            message = self._run(documents, out, targets)
            if self._warm is not None:
                # The waiting instance took the job; where it did not, a fresh one gets it.
                self._end_warm()
                if not all(pdf.is_file() for pdf in targets):
                    message = self._run(documents, out, targets)
        except RenderError as error:
            late, message = error, ""
        return [
            pdf if _is_pdf(pdf) else late or _no_pdf(source.name, message, self.folder)
            for source, pdf in zip(documents, targets, strict=True)
        ]

    def _run(self, documents: Sequence[Path], out: Path, targets: Sequence[Path]) -> str:
        """Run one conversion and return what LibreOffice said of it."""
        for old in targets:
            old.unlink(missing_ok=True)
        process = self._start(
            [
                f"--infilter={_FILTER}",
                "--convert-to",
                _OPTIONS,
                "--outdir",
                str(out),
                *(str(document) for document in documents),
            ]
        )
        begun = time.monotonic()
        try:
            message = _wait(process, time_for(documents, self.timeout_s), also=self._warm)
        except subprocess.TimeoutExpired as error:
            _kill(process)
            raise RenderError(
                "LibreOffice took too long",
                where=documents[0].name,
                got=f"no end after {time.monotonic() - begun:.0f} s",
                expected="a PDF within the time limit",
                rule="render-timeout",
                next_step="run 'toolkit doctor'; convert the document by hand to see what stops it",
            ) from error
        return message.decode("utf-8", "replace").strip()[-300:] or f"exit code {process.returncode}"

    def _end_warm(self) -> None:
        if self._warm is not None:
            _kill(self._warm)
            self._warm = None

    def _start(self, arguments: list[str]) -> subprocess.Popen[bytes]:
        # Who converts a document must not decide its language, decimal sign or paper: LibreOffice would take
        # them from the locale wherever the document is silent. What it leaves in its folder for temporary
        # files when it is killed goes with ours.
        environment = {
            **os.environ, "SAL_USE_VCLPLUGIN": "svp", "LC_ALL": "C.UTF-8", "TMPDIR": str(self.folder),
        }  # fmt: skip
        environment.pop("LANGUAGE", None)
        environment.pop("DISPLAY", None)
        # A HOME that cannot be written to makes LibreOffice hang; a good one holds the user's fonts.
        if not os.access(environment.get("HOME") or "/", os.W_OK):
            environment["HOME"] = str(self.folder)
        return subprocess.Popen(
            [
                self.program,
                f"-env:UserInstallation={(self.folder / 'profile').as_uri()}",
                "--headless",
                "--norestore",
                "--nologo",
                "--nodefault",
                *arguments,
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            env=environment,
        )


def _wait(process: subprocess.Popen[bytes], limit_s: float, *, also: subprocess.Popen[bytes] | None) -> bytes:
    """Return what a conversion said; on a busy machine it may take until it has worked for the limit.

    ``also`` is the instance that the job may have been handed over to.

    Raises
    ------
    subprocess.TimeoutExpired
        after the limit it has worked for so long, or stands still, or has had several times the limit
    """
    groups = {program.pid for program in (process, also) if program is not None}
    begun, first = time.monotonic(), _processor_s(groups)
    worked, wait = 0.0, limit_s
    while True:
        try:
            return process.communicate(timeout=wait)[1]
        except subprocess.TimeoutExpired:
            before, worked = worked, _processor_s(groups) - first
            stands = worked - before < _STANDS * wait
            if stands or worked >= limit_s or time.monotonic() - begun >= _BUSY * limit_s:
                raise
            wait = min(_LOOK_S, limit_s)


def _processor_s(groups: set[int]) -> float:
    """Return the processor time of groups of processes [s]; 0 where the system does not tell."""
    ticks = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            fields = stat.read_text().rpartition(")")[2].split()
            if int(fields[2]) in groups:
                ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK") if ticks else 0.0


def time_for(documents: Sequence[Path], each_s: float) -> float:
    """Return the processor time [s] after which a conversion is given up; ``each_s`` for an ordinary one.

    LibreOffice lays a table of n rows out in a time that grows with n squared: five hundred pages of one
    table take minutes, and are no reason to give up.
    """
    sizes = [_unpacked(document) for document in documents]
    by_bytes = max(0, sum(data for data, _ in sizes) - _SMALL) * _SECONDS_PER_BYTE
    by_rows = sum(rows * rows for _, rows in sizes) * _SECONDS_PER_ROW_2
    return each_s * max(1, len(documents)) + by_bytes + by_rows


def _unpacked(docx: Path) -> tuple[int, int]:
    """Return the bytes of a document's parts and the rows of its tables."""
    try:
        with zipfile.ZipFile(docx) as archive:
            parts = [one for one in archive.infolist() if one.filename.endswith(".xml")]
            size = sum(part.file_size for part in parts)
            # Few bytes hold few rows: an ordinary report is not read for them.
            rows = sum(archive.read(part).count(b"</w:tr>") for part in parts) if size > _SMALL else 0
            return size, rows
    except (OSError, zipfile.BadZipFile):
        return 0, 0


def _is_pdf(path: Path) -> bool:
    # One that was cut off in the middle has no end mark.
    if not path.is_file():
        return False
    data = read_regular(path, PDF_FILE)
    return data[:5] == b"%PDF-" and b"%%EOF" in data[-1024:]


def _no_pdf(name: str, message: str, folder: Path) -> RenderError:
    free = shutil.disk_usage(folder).free
    if free < _ROOM:
        return RenderError(
            "LibreOffice made no PDF, and there is hardly room for one",
            where=f"the folder for temporary files, {folder.parent}",
            got=f"{free / 2**20:.1f} MB free",
            expected=f"{_ROOM / 2**20:.0f} MB for a profile, a document and its PDF",
            rule="render-failed",
            next_step="free space, or name another folder in TMPDIR; nothing was changed",
        )
    return RenderError(
        "LibreOffice made no PDF",
        where=name,
        got=message or "nothing",
        expected="a PDF of the filled report",
        rule="render-failed",
        next_step="run 'toolkit doctor'; open the .docx in LibreOffice to see why",
    )


def find_soffice() -> str:
    """Return the path of LibreOffice.

    Raises
    ------
    RenderError
        it is not installed, or ``TOOLKIT_SOFFICE`` names no program
    """
    if stated := os.environ.get(SOFFICE):
        if program := shutil.which(stated):
            return program
        path = Path(stated)
        raise RenderError(
            f"{SOFFICE} does not name a program",
            where=f"the environment, {SOFFICE}",
            got=f"{stated}: {'a folder' if path.is_dir() else 'not executable' if path.exists() else 'no such file'}",
            expected="the path of LibreOffice's program soffice",
            next_step=f"correct {SOFFICE}, or unset it: soffice is then looked for on the PATH",
            rule="no-soffice",
        )
    if program := shutil.which("soffice") or shutil.which("libreoffice"):
        return program
    raise RenderError(
        "LibreOffice is not installed",
        where="soffice",
        got="no program of that name on the PATH",
        expected="LibreOffice Writer, with its fonts",
        next_step="run 'toolkit doctor': it prints the command that installs it",
        rule="no-soffice",
    )


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End soffice and its children: the launcher's own end leaves soffice.bin behind."""
    end_group(process)
    process.communicate()
