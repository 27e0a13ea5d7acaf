"""Files in a PDF: attached before it is sealed (associated files of PDF/A-3, ISO 19005-3)."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from toolkit.trust.seal.check import Forged

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.pdf_utils.reader import PdfFileReader

_PART = re.compile(rb"(<pdfaid:part>|pdfaid:part=['\"])([12])(?=[<'\"])")
_TYPES = {".json": "application/json", ".xml": "application/xml"}
_MOST_BYTES = 16 * 2**20


def attach(writer: IncrementalPdfFileWriter, files: Mapping[str, bytes]) -> None:
    """Attach files by name and, where the file says PDF/A-2, say PDF/A-3: only that may carry any file."""
    from pyhanko.pdf_utils import generic
    from pyhanko.pdf_utils.embed import EmbeddedFileObject, EmbeddedFileParams, FileSpec, embed_file

    if not files:
        return
    now = dt.datetime.now(dt.UTC)
    for name, data in files.items():
        kind = _TYPES.get("." + name.rpartition(".")[2], "application/octet-stream")
        params = EmbeddedFileParams(creation_date=now, modification_date=now)
        embedded = EmbeddedFileObject.from_file_data(writer, data, mime_type=kind, params=params)
        embed_file(
            writer, FileSpec(file_spec_string=name, file_name=name, embedded_data=embedded, description=name)
        )
        # By pyHanko's own argument the file would become PDF 2.0, which PDF/A-3 is not.
        specification = writer.root["/Names"]["/EmbeddedFiles"]["/Names"].raw_get(-1)
        described = specification.get_object()
        described["/AFRelationship"] = generic.NameObject("/Data")
        if "/AF" not in writer.root:
            writer.root["/AF"] = generic.ArrayObject()
        writer.root["/AF"].append(specification)
    writer.update_root()
    _say_part_3(writer)


def attachments_of(reader: PdfFileReader) -> dict[str, bytes]:
    """Return the files that a PDF carries, by name.

    Raises
    ------
    Forged
        they are too large
    """
    names: Any = reader.root
    for key in ("/Names", "/EmbeddedFiles", "/Names"):
        if key not in names:
            return {}
        names = names[key]
    files: dict[str, bytes] = {}
    for index in range(0, len(names) - 1, 2):
        specification: Any = names[index + 1]
        data = specification["/EF"]["/F"].data
        if len(data) > _MOST_BYTES:
            raise Forged("a file in the PDF is larger than any that is attached to a certificate")
        files[str(names[index])] = data
    return files


def _say_part_3(writer: IncrementalPdfFileWriter) -> None:
    from pyhanko.pdf_utils import generic

    if "/Metadata" not in writer.root or not _PART.search(writer.root["/Metadata"].data):
        return
    stream = generic.StreamObject(
        {"/Type": generic.NameObject("/Metadata"), "/Subtype": generic.NameObject("/XML")},
        stream_data=_PART.sub(rb"\g<1>3", writer.root["/Metadata"].data),
    )
    writer.root["/Metadata"] = writer.add_object(stream)
    writer.update_root()
