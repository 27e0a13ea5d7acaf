"""The page of the proof: its inline marks, its curves, and the bars that are not met."""

from xml.etree import ElementTree as ET

import pytest

from proof import content, page
from proof.intervals import Rate
from proof.score import Bar


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("met", [("met", "met")]),
        ("all bars met", [("text", "all bars met")]),
        ("**not met**", [("text", ""), ("not met", "not met"), ("text", "")]),
        ("`<a>` & b", [("text", ""), ("code", "<a>"), ("text", " & b")]),
    ],
)
def test_a_cell_shows_its_code_and_whether_a_bar_is_met(text, parts):
    assert page.spans(text) == parts


def test_a_curve_draws_a_dot_for_every_bin_that_holds_cases():
    rates = [Rate(0, 0), Rate(1, 4), Rate(4, 4)]
    bins = [{"from": i, "to": i + 1.0, "rate": rate} for i, rate in enumerate(rates)]
    drawn = ET.fromstring(str(page.curve(bins, "size <1>")))  # noqa: S314  our own
    assert len(drawn.findall("circle")) == 2
    assert len(drawn.find("polyline").get("points").split()) == 2
    assert drawn.get("aria-label") == "size <1>"


def test_a_bar_that_is_not_met_stands_with_every_batch_and_its_reason():
    bars = (
        Bar(title="cover", asked="90 to 98 %", observed="141 of 157 = 89.8 %", met=False),
        Bar(title="nulls", asked="at most 2 %", observed="0 of 152 = 0.0 %", met=True),
    )
    before = {"answers_sha256": "a" * 64, "figures": {"cover": "85 of 100 = 85.0 %"}}
    now = {"answers_sha256": "b" * 64, "figures": {"cover": "141 of 157 = 89.8 %"}}
    log = [before | {"reasons": {"cover": "an old one"}}, now | {"reasons": {"cover": "small drags"}}]
    (table,) = content._missed({"bars": bars, "log": log})
    assert table.rows == [
        ["cover", "85 of 100 = 85.0 % (`aaaaaaaa`); 141 of 157 = 89.8 % (`bbbbbbbb`)", "small drags"]
    ]
    (without,) = content._missed({"bars": bars, "log": [log[0], now]})
    assert without.rows[0][2] == "not stated"
    assert content._missed({"bars": bars[1:], "log": log}) == []
