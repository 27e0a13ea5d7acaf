"""Whatever is done to a file: a recording or a ToolkitError, never anything else."""

from __future__ import annotations

from functools import cache

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.recording.workbook_factory import DATA, HEADERS, SHEET, members, packed, with_cell, workbook
from toolkit.errors import ToolkitError
from toolkit.machine import load_machine
from toolkit.recording import Recording, is_own_output, machine_of, read_recording

M15 = load_machine("m15")
CSV = (",".join(HEADERS) + "\n" + "\n".join(",".join(map(str, row)) for row in DATA) + "\n").encode()
SNIPPETS = (
    b'<c> </c> <row> </row> r="XFD1048576" <c_r="ZZ99999"><v>1</v></c> <row_r="1048576"> " \' < > /> &#49; '
    b'<v>1</v> 9999999 _t="e" _t="s" _t="b" _s="7" - \xff \x00 <!-- <![CDATA[ <!DOCTYPE_a> ]]> NaN 1e999 '
    b"&a; #N/A [ ] .. \xef\xbb\xbf"
).split(b" ")

quick = settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@cache
def good() -> bytes:
    return workbook()


def survives(path, data: bytes) -> None:
    path.write_bytes(data)
    for reader in ("calamine", "both"):
        try:
            recording = read_recording(path, M15, reader=reader)
        except ToolkitError as error:
            told = error.as_dict()
            if not (told["rule"] and told["next_step"]):
                raise
            continue
        assert isinstance(recording, Recording)
        assert recording.rows > 0
        assert all(np.isfinite(one.values).all() for one in recording.series)
        assert {one.symbol for one in recording.series} >= {"FZ", "D51", "D52", "E5", "SA"}
    is_own_output(path)
    machine_of(path)


@st.composite
def mutated(draw, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(changed) - 1, 0)))
        kind = draw(st.sampled_from(("set", "delete", "insert", "copy", "cut")))
        if kind == "set" and changed:
            changed[at] = draw(st.integers(0, 255))
        elif kind == "delete":
            del changed[at : at + draw(st.integers(1, 40))]
        elif kind == "insert":
            changed[at:at] = draw(
                st.one_of(
                    st.sampled_from([one.replace(b"_", b" ") for one in SNIPPETS]), st.binary(max_size=8)
                )
            )
        elif kind == "copy":
            changed[at:at] = changed[: draw(st.integers(0, 60))]
        elif draw(st.integers(0, 9)) == 0:
            del changed[at:]
    return bytes(changed)


@quick
@given(data=mutated(good()))
def test_bytes_of_the_file(tmp_path, data):
    survives(tmp_path / "f", data)


@quick
@given(name=st.sampled_from([SHEET, SHEET, SHEET, *members()]), data=st.data())
def test_bytes_of_a_member(tmp_path, name, data):
    parts = members()
    survives(tmp_path / "f", packed({**parts, name: data.draw(mutated(parts[name]))}))


@quick
@given(
    gone=st.sampled_from([*members()]), name=st.text(min_size=1, max_size=12), content=st.binary(max_size=40)
)
def test_members_that_come_and_go(tmp_path, gone, name, content):
    parts = members()
    if "\x00" not in name:
        parts[name.encode("utf-8", "replace").decode()] = content
    survives(tmp_path / "f", packed(parts))
    del parts[gone]
    survives(tmp_path / "f", packed(parts))


@quick
@given(
    row=st.integers(0, 3),
    column=st.integers(0, 6),
    kind=st.sampled_from(["", "n", "s", "str", "b", "e", "d", "inlineStr", "x"]),
    text=st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="<&>"), max_size=12)
    | st.floats().map(repr)
    | st.sampled_from(["#N/A", "1", "0", "-1", "2020-01-01", "1e5", "99999999999999999999", "TRUE"]),
)
def test_any_cell(tmp_path, row, column, kind, text):
    cell = f'<c r="@"{f" t={chr(34)}{kind}{chr(34)}" if kind else ""}><v>{text}</v></c>'
    survives(tmp_path / "f", with_cell(row, column, cell))


@quick
@given(data=mutated(CSV))
def test_bytes_of_a_csv_file(tmp_path, data):
    survives(tmp_path / "f", data)


@quick
@given(data=st.binary(max_size=300) | st.text(max_size=100).map(str.encode))
def test_anything_at_all(tmp_path, data):
    survives(tmp_path / "f", data)
