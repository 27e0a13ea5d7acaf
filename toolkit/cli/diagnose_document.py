"""A diagnosis as a Word document and its verified PDF, for `toolkit diagnose --pdf`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolkit.diagnosis.case import Case
    from toolkit.diagnosis.diagnose import Result
    from toolkit.report.template.package import Template


def write_document(
    case: Case,
    result: Result,
    opened: Template,
    out: Path,
    *,
    augmented: str | None,
    registry: Path | None,
    by: str | None,
) -> dict[str, Any]:
    """Deliver ``diagnosis.docx`` and ``diagnosis.pdf``; return what the JSON answer says of them.

    Parameters
    ----------
    augmented : the answer's model file, None without one
    registry : folder of the calibrations that the case may name
    """
    from datetime import date

    from toolkit.cli.delivery import delivered_payload
    from toolkit.diagnosis.load import record_of
    from toolkit.files import sha256_bytes
    from toolkit.report.deliver import deliver
    from toolkit.report.diagnosis.content import build_diagnosis_content
    from toolkit.report.style import read_style, style_file

    content = build_diagnosis_content(
        case,
        result,
        read_style(style_file(opened.path)),
        issued=date.today(),  # noqa: DTZ011
        record=record_of(case, registry) if case.simulation.calibration else None,
        model_sha256=None if augmented is None else sha256_bytes(augmented.encode()),
        by=by,
    )
    return delivered_payload(deliver(opened, content, out, name="diagnosis"))
