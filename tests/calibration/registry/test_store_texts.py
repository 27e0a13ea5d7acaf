"""What a line of a ledger says can be printed; of one that says otherwise documents are made all the same."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.report.certificate.test_certificate import DAY, STYLE, registry_of
from toolkit.calibration.registry import store
from toolkit.calibration.registry.approval import approve, discard, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.ledger import LEDGER
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import ConfigError
from toolkit.report.certificate.collect import collect
from toolkit.report.certificate.content import build_content
from toolkit.report.certificate.dcc import build_dcc
from toolkit.report.word.fill import fill
from toolkit.report.word.package import read_template

HOSTILE = ["B\x08\x1b[2J", "o\x01p", "a\x9bb", "B\u202eA", "\udcff\udcfe", "\x00d", "B\ufffe", "B\u2028x"]
CHECKOUT = Path(__file__).resolve().parents[3]


def _approve(registry: Registry, text: str) -> object:
    return approve(registry, "pair-r1", in_force_from=dt.date(2026, 2, 2), checked_by=text)


def _second(registry: Registry, text: str) -> object:
    return approve(
        registry, "pair-r1", in_force_from=dt.date(2026, 2, 2), checked_by="X", approved_by=text
    )  # fmt: skip


def _because(registry: Registry, text: str) -> object:
    return approve(registry, "pair-r1", in_force_from=DAY, checked_by="B", reason=text)


def _discard(registry: Registry, text: str) -> object:
    return discard(registry, "pair-r1", by="B", reason=text)


@pytest.mark.parametrize("decide", [_approve, _second, _because, _discard])
@pytest.mark.parametrize("text", HOSTILE)
def test_no_decision_brings_a_text_that_no_document_can_print(
    tmp_path: Path, decide: Callable[[Registry, str], object], text: str
) -> None:
    registry = registry_of(tmp_path, approved=False)
    before = registry.head("pair")
    with pytest.raises(ConfigError) as caught:
        decide(registry, text)
    assert caught.value.rule == "unprintable"
    assert "pair-r1" in str(caught.value.where)
    assert registry.head("pair") == before


def test_a_name_has_one_line_and_a_reason_may_have_more(tmp_path: Path) -> None:
    registry = registry_of(tmp_path, approved=False)
    with pytest.raises(ConfigError):
        _approve(registry, "B\nchecked by C")
    _discard(registry, "wrong cell\nsee the log")
    assert registry.status("pair-r1").reason == "wrong cell\nsee the log"


def test_no_session_brings_one(tmp_path: Path) -> None:
    registry = registry_of(tmp_path)
    session = tmp_path / "SESSION.toml"
    for word in ("\\u0008", "\\u202e"):
        (tmp_path / "BAD.toml").write_text(
            session.read_text().replace('operator = "A"', f'operator = "A{word}"')
        )
        with pytest.raises(ConfigError) as caught:
            calibrate(tmp_path / "BAD.toml", registry)
        assert caught.value.rule == "unprintable"
        assert str(caught.value.where).endswith("BAD.toml: operator")


def test_a_ledger_of_former_years_is_read_and_its_documents_show_the_escape(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry = registry_of(tmp_path, approved=False)
    with monkeypatch.context() as former:
        former.setattr(store, "check_entries", lambda *_, **__: None)
        done = approve(
            registry, "pair-r1", in_force_from=dt.date(2026, 2, 2), checked_by="B\x08\x1b[2J",
            known_on=dt.date(2026, 2, 2), reason="late \u202ebecause",
        )  # fmt: skip
        assert done.done
    assert b"B\\b\\u001b[2J" in (registry.folder / "pair" / LEDGER).read_bytes()
    assert all(row.ok for row in verify_registry(registry))
    certificate = collect(registry, "pair-r1", STYLE, issued=DAY)
    content = build_content(certificate, STYLE)
    template = read_template(CHECKOUT / "report_templates" / "certificate.docx")
    filled = fill(template, content, {}, allow_missing=True)
    said = {entry.tag: entry.text for entry in filled.manifest}
    assert said["tk:certificate.checked_by"] == "B\\x08\\x1b[2J"
    assert b"B\\x08\\x1b[2J" in build_dcc(certificate)
    withdraw(registry, "pair-r1", on=dt.date(2026, 7, 1), reason="a fault", by="D")
    assert json.loads((registry.folder / "pair" / LEDGER).read_bytes().splitlines()[-1])["by"] == "D"
