"""Real recordings: every case is read, every answer judged by what was written down before it."""

from __future__ import annotations

import gzip
import importlib.util
import json
import struct
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from benchmarks.recordings.__main__ import main
from benchmarks.recordings.answer import CASES, Answer, outcome, write_case
from benchmarks.recordings.catalogue import RECORDINGS
from benchmarks.recordings.page import sources, table
from benchmarks.recordings.readers import cooling, load_cell
from benchmarks.recordings.recording import Recording, Run
from benchmarks.records import HashError
from toolkit.diagnosis.case.reader import read_case
from toolkit.effects import catalogue

BY_NAME = {recording.name: recording for recording in RECORDINGS}


def simulator(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, CASES / name / "sim.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def channels(name: str) -> dict[str, dict[str, str]]:
    import tomllib

    case = tomllib.loads((CASES / name / "CASE.toml").read_text(encoding="utf-8"))
    return dict(case["recording"]["channels"])


def test_there_are_twelve_recordings_that_lack_something_and_three_controls() -> None:
    kinds = [recording.kind for recording in RECORDINGS]
    assert kinds.count("control") >= 3
    assert len(kinds) - kinds.count("control") >= 12
    assert len(BY_NAME) == len(RECORDINGS)


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda r: r.name)
def test_every_entry_names_its_source_and_only_effects_that_exist(recording: Recording) -> None:
    assert recording.published_at.startswith("https://")
    assert "commit " in recording.published_at
    assert recording.licence
    assert recording.missing
    assert all(len(bytes.fromhex(sha256)) == 32 for sha256 in recording.files.values())
    assert set(recording.names) <= set(catalogue.effects())
    assert bool(recording.names) == (recording.kind == "named")
    assert recording.missing in sources()


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda r: r.name)
def test_every_case_is_read_and_its_simulation_answers_at_the_declared_parameters(
    recording: Recording, tmp_path: Path
) -> None:
    declared = channels(recording.name)
    table = pd.DataFrame({name: np.linspace(1.0, 2.0, 30) for name in declared})
    conditions = {"speed0": 1.0, "start": 90.0, "angle0": 0.5}
    tables = {"first": table, "second": table.iloc[:-1]}
    runs = tuple(Run(name=name, table=rows, conditions=conditions) for name, rows in tables.items())
    case = read_case(write_case(recording, runs, tmp_path))
    assert [run.name for run in case.runs] == ["first.csv", "second.csv"]
    values = {p.name: p.value for p in case.parameters}
    outputs = {name for name, channel in declared.items() if channel["role"] == "output"}
    inputs = table.drop(columns=list(outputs))
    module = simulator(recording.name)
    if hasattr(module, "simulate"):
        answer = module.simulate(inputs, values)
        assert set(answer.columns) == outputs
        assert len(answer) == len(inputs)
        assert np.all(np.isfinite(answer.to_numpy()))
    else:
        takes_run = "run" in module.initial.__code__.co_varnames
        start = module.initial(values, dict(runs[0].conditions)) if takes_run else module.initial(values)
        assert np.all(np.isfinite(module.rhs(0.0, start, dict(inputs.iloc[0]), values)))
        assert set(module.outputs(start, dict(inputs.iloc[0]), values)) == outputs


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda r: r.name)
def test_a_file_of_another_content_is_refused(recording: Recording, tmp_path: Path) -> None:
    for name in recording.files:
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(HashError):
        recording.read(tmp_path)


def test_the_kth_repetition_at_each_load_is_a_run(tmp_path: Path) -> None:
    # The first lines of the publisher's table (public domain), under 25 lines of text.
    rows = ["2. 0.20024", "2. 0.20016", "2. 0.20024", "4. 0.40056", "4. 0.40045", "4. 0.40054"]
    path = tmp_path / "LOADCELL.DAT"
    path.write_text("\n".join(["text"] * 25 + rows) + "\n", encoding="latin-1")
    runs = load_cell({"LOADCELL.DAT": path})
    assert [list(run.table["response"]) for run in runs] == [
        [0.20024, 0.40056],
        [0.20016, 0.40045],
        [0.20024, 0.40054],
    ]
    assert all(list(run.table["load"]) == [2.0, 4.0] for run in runs)


def test_two_numeric_vectors_of_a_serialised_data_frame_are_time_and_temperature(tmp_path: Path) -> None:
    # R Internals, "Serialization Formats": a numeric vector is its type (14), its length and XDR doubles.
    minutes, degrees = np.arange(222.0), np.linspace(98.0, 26.0, 222)
    vectors = [struct.pack(">ii", 14, 222) + x.astype(">f8").tobytes() for x in (minutes, degrees)]
    path = tmp_path / "CoolingWater.rda"
    path.write_bytes(gzip.compress(b"RDX2\nX\n" + b"\x00\x00\x04\x02".join(vectors)))
    (run,) = cooling({"CoolingWater.rda": path})
    np.testing.assert_array_equal(run.table["t"], 60.0 * minutes)
    np.testing.assert_array_equal(run.table["temperature"], degrees)
    assert run.conditions["start"] == 98.0


@pytest.mark.parametrize(
    ("name", "verdict", "effects", "worth"),
    [
        ("pendulum", "named", ["coulomb_friction"], "right"),
        ("pendulum", "equivalent", ["viscous_damping = coulomb_friction"], "right"),
        ("pendulum", "named", ["channel_delay"], "false name"),
        ("pendulum", "unknown", [], "not named"),
        ("pendulum", "nothing", [], "nothing said"),
        ("pendulum", "untestable", [], "nothing said"),
        ("beam", "unknown", [], "right"),
        ("beam", "named", ["zero_drift"], "false name"),
        ("beam", "nothing", [], "nothing said"),
        ("pipeline", "nothing", [], "right"),
        ("pipeline", "named", ["nonlinearity"], "false name"),
        ("pipeline", "unknown", [], "not named"),
    ],
)
def test_an_answer_is_worth_what_the_entry_says(
    name: str, verdict: str, effects: list[str], worth: str
) -> None:
    assert outcome(BY_NAME[name], verdict, effects) == worth


def test_the_worst_answer_stands_first() -> None:
    answers = [
        Answer(recording="pendulum", outcome="right", verdict="named", effects=("coulomb_friction",)),
        Answer(recording="beam", outcome="false name", verdict="named", effects=("zero_drift",)),
        Answer(recording="damper", outcome="not named", verdict="unknown"),
    ]
    lines = table(answers).splitlines()[2:]
    assert [line.split(" | ")[0] for line in lines] == ["| beam", "| damper", "| pendulum"]


def test_a_recording_without_its_files_is_a_line_that_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = tmp_path / "results.jsonl"
    assert main([str(tmp_path), "beam", "--results", str(results)]) == 0
    assert "LEW.DAT is not in the data folder" in capsys.readouterr().out
    assert json.loads(results.read_text(encoding="utf-8"))["outcome"] == "not run"


def test_a_wrong_file_ends_with_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "LEW.DAT").write_bytes(b"abc")
    assert main([str(tmp_path), "beam"]) == 2
    assert "SHA-256" in capsys.readouterr().err
