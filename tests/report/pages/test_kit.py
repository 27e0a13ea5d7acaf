"""The page kit: what is put into a page stays text, only the page's own script runs, nothing is requested."""

from __future__ import annotations

import ast
import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import jinja2
import pytest

import proof
import toolkit
from tests.house.source import read_module, read_package
from toolkit.report.audit.svg import Drawing
from toolkit.report.pages.kit import Column, Figure, Table, environment, facts, page_parts, quantity, table

TOOLKIT = Path(toolkit.__file__).parent
PROOF = Path(proof.__file__).parent
PAGES = sorted(path.parent for folder in (TOOLKIT, PROOF) for path in folder.rglob("page.html.j2"))
HOSTILE = (
    "<script>alert(1)</script>", "</script><img src=x onerror=alert(1)>", "\" onload='x' y=\"", "{{ 7 * 7 }}",
    "\u202eright to left \u05e9\u05dc\u05d5\u05dd", "tire \U0001f6de", "a & b &amp; c", "javascript:alert(1)",
)  # fmt: skip

TEMPLATE = """{% extends "base.html.j2" %}
{% from "parts.html.j2" import bullets, figure, mark, table %}
{% block title %}{{ name }}{% endblock %}
{% block content %}
{{ mark(name) }}<h1 title="{{ name }}">{{ name }}</h1>
{{ table(cells) }}{{ bullets([name]) }}{{ figure(drawn) }}{{ picture }}
{% endblock %}
{% block data %}<script type="application/json" id="data">{{ [name]|tojson }}</script>{% endblock %}
"""


