"""`toolkit compare`: tests against each other, or against a maker's table."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import (
    INTO_FOLDER,
    Draft,
    KnownAt,
    Output,
    ProtocolFile,
    Reader,
    RegistryOptions,
    day,
)
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.comparison.model import Mode
    from toolkit.report.word.package import Template

NAME = "compare"


@answers("toolkit.lab.tire_tests.compare_answer:CompareForms")
def command(
    sources: Annotated[
        list[Path] | None,
        "Tests (folders or reduced .xlsx) and makers' tables (.csv); A is the reference.",
        ARGUMENT,
        Mark(metavar="A B ..."),
    ] = None,
    mode: Annotated[
        str | None, "table, surfaces, tires or repeats; default: by what the tests state."
    ] = None,
    axes: Annotated[str, "Axes of the tables: SAE, adapted-SAE, ISO-W, machine."] = "SAE",
    laboratories: Annotated[
        Path | None,
        "Interlaboratory comparison (.csv): measurand,laboratory,value [N],U [N],k; a row a result.",
        Mark(metavar="FILE"),
    ] = None,
    reference: Annotated[
        str | None, "Laboratory whose values are the assigned ones; default: consensus."
    ] = None,
    sigma: Annotated[
        float | None, "sigma_pt of --laboratories, in the results' unit; default: robust."
    ] = None,
    level: Annotated[float, "Chance of even one false decision in a table (Holm)."] = 0.05,
    reproducibility: Annotated[
        bool, "Require reproducibility: tests of one laboratory alone are then an error."
    ] = False,
    units: Annotated[
        str | None,
        "SI or lbf, for people: text, figures, document. Default: SI; in the document the style file's. The "
        "JSON answer is always in SI.",
    ] = None,
    figures: Annotated[
        Path | None, "Folder for the figures (PNG), as the thesis's 6.6 to 6.29.", INTO_FOLDER
    ] = None,
    out: Annotated[
        Path | None, "Folder for comparison.docx (laboratories.docx) and its verified PDF.", INTO_FOLDER
    ] = None,
    template: Annotated[
        Path | None, "Word template of --out; default: comparison.docx or laboratories.docx."
    ] = None,
    protocol: ProtocolFile = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    reader: Reader = "calamine",
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Compare tests with each other, or with a maker's table.

    Differences from the first, each with its uncertainty: what tests share (one calibration record, the
    load cell) cancels. Which are significant is decided over the whole table. Repeats of one tire give
    repeatability and intermediate precision by day, operator, mounting.

    A maker's table holds forces (SA [deg],FZ [N],FY [N],MZ [N*m]) or characteristics (FZ [N],conicity [N],
    U_conicity [N],plysteer [N],secant_cornering [N/deg],...).

    --laboratories takes an interlaboratory comparison instead: scores z', zeta and E_n by ISO 13528, and
    repeatability and reproducibility with Mandel's h and k by ISO 5725-2, for laboratories with different
    numbers of results too.

    Ends with 0 whether or not there are differences: they are results. 1: the data has findings.

    Example: toolkit compare tests/steel tests/sandpaper --figures figures
    """
    from toolkit.comparison.compare import compare
    from toolkit.lab.answers import document_text, unit_choice
    from toolkit.lab.home import document_template
    from toolkit.lab.tire_tests.compare import read_entries, write_comparison
    from toolkit.lab.tire_tests.compare_answer import compare_answer, comparison_text
    from toolkit.report.comparison.content import Compared

    if laboratories is not None:
        if sources:
            raise ConfigError(
                "a comparison of laboratories takes no tests", where="--laboratories",
                got=", ".join(map(str, sources)), expected="--laboratories FILE alone",
                next_step="leave the tests out", rule="usage",
            )  # fmt: skip
        return _laboratories(
            laboratories, reference, sigma, figures, out,
            document_template(template, out, default="laboratories.docx", home=place.home),
            day(known_at), output,
        )  # fmt: skip
    if not sources or reference is not None or sigma is not None:
        raise ConfigError(
            "there is nothing to compare" if not sources else "an option of --laboratories alone",
            where="compare", got="no tests" if not sources else "--reference or --sigma",
            expected="two tests or more, or --laboratories FILE", next_step="see 'toolkit compare --help'",
            rule="usage",
        )  # fmt: skip
    basis = place.basis(known_at=known_at, draft=draft, protocol=protocol, reader=reader)
    style = unit_choice(units or "SI")
    opened = document_template(template, out, default="comparison.docx", home=place.home)
    with output.progress("reading") as step:
        entries, findings = read_entries(sources, basis, axes=axes, step=step)
    comparison = compare(
        entries, mode=cast("Mode | None", mode), level=level, reproducibility=reproducibility
    )
    attention = [*findings, *comparison.findings]
    compared = Compared(comparison=comparison, findings=attention, issued=day(known_at) or date.today())  # noqa: DTZ011
    drawn, document = write_comparison(
        compared, style, figures=figures, opened=opened, out=out, units=None if units is None else style
    )
    payload = compare_answer(comparison, attention, drawn, document, output.timing)
    text = f"{comparison_text(compared, style, drawn)}\n{document_text(payload['document'])}".rstrip("\n")
    output.answer(payload, text)
    return 1 if document is not None and document.warnings else exit_code(attention)


def _laboratories(
    path: Path,
    reference: str | None,
    sigma: float | None,
    figures: Path | None,
    out: Path | None,
    opened: Template | None,
    known_at: date | None,
    output: Output,
) -> int:
    from toolkit.lab.tire_tests.compare import laboratories_answer

    payload, text, findings = laboratories_answer(
        path, reference=reference, sigma=sigma, figures=figures, opened=opened, out=out,
        issued=known_at or date.today(),  # noqa: DTZ011
    )  # fmt: skip
    output.answer(payload, text)
    warned = bool((payload["document"] or {}).get("warnings"))
    return max(int(warned), exit_code(findings))
