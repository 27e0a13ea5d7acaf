"""Every table that people bring is read by one reader: encodings, separators and decimal signs alike."""

import numpy as np
import pytest

from toolkit.audit.linked import read_reports
from toolkit.comparison.laboratory_file import read_laboratories
from toolkit.comparison.maker_table import maker_characteristics
from toolkit.errors import ToolkitError
from toolkit.tires.field_file import is_field_file, read_field_file
from toolkit.tires.table import read_table

ENCODINGS = {
    "utf-8": "", "utf-8-sig": "", "utf-16": "", "utf-16-le": "\ufeff", "utf-16-be": "\ufeff", "cp1252": "",
}  # fmt: skip
WAYS = [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]
EVERY = [(encoding, *way) for encoding in ENCODINGS for way in WAYS]


def written(path, rows, encoding, separator, decimal):
    lines = [separator.join(cell.replace(".", decimal) for cell in row) for row in rows]
    head = separator.join(rows[0])
    path.write_bytes((ENCODINGS[encoding] + "\r\n".join([head, *lines[1:]]) + "\r\n").encode(encoding))
    return path


@pytest.mark.parametrize(("encoding", "separator", "decimal"), EVERY)
def test_a_table_of_forces(tmp_path, encoding, separator, decimal):
    rows = [
        ["SA [°]", "FZ [N]", "FY [N]", "MZ [N·m]"],
        ["-2.5", "3000", "1200.25", "-31.5"],
        ["0", "3000", "0", "0"],
    ]
    table = read_table(written(tmp_path / "t.csv", rows, encoding, separator, decimal))
    assert np.degrees(table["SA"]) == pytest.approx([-2.5, 0])
    assert table["FY"].tolist() == [1200.25, 0.0]
    assert table["MZ"].tolist() == [-31.5, 0.0]


@pytest.mark.parametrize(("encoding", "separator", "decimal"), EVERY)
def test_a_makers_characteristics(tmp_path, encoding, separator, decimal):
    rows = [["FZ [N]", "conicity [N]"], ["3000", "45.5"], ["4000", "60.25"]]
    read = maker_characteristics(
        written(tmp_path / "m.csv", rows, encoding, separator, decimal), identity="m"
    )
    assert [row.number.value for row in read] == [45.5, 60.25]


@pytest.mark.parametrize(("encoding", "separator", "decimal"), EVERY)
def test_the_results_of_laboratories(tmp_path, encoding, separator, decimal):
    rows = [["laboratory", "value [N]"], ["Köln", "10.5"], ["Köln", "10.7"], ["Lyon", "11.25"]]
    measurands, unit = read_laboratories(written(tmp_path / "l.csv", rows, encoding, separator, decimal))
    (results,) = measurands.values()
    assert unit == "N"
    assert {one.laboratory: one.values for one in results} == {"Köln": (10.5, 10.7), "Lyon": (11.25,)}


@pytest.mark.parametrize(("encoding", "separator", "decimal"), EVERY)
def test_a_list_of_past_reports(tmp_path, encoding, separator, decimal):
    rows = [["report", "test"], ["Bericht Ü 1", "2018/tire A"]]
    (report,) = read_reports(written(tmp_path / "r.csv", rows, encoding, separator, decimal), [])
    assert (report.report, report.names) == ("Bericht Ü 1", {"2018/tire A"})


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_file_of_the_field(tmp_path, encoding):
    rows = [
        ["ET", "SA", "FZ", "FY"],
        ["s", "deg", "N", "N"],
        ["0.0", "1.5", "-3000", "-900"],
        ["0.1", "2", "-3000", "-1200"],
    ]
    path = written(tmp_path / "f.dat", rows, encoding, "\t", ".")
    assert is_field_file(path)
    assert read_field_file(path).columns["FY"].tolist() == [-900.0, -1200.0]


def test_bytes_that_are_no_text_in_any_of_them_are_refused(tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes(b"SA [deg],FZ [N],FY [N]\n1,\x81,3\n")
    for read in (read_table, read_laboratories, lambda file: read_reports(file, [])):
        with pytest.raises(ToolkitError) as refusal:
            read(path)
        assert refusal.value.exit_code == 2
