# ruff: noqa: E501  lines of WordprocessingML read best whole
"""Real conversions by LibreOffice: few, because each takes seconds."""

from __future__ import annotations

import datetime as dt
import errno
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import opened, p, run, sdt, tbl
from toolkit.errors import OutputError, RenderError, TemplateError
from toolkit.recording.marks import is_own_output
from toolkit.report import deliver as deliver_module
from toolkit.report.deliver import Delivered, deliver
from toolkit.report.test.content import build_content
from toolkit.report.word import office, verify
from toolkit.report.word.fill import Entry, Filled
from toolkit.report.word.office import Office

CHECKOUT = Path(__file__).resolve().parents[2]
DAY = dt.date(2026, 11, 21)
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


def content(**changes: object):
    return build_content(make_result(**changes), make_record(), issued=DAY)


def pdf_text(pdf: Path) -> str:
    done = subprocess.run(["pdftotext", "-layout", str(pdf), "-"], capture_output=True, check=True, text=True)
    return done.stdout


@office_needed
def test_the_default_template_becomes_a_verified_report(plain_report: Delivered) -> None:
    done = plain_report
    out = done.pdf.parent
    assert sorted(one.name for one in out.iterdir()) == ["report.docx", "report.pdf"]
    assert [one.name for one in out.parent.iterdir()] == ["out"]
    assert all(check.ok for check in done.checks)
    assert done.warnings == ()
    assert len(done.filled.figures) == 11
    page = pdf_text(done.pdf)
    # The title page of the source document's Figure 5.3, the record's hash, and the mark on every page.
    for words in ("Tire force and moment test", "265/35 ZR 18", "34 psi, 2.34 bar", "c0ffee" + "0" * 58):
        assert words in page
    assert page.count("SIMULATED DATA") >= done.pages
    assert f"page 1 of {done.pages}" in page
    assert b"/Lang" in done.pdf.read_bytes()


@office_needed
def test_hostile_metadata_reaches_the_pdf(tmp_path: Path) -> None:
    made = content(
        special="a < b & c = {{tk:test.date}}", operator="سمير اختبار", requestor="smile 😀",
        tire_series="x" * 70, tire_company="=1+1",
    )  # fmt: skip
    body = p("{{tk:test.special}} ", sdt("tk:test.operator", run("x"))) + p("{{tk:test.requestor}}")
    narrow = '<w:tc><w:tcPr><w:tcW w:w="900" w:type="dxa"/></w:tcPr>{}</w:tc>'
    table = (
        '<w:tbl><w:tblPr><w:tblW w:w="1800" w:type="dxa"/><w:tblLayout w:type="fixed"/></w:tblPr>'
        '<w:tblGrid><w:gridCol w:w="900"/><w:gridCol w:w="900"/></w:tblGrid><w:tr>'
        + narrow.format(p("{{tk:tire.series}}")) + narrow.format(p("{{tk:tire.company}} {{tk:calibration.hash}}")) + "</w:tr></w:tbl>"
    )  # fmt: skip
    results = p("{{tk:table.results}}") + tbl(["SA", "FY"], ["{{tk:row.SA}}", "{{tk:row.FY|.3f}}"])
    done = deliver(opened(tmp_path, body + table + results), made, tmp_path / "out")
    assert "a < b & c = {{tk:test.date}}" in pdf_text(done.pdf)
    assert all(check.ok or check.warning for check in done.checks)


def filled(*entries: tuple[str, str], cells: tuple[tuple[str, ...], ...] = ()) -> Filled:
    manifest = tuple(Entry(tag=tag, text=text, part="word/document.xml") for tag, text in entries)
    return Filled(docx=b"", manifest=manifest, figures=(), cells=cells, missing=(), lint=(), marks_added=())


def names(checks: list[verify.Check]) -> set[str]:
    return {one.name for one in checks if not one.ok}


def test_values_are_compared_without_white_space_and_soft_hyphens() -> None:
    page = "Cornering stiff\u00adness\n12\u00a0345.6 N 0.2\n5\f"
    assert names(verify.text_checks(page, filled(("a", "stiffness 12345.6"), ("b", "0.25")))) == set()
    assert names(verify.text_checks(page, filled(("a", "12345.7")))) == {"values"}


def test_cells_are_compared_in_their_order() -> None:
    rows = (("-0.30", "371.4"), ("0.70", "-12.0"))
    assert names(verify.text_checks("SA FY -0.30 371.4 0.70 -12.0", filled(cells=rows))) == set()
    assert names(verify.text_checks("SA FY -0.30 371.4 0.70 -12.1", filled(cells=rows))) == {"cells"}


def test_a_script_that_cannot_be_read_back_is_a_warning_and_a_number_beside_it_is_not() -> None:
    checks = verify.text_checks("smile 5.0", filled(("a", "smile 😀"), ("b", "5.0")))
    assert [(one.name, one.warning) for one in checks if not one.ok] == [("script", True)]
    assert "values" in names(verify.text_checks("smile", filled(("b", "5.0"))))


