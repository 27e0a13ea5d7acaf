"""What the commands that fill a Word template share: where it lies, names of files, the answer in JSON."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.cli.home import find_home, packaged_home
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.report.deliver import Delivered


def home_template(name: str, home: Path | None = None) -> Path:
    """Return a template of the home's ``report_templates/``; the packaged one where the home has none.

    Raises
    ------
    ConfigError
        ``home`` was given and is none
    """
    packaged = packaged_home() / "report_templates" / name
    try:
        own = find_home(home) / "report_templates" / name
    except ConfigError:
        if home is not None:
            raise
        return packaged
    return own if own.is_file() else packaged


def draft_keys(*uses: CalibrationUse) -> dict[str, Any]:
    """Return whether an answer is a draft, and why: the same keys in every answer and manifest."""
    reasons = dict.fromkeys(f"{one.id}: {reason}" for one in uses for reason in one.draft_reasons)
    return {"draft": bool(reasons), "draft_reasons": list(reasons)}


def mark_words(*uses: CalibrationUse) -> str:
    """Return the marks of the records as the end of a line for people."""
    words = dict.fromkeys(
        word
        for one in uses
        for word, on in (("DRAFT", one.draft), ("UNVERIFIED", one.unverified), ("KNOWN SINCE", one.since))
        if on
    )
    return "".join(f"  {word}" for word in words)


def file_name(text: str, *, otherwise: str) -> str:
    """Return the name of a test, or the id of a certificate, as a file's name.

    >>> file_name("CAL 2026/017", otherwise="certificate"), file_name("../", otherwise="test")
    ('CAL-2026-017', 'test')
    """
    return re.sub(r"[^\w.-]+", "-", text).strip("-.")[:100] or otherwise


def delivered_payload(done: Delivered) -> dict[str, Any]:
    """Return what the JSON answer says of any delivered document: files, pages, checks, hashes, warnings."""
    return {
        "docx": done.docx,
        "pdf": done.pdf,
        "pages": done.pages,
        "verified": True,
        "checks": [check.as_dict() for check in done.checks],
        "template_sha256": done.template_sha256,
        "content_sha256": done.content_sha256,
        "figures": [{"tag": tag, "alt": alt} for tag, alt in done.filled.figures],
        "warnings": list(done.warnings),
    }
