"""A session that is typed or dropped: kept, tried as `calibrate --dry-run`, entered as by `calibrate`."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

import pytest

from tests.cli.test_calibration_control import session
from tests.workbench.conftest import Answer, Served, plain
from tests.workbench.test_signing_page import People, people
from toolkit.calibration.registry.registry import Registry
from toolkit.cli.main import run as run_toolkit
from toolkit.errors import ConfigError
from toolkit.lab.desk.drafts import open_draft
from toolkit.lab.desk.versions import version_of

__all__ = ["people"]
Capture = pytest.CaptureFixture[str]


def files_of(path: Path) -> dict[str, bytes]:
    return {name: path.with_name(name).read_bytes() for name in (path.name, "loads.csv", "check.csv")}


def dropped(bench: Served, path: Path) -> str:
    """Drop the files of a session; return the id of its draft."""
    files = [("files", name, data) for name, data in files_of(path).items()]
    answer = bench.upload("/session", files, **{"from": "files"})
    assert answer.status == 303, plain(answer.body)
    return answer.headers["location"].rpartition("/")[2]


def typed(bench: Served, draft: str) -> dict[str, str]:
    """Return what the form of a draft holds."""
    content = open_draft(bench.home, draft)
    tables = {key: text or "" for key, text in content.grids.items()}
    return {"session": content.session, **tables, "version": content.version}


def kept(bench: Served, draft: str, content: dict[str, str]) -> Answer:
    """Keep what was typed, as the page does: the form knows the version from then on."""
    answer = bench.send(f"/session/{draft}/save", content, HX_Request="true")
    if answer.status == 200:
        content["version"] = json.loads(answer.body)["version"]
    return answer


def tried(bench: Served, draft: str, content: dict[str, str]) -> Answer:
    """Keep what was typed, then try the draft as it is kept."""
    assert kept(bench, draft, content).status == 200
    return bench.send(f"/session/{draft}/rehearse", {}, HX_Request="true")


def command(capsys: Capture, *words: object) -> dict[str, object]:
    capsys.readouterr()
    with pytest.raises(SystemExit):
        run_toolkit([*map(str, words), "--json"])
    answer: dict[str, object] = json.loads(capsys.readouterr().out)
    return answer


def registry_files(home: Path) -> dict[str, bytes]:
    folder = home / "calibrations" / "cell"
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.is_file() and path.name not in ("ledger.jsonl", "head.json")
    }


def test_dropped_files_are_entered_with_the_bytes_that_the_command_enters(
    own: Served, tmp_path: Path, capsys: Capture
) -> None:
    path = session(tmp_path / "new", 2025, 0.1)
    shutil.copytree(own.home, tmp_path / "other")
    draft = dropped(own, path)
    for name, data in files_of(path).items():
        assert (own.home / "drafts" / draft / name).read_bytes() == data
    done = own.send(f"/session/{draft}/enter", typed(own, draft))
    assert (done.status, done.headers["location"]) == (303, f"{own.place}/record/cell-r8")
    by_command = command(capsys, "calibrate", path, "--home", tmp_path / "other")
    assert by_command["record"]["id"] == "cell-r8"  # type: ignore[index]
    assert registry_files(own.home) == registry_files(tmp_path / "other")
    assert not (own.home / "drafts" / draft).exists()
    assert (own.home / "sessions" / "cell-r8" / "loads.csv").read_bytes() == path.with_name(
        "loads.csv"
    ).read_bytes()
    # Whoever still has its page open is told where it is now.
    gone = own.page(f"/session/{draft}")
    assert (gone.status, "entered as cell-r8" in plain(gone.body)) == (410, True)
    assert "/record/cell-r8" in gone.body


def test_what_is_tried_is_what_the_dry_run_says(own: Served, tmp_path: Path, capsys: Capture) -> None:
    path = session(tmp_path / "new", 2025, 0.8)
    before = registry_files(own.home)
    draft = dropped(own, path)
    part = tried(own, draft, typed(own, draft))
    assert part.status == 200
    dry = command(capsys, "calibrate", path, "--home", own.home, "--dry-run", "--full")
    assert 'data-record="cell-r8"' in part.body
    for finding in dry["findings"]:  # type: ignore[attr-defined]
        assert finding["message"] in plain(part.body).replace("&#39;", "'").replace("&#34;", '"')
    fit = dry["loads"]["FY"]["report"]  # type: ignore[index]
    values = [float(value) for value in part.data(load="FY")]
    for term in fit["coefficients"].values():
        assert {term["value"], term["standard_error"]} <= set(values)
    assert set(fit["rows"]["residual"]) <= set(values)
    assert set(fit["rows"]["cook"]) <= set(values)
    for name in ("gates", "responses", "fit", "budget", "as_found"):
        assert f'data-part="{name}"' in part.body
    assert "compared with cell-r1" in plain(part.body).lower()
    assert registry_files(own.home) == before, "a dry run makes nothing"


def test_rows_pasted_with_tabs_and_decimal_commas_are_read(own: Served, tmp_path: Path) -> None:
    path = session(tmp_path / "new", 2025, 0.0)
    answer = own.send("/session", {"instrument": "cell", "date": "2025-03-01", "operator": "A"})
    draft = answer.headers["location"].rpartition("/")[2]
    content = typed(own, draft)
    assert content["data"] == "S [mV/V]\tFY [N]\trun\tdirection\n"
    assert "polarity" not in content["session"], "a reading of the last session is none of this one"
    rows = path.with_name("loads.csv").read_text().splitlines()[1:]
    pasted = [row.replace(",", "\t").replace(".", ",") for row in rows]
    content["data"] += "\r\n".join(pasted) + "\r\n"
    assert "check" not in content["session"]
    content["session"] += '[[polarity]]\nload = "FY"\nvalue = { value = 500, unit = "N" }\n'
    content["session"] += 'indications = { S = { value = 1.01, unit = "mV/V" } }\n'
    content["check"] = "S [mV/V]\tFY [N]\n0,9\t450\n"
    part = tried(own, draft, content)
    assert 'data-record="cell-r8"' in part.body, plain(part.body)
    values = [float(value) for value in part.data(load="FY")]
    assert min(abs(value - 500.0) for value in values) < 0.01, "0.002 mV/V per N: 500 N per mV/V"
    # The form still holds the statements as they were typed, without the check loads' own.
    for _ in range(2):
        part = tried(own, draft, content)
        assert "no-check" not in part.body
    assert own.send(f"/session/{draft}/enter", content).status == 303
    record = own.registry.load("cell-r8")
    assert record.data_file("check") is not None
    assert record.load("FY").coefficients[0] == pytest.approx(500, rel=1e-4)


def faults(part: Answer) -> list[dict[str, object]]:
    """Return the cells that a rehearsal marks."""
    text = part.body.partition('data-faults="')[2].partition('"')[0].replace("&#34;", '"')
    marked: list[dict[str, object]] = json.loads(text)
    return marked


def test_all_bad_cells_are_told_at_once(own: Served, tmp_path: Path) -> None:
    content = typed(own, draft := dropped(own, session(tmp_path / "new", 2025, 0.0)))
    rows = [row.split("\t") for row in content["data"].splitlines()]
    rows[3][0], rows[1][1], rows[4][2] = "x", "", "1.5"
    content["data"] = "\n".join("\t".join(row) for row in rows)
    part = tried(own, draft, content)
    assert [(fault["line"], fault["column"]) for fault in faults(part)] == [(2, 1), (4, 0), (5, 2)]


@pytest.mark.parametrize(
    ("line", "column", "text"), [(4, 0, "1,2,3"), (2, 1, ""), (8, 1, "x"), (5, 2, "1.5")]
)
def test_an_error_is_told_at_its_cell(own: Served, tmp_path: Path, line: int, column: int, text: str) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    content = typed(own, draft)
    rows = [row.split("\t") for row in content["data"].splitlines()]
    rows[line - 1][column] = text
    content["data"] = "\n".join("\t".join(row) for row in rows)
    part = tried(own, draft, content)
    assert faults(part) == [{"table": "data", "line": line, "column": column}]
    # It is kept as it was typed, and refused at the entry too, with the same reason.
    assert typed(own, draft)["data"] == content["data"] + "\n"
    refused = own.send(f"/session/{draft}/enter", content)
    assert (refused.status, "holds no usable value" in plain(refused.body)) == (400, True)
    assert "cell-r8" not in own.registry.ids("cell")


def test_statements_that_are_no_toml_are_kept_and_told(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    for statements in ("= nothing", "schema = 1\nunknown = 2\n", "\x00", ""):
        content = typed(own, draft) | {"session": statements}
        part = tried(own, draft, content)
        assert part.status == 200
        assert "next step" in plain(part.body)
        # Where it can be read, the check loads that are typed are stated before it.
        assert open_draft(own.home, draft).session.removeprefix('check = "check.csv"\n') == statements
        assert own.page(f"/session/{draft}").status == 200
        assert own.page("/agenda/drafts").data(count="drafts") == ["1"]


def test_what_is_typed_outlives_the_browser_and_the_server(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    content = typed(own, draft)
    content["data"] = content["data"].replace("0.2", "0.3", 1)
    assert kept(own, draft, content).status == 200
    assert own.page(f"/session/{draft}").body.count("0.3") > 0
    assert typed(own, draft) == content
    # What was not changed keeps its bytes: commas stay commas.
    assert "," in (own.home / "drafts" / draft / "check.csv").read_text()


def test_a_workbook_is_read_as_it_lies_there(own: Served, tmp_path: Path) -> None:
    from openpyxl import Workbook

    path = session(tmp_path / "new", 2025, 0.0)
    book = Workbook()
    for row in path.with_name("loads.csv").read_text().splitlines():
        book.active.append([float(cell) if cell[0].isdigit() else cell for cell in row.split(",")])
    book.save(tmp_path / "loads.xlsx")
    draft = dropped(own, path)
    answer = own.upload(
        f"/session/{draft}/files", [("files", "loads.xlsx", (tmp_path / "loads.xlsx").read_bytes())],
        version=typed(own, draft)["version"],
    )  # fmt: skip
    assert answer.status == 303
    content = typed(own, draft)
    content["session"] = content["session"].replace("loads.csv", "loads.xlsx")
    content.pop("data")
    part = tried(own, draft, content)
    assert 'data-record="cell-r8"' in part.body, plain(part.body)
    assert (own.home / "drafts" / draft / "loads.xlsx").read_bytes() == (tmp_path / "loads.xlsx").read_bytes()


@pytest.mark.parametrize(
    "name", ["../people.toml.csv", "/etc/x.csv", ".hidden", "a/b.csv", "", "x" * 300, "a\\b.csv"]
)
def test_a_file_of_a_foreign_name_is_refused(own: Served, tmp_path: Path, name: str) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    answer = own.upload(f"/session/{draft}/files", [("files", name, b"a,b\n1,2\n")],
                        version=typed(own, draft)["version"])  # fmt: skip
    assert answer.status == 400
    assert len(list((own.home / "drafts" / draft).iterdir())) == 3


@pytest.mark.parametrize(
    "path", ["/session/draft-9", "/session/..%2f..", "/session/draft-1%2f..", "/session/x"]
)
def test_no_address_of_a_draft_names_a_folder(own: Served, path: str) -> None:
    assert own.page(path).status == 404
    assert own.send(f"{path}/discard", {}).status == 404


def test_statements_never_lead_the_tables_out_of_the_draft(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    (own.home / "secret.csv").write_text("S [mV/V],FY [N]\n1,2\n")
    content = typed(own, draft)
    content["session"] = content["session"].replace('"loads.csv"', '"../../secret.csv"')
    part = tried(own, draft, content)
    assert "outside" in part.body
    assert (own.home / "secret.csv").read_text() == "S [mV/V],FY [N]\n1,2\n"


def test_sessions_that_begin_at_once_are_two_and_one_cut_off_is_empty(own: Served) -> None:
    from concurrent.futures import ThreadPoolExecutor

    form = {"instrument": "cell", "date": "2025-03-01", "operator": "A"}
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda _: own.send("/session", form), range(4)))
    assert [answer.status for answer in answers] == [303] * 4
    assert len({answer.headers["location"] for answer in answers}) == 4
    (own.home / "drafts" / "draft-9").mkdir()
    (own.home / "drafts" / "draft-10").mkdir()
    (own.home / "drafts" / "draft-10" / "SESSION.toml").mkdir()
    assert own.page("/agenda/drafts").data(count="drafts") == ["6"]
    assert own.page("/session").status == 200
    assert own.page("/session/draft-9").status == 200
    assert own.page("/session/draft-10").status == 400
    for name in ("draft-9", "draft-10"):
        content = {"version": version_of(own.home / "drafts" / name)}
        assert own.send(f"/session/{name}/discard", content).status == 303


def test_a_draft_is_removed_when_asked(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    assert own.send(f"/session/{draft}/discard", typed(own, draft)).status == 303
    assert "This draft was removed" in own.page(f"/session/{draft}").body
    assert not (own.home / "drafts" / draft).exists()


def test_a_session_that_is_recorded_leads_to_its_record(own: Served) -> None:
    path = own.home / "sessions" / "s0" / "SESSION.toml"
    draft = dropped(own, path)
    part = tried(own, draft, typed(own, draft))
    assert 'data-existing="true"' in part.body
    done = own.send(f"/session/{draft}/enter", typed(own, draft))
    assert done.headers["location"].endswith("/record/cell-r1")
    assert "cell-r8" not in own.registry.ids("cell")


def test_where_people_are_enrolled_the_entry_is_requested_and_signed(people: People, tmp_path: Path) -> None:
    bench = people.bench
    draft = dropped(bench, session(tmp_path / "new", 2025, 0.0))
    requested = bench.send(f"/session/{draft}/enter", typed(bench, draft))
    assert requested.headers["location"].endswith(f"/session/{draft}#decision")
    body = bench.page(f"/session/{draft}").body
    assert "to be signed" in plain(body).lower()
    # What is signed stays what was requested.
    bench.send(f"/session/{draft}/save", typed(bench, draft) | {"session": "changed"})
    assert "changed" not in open_draft(bench.home, draft).session
    assert bench.send(f"/session/{draft}/discard", {}).status == 400
    answer = people.signed("carl", bench.page(f"/request/{draft}").body)
    forged = people.hand_in(answer.replace('"by": "carl"', '"by": "anna"'), draft)
    assert (forged.status, "a signature is not valid" in plain(forged.body)) == (400, True)
    done = people.hand_in(answer, draft)
    assert done.headers["location"].endswith("/record/cell-r8"), plain(done.body)
    entry = Registry(bench.registry.folder).ledger("cell").entries[-1]
    assert (entry.id, entry.signatures[0]["by"]) == ("cell-r8", "carl")
    assert not (bench.home / "drafts" / draft).exists()


def test_hostile_words_of_a_draft_stay_text(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    hostile = '</textarea><script>alert(1)</script>{{ 7*7 }}"'
    content = typed(own, draft) | {"session": f"# {hostile}", "data": hostile, "check": hostile}
    assert kept(own, draft, content).status == 200
    body = own.page(f"/session/{draft}").body
    assert "<script>alert" not in body
    assert "{{ 7*7 }}" in body


def field(name: str, text: str) -> dict[str, str]:
    """Return what a page sends of a field that was changed."""
    return {"statements": json.dumps([[name, text]])}


def test_a_statement_is_changed_in_its_field(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    content = typed(own, draft)
    assert 'data-key="cells.S.serial"' in own.page(f"/session/{draft}").body
    answer = json.loads(kept(own, draft, content | field("cells.S.serial", "<77>")).body)
    assert 'serial = "<77>"' in answer["session"]
    assert answer["fields"] == "", "fields are not drawn anew where nobody changed the text"
    assert tomllib.loads(open_draft(own.home, draft).session)["cells"]["S"]["serial"] == "<77>"
    # Who changes the text finds the fields changed.
    content = typed(own, draft)
    content["session"] = content["session"].replace("<77>", "78")
    answer = json.loads(kept(own, draft, content).body)
    assert re.search(r'data-key="cells.S.serial"[^>]* value="78"', answer["fields"])
    for key, text in (("cells.X.serial", "1"), ("", ""), ("__class__", "1")):
        refused = kept(own, draft, content | field(key, text))
        assert (refused.status, "cannot be changed" in refused.body) == (400, True)
    for statements in ("{", "[[1]]", "7", '[["a"]]'):
        assert kept(own, draft, content | {"statements": statements}).status == 400
    assert kept(own, draft, content | {"session": "a = [", **field("operator", "B")}).status == 400
    assert open_draft(own.home, draft).session == content["session"]


def test_a_rehearsal_writes_nothing_and_says_which_version_it_judged(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    before = typed(own, draft)
    changed = before | {"session": "changed", "data": "changed"}
    part = own.send(f"/session/{draft}/rehearse", changed, HX_Request="true")
    assert typed(own, draft) == before
    assert f'data-version="{before["version"]}"' in part.body
    broken = typed(own, draft) | {"session": "a = ["}
    part = tried(own, draft, broken)
    assert f'data-version="{broken["version"]}"' in part.body
    assert broken["version"] != before["version"]
    assert f"drafts/{draft}" in plain(part.body), "an error names the draft, not the copy that was tried"


def test_a_change_of_an_older_version_is_refused_with_both_texts(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    old = typed(own, draft)
    assert kept(own, draft, dict(old) | field("operator", "AAA")).status == 200
    content = open_draft(own.home, draft)
    for action, form in (
        ("save", old | field("operator", "BBB")), ("enter", old | {"session": old["session"] + "# BBB"}),
        ("discard", {"version": old["version"]}), ("save", {"session": "BBB"}),
    ):  # fmt: skip
        refused = own.send(f"/session/{draft}/{action}", form)
        assert refused.status == 409, action
        assert "Nothing is lost" in plain(refused.body)
        if action != "discard":
            assert "AAA" in refused.body, action
            assert "BBB" in refused.body, action
        assert open_draft(own.home, draft) == content
    refused = own.upload(f"/session/{draft}/files", [("files", "SESSION.toml", b"")], version=old["version"])
    assert refused.status == 409
    # Whoever saw both may put the one in the place of the other.
    refused = own.send(f"/session/{draft}/save", old | field("operator", "BBB"))
    assert f'name="version" value="{content.version}"' in refused.body
    again = old | field("operator", "BBB") | {"version": content.version}
    assert own.send(f"/session/{draft}/save", again).status == 303
    assert 'operator = "BBB"' in open_draft(own.home, draft).session


def test_a_page_that_is_left_knows_its_own_changes_in_their_order(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    old = typed(own, draft) | {"page": "p"}
    first, last = ({**old, "number": str(at), **field("operator", f"N{at}")} for at in (1, 2))
    assert kept(own, draft, dict(last)).status == 200
    assert kept(own, draft, dict(first)).status == 200, "it came late: what it says is older"
    assert 'operator = "N2"' in open_draft(own.home, draft).session
    assert kept(own, draft, {**old, "number": "3", **field("operator", "N3")}).status == 200
    assert 'operator = "N3"' in open_draft(own.home, draft).session
    assert kept(own, draft, {**old, "page": "q", "number": "9"}).status == 409


def test_what_is_typed_into_a_draft_that_was_entered_is_told_where_it_is(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.1))
    content = typed(own, draft)
    assert own.send(f"/session/{draft}/enter", content).status == 303
    late = content | {"session": content["session"] + "# typed too late"}
    for headers in ({}, {"HX_Request": "true"}):
        answer = own.send(f"/session/{draft}/save", late, **headers)
        assert (answer.status, 'data-ended="cell-r8"' in answer.body) == (410, True)
    assert "# typed too late" in own.send(f"/session/{draft}/enter", late).body
    # Its number is not given to another draft.
    answer = own.send("/session", {"instrument": "cell", "date": "2025-03-01", "operator": "A"})
    assert answer.headers["location"].endswith("/session/draft-2")


@pytest.mark.parametrize(
    ("name", "text"),
    [("instrument", "../../evil"), ("instrument", "x" * 5000), ("date", "2099-01-01"),
     ("indications", "D51 [mV/V], D51 [mV/V]"), ("instrument", "é")],
)  # fmt: skip
def test_a_session_does_not_begin_with_what_its_reader_refuses(own: Served, name: str, text: str) -> None:
    form = {
        "instrument": "rig", "date": "2025-03-01", "operator": "A", "indications": "D51 [mV/V]",
        "loads": "FY [N]",
    }  # fmt: skip
    answer = own.send("/session", form | {name: text})
    assert (answer.status, f"{name} cannot be used" in plain(answer.body)) == (400, True)
    assert not (own.home / "drafts").exists()


def test_an_entry_that_cannot_be_used_is_told_at_its_field(own: Served, tmp_path: Path) -> None:
    draft = dropped(own, session(tmp_path / "new", 2025, 0.0))
    content = typed(own, draft)
    for name, text in (
        ("instrument", "../../evil"), ("date", "2099-01-01"), ("indications", "S, S"),
        ("cells.S.excitation", "-1"),
    ):  # fmt: skip
        answer = json.loads(kept(own, draft, dict(content) | field(name, text)).body)
        assert name in answer["faults"]
        content["version"] = answer["version"]


def test_a_draft_that_was_entered_while_it_was_tried_is_told_as_gone(tmp_path: Path) -> None:
    # A rehearsal that ends after the entry has nothing to show; it is no bug of the program.
    with pytest.raises(ConfigError, match="no longer there"):
        open_draft(tmp_path, "draft-1")
