"""A test's page: its numbers are those of `process` and `audit`; nothing but an id leads to a folder."""

from __future__ import annotations

import csv
import html
import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.workbench.conftest import ROOT, Answer, Served, plain, serving
from tests.workbench.test_home_page import command
from toolkit.estimate import plus_minus
from toolkit.lab.desk.holdings import holding_id

Capture = pytest.CaptureFixture[str]
ONE, TWO = holding_id("tests/one"), holding_id("tests/two")


@pytest.fixture(scope="module")
def tested(tmp_path_factory: pytest.TempPathFactory, virtual_test: Path) -> Iterator[Served]:
    """A server of a home with two tests; the second lacks a recording."""
    home = tmp_path_factory.mktemp("tested") / "lab"
    shutil.copytree(ROOT / "calibrations", home / "calibrations")
    for name in ("one", "two"):
        shutil.copytree(virtual_test, home / "tests" / name)
    (home / "tests" / "two" / "FM_run_3.xlsx").unlink()
    with serving(home) as bench:
        yield bench


def curves(answer: Answer) -> list[dict[str, Any]]:
    drawn = re.findall(r'data-curves="([^"]*)"', answer.body)
    return [json.loads(html.unescape(one)) for one in drawn]


def test_the_list_names_every_test_with_its_state_and_finds_one(tested: Served) -> None:
    assert tested.page("/tests").status == 200
    windows = tested.page("/tests/windows")
    assert windows.data(count="tests") == ["2"]
    assert f"{tested.place}/tests/window/0?q=" in windows.body
    rows = tested.page("/tests/window/0?q=")
    assert [f'data-test="{one}"' in rows.body for one in (ONE, TWO)] == [True, True]
    assert plain(rows.body).count("no report 2026-03-17 m15-virtual 205/55R16") == 2
    assert tested.page("/tests/windows?q=TWO").data(count="tests") == ["1"]
    assert ONE not in tested.page("/tests/window/0?q=TWO").body


def test_points_are_those_of_process_with_U_of_the_whole_budget(tested: Served, capsys: Capture) -> None:
    answer = command(capsys, "process", tested.home / "tests" / "one", "--home", tested.home)
    FY, MZ, gough = curves(tested.page(f"/test/{ONE}/part/results"))
    used = [condition for condition in answer["conditions"] if condition["used"]]
    for chart, key, u in ((FY, "FY_common_N", "u_FY_N"), (MZ, "MZ_common_Nm", "u_MZ_Nm")):
        points = [
            (y, U) for s in chart["series"] if not s.get("line") for y, U in zip(s["y"], s["U"], strict=True)
        ]
        assert sorted(points) == sorted((c[key], 2.0 * c[u]) for c in used)
    points = [
        (x, y) for s in gough["series"] if not s.get("line") for x, y in zip(s["x"], s["y"], strict=True)
    ]
    assert sorted(points) == sorted((c["MZ_common_Nm"], c["FY_common_N"]) for c in used)
    assert {(s["condition"]["load"], s["condition"]["rotation"]) for s in FY["series"]} == {
        (load, rotation) for load in range(5) for rotation in ("forward", "reverse")
    }


def test_a_fitted_curve_passes_where_process_says_it_does(tested: Served, capsys: Capture) -> None:
    answer = command(capsys, "process", tested.home / "tests" / "one", "--home", tested.home)
    FY = curves(tested.page(f"/test/{ONE}/part/results"))[0]
    lines = {(s["condition"]["load_N"], s["condition"]["rotation"]): s for s in FY["series"] if s.get("line")}
    for row in answer["characteristics"]["at_angles"]:
        line = lines[row["load_N"], row["rotation"]]
        angle = row["SA_rad"] * 57.29577951308232
        if not line["x"][0] <= angle <= line["x"][-1]:
            continue
        after = next(at for at, x in enumerate(line["x"]) if x >= angle)
        ends = sorted(line["y"][max(after - 1, 0) : after + 1])
        assert ends[0] <= row["FY"]["value"] <= ends[-1]


def test_characteristics_have_the_values_and_U_of_process(tested: Served, capsys: Capture) -> None:
    answer = command(capsys, "process", tested.home / "tests" / "one", "--home", tested.home)
    page = tested.page(f"/test/{ONE}/part/results")
    values = {float(value) for value in page.data()}
    for group in ("stiffness", "pull", "at_angles"):
        for row in answer["characteristics"][group]:
            for entry in row.values():
                if isinstance(entry, dict):
                    assert {entry["value"], entry["expanded_uncertainty"], entry["k"]} <= values
                    # As everywhere where people read both: U in two digits, the value to its last place.
                    for printed in plus_minus(entry["value"], entry["expanded_uncertainty"]).split(" ± "):
                        assert f">{printed.replace('-', chr(0x2212))}</data>" in page.body


