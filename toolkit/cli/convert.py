"""`toolkit convert`: between tire files, TYDEX files and tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypedDict

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import INTO_FILE, Draft, KnownAt, Output, RegistryOptions
from toolkit.findings import FindingEntry
from toolkit.lab.answers import Timing

ConvertAnswer = TypedDict(
    "ConvertAnswer",
    {
        "in": str,
        "out": str,
        "from": Annotated[str, "kind of the source"],
        "to": Annotated[str, "kind of the target"],
        "axes": str,
        "draft": bool,
        "draft_reasons": list[str],
        "findings": list[FindingEntry],
        "timing": Timing,
    },
)
ConvertAnswer.__doc__ = "A file, written in another format."


NAME = "convert"


@answers(ConvertAnswer)
def command(
    source: Annotated[Path, "A .tir, .tdx, .csv or reduced .xlsx.", ARGUMENT, Mark(metavar="IN")],
    target: Annotated[Path, "A .tir, .fmu, .tdx or .csv.", ARGUMENT, INTO_FILE, Mark(metavar="OUT")],
    axes: Annotated[str, "Axes of the .csv: SAE, adapted-SAE, ISO-W, machine."] = "SAE",
    fmi: Annotated[str, "Version of FMI of an .fmu: 2 or 3."] = "2",
    known_at: KnownAt = None,
    draft: Draft = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Convert between the formats that are read and written; what the target cannot hold is named.

    A reduced test is judged by the registry as in every other command. Where its record is unverified, or
    something became known of it since, a table says so in a column `calibration`; a draft goes into no .csv.

    Example: toolkit convert tire.tdx tire.csv --axes SAE
    """
    from functools import partial

    from toolkit.lab.answers import draft_keys, findings_text
    from toolkit.lab.tire_tests.convert import convert
    from toolkit.lab.tire_tests.resolve import resolve_test

    resolve = partial(resolve_test, basis=place.basis(known_at=known_at, draft=draft))
    converted = convert(source, target, axes=axes, fmi=fmi, resolve=resolve)
    text = f"{target} written"
    if converted.findings:
        text += f"\n\n{findings_text(converted.findings)}"
    payload = {
        "in": str(source),
        "out": str(target),
        "from": converted.kinds[0],
        "to": converted.kinds[1],
        "axes": axes if "csv" in converted.kinds else "ISO-W",
        **draft_keys(*([converted.use] if converted.use else [])),
        "findings": [finding.as_dict() for finding in converted.findings],
        "timing": output.timing,
    }
    output.answer(payload, text)
    return exit_code(converted.findings)
