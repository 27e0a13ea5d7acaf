"""TYDEX 1.3: fixed columns, factor and offset, constants, what is kept, what is refused."""

import numpy as np
import pytest

from toolkit.errors import CellError, ToolkitError, UnitError, UnreadableError
from toolkit.tires.tydex import fitted, read_tydex, tydex_text

FILE = """**HEADER
RELEASE   Release of TYDEX-Format                 1.3
MEASID    Measurement ID                          T42

**COMMENTS
a bench

**CONSTANTS
! name    description                   unit      value
INFLPRES  inflation pressure            bar       2.5
LOCATION  where                                   drum
**MEASURCHANNELS
SLIPANGL  slip angle                    deg       0.1       0         0
FZW       load                          kN        0.001     0         0.5
FYW       side force                    N         1
MZW       aligning moment               Nm        2         -1
WHROTSPD  wheel speed                   rad/s     1         0         0
**MEASURDATA         2
       -20      3500      1200      10.5        70
       400-3500.1234  -2345.67-123456.78        71
**END
"""


@pytest.fixture
def read(tmp_path):
    def made(text=FILE, encoding="utf-8"):
        path = tmp_path / "tire.tdx"
        path.write_bytes(text.encode(encoding))
        return read_tydex(path)

    return made


def channel(file, symbol):
    return next((one.unit, one.values.tolist()) for one in file.channels if one.symbol == symbol)


def test_physical_is_factor_times_value_plus_offset_in_the_unit_given(read):
    file = read()
    assert channel(file, "SA") == ("deg", [-2.0, 40.0])
    assert channel(file, "FZ")[0] == "kN"
    assert channel(file, "FZ")[1] == pytest.approx([4.0, -3.0001234])
    assert channel(file, "FY") == ("N", [1200.0, -2345.67])
    # Columns of ten that touch each other are still two numbers.
    assert channel(file, "MZ") == ("N*m", [20.0, pytest.approx(-246914.56)])
    assert channel(file, "P") == ("bar", [2.5, 2.5])
    assert file.findings == ()


def test_what_is_not_ours_is_named(read):
    file = read()
    assert [one.name for one in file.channels if one.symbol is None] == ["WHROTSPD"]
    assert any("LOCATION = drum" in one for one in file.other)
    assert "MEASID" in file.other


def test_a_measured_channel_outranks_its_constant(read):
    text = FILE.replace(
        "INFLPRES  inflation pressure            bar  ", "FZW       nominal                       kN   "
    )
    file = read(text)
    assert channel(file, "FZ")[1][0] == 4.0
    assert [finding.rule for finding in file.findings] == ["tydex-constant"]


def test_rows_out_of_their_columns_are_read_by_spaces_and_said(read):
    file = read(FILE.replace("       -20      3500      1200      10.5        70", "-20 3500 1200 10.5 70"))
    assert channel(file, "FY")[1][0] == 1200.0
    assert [finding.rule for finding in file.findings] == ["tydex-columns"]


@pytest.mark.parametrize(
    ("old", "new", "error", "rule"),
    [
        ("**END\n", "", UnreadableError, "tydex-end"),
        ("**MEASURDATA         2", "**MEASURDATA         3", UnreadableError, "tydex-end"),
        ("**MEASURCHANNELS", "**CHANNELS", UnreadableError, "not-a-tydex"),
        ("**MEASURDATA         2", "**MEASURDATA\n**CONSTANTS", UnreadableError, "not-a-tydex"),
        ("      1200", "       nan", CellError, "text-cell"),
        ("      1200", "      1,2 ", CellError, "text-cell"),
        ("      1200", "      1e999", CellError, "text-cell"),
        ("      10.5        70", "      10.5", CellError, "empty-cell"),
        ("        70", "        70        71", CellError, "ragged-row"),
        ("side force                    N ", "side force                    kg", UnitError, "unit-dimension"),
        ("side force                    N ", "side force                    xy", UnitError, "unknown-unit"),
        ("0.001     0         0.5", "0.001     1         0.5", UnreadableError, "tydex-offset"),
        ("FYW  ", "FZW  ", UnreadableError, "doubled-column"),
        ("bar       2.5", "bar       two", CellError, "text-cell"),
    ],
)
def test_hostile_files_are_refused_with_all_parts(read, old, new, error, rule):
    assert old in FILE
    with pytest.raises(error) as caught:
        read(FILE.replace(old, new, 1))
    assert (caught.value.rule, caught.value.exit_code) == (rule, 2)
    assert "tire.tdx" in caught.value.where
    assert caught.value.expected
    assert caught.value.next_step


