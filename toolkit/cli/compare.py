"""`toolkit compare`: tests against each other, or against a maker's table."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from toolkit.cli.console import (
    Calibrations,
    Draft,
    Home,
    Json,
    KnownAt,
    ProtocolFile,
    Quiet,
    Reader,
    answer,
    day,
    exit_code,
    progress,
)
from toolkit.cli.console import reader as choose_reader
from toolkit.cli.delivery import delivered_payload, home_template

if TYPE_CHECKING:
    from datetime import date

    from toolkit.comparison.model import Comparison, Entry, Mode
    from toolkit.findings import Finding
    from toolkit.report.deliver import Delivered
    from toolkit.report.style import Style
    from toolkit.report.word.package import Template

NAME = "compare"


def command(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B ...",
            help="Tests (folders or reduced .xlsx) and makers' tables (.csv); A is the reference.",
        ),
    ],
    mode: Annotated[
        str | None,
        typer.Option("--mode", help="table, surfaces, tires or repeats; default: by what the tests state."),
    ] = None,
    axes: Annotated[
        str, typer.Option("--axes", help="Axes of the tables: SAE, adapted-SAE, ISO-W, machine.")
    ] = "SAE",
    level: Annotated[
        float, typer.Option("--level", help="Chance of even one false decision in a table (Holm).")
    ] = 0.05,
    reproducibility: Annotated[
        bool,
        typer.Option("--reproducibility", help="Demand it: an error without another laboratory's tests."),
    ] = False,
    units: Annotated[
        str | None,
        typer.Option(
            "--units",
            help="SI or lbf, for people: text, figures, document. Default: SI; in the document the style "
            "file's. The JSON answer is always in SI.",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", help="Folder for the figures (PNG), as the thesis's 6.6 to 6.29."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for comparison.docx and its verified comparison.pdf.")
    ] = None,
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template of --out; default: report_templates/comparison.docx."),
    ] = None,
    protocol: ProtocolFile = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    reader: Reader = "calamine",
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Compare tests with each other, or with a maker's table.

    Differences from the first, each with its uncertainty: what tests share (one calibration record, the
    load cell) cancels. Which are significant is decided over the whole table. Repeats of one tire give
    repeatability and intermediate precision by day, operator, mounting.

    A maker's table holds forces (SA [deg],FZ [N],FY [N],MZ [N*m]) or characteristics (FZ [N],conicity [N],
    U_conicity [N],plysteer [N],secant_cornering [N/deg],...).

    Ends with 0 whether or not there are differences: they are results. 1: the data has findings.

    Example: toolkit compare tests/steel tests/sandpaper --figures figures
    """
    from toolkit.cli.compare_answer import comparison_payload, comparison_text
    from toolkit.cli.units import unit_choice
    from toolkit.comparison.compare import compare

    chosen = choose_reader(reader)
    style = unit_choice(units or "SI")
    started = time.perf_counter()
    opened = _template(template, out, home)
    with progress(None, "reading", show=not (json or quiet)) as step:
        entries, findings = read_entries(
            sources, axes=axes, protocol=protocol, known_at=day(known_at), calibrations=calibrations,
            home=home, draft=draft, reader=chosen, step=step,
        )  # fmt: skip
    found = compare(entries, mode=cast("Mode | None", mode), level=level, reproducibility=reproducibility)
    drawn = _draw(found, style, figures) if figures else {}
    every = [*findings, *found.findings]
    made = (
        None
        if opened is None or out is None
        else _document(found, opened, out, every, day(known_at), None if units is None else style)
    )
    payload: dict[str, Any] = comparison_payload(found) | {
        "figures": drawn,
        "document": None if made is None else delivered_payload(made),
        "findings": [finding.as_dict() for finding in every],
        "timing": {"seconds": time.perf_counter() - started},
    }
    text = comparison_text(found, style, every, drawn)
    if made is not None:
        text += f"\n\n{made.pdf}\n{made.docx}\n{made.pages} pages, verified"
        text += "".join(f"\n  warning {one}" for one in made.warnings)
    answer(payload, text, as_json=json, quiet=quiet)
    return 1 if made is not None and made.warnings else exit_code(every)