def test_loose_fonts_are_found() -> None:
    listing = (
        "name                                 type              encoding         emb sub uni object ID\n"
        "------------------------------------ ----------------- ---------------- --- --- --- ---------\n"
        "BAAAAA+Carlito                       TrueType          WinAnsi          yes yes yes     10  0\n"
        "Helvetica                            Type 1            WinAnsi          no  no  no      12  0\n"
    )
    assert verify._fonts(listing).message == "Helvetica"


def fake(folder: Path, script: str) -> Path:
    path = folder / "soffice"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO])
def test_a_disk_that_is_full_while_a_report_is_made(tmp_path: Path, monkeypatch, number: int) -> None:
    """The place is to blame: an error of its own, which a watch waits for, and nothing is left."""
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, "exit 0")))

    def full(_filled: Filled) -> list[verify.Check]:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(deliver_module, "verify_docx", full)
    template = opened(tmp_path, p("x"))
    before = sorted(tmp_path.iterdir())
    with pytest.raises(OutputError) as caught:
        deliver(template, content(), tmp_path / "new" / "out")
    assert (caught.value.rule, caught.value.got) == ("not-writable", os.strerror(number))
    assert caught.value.where == str(tmp_path / "new" / "out")
    assert sorted(tmp_path.iterdir()) == before


def test_an_error_that_is_not_the_disk_s_stays_what_it_is(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, "exit 0")))

    def broken(_filled: Filled) -> list[verify.Check]:
        raise OSError(errno.ENOEXEC, os.strerror(errno.ENOEXEC))

    monkeypatch.setattr(deliver_module, "verify_docx", broken)
    with pytest.raises(OSError, match=os.strerror(errno.ENOEXEC)):
        deliver(opened(tmp_path, p("x")), content(), tmp_path / "out")


@pytest.mark.parametrize(
    ("script", "rule"),
    [
        ("exit 0", "render-failed"),
        ('case "$*" in *--convert-to*) ;; *) exit 0;; esac; exec sleep 30', "render-timeout"),
        ('case "$*" in *--convert-to*) ;; *) exit 0;; esac; for a in "$@"; do last=$a; done; '
         'echo "no pdf" > "${last%.docx}.pdf"', "render-failed"),
    ],
)  # fmt: skip
def test_a_failed_conversion_leaves_nothing(tmp_path: Path, monkeypatch, script: str, rule: str) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, script)))
    template = opened(tmp_path, p("x"))
    before = sorted(tmp_path.iterdir())
    out = tmp_path / "a" / "b"
    office = Office(timeout_s=0.5)
    with pytest.raises(RenderError) as caught:
        deliver(template, content(), out, office=office)
    assert caught.value.rule == rule
    assert "doctor" in str(caught.value.next_step)
    assert sorted(tmp_path.iterdir()) == before
    assert not office.folder.exists()


def test_temporary_files_of_a_libreoffice_that_was_killed_go_with_it(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, 'echo x > "$TMPDIR/lu12.tmp"; kill -9 $$')))
    with pytest.raises(RenderError):
        deliver(opened(tmp_path, p("x")), content(), tmp_path / "out")
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.parametrize(
    ("script", "ends"),
    [
        # It works until its PDF is there, long after the limit; one that sleeps is ended at the limit.
        ('n=0; while [ ! -e "$GO" ]; do n=$((n+1)); done; echo done >&2', True),
        ("sleep 60", False),
    ],
)
def test_a_conversion_that_a_busy_machine_holds_up_gets_more_time(
    tmp_path: Path, monkeypatch, script: str, ends: bool
) -> None:
    go = tmp_path / "go"
    monkeypatch.setattr(office, "_LOOK_S", 0.2)
    # As if half of a core were given to it: it has worked for less than its limit when that is over.
    looks = iter(range(1, 100))
    real = office._processor_s

    def slow(groups: set[int]) -> float:
        if next(looks) == 4:
            go.touch()
        return real(groups) / 20

    monkeypatch.setattr(office, "_processor_s", slow)
    monkeypatch.setattr(office, "_STANDS", 0.001)
    process = subprocess.Popen(
        ["sh", "-c", script],
        stderr=subprocess.PIPE,
        start_new_session=True,
        env={**os.environ, "GO": str(go)},
    )
    try:
        if ends:
            assert office._wait(process, 0.5, also=None) == b"done\n"
            assert next(looks) > 3  # it was looked at after its limit
        else:
            with pytest.raises(subprocess.TimeoutExpired):
                office._wait(process, 0.5, also=None)
    finally:
        office._kill(process)


# A LibreOffice that makes a PDF of each document but those named bad*, and notes who converted what.
_NOTING = """
case "$*" in *--convert-to*) ;; *) exit 0;; esac
for a in "$@"; do case "$a" in
    -env:*) profile=$a ;;
    *bad*.docx) ;;
    *.docx) printf '%%PDF-1.7 %%%%EOF' > "${a%.docx}.pdf"; echo "$profile ${a##*/}" >> "$NOTES" ;;
esac; done
"""


