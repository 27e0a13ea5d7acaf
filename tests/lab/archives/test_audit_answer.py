"""What an audit says to people: reasons can be read in a narrow terminal."""

from __future__ import annotations

from toolkit.lab.archives.audit_answer import _table

SIGN = "E5 negative in FY, MZ; constant negative in FY"
MISSING = "missing-column: the recording lacks 'D52 (Filtered)', 'D51 (Filtered)', 'E5 (Filtered)'"


def test_reasons_that_a_line_has_no_room_for_stand_whole_below_the_table() -> None:
    rows = [
        ["2019/T-017/FM_run_1.xlsx", "sign_variant", "m15-r2", SIGN, "m15-r2", "980.5", "1.20"],
        ["2019/T-017/FM_run_2.xlsx", "unreadable", "", MISSING, "", "", ""],
        ["2019/T-017/FM_run_3.xlsx", "sign_variant", "m15-r2", SIGN, "m15-r2", "15.5", "0.20"],
        ["2019/T-017/FM_run_4.xlsx", "undated", "m15-r2", "", "", "", ""],
    ]
    narrow = _table(rows, 80)
    text = "\n".join(narrow)
    assert max(map(len, text.splitlines())) <= 88  # names and numbers are never cut
    assert "\u2026" not in text
    told = " ".join(text.partition("how:")[2].split())
    assert told == f"1 {SIGN} 2 {MISSING}"
    first, second, third, fourth = text.splitlines()[2:6]
    assert [line.split()[3] for line in (first, third)] == ["1", "1"]
    assert second.split() == [rows[1][0], "unreadable", "2"]
    assert fourth.split() == [rows[3][0], "undated", "m15-r2"]
    wide = "\n".join(_table(rows, 240))
    assert SIGN in wide
    assert "how:" not in wide
