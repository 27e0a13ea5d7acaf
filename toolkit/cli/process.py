"""`toolkit process`: recordings to one reduced test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import (
    INTO_FILE,
    CalibrationId,
    Draft,
    KnownAt,
    Output,
    ProtocolFile,
    Reader,
    RegistryOptions,
    Units,
)

if TYPE_CHECKING:
    from toolkit.lab.tire_tests.process_answer import ProcessAnswer

NAME = "process"


@answers("toolkit.lab.tire_tests.process_answer:ProcessAnswer")
def command(
    test: Annotated[Path, "Folder with test.toml and the recordings.", ARGUMENT, Mark(metavar="TEST")],
    calibration: CalibrationId = None,
    out: Annotated[
        Path | None, "Write the reduced test (.xlsx: the whole test in one file).", INTO_FILE
    ] = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    units: Units = "SI",
    protocol: ProtocolFile = None,
    reader: Reader = "calamine",
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Turn a test's recordings into one reduced test.

    Corrected by the calibration in force, averaged, in SI and SAE axes, with curves and characteristics.

    Example: toolkit process tests/2019-06-04 --out test.xlsx
    """
    from toolkit.lab.answers import unit_choice
    from toolkit.lab.tire_tests.process_answer import process_payload, process_text
    from toolkit.lab.tire_tests.resolve import resolve_test
    from toolkit.recording.marks import refuse_original
    from toolkit.testfile import write_test_file

    basis = place.basis(
        calibration=calibration, known_at=known_at, draft=draft, protocol=protocol, reader=reader
    )
    style = unit_choice(units)
    if out is not None:
        refuse_original(out, suffix=".xlsx")
    with output.progress("reading") as step:
        resolved = resolve_test(test, basis, step=step)
    digest = write_test_file(out, resolved.result, dict(resolved.recordings)) if out else None
    payload: ProcessAnswer = {
        **process_payload(resolved),
        "out": out,
        "content_sha256": digest,
        "timing": output.timing,
    }
    output.answer(payload, process_text(resolved, out, style))
    return exit_code(resolved.findings)