def test_many_documents_are_shared_out_and_come_back_in_their_order(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, _NOTING)))
    monkeypatch.setenv("NOTES", str(tmp_path / "notes"))
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    names = ["a", "bad1", "b", "c", "d"]
    sources = [tmp_path / f"{name}.docx" for name in names]
    for source in sources:
        source.write_bytes(b"")
    with Office() as office:
        office.expect(3)
        assert office._beside == []  # not worth a second start
        office.expect(len(sources))
        (beside,) = office._beside
        made = office.convert_each(sources, tmp_path)
    assert [one.name if isinstance(one, Path) else one.rule for one in made] == [
        "a.pdf", "render-failed", "b.pdf", "c.pdf", "d.pdf",
    ]  # fmt: skip
    notes = [line.split() for line in (tmp_path / "notes").read_text().splitlines()]
    profiles = {name: profile for profile, name in notes}
    # A profile is never shared: LibreOffice would hand one job over to the other, and lose it.
    assert profiles["a.docx"] == profiles["b.docx"] == profiles["d.docx"] != profiles["c.docx"]
    assert not office.folder.exists()
    assert not beside.folder.exists()


def test_keep_puts_what_was_made_into_rejected(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, "exit 0")))
    out = tmp_path / "out"
    with pytest.raises(RenderError):
        deliver(opened(tmp_path, p("x")), content(), out, keep=True)
    assert [one.name for one in out.iterdir()] == ["rejected"]
    assert sorted(one.name for one in (out / "rejected").iterdir()) == ["reason.txt", "report.docx"]


def test_no_soffice(monkeypatch) -> None:
    monkeypatch.delenv("TOOLKIT_SOFFICE", raising=False)
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(RenderError) as caught:
        Office()
    assert caught.value.rule == "no-soffice"
    assert "toolkit doctor" in str(caught.value.next_step)


@pytest.mark.parametrize(
    ("name", "why"), [("nowhere", "no such file"), (".", "a folder"), ("x", "not executable")]
)
def test_a_stated_soffice_that_is_no_program(tmp_path: Path, monkeypatch, name: str, why: str) -> None:
    (tmp_path / "x").write_text("no program")
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(tmp_path / name))
    with pytest.raises(RenderError, match="TOOLKIT_SOFFICE does not name a program") as caught:
        Office()
    assert caught.value.rule == "no-soffice"
    assert caught.value.got == f"{tmp_path / name}: {why}"


def test_a_folder_for_temporary_files_without_room_is_named(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, "exit 0")))
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _folder: usage._replace(free=300 * 1024))
    with pytest.raises(RenderError, match="hardly room") as caught:
        deliver(opened(tmp_path, p("x")), content(), tmp_path / "out")
    assert tempfile.gettempdir() in str(caught.value.where)
    assert caught.value.got == "0.3 MB free"


def test_a_missing_value_leaves_the_old_report_alone(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, "exit 0")))
    out = tmp_path / "out"
    out.mkdir()
    old = b"%PDF-1.7 toolkit-output"
    (out / "report.pdf").write_bytes(old)
    with pytest.raises(TemplateError):
        deliver(opened(tmp_path, p("{{tk:test.operator}}")), content(operator=None), out)
    assert [one.name for one in out.iterdir()] == ["report.pdf"]
    assert (out / "report.pdf").read_bytes() == old


@office_needed
def test_a_report_is_known_again_and_replaces_only_a_report(tmp_path: Path, plain_report: Delivered) -> None:
    template = opened(tmp_path, p("{{tk:calibration.hash}}"))
    out = tmp_path / "out"
    out.mkdir()
    (out / "report.docx").write_bytes(b"somebody's own letter")
    with pytest.raises(OutputError) as caught:
        deliver(template, content(), out)
    assert caught.value.rule == "original"
    assert [path.name for path in out.iterdir()] == ["report.docx"]
    for old in (plain_report.docx, plain_report.pdf):
        shutil.copy(old, out)
    made = deliver(template, content(), out)
    for new, old in ((made.docx, plain_report.docx), (made.pdf, plain_report.pdf)):
        assert is_own_output(new)
        assert is_own_output(old)
        assert new.read_bytes() != old.read_bytes()


@pytest.mark.parametrize("locale", ["de_DE.UTF-8", "tr_TR.UTF-8"])
def test_no_document_takes_its_language_from_who_converts_it(
    tmp_path: Path, monkeypatch, locale: str
) -> None:
    note = 'echo "$LC_ALL/$LANGUAGE" >> "$NOTES"\n'
    monkeypatch.setenv("TOOLKIT_SOFFICE", str(fake(tmp_path, note + _NOTING.replace('>> "$NOTES"', ""))))
    monkeypatch.setenv("NOTES", str(tmp_path / "notes"))
    for name in ("LC_ALL", "LANG", "LANGUAGE"):
        monkeypatch.setenv(name, locale)
    (tmp_path / "a.docx").write_bytes(b"")
    with Office() as office:
        office.convert_each([tmp_path / "a.docx"], tmp_path)
    assert set((tmp_path / "notes").read_text().split()) == {"C.UTF-8/"}
