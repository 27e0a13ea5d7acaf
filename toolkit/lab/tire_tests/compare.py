"""What is compared: tests and makers' tables read to one kind of entry; the figures and the document."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from datetime import date
    from pathlib import Path

    from toolkit.comparison.model import Comparison, Entry
    from toolkit.findings import Finding
    from toolkit.report.deliver import Delivered
    from toolkit.report.style import Style
    from toolkit.report.word.package import Template


def write_comparison(
    comparison: Comparison,
    style: Style,
    findings: Sequence[Finding],
    *,
    figures: Path | None,
    opened: Template | None,
    out: Path | None,
    known_at: date | None,
    units: Style | None,
) -> tuple[dict[str, Path], Delivered | None]:
    """Write the figures and deliver the document, what is asked for of both; return them.

    ``style`` is that of the figures, ``units`` those of the document where they are not its template's.
    """
    from toolkit.publication import publication

    with ExitStack() as together:
        drawn = {}
        if figures is not None:
            drawn = _write_figures(comparison, style, together.enter_context(publication(figures)), figures)
        if opened is None or out is None:
            return drawn, None
        stage = together.enter_context(publication(out))
        return drawn, _deliver(comparison, opened, out, stage, findings, known_at, units)


def _deliver(
    comparison: Comparison,
    opened: Template,
    out: Path,
    stage: Path,
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
    content = build_comparison_content(comparison, style, findings, issued=known_at or date.today())  # noqa: DTZ011
    return deliver(opened, content, out, name="comparison", stage=stage)


def read_entries(sources: Sequence[Path], *, axes: str, **options: Any) -> tuple[list[Entry], list[Finding]]:
    """Return what is compared, tests first read so that tables are read at their slip angles."""
    from toolkit.comparison.compare import DEFAULT_ANGLES

    entries: dict[int, Entry] = {}
    findings: list[Finding] = []
    tables = [i for i, path in enumerate(sources) if path.suffix.lower() == ".csv" and not path.is_dir()]
    for place, path in enumerate(sources):
        if place not in tables:
            entries[place], own_findings = _test(path, **options)
            findings += own_findings
    angles = sorted(
        {row.SA_rad for entry in entries.values() for row in entry.rows if row.SA_rad is not None}
    ) or list(DEFAULT_ANGLES)
    for place in tables:
        entries[place], own_findings = _table(sources[place], axes=axes, angles=angles)
        findings += own_findings
    return [entries[place] for place in range(len(sources))], findings


def _test(path: Path, **options: Any) -> tuple[Entry, list[Finding]]:
    from dataclasses import replace

    from toolkit.comparison.compare import test_entry
    from toolkit.lab.tire_tests.resolve import resolve_test
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
