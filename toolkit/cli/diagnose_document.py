"""A diagnosis as a Word document and its verified PDF, for `toolkit diagnose --pdf`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.diagnose import Result
    from toolkit.report.word.package import Template


def write_document(
    case: Case,
    result: Result,
    opened: Template,
    out: Path,
    *,
    augmented: str | None,
    use: CalibrationUse | None,
    by: str | None,
) -> dict[str, Any]:
    """Deliver ``diagnosis.docx`` and ``diagnosis.pdf``; return what the JSON answer says of them.

    Parameters
    ----------
    augmented : the answer's model file, None without one
    use : the calibration that the case names
    """
    from datetime import date

    from toolkit.cli.delivery import delivered_payload
    from toolkit.files import sha256_bytes
    from toolkit.report.deliver import deliver
    from toolkit.report.diagnosis.content import build_diagnosis_content
    from toolkit.report.style import read_style, style_file

    content = build_diagnosis_content(
        case,
        result,
        read_style(style_file(opened.path)),
        issued=date.today(),  # noqa: DTZ011
        use=use,
        model_sha256=None if augmented is None else sha256_bytes(augmented.encode()),
        by=by,
    )
    return delivered_payload(deliver(opened, content, out, name="diagnosis"))