def _template(template: Path | None, out: Path | None, home: Path | None) -> Template | None:
    """Return the template of a comparison's document, judged before anything is read; None without one."""
    from toolkit.errors import ConfigError
    from toolkit.report.word.package import read_template

    if out is None:
        if template is not None:
            raise ConfigError(
                "a template needs a folder for what it makes", where="--template", got=template,
                expected="--out DIR beside it", next_step="add --out DIR", rule="template-without-out",
            )  # fmt: skip
        return None
    return read_template(template or home_template("comparison.docx", home))


def _document(
    found: Comparison,
    opened: Template,
    out: Path,
    findings: Sequence[Finding],
    known_at: date | None,
    units: Style | None,
) -> Delivered:
    from datetime import date

    from toolkit.report.comparison.content import build_comparison_content
    from toolkit.report.deliver import deliver
    from toolkit.report.style import read_style, style_file

    style = read_style(style_file(opened.path))
    if units is not None:
        style = style.in_units_of(units)
    content = build_comparison_content(found, style, findings, issued=known_at or date.today())  # noqa: DTZ011
    return deliver(opened, content, out, name="comparison")


def read_entries(sources: Sequence[Path], *, axes: str, **options: Any) -> tuple[list[Entry], list[Finding]]:
    """Return what is compared, tests first read so that tables are read at their slip angles."""
    from toolkit.comparison.compare import DEFAULT_ANGLES

    found: dict[int, Entry] = {}
    findings: list[Finding] = []
    tables = [i for i, path in enumerate(sources) if path.suffix.lower() == ".csv" and not path.is_dir()]
    for place, path in enumerate(sources):
        if place not in tables:
            found[place], more = _test(path, **options)
            findings += more
    angles = sorted(
        {row.SA_rad for one in found.values() for row in one.rows if row.SA_rad is not None}
    ) or list(DEFAULT_ANGLES)
    for place in tables:
        found[place], more = _table(sources[place], axes=axes, angles=angles)
        findings += more
    return [found[place] for place in range(len(sources))], findings


def _test(path: Path, **options: Any) -> tuple[Entry, list[Finding]]:
    from dataclasses import replace

    from toolkit.cli.resolve import resolve_test
    from toolkit.comparison.compare import test_entry
    from toolkit.machine import load_machine

    resolved = resolve_test(path, **options)
    reduced = resolved.result.reduced
    entry = test_entry(
        reduced,
        resolved.result.characteristics,
        machine=load_machine(reduced.info.machine),
        record=resolved.record,
        source=str(path),
    )
    return entry, [replace(one, where=f"{entry.label}: {one.where}") for one in resolved.findings]


def _table(path: Path, *, axes: str, angles: Sequence[float]) -> tuple[Entry, list[Finding]]:
    import hashlib

    from toolkit.comparison.maker_characteristics import is_characteristics_table, maker_characteristics
    from toolkit.comparison.maker_table import maker_rows
    from toolkit.comparison.model import Entry

    if path.is_file() and is_characteristics_table(path):
        identity = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
        rows = maker_characteristics(path, identity=identity)
        return Entry(
            label=path.stem, kind="characteristics", identity=identity, source=str(path), rows=rows
        ), []
    identity = hashlib.sha256(path.read_bytes()).hexdigest()[:12] if path.is_file() else ""
    read, findings = maker_rows(path, axes=axes, angles_rad=angles, identity=identity)
    return Entry(label=path.stem, kind="table", identity=identity, source=str(path), rows=read), list(
        findings
    )


def _draw(found: Comparison, style: Style, folder: Path) -> dict[str, Path]:
    from toolkit.files import write_atomic
    from toolkit.report.comparison.plots import comparison_plots
    from toolkit.report.figures import draw

    drawn = {}
    for name, plot in comparison_plots(found, style).items():
        path = folder / f"{name}.png"
        write_atomic(path, draw(plot).png)
        drawn[name] = path
    return drawn
