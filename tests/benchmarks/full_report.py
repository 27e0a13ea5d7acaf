"""A report with 30 figures and 20 tables, made as a whole process: `python -m tests.benchmarks.full_report`.

REPORT_FIGURES=300 in the environment makes it as long. A figure or table stands once in a body; a test has
eleven and thirteen: the others are copies under names of their own, in a vocabulary made for the purpose.
"""

from __future__ import annotations

import dataclasses
import io
import os
import sys
from copy import deepcopy
from pathlib import Path
from typing import Any

FIGURES, TABLES = int(os.environ.get("REPORT_FIGURES", "30")), 20
TEMPLATES = Path(__file__).resolve().parents[2] / "report_templates"


def content(test: Path, home: Path) -> Any:
    """Return the content of a test with its figures and tables repeated."""
    from toolkit.lab.tire_tests.resolve import Basis, resolve_test
    from toolkit.report.style import Style
    from toolkit.report.test.content import REPORT, build_content
    from toolkit.report.vocabulary import TableEntry

    resolved = resolve_test(test, Basis(home=home))
    made = build_content(
        resolved.result, resolved.record, findings=resolved.findings, style=Style(laboratory="Bench")
    )
    plots = list(made.plots.values())
    filled = [table for table in made.tables.values() if table.rows]
    figures = {f"f{i}": plots[i % len(plots)] for i in range(FIGURES)}
    tables = {f"t{i}": filled[i % len(filled)] for i in range(TABLES)}
    vocabulary = dataclasses.replace(
        REPORT.vocabulary,
        figures=dict.fromkeys(figures, "a figure"),
        tables={name: TableEntry(description="a table", columns=t.columns) for name, t in tables.items()},
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
    """Return a template that asks for all of them: the blocks of org.docx, copied under other names."""
    import docx
    from docx.oxml.ns import qn

    document: Any = docx.Document(str(TEMPLATES / "org.docx"))
    body = document.element.body
    blocks = {
        tag.get(qn("w:val")): block
        for block in body.iter(qn("w:sdt"))
        if (tag := block.find(f"{qn('w:sdtPr')}/{qn('w:tag')}")) is not None
    }
    contents = next(
        block for block in body.iter(qn("w:sdt")) if next(block.iter(qn("w:docPartObj")), None) is not None
    )
    heading = next(
        block
        for block in body.iter(qn("w:p"))
        if block.find(f"{qn('w:pPr')}/{qn('w:pStyle')}[@{qn('w:val')}='Heading1']") is not None
    )
    story = [contents, _paragraph(document, "{{tk:calibration.hash}}")]
    for name in made.plots:
        title = deepcopy(heading)
        for text in title.iter(qn("w:t")):
            text.text = f"Figure {name}"
        picture, caption = _renamed(blocks["tk:if.fy_vs_slip"], "fy_vs_slip", name)
        words = next(caption.iter(qn("w:sdt")))
        words.addprevious(_paragraph(document, "a figure").find(qn("w:r")))
        caption.remove(words)
        story += [title, picture, caption]
    for name, table in made.tables.items():
        caption, grid, gap = _renamed(blocks["tk:if.files"], "files", name)
        columns = [column.name for column in table.columns]
        for row in grid.iter(qn("w:tr")):
            first, *others = row.findall(qn("w:tc"))
            for cell in others:
                row.remove(cell)
            for column in columns:
                row.append(_cell(first, column, 166 / len(columns)))
            row.remove(first)
        scale = next(grid.iter(qn("w:tblGrid")))
        for mark in list(scale):
            scale.remove(mark)
        for _ in columns:
            width = scale.makeelement(qn("w:gridCol"))
            width.set(qn("w:w"), str(round(166 / len(columns) * 1440 / 25.4)))
            scale.append(width)
        story += [caption, grid, gap]
    for element in list(body):
        if element.tag != qn("w:sectPr"):
            body.remove(element)
    for element in story:
        body.insert(len(body) - 1, element)
    stream = io.BytesIO()
    document.save(stream)
    return stream.getvalue()


def _paragraph(document: Any, text: str) -> Any:
    element = document.add_paragraph(text)._p
    element.getparent().remove(element)
    return element


def _renamed(block: Any, name: str, other: str) -> list[Any]:
    """Return copies of what a block holds, with the tags of one name under another one."""
    from docx.oxml.ns import qn

    copies = [deepcopy(child) for child in block.find(qn("w:sdtContent"))]
    for copy in copies:
        for tag in copy.iter(qn("w:tag")):
            family, _, rest = tag.get(qn("w:val")).rpartition(".")
            tag.set(qn("w:val"), f"{family}.{other}" if rest == name else tag.get(qn("w:val")))
    return copies


def _cell(pattern: Any, column: str, width_mm: float) -> Any:
    from docx.oxml.ns import qn

    cell = deepcopy(pattern)
    cell.find(f"{qn('w:tcPr')}/{qn('w:tcW')}").set(qn("w:w"), str(round(width_mm * 1440 / 25.4)))
    for tag in cell.iter(qn("w:tag")):
        tag.set(qn("w:val"), f"tk:row.{column}")
    for text in cell.iter(qn("w:t")):
        text.text = column
    return cell


def main() -> None:
    """Make the report: TEST HOME OUT."""
    from toolkit.report.deliver import deliver
    from toolkit.report.drawer import Drawer
    from toolkit.report.word.office import Office
    from toolkit.report.word.package import read_template

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
