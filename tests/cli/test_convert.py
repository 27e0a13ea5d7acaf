"""`toolkit convert`: what comes back, what is named, what is refused."""

import functools
import json

import pytest

from tests.cli import one_command
from tests.cli.test_evaluate import TIRE
from toolkit.cli import convert
from toolkit.errors import ToolkitError
from toolkit.tires.table import read_table
from toolkit.tires.tir import read_tir
from toolkit.tires.tydex import read_tydex

run = functools.partial(one_command.run, convert.command)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "tire.csv"
    path.write_text("SA [deg],FZ [N],FY [N],MZ [N*m],P [kPa]\n-2,4000,1500.5,-40,220\n2,4000,-1500,41,220\n")
    return path


def test_table_to_tydex_is_ISO_and_comes_back(table, tmp_path):
    tydex, back = tmp_path / "tire.tdx", tmp_path / "back.csv"
    assert run(table, tydex)[0] == 0
    columns = {one.symbol: one.values.tolist() for one in read_tydex(tydex).channels}
    assert columns["SA"] == [2.0, -2.0]  # SAE to ISO-W: SA, FY and MZ change sign together
    assert columns["FY"] == [-1500.5, 1500.0]
    assert columns["FZ"] == [4000.0, 4000.0]
    assert run(tydex, back)[0] == 0
    one, other = read_table(table), read_table(back)
    assert [name for name, _ in one.columns] == [name for name, _ in other.columns]
    assert one.header == other.header
    for (_, values), (_, again) in zip(one.columns, other.columns, strict=True):
        assert values.tolist() == again.tolist()


def test_axes_are_those_of_the_table(table, tmp_path):
    run(table, tmp_path / "x.tdx", "--axes", "ISO-W")
    assert next(c.values[0] for c in read_tydex(tmp_path / "x.tdx").channels if c.symbol == "FY") == 1500.5
    code, out = run(tmp_path / "x.tdx", tmp_path / "y.csv", "--axes", "adapted-SAE", "--json")
    assert (code, json.loads(out)["axes"]) == (0, "adapted-SAE")
    assert read_table(tmp_path / "y.csv")["FY"][0] == -1500.5
    assert (tmp_path / "y.csv").read_text().splitlines()[1].startswith("-2.0,")


def test_what_has_no_place_is_named(tmp_path, table):
    run(table, tmp_path / "x.tdx")
    text = (
        (tmp_path / "x.tdx")
        .read_text()
        .replace("**CONSTANTS", "**CONSTANTS\nRIMNAME   rim                                     K7")
    )
    (tmp_path / "x.tdx").write_text(text)
    code, out = run(tmp_path / "x.tdx", tmp_path / "y.csv", "--json")
    assert code == 1
    assert "RIMNAME = K7" in json.loads(out)["findings"][0]["message"]


@pytest.mark.parametrize("fittyp", ["5", "52", "61", "62"])
def test_a_tire_file_keeps_its_model_its_keys_and_its_comments(tmp_path, fittyp):
    source, target, again = (tmp_path / name for name in ("a.tir", "b.tir", "c.tir"))
    source.write_text(TIRE.replace("61", fittyp) + "OWN_KEY = 3.25E-3  $ ours\n! the end\n")
    assert run(source, target)[0] == 0
    one, other = read_tir(source), read_tir(target)
    assert one.lines == other.lines
    assert other.number("FITTYP") == float(fittyp)
    assert other.number("OWN_KEY") == 3.25e-3
    run(target, again)
    assert again.read_bytes() == target.read_bytes()


@pytest.mark.parametrize(
    ("source", "target", "rule"),
    [
        ("tire.csv", "x.tir", "output-name"),
        ("tire.csv", "x.docx", "output-name"),
        ("tire.csv", "tire.csv", "output-name"),
        ("none.tdx", "x.csv", "no-file"),
        ("none.tir", "x.tir", "no-file"),
        ("bad.tir", "x.tir", "tir-fittyp"),
        ("bad.tir", "bad.tir", "original"),
    ],
)
def test_bad_input_is_refused_and_writes_nothing(table, tmp_path, source, target, rule):
    (tmp_path / "bad.tir").write_text(TIRE.replace("61", "7"))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ToolkitError) as caught:
        run(tmp_path / source, tmp_path / target)
    assert (caught.value.rule, caught.value.exit_code) == (rule, 2)
    assert caught.value.expected
    assert caught.value.next_step
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_unknown_axes(table, tmp_path):
    with pytest.raises(ToolkitError) as caught:
        run(table, tmp_path / "x.tdx", "--axes", "ISO")
    assert caught.value.rule == "unknown-axes"
