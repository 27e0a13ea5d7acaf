"""The page of the proof: what is wider than the window scrolls by itself, not the page."""

from tests.concealed import content, page
from tests.concealed.content import Table
from tests.concealed.score import Bar


def test_a_wide_table_has_a_container_that_scrolls():
    head = tuple(f"answer {i}" for i in range(40))
    wide = Table(title="Confusion", sentence="s", head=head, rows=[list(head)])
    assert '<div class="wide"><table>' in page._table(wide, "")
    assert ".wide, pre { overflow-x: auto }" in page._STYLE  # the commands have lines as long as any table


def test_ink_and_paper_are_both_stated():
    assert "color: #1b1f24; background: #fff" in page._STYLE


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
