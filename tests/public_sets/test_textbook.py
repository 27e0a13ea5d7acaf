"""The case that a set is written as: training rows with outputs, test rows without."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks import __main__ as bench
from benchmarks import textbook
from benchmarks.__main__ import main, report
from benchmarks.records import PublicSet, Record, Split
from benchmarks.sets import SETS
from benchmarks.table import Report, Row, number
from toolkit.diagnosis.case.reader import read_case


def record(name: str, rows: int = 60, **more: int) -> Record:
    t = 0.1 * np.arange(rows)
    return Record(name=name, t=t, u=len(name) * np.sin(t), y=np.cos(t), **more)


def split() -> Split:
    return Split(
        train=(record("first"), record("second")),
        test=(record("later", warm_up=5), record("onward", warm_up=4, lead_in=20)),
    )


@pytest.mark.parametrize("public", SETS, ids=lambda s: s.name)
def test_every_set_is_a_case_that_is_read_and_simulated_from_its_first_row(
    public: PublicSet, tmp_path: Path
) -> None:
    case = read_case(textbook.write_case(public, split(), tmp_path))
    assert [run.name for run in case.runs] == ["run_first.csv", "run_second.csv"]
    spec = importlib.util.spec_from_file_location(public.name, tmp_path / "sim.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    values = {p.name: p.value for p in case.parameters}
    takes_run = "run" in module.initial.__code__.co_varnames
    start = module.initial(values, {"y0": 1.0, "rate0": 0.0}) if takes_run else module.initial(values)
    rates = module.rhs(0.0, np.array(start), {"u": 1.0}, values)
    assert len(rates) == len(start)
    assert np.all(np.isfinite(rates))
    assert set(module.outputs(np.array(start), {"u": 1.0}, values)) == {"y"}


def test_no_output_of_the_test_part_is_written_and_only_its_first_rows_start_the_model(
    tmp_path: Path,
) -> None:
    parts = split()
    textbook.write_case(SETS[0], parts, tmp_path)
    for name in ("later", "onward"):
        assert list(pd.read_csv(tmp_path / f"predict_{name}.csv").columns) == ["t", "u"]
    text = (tmp_path / "CASE.toml").read_text(encoding="utf-8")
    # cos at its start: 1 with a rate near 0; a record with a lead-in is begun at rest and says nothing.
    assert text.count("y0 = ") == 1
    assert "y0 = 0.99" in text or "y0 = 1.0" in text


def test_a_set_without_its_files_is_a_row_that_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path), "drives", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    (row,) = answer["benchmarks"][0]["rows"]
    assert row["run"] is False
    assert "DATAUNIF.MAT is not in the data folder" in row["remark"]


def test_a_wrong_file_ends_with_exit_code_2_and_its_hash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "DATAUNIF.MAT").write_bytes(b"abc")
    assert main([str(tmp_path), "drives"]) == 2
    shown = capsys.readouterr()
    assert "ba7816bf8f01cfea" in shown.err
    assert shown.out == ""


def test_an_unknown_set_is_refused_with_its_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path), "tank"])
    assert ended.value.code == 2
    assert "tank" in capsys.readouterr().err


def test_a_page_says_what_was_not_run_and_a_document_has_no_number_for_it(tmp_path: Path) -> None:
    public = SETS[0]
    shown = report(public, tmp_path, budget_s=1.0)
    assert "| all | not run |" in shown.markdown()
    ran_away = Report(public=public, rows=(Row(method="SINDy", errors=(float("inf"),)),))
    assert "| SINDy | diverged |" in ran_away.markdown()
    assert json.loads(json.dumps(ran_away.document()))["rows"][0]["errors"] == [None]
    assert public.files["dataBenchmark.mat"] in shown.markdown()


def test_three_digits_are_printed() -> None:
    assert [number(x) for x in (0.09618, 7.0, 1234.5)] == ["0.0962", "7", "1234"]


def test_a_name_counts_alone_and_in_a_class() -> None:
    answer = textbook.Answer(
        verdict="equivalent", remaining="unknown", complete=True, refitted=True,
        effects=("saturation = overflow",),
        errors={}, processor_s=1.0,
    )  # fmt: skip
    assert answer.names(("overflow",))
    assert not answer.names(("over",))


def test_a_budget_that_ends_before_the_refit_is_no_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = textbook.Answer(
        verdict="untestable", remaining="unknown", complete=False, refitted=False, effects=(),
        errors=dict.fromkeys(textbook.STAGES, (0.5,)), processor_s=1.0,
    )  # fmt: skip
    monkeypatch.setattr(bench, "diagnose", lambda *_, **__: nothing)
    declared, refitted, augmented = bench.diagnosis_rows(SETS[0], split(), tmp_path, 1.0)
    assert declared.errors == (0.5,)
    assert refitted.why_not == augmented.why_not == "the budget was spent before the parameters were fitted"


def test_without_a_budget_no_diagnosis_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "diagnose", lambda *_, **__: pytest.fail("the diagnosis was begun"))
    (row,) = bench.diagnosis_rows(SETS[0], split(), tmp_path, 0.0)
    assert row.why_not
