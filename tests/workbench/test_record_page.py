"""A record's page: its numbers are those of the commands, its decisions those of the registry."""

from __future__ import annotations

import json

import pytest

from tests.workbench.conftest import Served, plain
from tests.workbench.test_home_page import command
from toolkit.calibration.issued import issued_text
from toolkit.machine import load_machine

Capture = pytest.CaptureFixture[str]


def test_coefficients_are_those_of_show(served: Served, capsys: Capture) -> None:
    shown = command(capsys, "calibration", "show", "cell-r1", "--home", served.home)
    values = [float(value) for value in served.page("/record/cell-r1").data()]
    load = shown["loads"]["FY"]
    for term, coefficient in load["coefficients"].items():
        assert coefficient in values
        assert load["issued"][term] in values
        assert load["standard_errors"][term] in values
        digits = issued_text(load["issued"][term], load["method"]).replace("-", "\u2212")
        assert f">{digits}</data>" in served.page("/record/cell-r1").body


def test_the_fit_is_that_of_report(served: Served, capsys: Capture) -> None:
    report = command(capsys, "calibration", "report", "m15-virtual-r1", "--home", served.home)
    part = served.page("/record/m15-virtual-r1/part/fit")
    for name, load in report["loads"].items():
        values = [float(value) for value in part.data(load=name)]
        for coefficient in load["coefficients"].values():
            for key in ("value", "standard_error", "percent_fs"):
                assert coefficient[key] in values
            assert coefficient["sign_confidence"] in values
        for key in ("residual", "leverage", "cook", "external"):
            assert set(load["rows"][key]) <= set(values)
        assert load["press"] in values
        drawn = json.loads(part.body.split('data-curves="')[1].split('"')[0].replace("&#34;", '"'))
        points = [(x, y) for series in drawn["series"] for x, y in zip(series["x"], series["y"], strict=True)]
        own = next(load["rows"] for load in report["loads"].values())
        assert sorted(points) == sorted(zip(own["reference"], own["residual"], strict=True))


def test_the_budget_is_that_of_budget(served: Served, capsys: Capture) -> None:
    budget = command(capsys, "calibration", "budget", "m15-virtual-r1", "--home", served.home)
    part = served.page("/record/m15-virtual-r1/part/budget")
    for name, load in budget["loads"].items():
        values = [float(value) for value in part.data(load=name)]
        assert [load["value"], load["U"], load["k"]] == values[:3]
        assert [c["u"] for c in load["components"] if c["stated"]] == values[4::2]


def test_the_gates_are_those_that_an_approval_meets(own: Served, capsys: Capture) -> None:
    from tests.cli.test_calibration_control import session
    from toolkit.calibration.control.calibrate import calibrate

    # The span of 10 % more than the record in force: the gate of span blocks.
    path = session(own.home / "sessions" / "wrong", 2025, 0.0)
    data = path.with_name("loads.csv")
    rows = [line.split(",") for line in data.read_text().splitlines()]
    data.write_text(
        "\n".join(
            ",".join(row if at == 0 else [f"{float(row[0]) * 1.1:.9f}", *row[1:]])
            for at, row in enumerate(rows)
        )
        + "\n"
    )
    candidate = calibrate(path, own.registry).record.id
    body = own.page(f"/record/{candidate}/part/gates").body
    assert 'data-blocked="true"' in body
    assert 'data-state="fail" data-rule="span"' in body
    answer = own.send(
        f"/record/{candidate}/decide/approve", {"in_force_from": "2025-03-01", "checked_by": "B"}
    )
    assert answer.status == 422
    words = ("--in-force-from", "2025-03-01", "--checked-by", "B", "--home", own.home)
    refused = command(capsys, "calibration", "approve", candidate, *words)
    assert refused["findings"]
    for finding in refused["findings"]:
        assert finding["message"] in plain(answer.body)
    assert own.registry.status(candidate).state == "candidate"


def test_the_gates_that_pass_are_named_and_those_that_cannot_be_judged(served: Served) -> None:
    body = served.page("/record/cell-r7/part/gates").body
    assert 'data-blocked="false"' in body
    assert "not judged polarity , lever : it needs a machine definition" in plain(body)
    assert '<code data-rule="sign">' in body
    assert "it needs an earlier approved record" in plain(served.page("/record/cell-r1/part/gates").body)


def test_responses_stand_beside_those_of_the_last_record_in_SI(served: Served) -> None:
    # 0.002 mV/V per N: 500 N per mV/V, 500 000 N per V/V.
    values = [float(value) for value in served.page("/record/cell-r7/part/responses").data()]
    assert values[:2] == pytest.approx([5e5, 5e5], rel=1e-5)
    assert abs(values[2]) < 1e-3


def test_as_found_is_what_the_record_before_makes_of_the_rows(served: Served) -> None:
    from toolkit.calibration.control.as_found import as_found

    part = served.page("/record/cell-r7/part/as_found")
    load = as_found(served.registry, served.registry.load("cell-r7")).loads[0]
    assert [float(value) for value in part.data()] == [
        load.max_error, load.tolerance, load.max_percent_fs, load.worst_row
    ]  # fmt: skip
    assert "Nothing could be compared" in plain(served.page("/record/cell-r1/part/as_found").body)


