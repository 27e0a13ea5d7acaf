"""Draw, run, score and page with a stand-in for the tool; the real layer's own rules."""

from __future__ import annotations

import dataclasses
import gzip
import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from proof import proof_file, real_cases
from proof.__main__ import main
from proof.judge import judge
from proof.real import right, run_real, sized
from proof.running import answer_of
from tests.conftest import SHARED_DATA

ANSWER = """
import json, pathlib, sys
out = pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
out.mkdir(parents=True)
count = pathlib.Path(__file__).with_name("count")
count.write_text(str(int(count.read_text() if count.exists() else 0) + 1))
answer = {"schema": 1, "verdict": "nothing", "effects": [], "mismatch": [], "not_found": []}
(out / "diagnosis.json").write_text(json.dumps(answer))
"""


pytestmark = pytest.mark.usefixtures("light_families")


@pytest.fixture(scope="module")
def tool(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that answers "nothing" to every case, and counts."""
    folder = tmp_path_factory.mktemp("tool")
    (folder / "tool.py").write_text(ANSWER)
    (folder / "tool").write_text(f'#!/bin/sh\nexec {sys.executable} {folder}/tool.py "$@"\n')
    (folder / "tool").chmod(0o755)
    return folder / "tool"


@pytest.fixture(scope="module")
def batch(tool: Path, light_families: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch of four that was drawn and run."""
    out = tmp_path_factory.mktemp("batch") / "b"
    common = ["--out", str(out), "--workers", "1"]
    assert main(["draw", "--seed", "106", "--cases", "4", *common]) == 0
    assert main(["run", "--tool", str(tool), *common]) == 0
    return out


def test_a_case_is_run_once(batch: Path, tool: Path) -> None:
    before = tool.with_name("count").read_text()
    assert main(["run", "--tool", str(tool), "--out", str(batch), "--workers", "1"]) == 0
    assert tool.with_name("count").read_text() == before
    assert answer_of(batch, "case0001") is not None


def test_an_answer_that_cannot_be_read_is_none(batch: Path, tmp_path: Path) -> None:
    assert answer_of(tmp_path, "case0001") is None
    path = tmp_path / "runs" / "case0001" / "answer"
    path.mkdir(parents=True)
    (path / "diagnosis.json").write_text("{")
    assert answer_of(tmp_path, "case0001") is None


def test_the_score_and_its_page(batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [
        "score",
        "--out",
        str(batch),
        "--workers",
        "1",
        "--proof",
        str(tmp_path),
        "--log",
        str(tmp_path / "log"),
    ]
    assert main([*given, "--changed", "first"]) == 0
    assert main([*given, "--changed", "again"]) == 0  # the same batch stands in the log once
    shown = capsys.readouterr().out
    assert "false names on nulls: 0 of" in shown
    text = (tmp_path / "PROOF.md").read_text(encoding="utf-8")
    batch_json = json.loads((batch / "batch.json").read_text())
    assert batch_json["answers_sha256"] in text
    html = (tmp_path / "proof.html").read_text(encoding="utf-8")
    assert "<script" not in html
    assert "://" not in html
    assert html.count("<svg") == 3
    assert len((tmp_path / "log").read_text().splitlines()) == 1
    for part in ("Never put in", "pressure_change", "Outside the catalogue", "why it is outside", "verify"):
        assert part in text
        assert part in html


def _small(batch: Path, folder: Path) -> Path:
    """Score the batch and return the file that stands for it."""
    log = folder / "batches.jsonl"
    given = ["score", "--out", str(batch), "--workers", "1", "--proof", str(folder), "--log", str(log)]
    assert main(given) == 0
    head = json.loads((batch / "batch.json").read_text())["answers_sha256"][:16]
    return folder / f"proof-{head}.jsonl.gz"


def test_a_scored_batch_is_scored_again_from_its_small_file(
    batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _small(batch, tmp_path)
    bars = [x for x in capsys.readouterr().out.splitlines() if "(at " in x or "(93" in x]
    assert len(bars) == 8
    assert main(["verify", "--answers", str(path)]) == 0
    shown = capsys.readouterr().out
    assert all(line in shown for line in bars)
    assert json.loads((batch / "batch.json").read_text())["answers_sha256"] in shown
    first = path.read_bytes()
    assert _small(batch, tmp_path).read_bytes() == first


def test_the_seed_in_the_small_file_draws_the_sealed_data_again(batch: Path, tmp_path: Path) -> None:
    path = _small(batch, tmp_path)
    given = ["verify", "--answers", str(path), "--out", str(tmp_path / "again"), "--workers", "1"]
    assert main(given) == 0
    made = json.loads((tmp_path / "again" / "batch.json").read_text())
    assert made["data_sha256"] == json.loads((batch / "batch.json").read_text())["data_sha256"]
    assert made["generator_sha256"] == proof_file.read(path).batch["generator_sha256"]


def test_another_seed_is_not_the_sealed_batch(
    batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    proof = proof_file.read(_small(batch, tmp_path))
    text = proof.answers.replace('"seed": "0x6a"', '"seed": "0x6b"')
    assert text != proof.answers
    other = dataclasses.replace(
        proof, answers=text, batch=proof.batch | {"answers_sha256": hashlib.sha256(text.encode()).hexdigest()}
    )
    proof_file.write(tmp_path / "other.gz", other)
    given = ["verify", "--answers", str(tmp_path / "other.gz"), "--out", str(tmp_path / "b")]
    assert main([*given, "--workers", "1"]) == 1
    assert "does not give the data" in capsys.readouterr().err


def _cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def _reworded(data: bytes) -> bytes:
    return gzip.compress(gzip.decompress(data).replace(b"null", b"nulk", 1))


def _without_a_case(data: bytes) -> bytes:
    return gzip.compress(b"".join(gzip.decompress(data).splitlines(keepends=True)[:-1]))


def _a_case_twice(data: bytes) -> bytes:
    lines = gzip.decompress(data).splitlines(keepends=True)
    return gzip.compress(b"".join([*lines, lines[-1]]))


@pytest.mark.parametrize("damage", [_cut, _reworded, _without_a_case, _a_case_twice, lambda _: b""])
def test_a_small_file_that_was_changed_breaks_the_seal(
    damage: Callable[[bytes], bytes], batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _small(batch, tmp_path)
    path.write_bytes(damage(path.read_bytes()))
    assert main(["verify", "--answers", str(path)]) == 1
    assert "seal broken" in capsys.readouterr().err


def test_verify_asks_what_to_verify(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify"]) == 1
    assert "nothing to verify" in capsys.readouterr().err


def test_a_small_file_keeps_all_that_the_judge_reads() -> None:
    answer = {
        "verdict": "named", "remaining": "nothing", "fit": {"held_out": [1]},
        "mismatch": [{"channel": "F", "share_of_variance": 0.5, "where": []}],
        "effects": [{"name": "a", "statement": "..", "equivalent_to": ["b"],
                     "parameters": [{"name": "x", "value": 1.0, "ci95": [0.5, 1.5], "runs": None}]}],
        "not_found": [{"name": "c", "minimum_detectable": 0.1, "observable": True, "unit": "N"}],
    }  # fmt: skip
    sealed = {
        "bucket": "single", "size": 2.0, "distance": 9.0, "alike": {}, "by_output": {"F": 2.0, "G": 0.1},
        "effects": [{"name": "a", "parameters": {"x": 1.2}, "either_sign": False}],
    }  # fmt: skip
    assert judge("c", sealed, answer) == judge("c", sealed, proof_file.judged_part(answer))
    assert judge("c", sealed, answer).covered == {"a.x": True}


def test_a_file_that_no_repository_should_hold_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proof_file, "LARGEST_BYTES", 10)
    with pytest.raises(ValueError, match="at most 10"):
        proof_file.write(tmp_path / "p.gz", proof_file.Proof(batch={}, answers="{}", cases={}))
    assert list(tmp_path.iterdir()) == []


def test_a_broken_seal_ends_with_one(batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import shutil

    broken = Path(shutil.copytree(batch, tmp_path / "b"))
    (broken / "cases" / "case0001" / "CASE.toml").write_text("schema = 1\n")
    assert main(["verify", "--out", str(broken)]) == 1
    assert "seal broken" in capsys.readouterr().err


def test_a_batch_of_another_state_of_the_generator_is_not_scored(batch: Path, tmp_path: Path) -> None:
    import hashlib
    import shutil

    other = Path(shutil.copytree(batch, tmp_path / "b", ignore=shutil.ignore_patterns("score")))
    path = other / "sealed" / "answers.json"
    answers = json.loads(path.read_text())
    answers["seed"] = hex(107)
    path.write_text(json.dumps(answers))
    sealed = json.loads((other / "batch.json").read_text())
    sealed["answers_sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    (other / "batch.json").write_text(json.dumps(sealed))
    assert main(["score", "--out", str(other), "--workers", "1"]) == 1


def test_all_steps_in_one_command(tool: Path, tmp_path: Path) -> None:
    out = tmp_path / "b"
    given = ["all", "--out", str(out), "--seed", "106", "--cases", "1", "--workers", "1", "--tool", str(tool)]
    assert main([*given, "--data", str(tmp_path / "nowhere")]) == 0
    first = (out / "batch.json").read_bytes()
    assert main([*given, "--data", str(tmp_path / "nowhere")]) == 0
    assert (out / "batch.json").read_bytes() == first
    assert "Real recordings" in (out / "PROOF.md").read_text()


def _case(name: str) -> real_cases.RealCase:
    return next(c for c in real_cases.CASES if c.name == name)


@pytest.mark.parametrize(
    ("case", "verdict", "reported", "good"),
    [
        ("pontius", "named", [{"nonlinearity"}], True),
        ("pontius", "named", [{"hysteresis"}], False),
        ("pontius", "nothing", [], False),
        ("figure-4-4", "equivalent", [{"channel_sign", "wrong_calibration"}], True),
        ("emps-force", "named", [{"coulomb_friction"}], False),
        ("emps-force", "named", [{"coulomb_friction"}, {"constant_force", "zero_offset"}], True),
        ("emps-force", "named", [{"coulomb_friction"}, {"constant_force"}, {"creep"}], False),
        ("emps-loop", "named", [{"coulomb_friction"}, {"constant_force"}], True),
        ("whiffle-1", "equivalent", [{"quadratic_drag", "viscous_damping"}], True),
        ("golf", "nothing", [], True),
        ("golf", "named", [{"quadratic_drag"}], True),
        ("bowling", "named", [{"quadratic_drag"}], False),
        ("zarr13", "unknown", [], False),
    ],
)
def test_what_is_right_for_a_recording(case: str, verdict: str, reported: list[set[str]], good: bool) -> None:
    assert right(_case(case), verdict, tuple(frozenset(r) for r in reported)) is good


@pytest.mark.parametrize(
    ("friction", "offset", "good"), [(21.0, -3.0, True), (23.0, -3.0, False), (20.4, 4.0, False)]
)
def test_a_published_size_is_asked_as_well(friction: float, offset: float, good: bool) -> None:
    effects = [
        {"name": "coulomb_friction", "equivalent_to": [], "parameters": [{"value": friction}]},
        {"name": "zero_offset", "equivalent_to": ["constant_force"], "parameters": [{"value": offset}]},
    ]
    assert sized(_case("emps-force"), {"effects": effects}) is good
    assert not sized(_case("emps-force"), {"effects": effects[1:]})
    assert sized(_case("dziuba1"), {"effects": []})


def test_recordings_that_are_not_there_are_skipped_with_a_reason(tool: Path, tmp_path: Path) -> None:
    rows = run_real(tmp_path / "nowhere", tmp_path / "real", tool=[str(tool)], budget=5)
    assert all(row["answered"].startswith("skipped: ") for row in rows)


@pytest.mark.skipif(
    not SHARED_DATA.is_dir(), reason="the folder of public recordings is not beside the project"
)
def test_every_recording_becomes_a_case(tool: Path, tmp_path: Path) -> None:
    rows = run_real(SHARED_DATA, tmp_path / "real", tool=[str(tool)], budget=5)
    assert [row["case"] for row in rows] == [c.name for c in real_cases.CASES]
    assert {row["case"]: row["right"] for row in rows}["zarr13"] == "yes"  # the stand-in says nothing
    assert {row["case"]: row["right"] for row in rows}["dziuba1"] == "no"
    text = (tmp_path / "real" / "cases" / "dziuba1" / "run01.csv").read_text().splitlines()
    assert len(text) == 1001
    assert text[1] == "0,27.868"
