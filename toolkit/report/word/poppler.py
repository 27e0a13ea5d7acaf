"""Poppler's programs: what they print of a PDF, and its pages as pictures."""

from __future__ import annotations

import subprocess
from pathlib import Path

from toolkit.errors import RenderError

_LIMIT_S = 120
_INSTALL = "run 'toolkit doctor': it prints the command that installs poppler-utils"


def poppler(command: list[str]) -> str:
    """Return what one of poppler's programs prints.

    Raises
    ------
    RenderError
        ``no-poppler``: it is not installed; ``render-timeout``: it does not end
    """
    return _run(command).stdout.decode("utf-8", "replace")


def page_picture(pdf: Path, page: int, *, dpi: int, png: bool = True) -> bytes:
    """Return one page (from 1) as PNG, or as the plain pixels of a PPM.

    Raises
    ------
    RenderError
        ``no-poppler``: poppler is not installed, or cannot draw it; ``render-timeout``
    """
    kind = ["-png"] if png else []
    process = _run(
        ["pdftoppm", *kind, "-r", str(dpi), "-f", str(page), "-l", str(page), "-singlefile", str(pdf)]
    )
    if process.returncode or not process.stdout:
        raise RenderError(
            "a page cannot be drawn, so that nobody knows what is seen on it", where=f"{pdf}, page {page}",
            got=process.stderr.decode(errors="replace")[:500] or "nothing",
            expected="a picture by pdftoppm", next_step=_INSTALL, rule="no-poppler",
        )  # fmt: skip
    return process.stdout


def _run(command: list[str]) -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(command, capture_output=True, timeout=_LIMIT_S, check=False)
    except OSError as error:
        raise RenderError(
            "the PDF cannot be verified", where=command[0], got=f"no program that can be run: {error}",
            expected="poppler's pdftotext, pdftoppm, pdffonts and pdfinfo", next_step=_INSTALL,
            rule="no-poppler",
        ) from error  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise RenderError(
            "the PDF cannot be verified in time", where=command[0], got=f"no end after {_LIMIT_S} s",
            expected="an answer", next_step="open the PDF; try again with --keep", rule="render-timeout",
        ) from error  # fmt: skip
