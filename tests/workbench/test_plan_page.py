"""Plans by their pages: each kind is made from its form, and shows the numbers of its command."""

from __future__ import annotations

import html
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests import commands
from tests.built_once import built_once
from tests.planning.class_factory import answer, found, write_case
from tests.planning.planning_factory import LOADS, earlier
from tests.workbench.conftest import Served, filled, plain, serving
from tests.workbench.test_app_numbers import numbers
from tests.workbench.test_home_page import command
from tests.workbench.test_jobs_page import done
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.errors import ConfigError, UnreadableError
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.kept_plans import fixtures_of, plan_words, read_plan
from toolkit.lab.plans import protocol_plan

ANSWER = holding_id("diagnoses/late")
FORMS: dict[str, dict[str, str]] = {
    "session": {"subject": "cell", "u": "", "minutes": "", "loads": "33", "criterion": "I"},
    "test": {"subject": "", "u": "slope_cornering", "load": "833 lbf, 4 kN", "minutes": ""},
    "next": {"subject": ANSWER, "budget": "20", "limit": ""},
    "interval": {"subject": "cell", "reliability": "0.9", "tests": "100"},
}
COMMANDS: dict[str, tuple[str, ...]] = {
    "session": ("cell", "--loads", "33", "--criterion", "I"),
    "test": ("--u", "slope_cornering", "--load", "833 lbf", "--load", "4 kN"),
    "interval": ("cell", "--reliability", "0.9", "--tests", "100"),
}


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Served, dict[str, str]]]:
    """A server of a home, in which each kind of plan was made from its form; ids by kind."""
    built = built_once(tmp_path_factory, "planned", _plan_all)
    home = tmp_path_factory.mktemp("planned") / "lab"
    shutil.copytree(built / "lab", home)
    with serving(home) as bench:
        yield bench, json.loads((built / "ids.json").read_text(encoding="utf-8"))


def _plan_all(folder: Path) -> None:
    """Make a home as `lab`, with a plan of each kind, and the ids of the plans as `ids.json`."""
    home = filled(folder / "lab")
    case = write_case(home / "cases" / "late")
    late = home / "diagnoses" / "late"
    late.mkdir(parents=True)
    leaves = answer(read_case(case).sha256, found("channel_delay", "filter_lag"))
    (late / "diagnosis.json").write_text(json.dumps({"schema": 1, **json_value(leaves)}), encoding="utf-8")
    (late / "model.toml").write_text('[answer]\ncase = "../../cases/late/CASE.toml"\n', encoding="utf-8")
    ids = {}
    ids["test"] = _planned_here(home)
    with serving(home) as bench:
        for kind, form in FORMS.items():
            if kind == "test":
                continue
            page = done(bench, bench.send(f"/plans/{kind}", form))
            link = re.search(r"/plan/([0-9a-f]{16})", page.body)
            assert link is not None, plain(page.body)
            ids[kind] = link[1]
    (folder / "ids.json").write_text(json.dumps(ids), encoding="utf-8")


def _planned_here(home: Path) -> str:
    """Make the plan that the form of a test asks for, of an earlier test of fewer loads; return its id.

    Its job would try every load of the virtual machine, which takes as long as all other plans together.
    """
    words = plan_words(home, "test", FORMS["test"], None, None)
    with pytest.MonkeyPatch.context() as patch:
        fewer_loads(patch)
        patch.chdir(home)
        ended = commands.said(*words)
    assert ended.code == 0, ended.err
    return holding_id(words[words.index("--out") + 1])