class Elements(HTMLParser):
    """The elements of a page with their attributes, and its texts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "page.html.j2").write_text(TEMPLATE, encoding="utf-8")
    (tmp_path / "page.css").write_text("h1 { color: var(--ink); }\n", encoding="utf-8")
    (tmp_path / "page.js").write_text('"use strict";\n', encoding="utf-8")
    return tmp_path


def drawing_of(name: str) -> Drawing:
    drawing = Drawing(width=100, height=50, label=name)
    drawing.text((0, 0), "start", name, (name, "file"), name)
    drawing.bar((0, 0), (5, 5), "force", title=name)
    drawing.dot((1, 1), 2, "dot", title=name, grade=name)
    return drawing


def page_of(folder: Path, name: str) -> str:
    cells = table(["text", name], [[name, 1.5]], numbers=(1,))
    drawn = Figure(svg=b"<svg xmlns='http://www.w3.org/2000/svg'/>", alt=name)
    parts = page_parts(folder, name=name, cells=cells, drawn=drawn, picture=drawing_of(name).markup())
    return "".join(parts)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_stays_text_wherever_it_stands(folder, name):
    harmless, page = Elements(page_of(folder, "harmless")), Elements(page_of(folder, name))
    # The same elements with the same attributes: a name adds none, and ends none.
    shape = [(tag, sorted(attributes)) for tag, attributes in page.elements]
    assert shape == [(tag, sorted(attributes)) for tag, attributes in harmless.elements]
    assert not [key for _, attributes in page.elements for key in attributes if key.startswith("on")]
    assert next(attributes["title"] for tag, attributes in page.elements if tag == "h1") == name
    assert page.texts.count(name) == harmless.texts.count("harmless")


def test_the_policy_names_the_pages_own_style_and_script_and_nothing_else(folder):
    text = page_of(folder, "x")
    page = Elements(text)
    policy = next(
        a["content"] for tag, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"
    )
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    for element, rule in (("style", "style-src"), ("script", "script-src")):
        content = re.findall(rf"<{element}>(.*?)</{element}>", text, re.S)
        digest = base64.b64encode(hashlib.sha256(content[0].encode()).digest()).decode()
        assert rules.pop(rule) == f"'sha256-{digest}'"
        assert len(content) == 1
    assert rules == {
        "default-src": "'none'", "img-src": "data:", "base-uri": "'none'", "form-action": "'none'",
    }  # fmt: skip
    assert policy in text.replace("&#39;", "'").split("<title>")[0]  # it stands before all that it governs


def test_a_page_without_a_script_allows_none(folder):
    (folder / "page.js").unlink()
    text = page_of(folder, "x")
    assert "script-src &#39;none&#39;" in text
    assert "<script>" not in text


def test_what_a_template_asks_for_must_be_there(folder):
    with pytest.raises(jinja2.UndefinedError, match="cells"):
        "".join(page_parts(folder, name="x"))


def test_rows_are_written_while_they_are_read(tmp_path):
    (tmp_path / "page.html.j2").write_text(
        '{% extends "base.html.j2" %}{% block title %}t{% endblock %}'
        "{% block content %}{% for row in rows %}{{ row }}{% endfor %}{% endblock %}",
        encoding="utf-8",
    )
    read = []
    parts = page_parts(tmp_path, rows=(read.append(i) or f"row {i}" for i in range(1000)))
    assert next(part for part in parts if "row 0" in part)
    assert len(read) < 5


def test_a_table_sets_its_columns_by_their_kind(folder):
    cells = Table(
        columns=(Column(title="test"), Column(title="date", kind="date"), Column(title="FY", kind="number")),
        rows=[("a", "2021-01-01", "1.50")],
    )
    assert cells == table(["test", "date", "FY"], cells.rows, numbers=(2,), dates=(1,))
    parts = environment(folder).get_template("parts.html.j2").module
    shown = str(parts.table(cells))
    assert '<td>a</td><td class="d">2021-01-01</td><td class="n">1.50</td>' in shown
    # It scrolls by itself where it is wider than the window.
    assert '<div class="wide"><table>' in shown
    assert '<div class="scroll"><table>' in str(parts.table(cells, scroll=True))


def test_facts_for_a_notebook_are_texts():
    shown = facts("Record", {"id": "<b>m15</b>", "reason": ""})
    assert "<b>" not in shown
    assert "&lt;b&gt;m15&lt;/b&gt;" in shown
    assert "reason" not in shown


def test_a_quantity_keeps_its_unit_on_the_line():
    assert quantity(0.05, ".2f", "N·m") == "0.05\u00a0N·m"
    assert quantity(3.0, ".1f", "") == "3.0"


def test_a_drawing_is_well_formed_and_keeps_its_texts():
    name = "<&\"'>"
    drawn = ET.fromstring(str(drawing_of(name).markup()))  # noqa: S314  our own
    assert drawn.get("aria-label") == name
    assert "".join(drawn.find("text").itertext()) == 3 * name
    assert drawn.find("circle").get("data-grade") == name


def test_a_style_is_safe_in_the_dark_and_on_paper():
    for folder in (TOOLKIT / "report" / "pages", *PAGES):
        style = (folder / "page.css").read_text(encoding="utf-8")
        assert not re.search(r"url\(|@import|://", style)
        # Ink and paper are variables that the dark scheme sets too; a literal colour would stay behind.
        rules = re.sub(r"--[\w-]+: #[0-9a-f]+;", "", style)
        assert set(re.findall(r"#[0-9a-f]{3,6}\b(?!\s*[{.])", rules)) <= {"#ffffff", "#999999"}
    base = (TOOLKIT / "report" / "pages" / "page.css").read_text(encoding="utf-8")
    light, dark = (
        dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6});", block))
        for block in re.findall(r":root \{(.*?)\}", base, re.S)
    )
    assert light.keys() == dark.keys()
    assert contrast(light["--ink"], light["--paper"]) > 7
    assert contrast(dark["--ink"], dark["--paper"]) > 7
    for name in ("--soft", "--good", "--bad", "--accent"):
        assert contrast(light[name], light["--paper"]) > 4.5
        assert contrast(dark[name], dark["--paper"]) > 4.5
    assert "@media print" in base
    assert "@media screen and (prefers-color-scheme: dark)" in base  # paper is white


def contrast(ink: str, paper: str) -> float:
    """Return the contrast ratio of WCAG 2.2, 1.4.3."""

    def luminance(colour: str) -> float:
        values = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(ink), luminance(paper)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_no_template_switches_escaping_off_or_acts_by_an_attribute():
    assert len(PAGES) == 3
    templates = [path for folder in (TOOLKIT, PROOF) for path in folder.rglob("*.j2")]
    for path in templates:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\|\s*safe\b|autoescape|\bstyle=|\bon\w+=", text), path
        # An address comes from the program, or is a place of the page itself.
        assert not re.search(r"\b(?:src|href)=\"(?!\{\{|#|data:,)", text), path


def test_no_module_writes_html_by_string():
    tag = re.compile(
        r"</(?:table|tr|td|th|p|ul|li|details|section)>|</?(?:html|head|body|div|span|h[1-6]|svg)\b"
    )
    for module in [*read_package(), read_module(PROOF / "page.py")]:
        texts = [
            node.value
            for node in module.nodes
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        ]
        assert not [text for text in texts if tag.search(text)], module.path
        if module.path.parent.name != "pages":
            assert "Markup(" not in module.text, module.path