def test_other_files(tmp_path, read):
    for content in (b"", b"hello", b"**END\n", b"PK\x03\x04\x00\x00"):
        (tmp_path / "x.tdx").write_bytes(content)
        with pytest.raises(ToolkitError):
            read_tydex(tmp_path / "x.tdx")
    with pytest.raises(ToolkitError):
        read_tydex(tmp_path / "none.tdx")
    assert channel(read(FILE.replace("a bench", "größe"), "latin-1"), "P")[0] == "bar"


def test_written_and_read_again(read):
    columns = {
        "SA": ("deg", np.array([-2.5, 0.125])),
        "FZ": ("N", np.array([4000.0, 4000.5])),
        "KAPPA": ("1", np.array([0.01, -0.02])),
        "FX": ("N", np.array([1.0, 2.0])),
        "MZ": ("N*m", np.array([-1234.5, 3.0])),
        "t": ("s", np.array([0.0, 0.01])),
    }
    text, findings = tydex_text(columns, comments=("from a table",))
    assert findings == ()
    again = read(text)
    assert again.findings == ()
    for symbol, (name, values) in columns.items():
        assert channel(again, symbol) == (name, values.tolist())
    lines = text.splitlines()
    line = lines[lines.index("**MEASURCHANNELS") + 5]
    assert (line[:10], line[40:50], line[50:60], line[60:70]) == (
        "MZW       ",
        "Nm        ",
        "1         ",
        "0         ",
    )


def test_digits_that_ten_columns_lose_are_said():
    _, findings = tydex_text({"FY": ("N", np.array([1234.567891234]))})
    assert [finding.rule for finding in findings] == ["tydex-digits"]


@pytest.mark.parametrize(
    "value", [0.0, -1.0, 123456789.0, -1234567890.0, 1e-300, -1e300, 0.1 + 0.2, 2 / 3e-7]
)
def test_every_number_leaves_a_space(value):
    assert len(fitted(value)) <= 9
    assert float(fitted(value)) == pytest.approx(value, rel=5e-2)


def carrier(camber=""):
    lines = (
        "SLIPANGL  slip angle                    deg       1         0         0\n"
        "FZC       load                          kN        1         0         0\n"
        "FYC       side force                    N         1         0         0\n"
        "MZC       aligning moment               Nm        1         0         0\n"
    )
    return (
        f"**HEADER\n**CONSTANTS\n{camber}**MEASURCHANNELS\n{lines}"
        "**MEASURDATA         2\n         2         4      1200      -9.5\n        -2         4     -1200"
        "       9.5\n**END\n"
    )


@pytest.mark.parametrize(
    "camber",
    ["", "INCLANGL  camber                        deg       0\n"],
    ids=["no camber named", "zero camber"],
)
def test_without_camber_the_carriers_axes_are_the_roads(read, camber):
    # TYDEX manual 1.3: C turns into W about the x-axis by the inclination angle, and W's origin lies below.
    file = read(carrier(camber))
    assert channel(file, "FZ") == ("kN", [4.0, 4.0])
    assert channel(file, "FY") == ("N", [1200.0, -1200.0])
    assert channel(file, "MZ")[1] == [-9.5, 9.5]
    assert [(one.rule, one.level) for one in file.findings] == [("tydex-axes", "note")]


def test_with_camber_the_carriers_axes_are_not_taken_for_the_roads(read):
    file = read(carrier("INCLANGL  camber                        deg       2\n"))
    assert {one.symbol for one in file.channels} == {"SA", "IA", None}
    assert [(one.rule, one.level) for one in file.findings] == [("tydex-axes", "warning")]


def test_a_sign_that_was_turned_leaves_no_minus_before_zero():
    assert fitted(-0.0) == "0"