def fewer_loads(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(protocol_plan, "_virtual", lambda _order, _like: earlier(LOADS[1:4]))


def kept(bench: Served, plan_id: str) -> dict[str, Any]:
    answer = bench.page(f"/plan/{plan_id}/file/plan.json")
    assert answer.status == 200
    return dict(json.loads(answer.body))


@pytest.mark.parametrize("kind", [*FORMS])
def test_every_number_of_a_plan_is_one_of_its_answer(
    planned: tuple[Served, dict[str, str]], kind: str
) -> None:
    bench, ids = planned
    page = bench.page(f"/plan/{ids[kind]}")
    assert page.status == 200
    known = set(numbers(kept(bench, ids[kind])))
    shown = [float(html.unescape(value)) for value in re.findall(r'<data value="([^"]*)"', page.body)]
    assert len(shown) > 8
    assert [value for value in shown if value not in known] == []
    for text in kept(bench, ids[kind])["assumptions"]:
        assert " ".join(text.split()) in " ".join(html.unescape(plain(page.body)).split())


TWICE = pytest.mark.campaign("the longest plan a second time: what is kept of the others goes the same way")


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=TWICE) if kind == "test" else kind for kind in COMMANDS]
)
def test_a_kept_plan_is_what_the_command_answers(
    planned: tuple[Served, dict[str, str]],
    kind: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench, ids = planned
    if kind == "test":
        fewer_loads(monkeypatch)
    said = command(capsys, "plan", kind, *COMMANDS[kind], "--home", bench.home)
    for key in ("timing", "out", "files"):
        said.pop(key, None)
    assert kept(bench, ids[kind]) == {**said, "kind": kind}


def test_every_kind_is_listed_with_its_files(planned: tuple[Served, dict[str, str]]) -> None:
    bench, ids = planned
    listed = bench.page("/plans/list").body
    assert {*re.findall(r'data-plan="([0-9a-f]{16})"', listed)} == {*ids.values()}
    for kind, name in (("session", "SESSION.toml"), ("test", "protocol.toml"), ("next", "next.csv")):
        page = bench.page(f"/plan/{ids[kind]}")
        assert f"/file/{name}" in page.body
        file = bench.page(f"/plan/{ids[kind]}/file/{name}")
        assert file.status == 200
        assert file.headers["content-disposition"] == f'attachment; filename="{name}"'
        assert file.body == (bench.home / place_of(bench, ids[kind]) / name).read_text()
    assert "/file/next_F.png" in bench.page(f"/plan/{ids['next']}").body


def place_of(bench: Served, plan_id: str) -> str:
    number = next(n for n in range(1, 9) if holding_id(f"plans/plan-{n}") == plan_id)
    return f"plans/plan-{number}"


def test_a_page_speaks_german_and_so_do_what_it_assumes(planned: tuple[Served, dict[str, str]]) -> None:
    bench, ids = planned
    page = plain(bench.page(f"/plan/{ids['interval']}", Accept_Language="de").body)
    assert "Wann wieder kalibriert wird" in page
    assert "nichts bricht plötzlich" in page


def test_only_what_a_plan_writes_can_be_fetched(planned: tuple[Served, dict[str, str]]) -> None:
    bench, ids = planned
    (bench.home / place_of(bench, ids["session"]) / "secret.txt").write_text("x")
    for path in (
        f"/plan/{ids['session']}/file/secret.txt", f"/plan/{ids['session']}/file/protocol.toml",
        f"/plan/{ids['session']}/file/..%2F..%2Fcalibrations", f"/plan/{ids['interval']}/file/next_F.png",
        "/plan/plan-1", f"/plan/{holding_id('plans')}",
    ):  # fmt: skip
        assert bench.page(path).status == 404, path


def test_what_is_not_held_cannot_be_planned_for(planned: tuple[Served, dict[str, str]]) -> None:
    bench, _ = planned
    for kind, subject in (("session", "nobody"), ("test", "tests/a"), ("next", "x"), ("none", "cell")):
        assert bench.send(f"/plans/{kind}", {"subject": subject}).status == 404
    assert bench.send("/plans/interval", {"subject": ""}).status == 400


def test_what_somebody_types_is_never_an_option_of_its_own(tmp_path: Path) -> None:
    form = {"u": "--out=/etc, FY=1 N", "minutes": "--home", "criterion": "D", "seed": "9"}
    words = plan_words(tmp_path, "session", form, "cell", None)
    assert words == (
        "plan", "session", "cell", "--minutes=--home", "--criterion=D", "--u=--out=/etc", "--u=FY=1 N",
        "--out", "plans/plan-1", "--home", ".",
    )  # fmt: skip
    tread = {"sliding": "150", "rise": "20", "between_files": "45"}
    assert plan_words(tmp_path, "test", tread, None, None)[2:5] == (
        "--sliding=150", "--rise=20", "--between-files=45"
    )  # fmt: skip
    both = plan_words(tmp_path, "session", {"two_levels": "1"}, "cell", None, "fixtures/rig.toml")
    assert both[3:6] == ("--fixtures", "./fixtures/rig.toml", "--two-levels")
    assert "--two-levels" not in plan_words(tmp_path, "session", {"two_levels": ""}, "cell", None)
    (tmp_path / "plans" / "plan-7").mkdir(parents=True)
    assert "plans/plan-8" in plan_words(tmp_path, "test", {}, None, "plan.docx")
    with pytest.raises(ConfigError):
        plan_words(tmp_path, "interval", {}, None, None)


def test_a_home_has_the_fixtures_that_can_be_read(tmp_path: Path) -> None:
    text = 'instrument = "cell"\n[[fixture]]\nname = "pull"\nper_newton = { FY = 1.0 }\n'
    (tmp_path / "fixtures").mkdir()
    (tmp_path / "fixtures" / "rig.toml").write_text(text + 'weights = { value = [100], unit = "N" }\n')
    (tmp_path / "half.toml").write_text(text)
    assert fixtures_of(tmp_path) == {holding_id("fixtures/rig.toml"): "fixtures/rig.toml"}


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"kind": "session"}', '{"kind": "party"}', '{"kind": "interval", "days": 3}']
)
def test_a_plan_that_cannot_be_read_says_so(tmp_path: Path, text: str) -> None:
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(UnreadableError) as refused:
        read_plan(tmp_path)
    assert "plan.json" in str(refused.value)
