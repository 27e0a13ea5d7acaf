"""A report with 30 figures and 20 tables, made as a whole process: `python -m tests.benchmarks.full_report`.

A figure or table stands once in a body, and a test has eleven and thirteen: the others are copies under
names of their own, in a vocabulary made for the purpose.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

FIGURES, TABLES = 30, 20


def content(test: Path, home: Path) -> Any:
    """Return the content of a test with its figures and tables repeated."""
    from toolkit.lab.resolve import resolve_test
    from toolkit.report.build import build_content
    from toolkit.report.style import Style
    from toolkit.report.vocabulary import REPORT

    resolved = resolve_test(test, home=home)
    made = build_content(
        resolved.result, resolved.record, findings=resolved.findings, style=Style(laboratory="Bench")
    )
    plots = list(made.plots.values())
    filled = [table for table in made.tables.values() if table.rows]
    figures = {f"f{i}": plots[i % len(plots)] for i in range(FIGURES)}
    tables = {f"t{i}": filled[i % len(filled)] for i in range(TABLES)}
    vocabulary = dataclasses.replace(
        REPORT,
        figures=dict.fromkeys(figures, "a figure"),
        tables={name: ("a table", table.columns) for name, table in tables.items()},
        conditions={**REPORT.conditions, **dict.fromkeys(tables, "a table")},
    )
    return dataclasses.replace(
        made,
        # Each has data of its own, so that no picture serves twice.
        plots={
            name: dataclasses.replace(plot, name=name, x_label=f"{plot.x_label} ({name})")
            for name, plot in figures.items()
        },
        tables={name: dataclasses.replace(table, name=name) for name, table in tables.items()},
        conditions=made.conditions | dict.fromkeys(tables, True),
        vocabulary=vocabulary,
    )


def template(made: Any) -> bytes:
    """Return a template that asks for all of them, each with a numbered caption."""
    from toolkit.report.design.blocks import paragraph, run
    from toolkit.report.design.default import build_document
    from toolkit.report.design.pieces import contents

    def body(p: Any) -> list[str]:
        story = [contents("Contents"), paragraph(run("{{tk:calibration.hash}}"))]
        for name in made.plots:
            story += [
                paragraph(run(f"Figure {name}"), style="Heading1"),
                paragraph(p.picture(name, 150), style="Figure"),
                p.caption("Figure", run("a figure")),
            ]
        for name, table in made.tables.items():
            columns = [column.name for column in table.columns]
            widths = [166 / len(columns)] * len(columns)
            story.append(p.table(name, "a table", columns, columns, widths, "l" * len(columns)))
        return story

    return build_document(
        title="benchmark",
        body=body,
        header=lambda p: paragraph(p.inline("tk:simulated", "data"), style="Header"),
        footer=lambda p: paragraph(p.inline("tk:report.id", "id"), style="Footer"),
    )


def main() -> None:
    """Make the report: TEST HOME OUT."""
    from toolkit.report.deliver import deliver
    from toolkit.report.drawer import Drawer
    from toolkit.report.pdf import Office
    from toolkit.report.template.package import read_template

    test, home, out = map(Path, sys.argv[1:4])
    with Office() as office, Drawer() as drawer:
        made = content(test, home)
        path = out.with_suffix(".docx")
        path.write_bytes(template(made))
        done = deliver(read_template(path), made, out, office=office, drawer=drawer)
    assert len(done.filled.figures) == FIGURES
    print(f"{done.pages} pages")  # noqa: T201


if __name__ == "__main__":
    main()
