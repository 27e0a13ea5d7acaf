"""Every number of every page is one of a command's --json: whatever page there is, by its links alone."""

from __future__ import annotations

import contextlib
import html
import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.workbench.conftest import Served, filled, serving
from tests.workbench.test_home_page import command
from tests.workbench.test_page import ANSWER
from toolkit.cli.main import run
from toolkit.lab.laboratory import example, open_laboratory

Capture = pytest.CaptureFixture[str]
_FILE = re.compile(r"\.(xlsx|png|csv|json|js|css|docx|pdf|toml|txt)$")
PLANS = {"session": ("cell",), "interval": ("cell", "--tests", "100")}
"""Kinds of plans with what each is asked for; the numbers of every kind have a test of their own."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A home with something for every kind of page."""
    home = filled(tmp_path_factory.mktemp("numbers") / "lab")
    for unfinished in ("audit", "tests"):
        shutil.rmtree(home / unfinished)
    (home / "tests" / "few").mkdir(parents=True)
    shutil.copy(example("fig4_4"), home / "tests" / "few")
    (home / "tests" / "few" / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-31\n')
    open_laboratory(calibrations=home / "calibrations").audit_archive(
        home / "tests" / "few", out=home / "audits" / "one"
    )
    for kind, words in PLANS.items():
        said = io.StringIO()
        with contextlib.redirect_stdout(said), pytest.raises(SystemExit) as ended:
            run(["plan", kind, *words, "--home", str(home), "--out", str(home / "plans" / kind), "--json"])
        # The example was calibrated years ago: its next calibration is overdue, and the plan says so.
        assert ended.value.code == (1 if kind == "interval" else 0) or ended.value.code is None
        (home / f"plan-{kind}.json").write_text(said.getvalue())
    (home / "diagnoses" / "cell").mkdir(parents=True)
    (home / "diagnoses" / "cell" / "diagnosis.json").write_text(json.dumps(ANSWER))
    with serving(home) as bench:
        yield bench


def all_pages(bench: Served) -> dict[str, str]:
    """Return the text of every page and part that a link, or a place that fills itself, leads to."""
    pages: dict[str, str] = {}
    ahead = ["/"]
    while ahead:
        path = ahead.pop().partition("#")[0]
        if path in pages or _FILE.search(path.partition("?")[0]):
            continue
        answer = bench.page(path)
        assert answer.status == 200, path
        pages[path] = answer.body if "text/html" in answer.headers["content-type"] else ""
        links = map(html.unescape, re.findall(r'(?:href|hx-get)="([^"]+)"', pages[path]))
        ahead += [link.removeprefix(bench.place) for link in links if link.startswith(f"{bench.place}/")]
    return pages


def numbers(answer: Any) -> Iterator[float]:
    """Yield the numbers of an answer, and how many entries its lists have."""
    if isinstance(answer, bool) or answer is None or isinstance(answer, str):
        return
    if isinstance(answer, int | float):
        yield float(answer)
        return
    yield float(len(answer))
    for entry in answer.values() if isinstance(answer, dict) else answer:
        yield from numbers(entry)


def answers(home: Path, capsys: Capture) -> Iterator[Any]:
    """Yield what the commands answer about a home."""

    def ask(*words: object) -> dict[str, Any]:
        return command(capsys, *words, "--home", home)

    listed = ask("calibration", "list", "--all")
    yield listed
    yield ask("calibration", "due")
    for row in listed["records"]:
        yield ask("calibration", "show", row["id"], "--full")
        yield ask("calibration", "report", row["id"])
        yield ask("calibration", "budget", row["id"])
    for instrument in listed["heads"]:
        yield ask("calibration", "history", instrument)
        yield ask("calibration", "chart", instrument)
    yield ask("process", home / "tests" / "few")
    for kind in PLANS:  # what the command said as it made the plan: to plan takes long
        yield json.loads((home / f"plan-{kind}.json").read_text())
    lines = (home / "audits" / "one" / "audit.jsonl").read_text().splitlines()
    yield [json.loads(line) for line in lines]
    yield ANSWER


def strings(answer: Any) -> Iterator[str]:
    """Yield the texts of an answer."""
    if isinstance(answer, str):
        yield " ".join(answer.split())
    elif isinstance(answer, dict | list):
        for entry in answer.values() if isinstance(answer, dict) else answer:
            yield from strings(entry)


@pytest.fixture(scope="module")
def pages(whole: Served) -> dict[str, str]:
    """All pages of the home."""
    return all_pages(whole)


def test_every_number_of_every_page_is_one_of_the_commands(
    whole: Served, pages: dict[str, str], capsys: Capture
) -> None:
    told = list(answers(whole.home, capsys))
    known = {number for answer in told for number in numbers(answer)}
    shown = {
        path: [float(html.unescape(value)) for value in re.findall(r'<data value="([^"]*)"', body)]
        for path, body in pages.items()
    }
    assert sum(map(len, shown.values())) > 3000
    strange = {path: [value for value in values if value not in known] for path, values in shown.items()}
    assert {path: values for path, values in strange.items() if values} == {}
    # What else has decimals on a page stands so in a text of an answer, or in the statements of a form.
    texts = "\n".join(text for answer in told for text in strings(answer))
    for path, body in pages.items():
        plain = re.sub(r"(?s)<(data|code|pre|textarea|title|script|small|svg)\b[^>]*>.*?</\1>", " ", body)
        words = html.unescape(re.sub(r"(?s)<[^>]*>", " ", plain)).split()
        decimals = [word for word in words if re.search(r"\d[.,]\d", word)]
        assert [word for word in decimals if word not in texts] == [], path
