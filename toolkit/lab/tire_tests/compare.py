"""What is compared: tests and makers' tables read to one kind of entry; the figures and the document.

So are the results of an interlaboratory comparison (`toolkit compare --laboratories`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError
from toolkit.lab.answers import Timing, document_table, document_text, findings_text
from toolkit.listing import one_line

if TYPE_CHECKING:
    from datetime import date
    from pathlib import Path

    from toolkit.comparison.laboratories import LaboratoryComparison, Measurand
    from toolkit.comparison.model import Comparison, Entry
    from toolkit.findings import Finding
    from toolkit.lab.tire_tests.compare_answer import LaboratoryKeys
    from toolkit.lab.tire_tests.resolve import Basis
    from toolkit.report.comparison.content import Compared
    from toolkit.report.deliver import Delivered
    from toolkit.report.laboratories.content import ComparedLaboratories
    from toolkit.report.style import Style
    from toolkit.report.word.package import Template


def write_comparison(
    compared: Compared,
    style: Style,
    *,
    figures: Path | None,
    opened: Template | None,
    out: Path | None,
    units: Style | None,
) -> tuple[dict[str, Path], Delivered | None]:
    """Write the figures and deliver the document, what is asked for of both; return them.

    ``style`` is that of the figures, ``units`` those of the document where they are not its template's.
    """
    from toolkit.publication import publication

    with ExitStack() as together:
        drawn = {}
        if figures is not None:
            drawn = _write_figures(
                compared.comparison, style, together.enter_context(publication(figures)), figures
            )
        if opened is None or out is None:
            return drawn, None
        stage = together.enter_context(publication(out))
        return drawn, _deliver(compared, opened, out, stage, units)


def _deliver(compared: Compared, opened: Template, out: Path, stage: Path, units: Style | None) -> Delivered:
    from toolkit.report.comparison.content import build_comparison_content
    from toolkit.report.deliver import deliver
    from toolkit.report.style import read_style, style_file

    style = read_style(style_file(opened.path))
    if units is not None:
        style = style.in_units_of(units)
    return deliver(opened, build_comparison_content(compared, style), out, name="comparison", stage=stage)


def read_entries(
    sources: Sequence[Path], basis: Basis, *, axes: str, step: Callable[[str], None]
) -> tuple[list[Entry], list[Finding]]:
    """Return what is compared, tests first read so that tables are read at their slip angles."""
    from toolkit.comparison.compare import DEFAULT_ANGLES

    entries: dict[int, Entry] = {}
    findings: list[Finding] = []
    tables = [i for i, path in enumerate(sources) if path.suffix.lower() == ".csv" and not path.is_dir()]
    for place, path in enumerate(sources):
        if place not in tables:
            entries[place], own_findings = _test(path, basis, step)
            findings += own_findings
    angles = sorted(
        {row.SA_rad for entry in entries.values() for row in entry.rows if row.SA_rad is not None}
    ) or list(DEFAULT_ANGLES)
    for place in tables:
        entries[place], own_findings = _table(sources[place], axes=axes, angles=angles)
        findings += own_findings
    return [entries[place] for place in range(len(sources))], findings


def _test(path: Path, basis: Basis, step: Callable[[str], None]) -> tuple[Entry, list[Finding]]:
    from dataclasses import replace

    from toolkit.comparison.compare import test_entry
    from toolkit.lab.tire_tests.resolve import resolve_test

    resolved = resolve_test(path, basis, step=step)
    reduced = resolved.result.reduced
    entry = test_entry(
        reduced,
        resolved.result.characteristics,
        machine=reduced.machine(),
        record=resolved.record,
        source=str(path),
    )
    return entry, [replace(finding, where=f"{entry.label}: {finding.where}") for finding in resolved.findings]


def _table(path: Path, *, axes: str, angles: Sequence[float]) -> tuple[Entry, list[Finding]]:
    from toolkit.comparison.maker_table import (
        is_characteristics_table,
        maker_characteristics,
        maker_conditions,
        maker_rows,
    )
    from toolkit.comparison.model import Entry
    from toolkit.files import sha256_file

    if path.is_file() and is_characteristics_table(path):
        identity = sha256_file(path)[:12]
        rows = maker_characteristics(path, identity=identity)
        return Entry(
            label=path.stem, kind="characteristics", identity=identity, source=str(path), rows=rows
        ), []
    identity = sha256_file(path)[:12] if path.is_file() else ""
    read, findings = maker_rows(path, axes=axes, angles_rad=angles, identity=identity)
    entry = Entry(
        label=path.stem, kind="table", identity=identity, source=str(path), rows=read,
        conditions=maker_conditions(path, axes=axes),
    )  # fmt: skip
    return entry, list(findings)


def _write_figures(comparison: Comparison, style: Style, stage: Path, folder: Path) -> dict[str, Path]:
    """Write the figures of a comparison; return their paths in their folder by name."""
    from toolkit.report.comparison.content import comparison_plots
    from toolkit.report.figures import draw

    drawn = {}
    for name, plot in comparison_plots(comparison, style).items():
        (stage / f"{name}.png").write_bytes(draw(plot).png)
        drawn[name] = folder / f"{name}.png"
    return drawn


DOCUMENT = "laboratories"
"""The name of the document's two files."""


