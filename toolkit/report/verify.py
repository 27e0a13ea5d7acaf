"""Verify a filled report: what was meant to be printed is in the document and in its PDF."""

from __future__ import annotations

import io
import re
import subprocess
import tempfile
import unicodedata
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import RenderError
from toolkit.report.fill import Filled
from toolkit.report.scan import BROKEN, LITERAL, control_tag
from toolkit.report.xml import SDT_PR, W_P, W_SDT, clean, in_fallback, paragraph_text, q, stories

_SPACE = re.compile("[\\s\u00ad\u200b-\u200f\u202a-\u202e\u2066-\u2069\ufeff]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One check: ``ok``, or what was not as it should be. A warning does not stop the delivery."""

    name: str
    ok: bool
    message: str
    warning: bool = False

    def as_dict(self) -> dict[str, object]:
        """Return the check as a JSON-ready dict."""
        return {"name": self.name, "ok": self.ok, "message": self.message}


def squeeze(text: str) -> str:
    """Return text as it is compared: composed, without white space, soft hyphens and direction marks.

    >>> squeeze("1 234,5\\u00ad N")
    '1234,5N'
    """
    return _SPACE.sub("", unicodedata.normalize("NFKC", text))


def verify_docx(filled: Filled) -> tuple[Check, ...]:
    """Check the filled Word file itself: placeholders gone, every figure there with its text."""
    from docx.package import Package

    parts = stories(Package.open(io.BytesIO(filled.docx)))
    values = " ".join(entry.text for entry in filled.manifest)
    left, alts = [], []
    for story in parts:
        for paragraph in story.root.iter(W_P):
            text = paragraph_text(paragraph)
            left += [m[0] for m in LITERAL.finditer(text) if m[0] not in values]
            if BROKEN.search(text) and "{{" not in values:
                left.append(text[:40])
        for sdt in story.root.iter(W_SDT):
            tag = control_tag(sdt)
            if tag is not None and (
                tag.family == "if" or sdt.find(f"{SDT_PR}/{q('w:showingPlcHdr')}") is not None
            ):
                left.append(str(tag))
        alts += [p.get("descr") or "" for p in story.root.iter(q("wp:docPr")) if not in_fallback(p)]
    absent = [
        tag
        for tag, alt in filled.figures
        if " ".join(alt.split()) not in {" ".join(one.split()) for one in alts}
    ]
    return (
        Check(name="placeholders", ok=not left, message=", ".join(left[:5]) or "none left"),
        Check(
            name="alt-text",
            ok=not absent and all(alt for _, alt in filled.figures),
            message=", ".join(absent) or f"{len(filled.figures)} figures with alternative text",
        ),
    )


def verify_pdf(pdf: Path, filled: Filled) -> tuple[tuple[Check, ...], int]:
    """Check the PDF and return the checks and its number of pages.

    Raises
    ------
    RenderError
        poppler's programs are not installed
    """
    info = _run(["pdfinfo", str(pdf)])
    found = re.search(r"^Pages:\s+(\d+)", info, re.MULTILINE)
    pages = int(found[1]) if found else 0
    data = pdf.read_bytes()
    with tempfile.TemporaryDirectory(prefix="toolkit-verify-") as folder, ThreadPoolExecutor(2) as pool:
        # The text is the same without PDF/A's colour profile, which pdftotext sets up anew for each page:
        # 50 ms a page. The name is blotted out in place, so that every offset stays right.
        plain = Path(folder) / "text.pdf"
        plain.write_bytes(data.replace(b"/OutputIntents", b"/OutputIntent_"))
        fonts = pool.submit(_run, ["pdffonts", str(pdf)])
        text = _run(["pdftotext", "-raw", "-enc", "UTF-8", str(plain), "-"])
        listing = fonts.result()
    pictures = data.count(b"/Subtype/Image")
    mute = [tag for tag, alt in filled.figures if _pdf_string(alt) not in data]
    return (
        (
            *_texts(text, filled),
            _fonts(listing),
            Check(name="pages", ok=pages > 0 and text.count("\f") == pages, message=f"{pages} pages"),
            Check(
                name="figures",
                ok=pictures >= len({tag for tag, _ in filled.figures}) and not mute,
                message=f"no alternative text in the PDF for {', '.join(mute)}"
                if mute
                else f"{pictures} pictures in the PDF, {len(filled.figures)} figures in the report",
            ),
            Check(
                name="archive",
                ok=b"pdfaid" in data and "yes" in _line(info, "Tagged"),
                message="PDF/A-2 and tagged" if b"pdfaid" in data else "not PDF/A",
            ),
        ),
        pages,
    )


def _pdf_string(text: str) -> bytes:
    # LibreOffice writes alternative texts as UTF-16 in hexadecimal, in objects that are not packed.
    plain = clean(text).replace("\n", " ")
    return b"<FEFF" + plain.encode("utf-16-be").hex().upper().encode() + b">"


def _texts(text: str, filled: Filled) -> list[Check]:
    page = squeeze(text)
    rows_left = _absent_rows(page, filled.cells)
    lost, unreadable = [], []
    for entry in dict.fromkeys(filled.manifest):
        wanted = squeeze(entry.text)
        if not wanted or wanted in page or _in_pieces(wanted, page, entry.text):
            continue
        plain = "".join(ch for ch in wanted if not _hard_to_extract(ch))
        if plain != wanted and all(squeeze(w) in page for w in _plain_words(entry.text)):
            unreadable.append(entry.tag)
        else:
            lost.append(f"{entry.tag} {entry.text[:40]!r}")
    checks = [
        Check(
            name="values",
            ok=not lost,
            message="; ".join(lost[:5]) or f"{len(filled.manifest)} values found in the PDF",
        ),
        Check(
            name="cells",
            ok=not rows_left,
            message="; ".join(rows_left[:5]) or f"{sum(map(len, filled.cells))} table cells found in the PDF",
        ),
    ]
    if unreadable:
        checks.append(
            Check(
                name="script",
                ok=False,
                warning=True,
                message=f"{', '.join(unreadable[:5])}: characters that no installed font shows, "
                "or that run from right to left, could not be read back from the PDF",
            )
        )
    return checks


def _absent_rows(page: str, rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the rows that are not in the text in their order, cell after cell."""
    lost, cursor = [], 0
    for row in rows:
        joined = squeeze("".join(row))
        at = page.find(joined, cursor)
        if at >= 0:
            cursor = at + len(joined)
            continue
        # A row that breaks over a page, or whose cells the PDF paints in another order: cell by cell.
        for cell in row:
            wanted = squeeze(cell)
            if (
                wanted not in page
                and not _in_pieces(wanted, page, cell)
                and not any(map(_hard_to_extract, wanted))
            ):
                lost.append(cell[:60])
    return lost


def _in_pieces(wanted: str, page: str, original: str) -> bool:
    # Long prose may be cut by a page's end, with header and footer between its halves; a number may not.
    words = original.split()
    return len(words) > 3 and len(wanted) > 40 and all(squeeze(word) in page for word in words)


def _hard_to_extract(character: str) -> bool:
    return (
        unicodedata.bidirectional(character) in ("R", "AL", "AN")
        or unicodedata.category(character)
        in (
            "So",
            "Sk",
            "Cn",
            "Co",
            "Mn",
            "Me",
            "Cf",
        )
        or ord(character) > 0xFFFF
    )


def _plain_words(text: str) -> list[str]:
    return [word for word in text.split() if not any(map(_hard_to_extract, word))]


def _fonts(listing: str) -> Check:
    loose = []
    for line in listing.splitlines()[2:]:
        # name  type  encoding  emb sub uni  object ID: the flags are the last three words before two numbers.
        words = line.split()
        if len(words) >= 6 and words[-5] != "yes":
            loose.append(words[0])
    return Check(name="fonts", ok=not loose, message=", ".join(loose) or "all fonts embedded")


def _line(info: str, name: str) -> str:
    return next((line for line in info.splitlines() if line.startswith(name)), "")


def _run(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, timeout=120, check=False)
    except FileNotFoundError as error:
        raise RenderError(
            "the PDF cannot be verified",
            where=command[0],
            got="no program of that name on the PATH",
            expected="poppler's pdftotext, pdffonts and pdfinfo",
            next_step="run 'toolkit doctor': it prints the command that installs poppler-utils",
            rule="no-poppler",
        ) from error
    except subprocess.TimeoutExpired as error:
        raise RenderError(
            "the PDF cannot be verified in time",
            where=command[0],
            got="no end after 120 s",
            expected="an answer",
            next_step="open the PDF; try again with --keep",
            rule="render-timeout",
        ) from error
    return done.stdout.decode("utf-8", "replace")