def test_recordings_say_what_the_audit_of_their_folder_says(tested: Served, capsys: Capture) -> None:
    audit = command(capsys, "audit", tested.home / "tests" / "one", "--home", tested.home)
    part = tested.page(f"/test/{ONE}/part/recordings")
    assert part.data() == [str(len(audit["files"])), *part.data()[1:]]
    for file in audit["files"]:
        values = [float(value) for value in part.data(file=file["path"])]
        assert file["repair"]["FY_max_abs_N"] in values
        assert {block["FY_change_N"] for block in file["conditions"]} <= set(values)
        assert f'data-grade="{file["grade"]}"' in part.body
    assert len(curves(part)) == 2 * len(audit["files"])


def test_a_finding_of_the_protocol_stands_on_the_page(tested: Served, capsys: Capture) -> None:
    answer = command(capsys, "process", tested.home / "tests" / "two", "--home", tested.home)
    part = tested.page(f"/test/{TWO}/part/results")
    rules = {finding["rule"] for finding in answer["findings"]}
    assert "missing" in rules
    assert {*re.findall(r'data-rule="([^"]+)"', part.body)} == rules
    shown = re.findall(r'data-rule="([^"]+)"><b class="\w+" data-level="(\w+)">', part.body)
    assert shown == [(finding["rule"], finding["level"]) for finding in answer["findings"]]


def test_what_is_shown_is_downloaded_and_the_reduced_test_whole(
    tested: Served, capsys: Capture, tmp_path: Path
) -> None:
    answer = command(capsys, "process", tested.home / "tests" / "one", "--home", tested.home)
    table = tested.page(f"/test/{ONE}/download/conditions.csv?load=0&load=4&rotation=reverse")
    assert "attachment" in table.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(table.body)))
    loads = sorted({c["step_FZ_N"] for c in answer["conditions"]})
    wanted = [
        c for c in answer["conditions"]
        if c["used"] and c["rotation"] == "reverse" and c["step_FZ_N"] in (loads[0], loads[4])
    ]  # fmt: skip
    assert [float(row["FY_N"]) for row in rows] == [c["FY_N"] for c in wanted]
    assert {row["calibration"] for row in rows} == {"m15-virtual-r1"}
    everything = list(
        csv.DictReader(io.StringIO(tested.page(f"/test/{ONE}/download/characteristics.csv").body))
    )
    conicity = next(row for row in everything if row["name"] == "conicity")
    assert float(conicity["value"]) == answer["characteristics"]["pull"][0]["conicity"]["value"]
    reduced = tested.page(f"/test/{ONE}/download/test.xlsx")
    assert reduced.status == 200
    (tmp_path / "test.xlsx").write_bytes(reduced.content)
    read_back = command(capsys, "process", tmp_path / "test.xlsx", "--home", tested.home)
    assert read_back["conditions"] == answer["conditions"]
    assert tested.page(f"/test/{ONE}/download/../../etc/passwd").status == 404
    assert tested.page(f"/test/{ONE}/download/notes.txt").status == 404


def test_two_tests_stand_beside_each_other_over_the_same_ranges(tested: Served) -> None:
    part = tested.page(f"/beside/part?left={ONE}&right={TWO}")
    assert part.status == 200
    drawn = curves(part)
    for left, right in zip(drawn[:3], drawn[3:], strict=True):
        assert (left["x_range"], left["y_range"]) == (right["x_range"], right["y_range"])
        assert left["series"] != right["series"]
    same = tested.page(f"/beside/part?left={ONE}&right={ONE}&right_record=m15-virtual-r1")
    assert curves(same)[:3] == curves(same)[3:]


def test_only_an_id_of_the_home_has_a_page(tested: Served) -> None:
    for path in ("/test/one", "/test/..%2F..", "/test/tests%2Fone", f"/test/{holding_id('calibrations')}"):
        assert tested.page(path).status == 404, path
    assert tested.page(f"/test/{ONE}?record=m15-r1").status == 404
    assert tested.page(f"/test/{ONE}/part/results?record=../x").status == 404
    assert tested.page(f"/test/{ONE}/part/nothing").status == 404
    assert tested.page(f"/beside?left={ONE}").status == 404


def test_a_test_that_cannot_be_read_says_why_at_its_place(tested: Served) -> None:
    folder = tested.home / "tests" / "broken"
    folder.mkdir()
    (folder / "test.toml").write_text('schema = 1\nmachin = "m15"\n')
    broken = holding_id("tests/broken")
    try:
        page = tested.page(f"/test/{broken}")
        assert (page.status, 'data-state="refused"' in page.body) == (200, True)
        part = tested.page(f"/test/{broken}/part/results", HX_Request="true")
        assert part.status == 400
        assert "machin" in part.body
    finally:
        shutil.rmtree(folder)