def test_a_candidate_is_approved_withdrawn_and_its_reason_shown(own: Served) -> None:
    form = {
        "in_force_from": "2024-03-01",
        "checked_by": "B",
        "recall": "12 months",
        "reason": "",
        "approved_by": "",
    }
    done = own.send("/record/cell-r7/decide/approve", form)
    assert (done.status, done.headers["location"]) == (303, f"{own.place}/record/cell-r7")
    status = own.registry.status("cell-r7")
    assert (status.state, status.checked_by, status.recall) == ("approved", "B", "12 months")
    assert 'data-status="approved"' in own.page("/record/cell-r7").body
    assert own.page("/agenda/candidates").data(count="candidates") == ["5"]
    on = str(own.guard.app.state.bench.today)  # type: ignore[attr-defined]
    assert own.send("/record/cell-r7/decide/withdraw", {"on": on, "reason": " ", "by": "B"}).status == 400
    assert (
        own.send("/record/cell-r7/decide/withdraw", {"on": on, "reason": "dropped & bent", "by": "B"}).status
        == 303
    )
    body = own.page("/record/cell-r7").body
    assert "dropped &amp; bent" in body
    assert "<form" not in body


def test_the_person_who_entered_cannot_approve(own: Served) -> None:
    for name in ("A", " a ", "\u0410"):
        answer = own.send(
            "/record/cell-r7/decide/approve", {"in_force_from": "2024-03-01", "checked_by": name}
        )
        assert answer.status == 400
        assert "must be different names" in plain(answer.body)
    assert own.registry.status("cell-r7").state == "candidate"


@pytest.mark.parametrize(
    "form", [{}, {"in_force_from": "soon", "checked_by": "B"}, {"in_force_from": "2024-03-01"}]
)
def test_an_approval_that_lacks_something_says_what(own: Served, form: dict[str, str]) -> None:
    answer = own.send("/record/cell-r7/decide/approve", form)
    assert answer.status == 400
    assert "next step" in plain(answer.body)
    assert own.registry.status("cell-r7").state == "candidate"


def test_hostile_words_of_a_session_stay_text(own: Served) -> None:
    from tests.cli.test_calibration_control import session
    from toolkit.calibration.control.calibrate import calibrate

    path = session(own.home / "sessions" / "hostile", 2025, 0.0)
    hostile = "<script>alert(1)</script>{{ 7*7 }}%(name)s"
    path.write_text(path.read_text().replace('operator = "A"', f"operator = '{hostile}'"))
    record_id = calibrate(path, own.registry).record.id
    for answer in (own.page(f"/record/{record_id}"), own.page("/records"), own.page("/agenda/candidates")):
        assert answer.status == 200
        assert "<script>alert" not in answer.body
        assert "&lt;script&gt;alert(1)&lt;/script&gt;{{ 7*7 }}%(name)s" in answer.body


def test_a_legacy_record_has_no_fit_and_says_so(served: Served) -> None:
    body = served.page("/record/m15-r2").body
    assert "Unverified" in body
    assert "part/fit" not in body
    assert served.page("/record/m15-r2/part/budget", HX_Request="true").status == 400


def test_every_rule_that_a_gate_names_is_in_the_table() -> None:
    import ast
    from pathlib import Path

    import toolkit.calibration.registry.gates as gates
    from toolkit.lab.records.gates_answer import GATES

    folder = Path(gates.__file__).parent
    named = {
        keyword.value.value
        for module in ("gates", "history", "judgement", "plausible")
        for node in ast.walk(ast.parse((folder / f"{module}.py").read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "GateResult"
        for keyword in node.keywords
        if keyword.arg == "rule" and isinstance(keyword.value, ast.Constant)
    }
    assert named == set(GATES)


def test_what_a_decision_rests_on_stands_beside_it(served: Served) -> None:
    page = served.page("/record/cell-r7").body
    record = served.registry.load("cell-r7")
    for stored in record.data:
        assert f'data-role="{stored.role}"' in page
        assert stored.sha256 in page
    gates = served.page("/record/cell-r7/part/gates").body
    assert "none states this instrument" in gates
    assert "polarity reading" in gates or "by nothing" in gates
    machine = load_machine("m15")
    gates = served.page("/record/m15-r1/part/gates").body
    assert f'data-machine="m15">m15, version {machine.version}' in gates


@pytest.mark.parametrize(
    "typed", ["by=%ff%fe&reason=x", "by=B&reason=%00a", "by=B%08&reason=x", "by=B&reason=%E2%80%AEx"]
)
def test_a_decision_in_words_that_no_document_can_print_is_refused(own: Served, typed: str) -> None:
    on, head = str(own.guard.app.state.bench.today), own.registry.head("cell")  # type: ignore[attr-defined]
    body = f"form_key={own.guard.keys.form}&on={on}&{typed}"
    for record in ("cell-r1", "cell-r7"):
        answer = own.ask(f"{own.place}/record/{record}/decide/withdraw", "POST", body)
        assert answer.status == 400
    assert own.registry.head("cell") == head
