"""A scratch folder in which commands run one after another, and what of their answers is frozen."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import itertools
import json
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.golden.surface import CALIBRATIONS, ROOT, package_folder, run_command

NO_RESULT = frozenset(
    """timing head heads ledger_head software template_sha256 content_sha256 manifest_file pages checks
    signature ledger
    """.split()
)
"""Keys of answers that hold times, versions, ledger heads, layout and hashes of whole documents,
and who signed: no number follows from that."""
NO_RESULT_TAGS = frozenset(
    """tk:report.date tk:table.models.seconds tk:certificate.ledger_head tk:signature closing:signature
    closing:proof""".split()
)
"""Tags of documents that print the day, a time, a ledger's head, which has times in it, or who signed."""


@dataclass(slots=True)
class Workplace:
    """A folder of scratch files; what several entries start from is made once.

    ``base`` is the folder of the whole reading, ``shared`` maps a name to what `once` made for it.
    """

    folder: Path
    base: Path
    shared: dict[str, Any] = field(default_factory=dict)

    def room(self, name: str) -> Workplace:
        """Return a workplace in a new folder below this one that shares what was made once."""
        folder = self.folder / name.replace("/", "-").replace(" ", "-")
        folder.mkdir()
        return Workplace(folder, self.base, self.shared)

    def once(self, name: str, make: Callable[[Workplace], Any]) -> Any:
        """Return what ``make`` makes in a folder of its own, made once for all entries."""
        if name not in self.shared:
            self.shared[name] = make(Workplace(self.base, self.base, self.shared).room(name))
        return self.shared[name]

    def write(self, files: dict[str, str], folder: str = ".") -> Path:
        """Write texts by file name below this folder; return where they stand."""
        target = self.folder / folder
        for name, text in files.items():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_text(text, encoding="utf-8")
        return target

    def answer(self, *words: object, calibrations: Path | None = None) -> dict[str, Any]:
        """Run a command with ``--json`` in this folder; return its exit code and what it answered.

        ``calibrations`` is the registry's folder. What is no result is left out by `tidy`.
        """
        arguments = [*map(str, words), "--json"]
        if calibrations is not None:
            arguments += ["--calibrations", str(calibrations)]
        output, errors = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(self.folder),
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(errors),
        ):
            exit_code = run_command(arguments)
        try:
            document = json.loads(output.getvalue())
        except ValueError:
            raise RuntimeError(
                f"toolkit {' '.join(arguments)} gave no JSON, exit code {exit_code}:\n"
                f"{output.getvalue()[-2000:]}\n{errors.getvalue()[-2000:]}"
            ) from None
        if "error" in document:  # its words may get better; the rule and the exit code are the contract
            document = {"error": document["error"]["rule"]}
        return {"exit_code": exit_code, "answer": self.tidy(document)}

    def packaged(self, *words: object) -> dict[str, Any]:
        """Run a command with the packaged registry."""
        return self.answer(*words, calibrations=CALIBRATIONS)

    def tidy(self, value: Any) -> Any:
        """Return an answer without what is no result, its folders written as names.

        What a document holds stands by its tag: of each, the texts and their parts in the order of the
        document.
        """
        if isinstance(value, dict):
            return {
                key: self.tidy(_by_tag(entry) if key in ("manifest", "figures") else entry)
                for key, entry in value.items()
                if key not in NO_RESULT
            }
        if isinstance(value, list):
            return [self.tidy(entry) for entry in value]
        if not isinstance(value, str):
            return value
        folders = {self.folder: "<room>", self.base: "<workplace>", package_folder(): "<house>/toolkit",
                   ROOT: "<house>"}  # fmt: skip
        for folder, name in folders.items():
            value = value.replace(str(folder), name)
        return value


def _by_tag(rows: Any) -> Any:
    if not isinstance(rows, list) or not all(isinstance(row, dict) and "tag" in row for row in rows):
        return rows
    tags: dict[str, list[Any]] = {}
    for row in rows:
        if row["tag"] not in NO_RESULT_TAGS:
            tags.setdefault(row["tag"], []).append([text for key, text in row.items() if key != "tag"])
    return tags


def read_record(path: Path) -> dict[str, Any]:
    """Return a record's file: its hashed content and the hash, without the software's versions."""
    record = json.loads(path.read_text(encoding="utf-8"))
    return {"sha256": record["sha256"], "content": record["content"]}


def csv_columns(path: Path, *, every: int = 1) -> dict[str, Any]:
    """Return the columns of a CSV file: every so many cells, and a hash of the whole column as written."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(line for line in file if not line.startswith("#"))
    columns = zip(*rows, strict=True)
    return {name: sampled(cells, every) for name, cells in zip(header, columns, strict=True)}


def sheets(path: Path, names: Sequence[str] = (), *, every: int = 1) -> dict[str, Any]:
    """Return worksheets by column: the header's text, then the cells with every digit."""
    import openpyxl

    # By its bytes: recordings of the machine have no extension.
    book = openpyxl.load_workbook(io.BytesIO(path.read_bytes()), read_only=True, data_only=True)
    try:
        answer = {}
        for name in names or book.sheetnames:
            header, *rows = book[name].iter_rows(values_only=True)
            columns = itertools.zip_longest(header, *rows)  # a row ends with its last cell
            answer[name] = {
                str(title): sampled([_text(cell) for cell in cells], every) for title, *cells in columns
            }
    finally:
        book.close()
    return answer


def sampled(cells: Sequence[str], every: int) -> dict[str, Any] | list[str]:
    """Return all cells, or every so many with a hash over all of them."""
    if every == 1:
        return list(cells)
    digest = hashlib.sha256("\n".join(cells).encode()).hexdigest()
    return {"rows": len(cells), "sha256": digest, "sample": list(cells[::every])}


def _text(cell: object) -> str:
    return "" if cell is None else repr(cell) if isinstance(cell, float) else str(cell)


def toml_values(path: Path) -> dict[str, Any]:
    """Return a TOML file with its dates as texts."""
    return json.loads(json.dumps(tomllib.loads(path.read_text(encoding="utf-8")), default=str))


@contextlib.contextmanager
def workplace() -> Iterator[Workplace]:
    """Yield a workplace in a temporary folder that is removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        yield Workplace(Path(folder).resolve(), Path(folder).resolve())
