"""Document properties: the report's own title, author and dates in place of python-docx's of 2013."""

from __future__ import annotations

import datetime as dt
from typing import Any

from toolkit.calibration.records.use import DRAFT
from toolkit.recording.marks import output_keywords
from toolkit.report.content import ReportContent
from toolkit.report.template.xml import clean
from toolkit.version import __version__


def set_properties(package: Any, content: ReportContent) -> None:
    """Set title, author and dates; the dates are the day of issue, so that the content is reproducible."""
    _one_core(package)
    core = package.core_properties
    day = dt.datetime.combine(dt.date.fromisoformat(content.issued), dt.time(), tzinfo=dt.UTC).replace(
        tzinfo=None
    )
    title = f"{DRAFT}: {content.title}" if content.draft_reasons else content.title
    core.title, core.author = clean(title)[:255], clean(content.author)[:255]
    core.last_modified_by = f"toolkit {__version__}"
    core.subject = clean(content.subject)[:255]
    core.identifier = content.identity
    # So that a report that lies in a test's folder is never taken for a recording.
    core.keywords = output_keywords(simulated=any(name == "simulated" for name, _ in content.marks))
    core.comments = ""
    core.created = core.modified = day
    core.revision = 1


def _one_core(package: Any) -> None:
    """Let go of properties that stand there under another program's name for their relation.

    LibreOffice writes its own (``officedocument`` in small letters); python-docx does not see it and would
    add a second part of the same name, a file that Word calls damaged.
    """
    from docx.opc.constants import RELATIONSHIP_TYPE

    for identity, one in list(package.rels.items()):
        if one.reltype.endswith("/core-properties") and one.reltype != RELATIONSHIP_TYPE.CORE_PROPERTIES:
            del package.rels[identity]
