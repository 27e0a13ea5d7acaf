"""Files are taken by their hash, and test rows are kept from every fit."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.records import AbsentError, HashError, PublicSet, Record, published
from benchmarks.sets import SETS


def record(rows: int = 40, **more: int) -> Record:
    t = 0.5 * np.arange(rows)
    return Record(name="part", t=t, u=np.sin(t), y=3.0 + 0.25 * t, **more)


def test_a_file_with_another_hash_is_refused_with_both_hashes_and_the_page_that_helps(tmp_path: Path) -> None:
    path = tmp_path / "dataBenchmark.mat"
    path.write_bytes(b"converted by somebody")
    expected = hashlib.sha256(b"the publisher's").hexdigest()
    with pytest.raises(HashError) as error:
        published(path, expected)
    assert error.value.got == "SHA-256 " + hashlib.sha256(b"converted by somebody").hexdigest()
    assert error.value.expected == f"SHA-256 {expected}"
    assert str(path) in str(error.value)
    assert "docs/benchmarks.md" in str(error.value)


def test_a_file_with_the_hash_is_taken_and_an_absent_one_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(b"abc")
    # FIPS 180-2, appendix B.1: the digest of "abc".
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert published(path, digest) == path
    with pytest.raises(AbsentError, match=r"b\.mat"):
        published(tmp_path / "b.mat", digest)


@pytest.mark.parametrize("public", SETS, ids=lambda s: s.name)
def test_every_set_refuses_a_folder_with_files_of_its_names_and_other_content(
    public: PublicSet, tmp_path: Path
) -> None:
    for name in public.files:
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(HashError):
        public.read(tmp_path)


@pytest.mark.parametrize("public", SETS, ids=lambda s: s.name)
def test_every_hash_is_a_whole_sha256_and_every_figure_belongs_to_a_test_record(public: PublicSet) -> None:
    assert all(len(bytes.fromhex(sha256)) == 32 for sha256 in public.files.values())
    sizes = {len(figure.errors) for figure in public.figures} | ({len(public.aims)} - {0})
    assert len(sizes) <= 1
    assert all(figure.source for figure in public.figures)


def test_the_error_leaves_out_lead_in_and_warm_up() -> None:
    part = record(rows=40, warm_up=4, lead_in=10)
    simulated = part.y.copy()
    simulated[:14] = 1e9
    assert part.error_of(simulated) == 0.0
    simulated[14:] += 2.0
    assert part.error_of(simulated) == pytest.approx(2.0)


def test_a_simulation_that_ran_away_has_an_infinite_error() -> None:
    part = record()
    assert part.error_of(np.full(40, np.nan)) == np.inf
    assert part.error_of(np.full(40, 1e200)) == np.inf


def test_the_start_is_read_from_the_rows_that_may_start_a_model_alone() -> None:
    part = record(rows=40, warm_up=5)
    spoiled = part.y.copy()
    spoiled[5:] = 1e6
    value, rate = Record(name="x", t=part.t, u=part.u, y=spoiled, warm_up=5).start()
    assert value == pytest.approx(3.0)
    assert rate == pytest.approx(0.25)
