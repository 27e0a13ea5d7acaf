"""The templates that come with the toolkit, by name: what builds each, and its style file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PackagedTemplate:
    """One template of ``report_templates/``; ``style`` is its style file, None where ``org.toml`` serves."""

    name: str
    title: str
    build: Callable[[], bytes]
    style: str | None


def packaged_templates() -> dict[str, PackagedTemplate]:
    """Return the templates by the name of their file."""
    from toolkit.report.audit.template import build_audit
    from toolkit.report.certificate.template import build_certificate
    from toolkit.report.comparison.template import build_comparison
    from toolkit.report.design.default import STYLE_FILE, build_default
    from toolkit.report.design.german import STYLE_FILE as GERMAN
    from toolkit.report.design.german import build_german
    from toolkit.report.design.summary import build_summary
    from toolkit.report.diagnosis.template import build_diagnosis

    listed = (
        PackagedTemplate(name="org", title="a whole test report", build=build_default, style=STYLE_FILE),
        PackagedTemplate(name="summary", title="one page", build=build_summary, style=None),
        PackagedTemplate(
            name="pruefbericht",
            title="German, with a letterhead and a landscape section",
            build=build_german,
            style=GERMAN,
        ),
        PackagedTemplate(
            name="certificate", title="a calibration certificate", build=build_certificate, style=None
        ),
        PackagedTemplate(
            name="comparison", title="a comparison of tests", build=build_comparison, style=None
        ),
        PackagedTemplate(
            name="diagnosis", title="a diagnosis of a simulation", build=build_diagnosis, style=None
        ),
        PackagedTemplate(name="audit", title="an audit's summary", build=build_audit, style=None),
    )
    return {one.name: one for one in listed}
