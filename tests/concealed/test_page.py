"""The page of the proof: what is wider than the window scrolls by itself, not the page."""

from tests.concealed import page
from tests.concealed.content import Table


def test_a_wide_table_has_a_container_that_scrolls():
    head = tuple(f"answer {i}" for i in range(40))
    wide = Table(title="Confusion", sentence="s", head=head, rows=[list(head)])
    assert '<div class="wide"><table>' in page._table(wide, "")
    assert ".wide, pre { overflow-x: auto }" in page._STYLE  # the commands have lines as long as any table


def test_ink_and_paper_are_both_stated():
    assert "color: #1b1f24; background: #fff" in page._STYLE
