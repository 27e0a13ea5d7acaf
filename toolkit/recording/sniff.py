"""What a file is, by its content: names and extensions are never believed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of file: a short id and its name in words."""

    id: str
    text: str


_MAGIC = (
    (b"PK\x03\x04", Kind("zip", "a zip archive")),
    (b"PK\x05\x06", Kind("zip", "an empty zip archive")),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", Kind("ole", "an OLE compound file")),
    (b"%PDF-", Kind("pdf", "a PDF document")),
    (b"\x89PNG\r\n\x1a\n", Kind("png", "a PNG picture")),
    (b"\xff\xd8\xff", Kind("jpeg", "a JPEG picture")),
    (b"GIF8", Kind("gif", "a GIF picture")),
    (b"II*\x00", Kind("tiff", "a TIFF picture")),
    (b"MM\x00*", Kind("tiff", "a TIFF picture")),
    (b"{\\rtf", Kind("rtf", "an RTF document")),
    (b"\x1f\x8b", Kind("gzip", "a gzip archive")),
    (b"7z\xbc\xaf\x27\x1c", Kind("7z", "a 7-Zip archive")),
    (b"Rar!", Kind("rar", "a RAR archive")),
    (b"BZh", Kind("bzip2", "a bzip2 archive")),
    (b"\xfd7zXZ", Kind("xz", "an xz archive")),
    (b"\x7fELF", Kind("program", "a program")),
    (b"TDSm", Kind("tdms", "a LabVIEW TDMS file")),
    (b"MDF     ", Kind("mdf", "an MDF measurement file")),
    (b"UnFinMF ", Kind("mdf", "an MDF measurement file")),
    (b"MATLAB 5.0 MAT-file", Kind("mat", "a MATLAB file")),
    (b"MATLAB 7.3 MAT-file", Kind("mat", "a MATLAB file")),
    (b"\x89HDF\r\n\x1a\n", Kind("hdf5", "an HDF5 file")),
    (b"SQLite format 3\x00", Kind("sqlite", "an SQLite database")),
    (b"LabVIEW Measurement", Kind("lvm", "a LabVIEW .lvm file")),
    (b"\xef\xbb\xbfLabVIEW Measurement", Kind("lvm", "a LabVIEW .lvm file")),
    (b"PAR1", Kind("parquet", "a Parquet table")),
)
_WIDE = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16"}
_BOM = b"\xef\xbb\xbf"
_HEAD = 8192


def sniff(data: bytes) -> Kind:
    """Return the kind of a file from its first bytes.

    >>> sniff(b"%PDF-1.7 ...").text
    'a PDF document'
    >>> sniff(b"").id
    'empty'
    >>> sniff("FZ load,Fy".encode()).id, sniff(b"MZ [N*m],FY [N]").id, sniff(b"MZ\\x90\\x00\\x03\\x00").id
    ('text', 'text', 'program')
    """
    if not data:
        return Kind("empty", "an empty file")
    for magic, kind in _MAGIC:
        if data.startswith(magic):
            return kind
    if data[:2] in _WIDE:
        return Kind("utf-16", "text in UTF-16")
    head = data[:_HEAD]
    if b"\x00" in head:
        # Two letters are no magic by themselves: a table whose first column is MZ begins with them as well.
        is_program = data.startswith(b"MZ")
        return Kind("program", "a Windows program") if is_program else Kind("binary", "binary data")
    start = head.removeprefix(_BOM).lstrip()[:64].lower()
    if not start:
        return Kind("blank", "a file of blanks only")
    if start.startswith((b"<!doctype html", b"<html")):
        return Kind("html", "an HTML page")
    if start.startswith(b"<"):
        return Kind("xml", "an XML file")
    if start.startswith((b"{", b"[")):
        return Kind("json", "a JSON file")
    control = sum(byte < 32 and byte not in b"\t\n\r\f" for byte in head)
    if control > len(head) // 100:
        return Kind("binary", "binary data")
    return Kind("text", "a text file")


def ole_kind(data: bytes) -> Kind:
    """Return what an OLE compound file holds: an encrypted workbook, an old one, or something else."""
    for stream, kind in (
        ("EncryptedPackage", Kind("encrypted", "an encrypted Office file")),
        ("WordDocument", Kind("doc", "an old Word document (.doc)")),
        ("PowerPoint Document", Kind("ppt", "an old PowerPoint file (.ppt)")),
        ("Workbook", Kind("xls", "an old Excel workbook (.xls)")),
        ("Book", Kind("xls", "an old Excel workbook (.xls)")),
    ):
        if stream.encode("utf-16-le") in data:
            return kind
    return Kind("ole", "an OLE compound file")


def office_kind(names: frozenset[str], content_types: bytes) -> Kind:
    """Return what a zip archive holds, from its member names and its content types."""
    if b"spreadsheetml" in content_types or b"ms-excel" in content_types:
        if b"sheet.binary" in content_types:
            return Kind("xlsb", "a binary Excel workbook (.xlsb)")
        if b"sheet.main+xml" in content_types or b"template.main+xml" in content_types:
            return Kind("xlsx", "an Excel workbook")
        if b"macroEnabled" in content_types:
            return Kind("xlsm", "an Excel workbook with macros")
    if b"wordprocessingml" in content_types:
        return Kind("docx", "a Word document")
    if b"presentationml" in content_types:
        return Kind("pptx", "a PowerPoint file")
    if "mimetype" in names and "content.xml" in names:
        return Kind("odf", "an OpenDocument file")
    return Kind("zip", "a zip archive that is no workbook")
