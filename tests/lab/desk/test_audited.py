"""An audit that was answered: its first line, its files by filter and order, one file's curves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.benchmarks.archive_factory import KNOWN_AT, make_archive
from toolkit.audit.sides import disputed
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.lab.archives.audit_headline import headline_of
from toolkit.lab.desk.audited import Audited, read_audited, stamp
from toolkit.lab.laboratory import open_laboratory


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, list[dict[str, Any]]]:
    """An audit's folder, its registry, and the lines of its answer."""
    folder = tmp_path_factory.mktemp("audited")
    archive = make_archive(folder, files=40, rows=100)
    out = folder / "out"
    open_laboratory(calibrations=archive.calibrations).audit_archive(
        archive.folder, out=out, known_at=KNOWN_AT
    )
    lines = [json.loads(line) for line in (out / "audit.jsonl").read_text().splitlines()[1:]]
    return out, archive.calibrations, lines


@pytest.fixture(scope="module")
def audited(made: tuple[Path, Path, list[dict[str, Any]]]) -> Audited:
    return read_audited(made[0])


def wrong(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        line for line in lines
        if line["grade"] not in ("exact", "rounding") and line["repair"] and any(line["repair"].values())
        and not disputed(line)
    ]  # fmt: skip


def test_the_first_line_counts_what_the_answer_holds(
    made: tuple[Path, Path, list[dict[str, Any]]], audited: Audited
) -> None:
    lines, headline = made[2], audited.headline
    bad = wrong(lines)
    assert 0 < len(bad) < len(lines)
    assert (headline.files, headline.wrong) == (len(lines), len(bad))
    assert headline.FY_N == max(line["repair"]["FY_max_abs_N"] for line in bad)
    assert headline.MZ_Nm == max(line["repair"]["MZ_max_abs_Nm"] for line in bad)
    months = sorted(line["date"][:7] for line in bad)
    assert (headline.first, headline.last) == (months[0], months[-1])
    assert sum(count for _, _, count in headline.causes) == len(bad)
    assert dict(audited.grades) == {
        grade: count for grade in audited.grades if (count := sum(line["grade"] == grade for line in lines))
    }


def test_it_counts_as_the_audit_itself_does(
    made: tuple[Path, Path, list[dict[str, Any]]], tmp_path: Path
) -> None:
    head, *lines = (made[0] / "audit.jsonl").read_text().splitlines()
    small = json.loads(lines[0]) | {
        "grade": "stale", "repair": {"FY_max_abs_N": 0.05, "MZ_max_abs_Nm": 0.001}, "sides": None
    }  # fmt: skip
    (tmp_path / "audit.jsonl").write_text("\n".join([head, json.dumps(small), *lines[1:]]) + "\n")
    page, answer = read_audited(tmp_path).headline, headline_of([small, *map(json.loads, lines[1:])])
    assert answer.small == 1
    assert (page.wrong, page.FY_N, page.MZ_Nm) == (answer.wrong, answer.FY_N, answer.MZ_Nm)
    assert (page.first, page.last) == (answer.first, answer.last)
    assert page.disputed == answer.altered + answer.disputed


def test_files_are_found_by_words_and_grades_in_an_order(
    made: tuple[Path, Path, list[dict[str, Any]]], audited: Audited
) -> None:
    lines = made[2]
    assert [audited.files[place].path for place in audited.found()] == [line["path"] for line in lines]
    stale = audited.found(grades=("stale", "sign_variant"))
    assert len(stale) == sum(line["grade"] in ("stale", "sign_variant") for line in lines)
    name = lines[7]["path"]
    assert [audited.files[place].path for place in audited.found(name.upper())] == [
        line["path"] for line in lines if name in line["path"]
    ]
    changes = [audited.files[place].FY_N or -1.0 for place in audited.found(order="change")]
    assert changes == sorted(changes, reverse=True)
    assert audited.found("no such file") == []


def test_a_line_is_the_answer_itself_and_its_curves_differ_by_the_repair(
    made: tuple[Path, Path, list[dict[str, Any]]], audited: Audited
) -> None:
    _, calibrations, lines = made
    registry = Registry(calibrations)
    for place in audited.found(order="change")[:3]:
        assert audited.line(place) == lines[place]
        charts, same = audited.charts(place, registry)
        assert same
        file, record = (np.array(series["y"]) for series in charts["FY"]["series"])
        assert np.abs(file - record).max() == pytest.approx(lines[place]["repair"]["FY_max_abs_N"])


def test_a_file_that_changed_since_is_told(
    made: tuple[Path, Path, list[dict[str, Any]]], audited: Audited, tmp_path: Path
) -> None:
    import dataclasses
    import shutil

    _, calibrations, lines = made
    copy = tmp_path / "archive"
    assert audited.archive is not None
    shutil.copytree(audited.archive, copy)
    places = audited.found(grades=("exact",))
    first, second = (copy / lines[place]["path"] for place in places[:2])
    shutil.copy(second, first)
    moved = dataclasses.replace(audited, archive=copy)
    assert moved.charts(places[0], Registry(calibrations))[1] is False
    first.unlink()
    with pytest.raises(ToolkitError):
        moved.charts(places[0], Registry(calibrations))


def test_a_path_that_leads_out_of_the_archive_is_refused(tmp_path: Path, audited: Audited) -> None:
    line = audited.line(0) | {"path": "../../secret.xlsx"}
    head = {"known_at": "2026-01-01", "archive": str(tmp_path)}
    (tmp_path / "audit.jsonl").write_text(f"{json.dumps(head)}\n{json.dumps(line)}\n")
    with pytest.raises(ToolkitError) as caught:
        read_audited(tmp_path).charts(0, Registry(tmp_path))
    assert caught.value.rule == "archive"


@pytest.mark.parametrize("text", ["", "{}\n", '{"known_at": "2026-01-01"}\n{"path": 1}\n', "\x00\n", "[]\n"])
def test_what_is_no_answer_is_refused_with_its_place(tmp_path: Path, text: str) -> None:
    (tmp_path / "audit.jsonl").write_text(text)
    with pytest.raises(ToolkitError) as caught:
        read_audited(tmp_path)
    assert "audit.jsonl" in str(caught.value)


def test_an_answer_that_was_replaced_has_another_stamp(tmp_path: Path) -> None:
    from toolkit.publication import publication

    assert stamp(tmp_path) is None
    stamps = []
    for _ in range(2):
        with publication(tmp_path) as stage:
            (stage / "audit.jsonl").write_text('{"known_at": "2026-01-01"}\n')
        stamps.append(stamp(tmp_path))
    assert stamps[0] != stamps[1]


def test_a_name_that_looks_like_a_key_is_a_name(audited: Audited, tmp_path: Path) -> None:
    name = 'a, "conditions": b.xlsx'
    line = audited.line(0) | {"path": name}
    (tmp_path / "audit.jsonl").write_text(f'{{"known_at": "2026-01-01"}}\n{json.dumps(line)}\n')
    assert read_audited(tmp_path).files[0].path == name
