"""The judge and the score on answers made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from proof import baselines
from proof.catalogue import FAMILIES
from proof.intervals import Rate, rate
from proof.judge import judge
from proof.laws import LAWS
from proof.score import bars, summary


def sealed(bucket: str, *names: str, **more: Any) -> dict[str, Any]:
    """Return a sealed answer."""
    rows = [
        {
            "name": n,
            "channel": None,
            "parameters": {"gap": 0.3},
            "either_sign": False,
            "size": 2,
            "distance": 30,
        }
        for n in names
    ]
    return {
        "bucket": bucket,
        "effects": rows,
        "class": [],
        "size": 2.5,
        "distance": 30.0,
        "alike": {},
        **more,
    }


def said(verdict: str, *effects: str | tuple[str, ...], **more: Any) -> dict[str, Any]:
    """Return an answer of the tool; a tuple is an effect with those it may also be."""
    rows = []
    for e in effects:
        name, *others = (e,) if isinstance(e, str) else e
        rows.append({"name": name, "equivalent_to": others, "parameters": []})
    return {"schema": 1, "verdict": verdict, "effects": rows, "mismatch": [], "not_found": [], **more}


@pytest.mark.parametrize(
    ("truth", "answer", "right", "false_name"),
    [
        (sealed("null"), said("nothing"), True, False),
        (sealed("null"), said("unknown"), False, False),
        (sealed("null"), said("named", "creep"), False, True),
        (sealed("single", "backlash"), said("named", "backlash"), True, False),
        (sealed("single", "backlash"), said("equivalent", ("creep", "backlash")), True, False),
        (sealed("single", "backlash"), said("named", "creep"), False, True),
        (sealed("single", "backlash"), said("named", "backlash", "creep"), False, True),
        (sealed("single", "backlash"), said("nothing"), False, False),
        (sealed("stirred null"), said("named", "creep"), False, True),
        (sealed("stirred single", "backlash"), said("named", "backlash"), True, False),
        (sealed("three", "wear", "creep", "backlash"), said("named", "creep", "wear"), False, False),
        (sealed("two", "wear", "creep"), said("named", "creep", "wear"), True, False),
        (sealed("two", "wear", "creep"), said("named", "wear"), False, False),
        (sealed("outside", "hidden_line"), said("unknown"), True, False),
        (sealed("outside", "hidden_line"), said("named", "creep"), False, True),
        (sealed("outside", "hidden_line"), said("nothing"), False, False),
        (sealed("control"), said("unknown"), True, False),
        (sealed("control"), said("nothing"), True, False),
        (sealed("control"), said("equivalent", ("a", "b")), False, True),
    ],
)
def test_the_judge(truth: dict[str, Any], answer: dict[str, Any], right: bool, false_name: bool) -> None:
    found = judge("case", truth, answer)
    assert (found.right, found.false_name) == (right, false_name)


def test_the_class_is_asked_for_where_nothing_can_tell() -> None:
    truth = sealed("confounded", "plysteer", **{"class": ["plysteer", "steer_offset"]})
    assert judge("c", truth, said("equivalent", ("steer_offset", "plysteer"))).right
    alone = judge("c", truth, said("named", "plysteer"))
    assert not alone.right
    assert alone.overconfident
    assert not alone.false_name
    wrong = judge("c", truth, said("equivalent", ("plysteer", "steer_offset"), "creep"))
    assert not wrong.right
    assert wrong.false_name


def test_one_of_two_counts_as_partly() -> None:
    found = judge("c", sealed("two", "wear", "creep"), said("named", "wear"))
    assert found.partly


def test_what_a_recording_cannot_tell_is_excused_and_still_wrong() -> None:
    found = judge("c", sealed("single", "wear", alike={"creep": 1.2}), said("named", "creep"))
    assert found.excused
    assert found.false_name
    assert not found.right


def test_no_answer_is_a_failure_and_not_a_nothing() -> None:
    found = judge("c", sealed("null"), None)
    assert found.verdict == "failed"
    assert not found.right


@pytest.mark.parametrize(
    ("interval", "hit"), [([0.2, 0.4], True), ([0.31, 0.4], False), ([0.4, 0.2], True), ([-0.4, -0.2], False)]
)
def test_an_interval_covers_or_not(interval: list[float], hit: bool) -> None:
    answer = said("named", "backlash")
    answer["effects"][0]["parameters"] = [{"name": "gap", "value": 0.3, "ci95": interval}]
    assert judge("c", sealed("single", "backlash"), answer).covered == {"backlash.gap": hit}


def test_a_parameter_whose_sign_is_open_is_compared_by_magnitude() -> None:
    truth = sealed("single", "backlash")
    truth["effects"][0]["either_sign"] = True
    answer = said("named", "backlash")
    answer["effects"][0]["parameters"] = [{"name": "gap", "value": -0.3, "ci95": [-0.4, -0.2]}]
    assert judge("c", truth, answer).covered == {"backlash.gap": True}


def test_the_output_that_shows_most_is_asked_for() -> None:
    truth = sealed("single", "wear", by_output={"FY": 3.0, "MZ": 0.2})
    rows = [{"channel": "FY", "share_of_variance": 0.1}, {"channel": "MZ", "share_of_variance": 0.7}]
    assert judge("c", truth, said("unknown", mismatch=rows)).located is False
    assert judge("c", truth, said("unknown", mismatch=rows[:1])).located is True
    assert (
        judge("c", sealed("single", "wear", by_output={"FY": 3.0, "MZ": 2.9}), said("unknown")).located
        is None
    )


def test_a_miss_is_held_against_the_size_that_was_promised() -> None:
    row = {"name": "backlash", "minimum_detectable": 0.15, "unit": "deg", "observable": True}
    found = judge("c", sealed("single", "backlash"), said("nothing", not_found=[row]))
    assert found.minimum_detectable == pytest.approx(0.5)


def test_exact_intervals_are_the_published_ones() -> None:
    # the contract's own figures, and the rule of Hanley and Lippman-Hand for none in n: 1 - 0.025^(1/n)
    assert Rate(0, 150).high == pytest.approx(1 - 0.025 ** (1 / 150))
    assert 100 * Rate(0, 150).high == pytest.approx(2.4, abs=0.05)
    assert 100 * Rate(3, 150).high == pytest.approx(5.7, abs=0.05)
    assert Rate(0, 150).low == 0.0
    assert Rate(7, 7).high == 1.0
    # Newcombe (1998), Stat. Med. 17, table I: 81 of 263 by Clopper and Pearson
    assert (Rate(81, 263).low, Rate(81, 263).high) == pytest.approx((0.2527, 0.3676), abs=5e-5)
    assert str(rate([])) == "none observed"


def test_the_whole_score_of_a_batch_made_by_hand() -> None:
    cases = {
        "a": (sealed("null"), said("nothing")),
        "b": (sealed("null"), said("named", "creep")),
        "c": (sealed("single", "backlash"), said("named", "backlash")),
        "d": (sealed("outside", "hidden_line"), said("unknown")),
        "e": (sealed("two", "wear", "creep"), None),
    }
    judged = [judge(k, t, a) for k, (t, a) in cases.items()]
    extra = {
        "c": {"case": "c", "gap": {"tool": 0.9, "tool from declared": 0.95, "bic": 0.1}, "baselines": {
            "bic": {"verdict": "named", "names": ["creep"]}}},
    }  # fmt: skip
    runs = [{"case": k, "exit": 0, "seconds": 2.0} for k in cases]
    found = summary(judged, extra, {k: t for k, (t, _) in cases.items()}, runs)
    assert found["rates"]["false names on nulls"] == Rate(1, 2)
    assert found["rates"]["right class from 2 sd up"] == Rate(1, 1)
    assert found["failed"] == ["e"]
    assert found["gap"]["median"] == pytest.approx(0.9)
    assert found["matrix"]["backlash"] == {"backlash": 1}
    assert found["matrix"]["[null]"] == {"nothing": 1, "creep": 1}
    assert found["baselines"]["bic"]["false names beside a true effect"].hits == 1
    assert found["baselines"]["commonest effect"]["false names on nulls"] == Rate(2, 2)
    assert {b.title: b.met for b in found["bars"]}["false names on nulls"] is False


def test_the_bars_are_the_contracts() -> None:
    law = "law: place, form and variables"
    rates = {
        "false names on nulls": Rate(3, 150), "misnamed from outside": Rate(2, 40),
        "right class from 2 sd up": Rate(95, 100), "both of two": Rate(19, 20), law: Rate(4, 5),
    }  # fmt: skip
    gaps = ({"median": least, "n": 40, "quartiles": [0.5, 0.9]} for least in (0.8, 0.5))
    assert [b.met for b in bars(rates, Rate(94, 100), *gaps)] == [True] * 8
    rates = {
        "false names on nulls": Rate(4, 150), "misnamed from outside": Rate(3, 40),
        "right class from 2 sd up": Rate(94, 100), "both of two": Rate(18, 20), law: Rate(3, 5),
    }  # fmt: skip
    gaps = ({"median": least, "n": 40, "quartiles": [0.5, 0.9]} for least in (0.79, 0.49))
    assert [b.met for b in bars(rates, Rate(98, 100), *gaps)] == [False] * 8


def test_forward_selection_takes_the_terms_that_are_there() -> None:
    rng = np.random.default_rng(8)
    X = rng.standard_normal((400, 8))
    y = 2.0 * X[:, 3] - 0.7 * X[:, 6] + 0.3 * rng.standard_normal(400)
    assert baselines.bic_forward(X, y)[:2] == [3, 6]
    assert baselines.bic_forward(X, rng.standard_normal(400)) == []


def test_the_sparse_regression_drops_what_is_small() -> None:
    rng = np.random.default_rng(9)
    X = rng.standard_normal((500, 6))
    y = 1.5 * X[:, 1] + 0.05 * X[:, 4] + 0.1 * rng.standard_normal(500)
    assert baselines.thresholded(X, y) == [1]


def law(kind: str, channel: str, form: str, *variables: str, memory_s: float | None = None) -> dict[str, Any]:
    """Return a law of an answer."""
    place = {"kind": kind, "channel": channel}
    return {"place": place, "form": form, "acts": "adds", "variables": [*variables], "memory_s": memory_s}


@pytest.mark.parametrize(
    ("family", "name", "laws", "held"),
    [
        ("thermal", "hidden_radiation", [law("state", "T1", "static", "T1", "T3")], (True, True, True)),
        ("thermal", "hidden_radiation", [law("output", "T1", "static", "T1", "T3")], (False, True, True)),
        ("thermal", "hidden_radiation", [law("state", "T3", "static", "T3")], (True, False, True)),
        ("pendulum", "hidden_gust", [law("state", "om", "event")], (True, True, True)),
        ("pendulum", "hidden_gust", [law("state", "om", "event", "time")], (True, True, True)),
        ("pendulum", "hidden_gust", [law("state", "om", "static", "th")], (True, False, True)),
        ("drive", "hidden_resonance", [law("state", "v", "mode", "v", memory_s=0.4)], (True, True, True)),
        ("beam-python", "hidden_ambient", [law("output", "W", "tone"), law("output", "S", "static", "T")],
         (True, True, True)),
        ("tank", "hidden_hatch", [], (False, False, False)),
    ],
)  # fmt: skip
def test_a_law_is_right_by_place_variables_and_memory(
    family: str, name: str, laws: list[dict[str, Any]], held: tuple[bool, ...]
) -> None:
    judged = judge("c", sealed("outside", name, family=family), said("unknown", laws=laws)).law
    assert judged is not None
    assert (judged["place"], judged["variables"], judged["memory"]) == held
    assert judged["learned"] is bool(laws)


def test_no_law_is_asked_of_an_answer_of_before_nor_of_zeros_taken_anew() -> None:
    assert judge("c", sealed("outside", "hidden_gust", family="drive"), said("unknown")).law is None
    anew = sealed("outside", "hidden_tare", family="labview")
    assert judge("c", anew, said("unknown", laws=[])).law is None


def test_every_effect_from_outside_has_its_law_where_it_can_be_drawn() -> None:
    drawn = {(family, name) for family, row in FAMILIES.items() for name in row.outside}
    assert drawn - {*LAWS} == {("labview", "hidden_tare")}
    assert {*LAWS} <= drawn
