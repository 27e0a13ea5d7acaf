"""A figure as a chart of Word's own: what the chart shows, what its workbook holds, and that both agree."""

from __future__ import annotations

import dataclasses
import datetime as dt
import io
import math
import re
import zipfile
from pathlib import Path

import openpyxl
import pytest
from lxml import etree
from openpyxl.chart.chartspace import ChartSpace
from openpyxl.xml.functions import fromstring

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import opened, p, run, sdt
from toolkit.report.content import Curve, Plot
from toolkit.report.style import Style
from toolkit.report.test.content import REPORT, build_content
from toolkit.report.word.chart import chart_book, chart_texts, chart_xml
from toolkit.report.word.fill import fill
from toolkit.report.word.verify import verify_docx
from toolkit.report.word.xml import NS

C = f"{{{NS['c']}}}"
CONTENT = build_content(
    make_result(simulated=True), make_record(), style=Style(language="de", decimal_comma=True),
    issued=dt.date(2026, 11, 24),
)  # fmt: skip
CHARTS = sorted(set(CONTENT.plots) & REPORT.vocabulary.charts)


def plot(*curves: Curve, **more: object) -> Plot:
    base = Plot(name="it", x_label="x [m]", y_label="y [N]", curves=curves, caption="c.", alt="a.")
    return dataclasses.replace(base, **more)  # type: ignore[arg-type]


def numbers(reference: etree._Element) -> list[float | None]:
    """Return the cached numbers of a reference, None where a row has none."""
    cache = reference.find(f".//{C}numCache")
    found: list[float | None] = [None] * int(cache.find(f"{C}ptCount").get("val"))
    for point in cache.iter(f"{C}pt"):
        found[int(point.get("idx"))] = float(point.find(f"{C}v").text)
    return found


@pytest.mark.parametrize("name", CHARTS)
def test_a_chart_shows_the_curves_of_its_figure_and_word_finds_them_in_its_workbook(name: str) -> None:
    figure = CONTENT.plots[name]
    chart = etree.fromstring(chart_xml(figure, "de-DE"))
    book = openpyxl.load_workbook(io.BytesIO(chart_book(figure)))
    series = list(chart.iter(f"{C}ser"))
    assert len(series) == len(figure.curves)
    for curve, drawn in zip(figure.curves, series, strict=True):
        columns = [("xVal", curve.x), ("yVal", curve.y)]
        columns += [("errBars", curve.error)] if curve.error is not None and any(curve.error) else []
        for tag, values in columns:
            reference = drawn.find(f"{C}{tag}")
            cached = numbers(reference)
            assert cached[: len(values)] == list(values)
            assert set(cached[len(values) :]) <= {None}
            sheet, _, cells = reference.find(f".//{C}f").text.rpartition("!")
            held = [row[0].value for row in book[sheet.strip("'")][cells]]
            assert [v is None for v in held] == [v is None for v in cached]
            assert held[: len(values)] == pytest.approx(cached[: len(values)], rel=1e-14)
        sheet, _, cell = drawn.find(f"{C}tx//{C}f").text.rpartition("!")
        assert (book[sheet.strip("'")][cell].value or "") == (drawn.find(f"{C}tx//{C}v").text or "")
    titles = ["".join(title.itertext()) for title in chart.iter(f"{C}title")]
    assert titles == [figure.watermark, figure.x_label, figure.y_label]
    assert chart.find(f"{C}lang").get("val") == "de-DE"


@pytest.mark.parametrize("name", CHARTS)
def test_its_elements_are_those_of_the_schema_in_their_order(name: str) -> None:
    # openpyxl reads the relation to the workbook by another name than the schema's.
    data = re.sub(rb"<c:externalData.*</c:externalData>", b"", chart_xml(CONTENT.plots[name], "de-DE"))
    # openpyxl's reader knows each element and its values, and writes them in the order of the schema.
    again = ChartSpace.from_tree(fromstring(data)).to_tree()
    written = {(one.tag, tuple(child.tag for child in one)) for one in etree.fromstring(data).iter(f"{C}*")}
    for tag, children in written - {(f"{C}pt", (f"{C}v",))}:
        names = [child.rpartition("}")[2] for child in children]
        if tag == f"{C}errBars":  # openpyxl has its lengths the other way round
            assert names == "errDir errBarType errValType noEndCap plus minus spPr".split()
            continue
        orders = [[child.tag.rpartition("}")[2] for child in one] for one in again.iter(tag.removeprefix(C))]
        order = next((one for one in orders if set(one) >= set(names)), None)
        assert order is not None, (tag, names, orders)
        assert [one for one in dict.fromkeys(order) if one in names] == list(dict.fromkeys(names))


@pytest.mark.parametrize(("comma", "locale"), [(True, "407"), (False, "409")])
def test_its_numbers_have_the_decimal_sign_of_the_document(comma: bool, locale: str) -> None:
    data = chart_xml(plot(Curve(label="a", x=(0.0, 1.0), y=(0.0, 0.5)), decimal_comma=comma), "fr-FR")
    formats = [one.get("formatCode") for one in etree.fromstring(data).iter(f"{C}numFmt")]
    assert formats == [f"[$-{locale}]General"] * 2


