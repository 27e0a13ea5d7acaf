"""A case by its page: built, changed field by field, tried isolated; from this computer alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.workbench.conftest import Answer, Served, serving
from tests.workbench.test_diagnosis_page import CASE_FILES
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.versions import version_of
from toolkit.lab.home import make_home

CASE = f"/case/{holding_id('cases/case-1')}"
FILES = dict(CASE_FILES)


def begun(bench: Served, kind: str = "python") -> Answer:
    files = [("recordings", name, FILES[name]) for name in ("r0.csv", "r1.csv")]
    return bench.upload("/case", [*files, ("own", "sim.py", FILES["sim.py"])], kind=kind)


def send(bench: Served, path: str, form: dict[str, str], **headers: str) -> Answer:
    """Send a change as the page of the case does that shows what is kept now."""
    version = version_of(bench.home / "cases" / "case-1")
    return bench.send(f"{CASE}{path}", {"version": version, **form}, **headers)


def state(bench: Served, key: str, text: str) -> Answer:
    return send(bench, "/state", {"key": key, "value": text}, HX_Request="true")


def test_a_change_of_an_older_version_is_refused_with_both_texts(tmp_path: Path) -> None:
    make_home(tmp_path / "home")
    with serving(tmp_path / "home") as bench:
        begun(bench)
        folder = bench.home / "cases" / "case-1"
        old = version_of(folder)
        assert f'name="version" value="{old}"' in bench.page(CASE).body
        kept = state(bench, "title", "AAA")
        assert f'name="version" value="{version_of(folder)}"' in kept.body
        text = (folder / "case.toml").read_bytes()
        for path, form in (
            ("/state", {"key": "title", "value": "BBB"}), ("/state", {"key": "simulation.path", "value": ""}),
            ("/change/add", {"table": "simulation.parameters", "name": "gain"}),
        ):  # fmt: skip
            refused = bench.send(f"{CASE}{path}", {"version": old, **form})
            assert (refused.status, "Nothing is lost" in refused.body) == (409, True)
            assert (folder / "case.toml").read_bytes() == text
        refused = bench.send(f"{CASE}/state", {"version": old, "key": "title", "value": "BBB"})
        assert "AAA" in refused.body
        assert "BBB" in refused.body
        again = send(bench, "/state", {"key": "title", "value": "BBB"})
        assert again.headers["location"] == f"{bench.place}{CASE}#"
        assert b"BBB" in (folder / "case.toml").read_bytes()


def test_a_case_is_begun_changed_and_tried(tmp_path: Path) -> None:
    make_home(tmp_path / "home")
    with serving(tmp_path / "home") as bench:
        answer = begun(bench)
        assert (answer.status, answer.headers["location"]) == (303, f"{bench.place}{CASE}#")
        assert CASE in bench.page("/diagnoses/list").body
        for column, role in (("L", "input"), ("F", "output")):
            added = send(bench, "/change/add", {"table": "recording.channels", "name": column})
            assert added.headers["location"] == f"{bench.place}{CASE}#recording.channels"
            for key, text in (("unit", "N"), ("role", role)):
                kept = state(bench, f"recording.channels.{column}.{key}", text)
                assert (kept.status, kept.headers["hx-trigger"]) == (200, "stated")
        # The simulation reads a parameter that nobody declared: told by its place, as the command tells it.
        refused = bench.send(f"{CASE}/trial", {}, HX_Request="true")
        assert (refused.status, "gain" in refused.body) == (400, True)
        send(bench, "/change/add", {"table": "simulation.parameters", "name": "gain"})
        for key, text in (("value", "1"), ("unit", "1")):
            state(bench, f"simulation.parameters.gain.{key}", text)
        tried = bench.send(f"{CASE}/trial", {})
        assert (tried.status, tried.body.count("data-curves=")) == (200, 4)
        other = state(bench, "simulation.kind", "ode")
        assert other.headers["hx-refresh"] == "true"


@pytest.mark.parametrize(("path", "form"), [
    ("/state", {"key": "simulation.path", "value": "/etc/passwd"}),
    ("/state", {"key": "recording.nothing", "value": "1"}),
    ("/change/add", {"table": "recording", "name": "x"}),
    ("/change/add", {"table": "recording.run", "name": "/etc/passwd"}),
    ("/change/drop", {"table": "simulation"}),
    ("/change/files", {}),
])  # fmt: skip
def test_what_cannot_be_is_told_and_changes_nothing(tmp_path: Path, path: str, form: dict[str, str]) -> None:
    make_home(tmp_path / "home")
    with serving(tmp_path / "home") as bench:
        begun(bench)
        text = (tmp_path / "home" / "cases" / "case-1" / "case.toml").read_bytes()
        answer = send(bench, path, form)
        assert (answer.status, 'role="alert"' in answer.body) == (400, True)
        assert (tmp_path / "home" / "cases" / "case-1" / "case.toml").read_bytes() == text


def test_a_case_that_lies_elsewhere_has_no_page_and_none_is_begun_badly(tmp_path: Path) -> None:
    make_home(tmp_path / "home")
    case = tmp_path / "home" / "work" / "cell"
    case.mkdir(parents=True)
    for name, data in CASE_FILES:
        (case / name).write_bytes(data)
    with serving(tmp_path / "home") as bench:
        assert bench.page(f"/case/{holding_id('work/cell')}").status == 404
        assert bench.page(f"/case/{holding_id('cases/case-9')}").status == 404
        assert begun(bench, "fortran").status == 400
        assert not (tmp_path / "home" / "cases" / "case-1").exists()
        assert begun(bench).status == 303
        assert send(bench, "/change/erase", {}).status == 404
