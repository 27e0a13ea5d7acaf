"""A broken seal is seen, wherever it was broken."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from proof.batch import draw_batch, seed_of
from proof.draw import counts_of
from proof.seal import SealError, opened, verify

pytestmark = pytest.mark.usefixtures("light_families")


@pytest.fixture(scope="module")
def batch(light_families: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three small cases, sealed."""
    folder = tmp_path_factory.mktemp("sealed") / "batch"
    draw_batch(folder, seed=41, counts=counts_of(3), workers=1)
    return folder


@pytest.fixture
def copy(batch: Path, tmp_path: Path) -> Path:
    """A copy that may be broken."""
    import shutil

    return Path(shutil.copytree(batch, tmp_path / "batch"))


def test_an_untouched_batch_verifies_and_opens(batch: Path) -> None:
    assert verify(batch)["cases"] == 3
    answers, truth = opened(batch)
    assert set(answers["cases"]) == set(truth)
    assert len(answers["salt"]) == 64  # 256 bits
    assert answers["seed"] == hex(41)


def test_the_seal_is_the_sha256_of_the_answers_file(batch: Path) -> None:
    text = (batch / "sealed" / "answers.json").read_bytes()
    assert (
        json.loads((batch / "batch.json").read_text())["answers_sha256"] == hashlib.sha256(text).hexdigest()
    )


def test_the_salt_differs_from_draw_to_draw_and_the_data_does_not(batch: Path, tmp_path: Path) -> None:
    again = draw_batch(tmp_path / "again", seed=41, counts=counts_of(3), workers=1)
    first = json.loads((batch / "batch.json").read_text())
    assert again["data_sha256"] == first["data_sha256"]
    assert again["answers_sha256"] != first["answers_sha256"]


def test_a_changed_sample_breaks_the_seal(copy: Path) -> None:
    path = next((copy / "cases").rglob("run01.csv"))
    path.write_text(path.read_text().replace("1", "2", 1))
    with pytest.raises(SealError, match="cases"):
        verify(copy)


def test_an_added_file_breaks_the_seal(copy: Path) -> None:
    (next((copy / "cases").iterdir()) / "note.txt").write_text("")
    with pytest.raises(SealError, match="cases"):
        verify(copy)


def test_a_changed_answer_breaks_the_seal(copy: Path) -> None:
    path = copy / "sealed" / "answers.json"
    path.write_text(path.read_text().replace('"null"', '"single"', 1) + " ")
    with pytest.raises(SealError, match="answers"):
        verify(copy)


def test_a_changed_prediction_breaks_the_seal(copy: Path) -> None:
    path = next((copy / "sealed").glob("case*.csv"))
    path.write_text(path.read_text().replace("0,", "1,", 1))
    with pytest.raises(SealError, match="predictions"):
        opened(copy)


def test_the_batch_can_be_verified_without_its_answers(copy: Path) -> None:
    import shutil

    shutil.rmtree(copy / "sealed")
    assert verify(copy)["cases"] == 3


def test_a_seed_is_a_number_or_the_operating_systems() -> None:
    assert seed_of("0x1f") == 31
    assert seed_of("os") != seed_of("os")
    assert seed_of("os").bit_length() > 200