def test_the_upright_axis_has_room_for_the_bars_of_uncertainty_and_begins_at_zero() -> None:
    curve = Curve(label="a", x=(1.0, 2.0), y=(3.0, 9.7), error=(1.0, 1.0))
    scaling = list(etree.fromstring(chart_xml(plot(curve), "en-US")).iter(f"{C}scaling"))[1]
    assert float(scaling.find(f"{C}min").get("val")) == 0.0
    assert float(scaling.find(f"{C}max").get("val")) >= 10.7
    below = dataclasses.replace(curve, y=(-3.0, -9.7))
    scaling = list(etree.fromstring(chart_xml(plot(below), "en-US")).iter(f"{C}scaling"))[1]
    assert float(scaling.find(f"{C}max").get("val")) == 0.0
    assert float(scaling.find(f"{C}min").get("val")) <= -10.7


def test_points_and_their_curve_share_an_entry_of_the_legend_and_grid_lines_have_none() -> None:
    figure = plot(
        Curve(label="4 kN", x=(0.0,), y=(1.0,)), Curve(label="4 kN", x=(0.0,), y=(1.0,), style="line"),
        Curve(label="", x=(0.0, 1.0), y=(1.0, 2.0), style="grid", note="+2°"), legend_title="load FZ",
    )  # fmt: skip
    chart = etree.fromstring(chart_xml(figure, "en-US"))
    hidden = [one.find(f"{C}idx").get("val") for one in chart.iter(f"{C}legendEntry")]
    assert hidden == ["1", "2"]
    assert chart_texts(figure) == ("x [m]", "y [N]", "load FZ: 4 kN")
    (label,) = chart.iter(f"{C}dLbl")
    assert label.find(f"{C}showSerName").get("val") == "1"
    assert [one.find(f"{C}tx//{C}v").text for one in chart.iter(f"{C}ser")][2] == "+2°"


def test_a_name_is_text_whatever_it_holds_and_what_is_no_number_is_left_blank() -> None:
    figure = plot(Curve(label='=A1&<b>"\x07', x=(0.0, 1.0), y=(math.nan, 2.0)), legend_title="x")
    chart = etree.fromstring(chart_xml(figure, "en-US"))
    assert chart.find(f".//{C}tx//{C}v").text == 'x: =A1&<b>"\\x07'
    assert numbers(chart.find(f".//{C}yVal")) == [None, 2.0]
    sheet = openpyxl.load_workbook(
        io.BytesIO(chart_book(dataclasses.replace(figure, legend_title=None)))
    ).active
    assert (sheet["B1"].value, sheet["B1"].data_type) == ('=A1&<b>"\\x07', "s")
    assert (sheet["B2"].value, sheet["B3"].value) == (None, 2)


def test_the_same_figure_is_the_same_bytes_on_any_day(monkeypatch: pytest.MonkeyPatch) -> None:
    figure = CONTENT.plots["gough"]
    first = chart_book(figure), chart_xml(figure, "de-DE")

    class Later(dt.datetime):
        @classmethod
        def now(cls, tz: dt.tzinfo | None = None) -> dt.datetime:
            return dt.datetime(2030, 1, 1, tzinfo=tz)

    monkeypatch.setattr("openpyxl.writer.excel.datetime.datetime", Later)
    monkeypatch.setattr("openpyxl.packaging.core.datetime.datetime", Later, raising=False)
    assert (chart_book(figure), chart_xml(figure, "de-DE")) == first


def test_a_chart_stands_in_a_line_and_in_the_control_of_a_picture(tmp_path: Path) -> None:
    body = p("see {{tk:chart.gough|width=120mm}} here") + p(sdt("tk:chart.crat", run("x"), "<w:picture/>"))
    result = fill(opened(tmp_path, body), CONTENT, {})
    assert all(check.ok for check in verify_docx(result))
    assert [tag for tag, _ in result.figures] == ["tk:chart.gough", "tk:chart.crat"]
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        document = archive.read("word/document.xml")
        parts = [name for name in archive.namelist() if "chart" in name]
        (relations, _) = sorted(name for name in parts if name.endswith(".rels"))
        target = re.search(rb'Target="([^"]+)"', archive.read(relations))
    assert len(parts) == 6  # chart, its relations and its workbook, of two figures
    assert target is not None
    assert target[1].endswith(b".xlsx")
    root = etree.fromstring(document)
    extents = [int(one.get("cx")) for one in root.iter(f"{{{NS['wp']}}}extent")]
    assert extents[0] == 120 * 36000
    assert [one.get("descr") for one in root.iter(f"{{{NS['wp']}}}docPr")] == [
        CONTENT.plots["gough"].alt, CONTENT.plots["crat"].alt,
    ]  # fmt: skip
    assert not list(root.iter(f"{{{NS['w']}}}picture"))  # Word holds nothing but a picture in such a control


def test_a_narrow_chart_has_small_texts_as_a_narrow_picture_has(tmp_path: Path) -> None:
    def size(width: str) -> int:
        result = fill(opened(tmp_path, p(f"{{{{tk:chart.gough|width={width}}}}}")), CONTENT, {})
        with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
            (chart,) = [name for name in archive.namelist() if re.fullmatch(r"word/charts/\w+\.xml", name)]
            root = etree.fromstring(archive.read(chart))
        return int(root.findall(f"{C}txPr//{{{NS['a']}}}defRPr")[0].get("sz"))

    # Nine points at the width of a drawn figure, 6.3 inches.
    assert size("140mm") == pytest.approx(900 * 140 / 160.02, rel=0.01)
    assert size("70mm") == pytest.approx(900 * 70 / 160.02, rel=0.01)
