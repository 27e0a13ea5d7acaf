"""LabVIEW's text files: every header that the specification allows, and every cut and lie refused."""

from __future__ import annotations

import pytest

from tests.recording.format_checks import ROWS, refused, same
from tests.recording.format_factory import lvm
from toolkit.errors import CellError, ColumnError, RecordingError


@pytest.mark.parametrize("x", ["No", "One", "Multi"])
@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), ("\t", ","), (",", "."), (";", ",")])
@pytest.mark.parametrize(("multi", "segments"), [("Yes", 1), ("Yes", 3), ("No", 1)])
def test_every_variant_of_the_lvm_header(read, table, x, separator, decimal, multi, segments):
    same(read(lvm(table, x=x, separator=separator, decimal=decimal, multi=multi, segments=segments)), table)


def test_lvm_rows_appended_under_one_header(read, table):
    same(read(lvm(table, multi="No", segments=3)), table)


def test_lvm_text_in_another_code_page_changes_no_number(read, table):
    same(read(lvm(table).replace(b"Operator\tM", b"Operator\tM\xfcller")), table)


def test_lvm_cut_within_its_rows_or_headers(read, table):
    data = lvm(table)
    lines = data.splitlines(keepends=True)
    for keep in (5, 14, 20, len(lines) - 3):
        refused(read, b"".join(lines[:keep]), "truncated")
    refused(read, lvm(table, samples=ROWS - 1), "damaged")
    refused(read, data.replace(b"Channels\t7", b"Channels\t8"), "damaged")


def test_lvm_names_the_line_of_a_bad_value(read, table):
    lines = lvm(table).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(b"X_Value")) + 4
    lines[at] = lines[at].replace(lines[at].split(b"\t")[3], b"oops")
    error = refused(read, b"\r\n".join(lines), "text-cell", CellError)
    assert f"row {at + 1}," in error.where
    assert "oops" in error.got


def test_lvm_segments_of_other_channels_are_not_one_recording(read, table):
    lines = lvm(table, segments=2).splitlines()
    second = [i for i, line in enumerate(lines) if line.startswith(b"X_Value")][1]
    lines[second] = lines[second].replace(b"Fy", b"Fx [lbf]")
    refused(read, b"\n".join(lines), "several-sheets", RecordingError)


def test_lvm_channels_of_different_times_are_not_one_recording(read, table):
    lines = lvm(table, x="Multi").splitlines()
    fields = lines[-3].split(b"\t")
    fields[2] = b"99.5"
    lines[-3] = b"\t".join(fields)
    refused(read, b"\n".join(lines), "doubled-column", ColumnError)


def test_lvm_with_a_separator_of_its_own(read, table):
    refused(read, lvm(table).replace(b"Separator\tTab", b"Separator|Pipe", 1), "unreadable")


def test_lvm_without_rows(read, table):
    empty = {name: values[:0] for name, values in table.items()}
    refused(read, lvm(empty), "no-data")