def laboratories_answer(
    path: Path,
    *,
    reference: str | None,
    sigma: float | None,
    figures: Path | None,
    opened: Template | None = None,
    out: Path | None = None,
    issued: date,
) -> tuple[dict[str, Any], str, list[Finding]]:
    """Return the comparison of a file's laboratories as JSON and as text, with its findings.

    Figures go to ``figures``, the document by the template ``opened`` to ``out``, where they are given.

    Raises
    ------
    ToolkitError
        the file, the reference, sigma_pt or the template cannot be used; nothing is written
    """
    from toolkit.comparison.laboratories import compare_laboratories
    from toolkit.comparison.laboratory_file import read_laboratories
    from toolkit.declared import answer
    from toolkit.files import sha256_file
    from toolkit.lab.tire_tests.compare_answer import written_keys
    from toolkit.report.laboratories import content
    from toolkit.report.style import Style

    started = time.perf_counter()
    if sigma is not None and not (math.isfinite(sigma) and sigma > 0):
        raise ConfigError(
            "sigma_pt cannot be used", where="--sigma", got=sigma, expected="a finite number above 0",
            next_step="state it in the unit of the results", rule="laboratories",
        )  # fmt: skip
    reported, unit = read_laboratories(path)
    comparison = compare_laboratories(reported, unit=unit, reference=reference, sigma=sigma)
    compared = content.ComparedLaboratories(
        comparison=comparison, source=path.name, sha256=sha256_file(path), issued=issued
    )
    with ExitStack() as together:
        drawn = {} if figures is None else _figures(comparison, figures, together)
        document = None
        if opened is not None and out is not None:
            document = _document(compared, opened, out, together)
    timing: Timing = {"seconds": time.perf_counter() - started}
    keys: LaboratoryKeys = {
        "mode": "laboratories", "source": str(path), **written_keys(drawn, document, timing),
    }  # fmt: skip
    tables = (content.assigned, content.scores, content.consistency)
    texts = (document_table(declared, compared, Style()) for declared in tables)
    lines = [f"{text}\n" for text in texts if text]
    lines += [line for measurand in comparison.measurands for line in _precision_lines(measurand)]
    lines += [f"written: {one_line(file)}" for file in drawn.values()]
    lines += [text for text in (document_text(keys["document"]), findings_text(comparison.findings)) if text]
    return answer(comparison) | keys, "\n".join(lines), list(comparison.findings)


def _figures(comparison: LaboratoryComparison, folder: Path, together: ExitStack) -> dict[str, Path]:
    from toolkit.publication import publication
    from toolkit.report.figures import draw
    from toolkit.report.laboratories.content import laboratory_plots

    stage = together.enter_context(publication(folder))
    plots = laboratory_plots(comparison)
    for name, plot in plots.items():
        (stage / f"{name}.png").write_bytes(draw(plot).png)
    return {name: folder / f"{name}.png" for name in plots}


def _document(compared: ComparedLaboratories, opened: Template, out: Path, together: ExitStack) -> Delivered:
    from toolkit.publication import publication
    from toolkit.report.deliver import deliver
    from toolkit.report.laboratories.content import build_laboratories_content
    from toolkit.report.style import read_style, style_file

    content = build_laboratories_content(compared, read_style(style_file(opened.path)))
    stage = together.enter_context(publication(out))
    return deliver(opened, content, out, name=DOCUMENT, stage=stage)


def _precision_lines(measurand: Measurand) -> list[str]:
    p = measurand.precision
    if p is None:
        return []
    within = (
        "no repeats: no repeatability"
        if p.s_r is None
        else f"s_r = {p.s_r.value:.4g} ({p.s_r.low:.4g} to {p.s_r.high:.4g}), r = {p.r:.4g}"
    )
    return [
        f"{measurand.name} by ISO 5725-2, {p.laboratories} laboratories, {p.n} results, "
        f"mean {p.mean:.6g} {measurand.unit}: {within}, s_R = {p.s_R:.4g}, R = {p.R:.4g}",
        "",
    ]
