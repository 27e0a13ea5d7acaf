"""Reports that several tests read: each is converted and verified once."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from tests.report.report_factory import make_record, make_result
from toolkit.report.deliver import Delivered, deliver
from toolkit.report.drawer import Drawer
from toolkit.report.style import read_style
from toolkit.report.test.content import build_content
from toolkit.report.word.package import read_template

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def plain_report(tmp_path_factory: pytest.TempPathFactory) -> Delivered:
    """Return the default template's report of a simulated test without details, drawn by workers."""
    path = CHECKOUT / "report_templates" / "org.docx"
    content = build_content(
        make_result(simulated=True), make_record(), style=read_style(path.with_suffix(".toml")),
        issued=dt.date(2026, 11, 21),
    )  # fmt: skip
    # By a LibreOffice of its own, as a command has it.
    with pytest.MonkeyPatch.context() as patch, Drawer() as drawer:
        patch.delenv("TOOLKIT_SOFFICE", raising=False)
        return deliver(read_template(path), content, tmp_path_factory.mktemp("plain") / "out", drawer=drawer)
