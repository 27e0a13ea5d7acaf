"""`toolkit inspect`: what a recording holds, and which calibration computed its Fy and Mz."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import KnownAt, Output, RegistryOptions, day

if TYPE_CHECKING:
    from toolkit.findings import Finding
    from toolkit.lab.tire_tests.inspection_answer import Inspected, UnreadFile

NAME = "inspect"


@answers("toolkit.lab.tire_tests.inspection_answer:InspectForms")
def command(
    files: Annotated[list[Path], "Recordings, under any name.", ARGUMENT, Mark(metavar="FILE...")],
    machine: Annotated[
        str | None, "Machine; default: that of test.toml, else of the file, else the packaged one."
    ] = None,
    known_at: KnownAt = None,
    prove: Annotated[bool, "The interval that the printed digits allow each coefficient."] = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Show what recordings hold, and what computed them.

    Channels with units, load blocks, the measured slip angle, the calibration that computed Fy and Mz,
    and the corrected values beside them.

    Example: toolkit inspect tests/2019-06-04/run_01.xlsx
    """
    from toolkit.audit.inspection import inspect_file
    from toolkit.errors import ToolkitError
    from toolkit.lab.home import registry_if_any
    from toolkit.lab.tire_tests.inspection_answer import inspection_payload, inspection_text, intervals_of
    from toolkit.listing import one_line

    registry = registry_if_any(place.calibrations, place.home)
    payloads: list[Inspected | UnreadFile] = []
    texts = []
    findings: list[Finding] = []
    failed = False
    for path in files:
        try:
            inspection = inspect_file(path, registry, machine=machine, known_at=day(known_at))
        except ToolkitError as error:
            if len(files) == 1:
                raise
            # One bad file of many does not hide what the others hold.
            failed = True
            payloads.append({"file": path, "error": error.as_dict()})
            texts.append(f"{one_line(path)}\n  error: {error}")
            continue
        intervals = intervals_of(inspection) if prove else ()
        payloads.append(inspection_payload(inspection, intervals))
        texts.append(inspection_text(inspection, intervals))
        findings += inspection.findings
    payload: dict[str, Any] = {"files": payloads, "findings": [f.as_dict() for f in findings]}
    if len(payloads) == 1:  # one file: its keys stand at the top too
        payload = {**payloads[0], **payload}
    output.answer(payload, "\n\n".join(texts))
    return 2 if failed else exit_code(findings)
