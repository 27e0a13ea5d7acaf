"""approve, withdraw, show and diff as a user meets them: answers, exit codes, an unmoved ledger."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import commands
from tests.calibration.calibration_factory import hub_data
from tests.calibration.registry.test_candidate_legacy import GOOD
from toolkit.calibration.registry.candidate import calibrate, import_legacy
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.response import differences
from toolkit.trust.people import name_key

Run = Callable[..., tuple[int, dict[str, Any]]]
FROM = ("--in-force-from", "2026-02-01", "--checked-by", "B")


@pytest.fixture
def run(registry: Registry) -> Run:
    def call(*words: object) -> tuple[int, dict[str, Any]]:
        code, answer = commands.answer("calibration", *words, "--calibrations", registry.folder)
        return code, answer.get("error", answer)

    return call


@pytest.mark.parametrize(
    "name",
    [
        "operator one", "OPERATOR One", "  operator\tone ", "operator\u00a0one", "operator\u200b one",
        "\uff4fperator one", "\u043eperator one", "\u03bfperat\u03bfr one", "oper\u00adator one", "",
        "\u200b", "opera\u034ftor one", "operator one\ufe0f", "operator\u3164one", "operator\u2800 one",
        "operator \U000e0101one", "\u3164",
    ],
)  # fmt: skip
@pytest.mark.parametrize("role", ["checked", "approved"])
def test_the_same_name_written_otherwise_is_refused(
    run: Run, registry: Registry, name: str, role: str
) -> None:
    head = registry.head("hub")
    names = ("--checked-by", name) if role == "checked" else ("--checked-by", "B", "--approved-by", name)
    code, answer = run("approve", "hub-r1", "--in-force-from", "2026-02-01", *names)
    assert (code, answer["rule"]) == (2, "names")
    assert all(answer[key] for key in ("what", "where", "got", "expected", "next_step"))
    assert registry.head("hub") == head


def test_names_that_differ_in_a_letter_or_an_accent_are_two() -> None:
    keys = {name_key(name) for name in ("Müller", "Muller", "Miller", "М. Петрова", "N. Petrova", "王", "李")}
    assert len(keys) == 7


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (("approve", "hub-r9", *FROM), "missing"),
        (("approve", "hub", *FROM), "record-id"),
        (("approve", "hub-r1", "--in-force-from", "soon", "--checked-by", "B"), "usage"),
        (("approve", "hub-r1", "--in-force-from", "2026-01-04", "--checked-by", "B"), "approval"),
        (("withdraw", "hub-r9", "--on", "2026-02-01", "--reason", "x", "--by", "B"), "missing"),
        (("withdraw", "hub-r1", "--on", "2026-02-01", "--reason", " ", "--by", "B"), "withdrawal"),
        (("withdraw", "hub-r1", "--on", "2026-02-30", "--reason", "x", "--by", "B"), "usage"),
        (("withdraw", "nothing-r1", "--on", "2026-02-01", "--reason", "x", "--by", "B"), "missing"),
    ],
)
def test_a_decision_that_cannot_be_made(
    run: Run, registry: Registry, words: tuple[str, ...], rule: str
) -> None:
    head = registry.head("hub")
    code, answer = run(*words)
    assert (code, answer["rule"]) == (2, rule), answer
    assert registry.head("hub") == head
    assert registry.instruments() == ("hub",)


def test_an_id_that_never_was_is_no_lost_file(run: Run) -> None:
    for words in (("approve", "hub-r9", *FROM), ("diff", "hub-r1", "hub-r9"), ("show", "other-r1")):
        _, answer = run(*words)
        assert "backup" not in answer["next_step"]
        assert "toolkit calibration list" in answer["next_step"]
    assert "hub-r1" in run("approve", "hub-r9", *FROM)[1]["expected"]


def test_a_second_approval_moves_the_date_back_and_never_forward(run: Run, registry: Registry) -> None:
    assert run("approve", "hub-r1", *FROM)[0] == 0
    again = ("approve", "hub-r1", "--checked-by", "B", "--in-force-from")
    assert run(*again, "2026-01-10")[1]["rule"] == "approval"
    # The days from 1 February to 1 March would stay in force: the answer may not say otherwise.
    code, answer = run(*again, "2026-03-01", "--reason", "a typing error")
    assert (code, answer["rule"]) == (2, "approval")
    assert "withdrawal" in answer["expected"]
    code, answer = run(*again, "2026-01-10", "--reason", "its first use")
    assert (code, answer["approved"], answer["in_force_from"]) == (0, True, "2026-01-10")
    assert run("show", "hub-r1")[1]["record"]["in_force_from"] == "2026-01-10"


def test_what_is_withdrawn_stays_withdrawn(run: Run, registry: Registry) -> None:
    assert run("withdraw", "hub-r1", "--on", "2026-02-01", "--reason", "overloaded", "--by", "B")[0] == 0
    head = registry.head("hub")
    assert (
        run("withdraw", "hub-r1", "--on", "2026-03-01", "--reason", "again", "--by", "B")[1]["rule"]
        == "withdrawal"
    )
    assert run("approve", "hub-r1", *FROM, "--reason", "after all")[1]["rule"] == "approval"
    assert registry.head("hub") == head


def test_blocked_gates_are_listed_and_end_with_one(
    run: Run, registry: Registry, make_session: Callable[..., Path]
) -> None:
    wrong = hub_data(9, 6)
    wrong[:, 2] *= -1  # the check loads were read with the third cell's sign turned
    calibrate(make_session(hub_data(60, 4), check_rows=wrong, name="wrong"), registry)
    head = registry.head("hub")
    code, answer = run("approve", "hub-r2", *FROM)
    assert (code, answer["approved"], answer["head"]) == (1, False, head)
    assert {finding["rule"] for finding in answer["findings"]} == {"check-load"}
    # Every check row of FY, MZ and MX that E5 reaches by more than the tolerance.
    assert len({finding["where"] for finding in answer["findings"]}) == len(answer["findings"]) > 9


def test_what_the_check_loads_cannot_verify_goes_to_the_ledger(
    run: Run, registry: Registry, make_session: Callable[..., Path]
) -> None:
    # Rank is not enough: check loads of a thousandth of the range move no term by five tolerances.
    rows = hub_data(9, 6, noise=0)
    zero = np.array([0.012, -0.008, 0.02])  # calibration_factory.ZERO: the cells without load
    small = np.column_stack([(rows[:, :3] - zero) / 1000 + zero, rows[:, 3:] / 1000])
    calibrate(make_session(check_rows=small, name="small", digits=9), registry)
    code, answer = run("approve", "hub-r2", *FROM)
    assert (code, answer["approved"]) == (0, True)
    terms = {f"{load}: {cell}" for load in ("FY", "MZ", "MX") for cell in ("D51", "D52", "E5")}
    assert terms <= set(answer["unverifiable"])
    (event,) = [e for e in run("history", "hub")[1]["events"] if e["event"] == "approved"]
    assert event["unverifiable"] == answer["unverifiable"]


def test_copies_of_rows_of_the_fit_verify_no_term(
    run: Run, registry: Registry, make_session: Callable[..., Path]
) -> None:
    values = hub_data(60, 1)
    copied = np.array([[float(f"{one:.6g}") for one in row] for row in values[:12]])
    calibrate(make_session(values, check_rows=copied, name="copied"), registry)
    code, answer = run("approve", "hub-r2", *FROM)
    assert (code, answer["approved"]) == (0, True)
    terms = {f"{load}: {cell}" for load in ("FY", "MZ", "MX") for cell in ("D51", "D52", "E5")}
    assert terms <= set(answer["unverifiable"])


def test_show_tells_range_check_loads_and_head(run: Run, registry: Registry) -> None:
    code, answer = run("show", "hub-r1")
    rows, check = hub_data(60, 1).round(7), hub_data(9, 2).round(7)
    assert (code, answer["head"]) == (0, registry.head("hub"))
    assert answer["indications"][0]["maximum"] == rows[:, 0].max()
    fy = answer["loads"]["FY"]
    assert (fy["minimum"], fy["maximum"], fy["n"]) == (rows[:, 3].min(), rows[:, 3].max(), 60)
    assert fy["check_tolerance"] == pytest.approx(1e-3 * np.abs(rows[:, 3]).max(), rel=1e-12)
    found = np.linalg.lstsq(np.column_stack([rows[:, :3], np.ones(60)]), rows[:, 3], rcond=None)[0]
    off = np.abs(np.column_stack([check[:, :3], np.ones(9)]) @ found - check[:, 3]).max()
    assert fy["check_max"] == pytest.approx(off, rel=1e-6)


def test_diff_tells_what_a_change_moves(
    run: Run, registry: Registry, make_session: Callable[..., Path]
) -> None:
    assert run("diff", "hub-r1", "hub-r1")[0] == 0
    calibrate(make_session(hub_data(60, 4), name="later"), registry)
    code, answer = run("diff", "hub-r1", "hub-r2")
    row = next(one for one in answer["terms"] if (one["load"], one["term"]) == ("FY", "D51"))
    both = np.vstack([hub_data(60, 1), hub_data(60, 4)]).round(7)
    assert code == 1
    assert row["change"] == row["hub-r2"] - row["hub-r1"]
    assert row["effect"] == pytest.approx(abs(row["change"]) * np.abs(both[:, 0]).max(), rel=1e-12)
    assert row["effect_percent_fs"] == pytest.approx(
        100 * row["effect"] / np.abs(both[:, 3]).max(), rel=1e-12
    )


def test_a_difference_across_units_is_that_in_si_and_told_in_words(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    sources = (
        GOOD, GOOD.replace('unit = "N"', 'unit = "kN"'), GOOD.replace("S = 2", "S = 3"),
        GOOD.replace('unit = "mV/V"', 'unit = "count"'),
    )  # fmt: skip
    for at, text in enumerate(sources):
        (tmp_path / f"{at}.toml").write_text(text)
        import_legacy(tmp_path / f"{at}.toml", registry)
    plain, kilo, three, counts = (registry.load(f"old-r{n}") for n in (1, 2, 3, 4))
    # 2 kN/(mV/V) are 2000 N/(mV/V): 1998 more than 2, and the intercept of 1 kN is 999 N more than 1 N.
    found = differences(plain, kilo)
    assert [(t.change, t.unit, t.differs) for t in found] == [(1998.0, "N", True), (999.0, "N", True)]
    assert found[0].change_percent == pytest.approx(99900)
    assert found[0].note == "F in N, then in kN; that is 2000 N/(V/V), then 2e+06 N/(V/V)"
    assert [(t.term, t.change, t.effect, t.note) for t in differences(plain, three)] == [
        ("S", 1.0, None, None), ("intercept", 0.0, 0.0, None),
    ]  # fmt: skip
    (term, _) = differences(plain, counts)
    assert (term.change, term.differs) == (None, True)
    assert "S in mV/V, then in count, which is another kind of quantity" in str(term.note)
