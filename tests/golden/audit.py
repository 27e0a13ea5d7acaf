"""Audit answers of archives whose grades are known by their making, and what a repair writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.golden.entries import golden
from tests.golden.surface import CALIBRATIONS, FIGURE_4_4, make_archive
from tests.golden.workplace import Workplace, csv_columns, sheets

DAY = "2026-01-01"


def _archive(place: Workplace) -> tuple[Path, Path]:
    return place.once("archive", lambda room: make_archive(room.folder, files=78, rows=60, seed=20260401))


def _answer(place: Workplace, folder: Path, *words: object, calibrations: Path) -> dict[str, Any]:
    """Return an audit's answer; the hash of a recording made for it is left out: it has a time in it."""
    answer = place.answer("audit", folder, *words, calibrations=calibrations)
    for row in answer["answer"]["files"] + answer["answer"].get("repaired", []):
        row.pop("sha256", None)
        row.pop("replaces_sha256", None)
    return answer


@golden("audit/archive", quick=True)
def archive(place: Workplace) -> Any:
    """Every grade: sign variants, swaps, stale, segments, a single row, unknown, undated, unreadable."""
    folder, calibrations = _archive(place)
    return _answer(place, folder, "--known-at", DAY, calibrations=calibrations)


@golden("audit/known-earlier")
def known_earlier(place: Workplace) -> Any:
    """The same archive as it was judged in 2004."""
    folder, calibrations = _archive(place)
    return _answer(place, folder, "--known-at", "2004-06-01", calibrations=calibrations)


@golden("audit/repair")
def repair(place: Workplace) -> Any:
    """Corrected copies: the values of their columns."""
    folder, calibrations = _archive(place)
    answer = _answer(
        place, folder, "--known-at", DAY, "--repair", "corrected", "--out", "out", calibrations=calibrations
    )
    corrected = place.folder / "corrected"
    values = {}
    for path in sorted(path for path in corrected.rglob("*") if path.is_file()):
        name = path.relative_to(corrected).as_posix()
        if path.suffix == ".csv":
            values[name] = csv_columns(path, every=20)
        elif path.read_bytes()[:2] == b"PK":
            values[name] = sheets(path, every=20)
        else:
            values[name] = "a file"
    return answer | {"corrected": values}


@golden("audit/figure-4-4", quick=True)
def figure_4_4(place: Workplace) -> Any:
    """The recording of the source document under the packaged registry, with a report that names it."""
    folder = place.write({"test.toml": 'schema = 1\nmachine = "m15"\ndate = 2019-03-01\n'}, "archive/2019")
    (folder / "run").write_bytes(FIGURE_4_4.read_bytes())
    (folder / "cut.xlsx").write_bytes(FIGURE_4_4.read_bytes()[:3000])
    (folder.parent / "loose.xlsx").write_bytes(FIGURE_4_4.read_bytes())
    reports = place.write({"reports.csv": "report,test\nR-1,2019\nR-2,nowhere\n"}) / "reports.csv"
    return place.answer(
        "audit", place.folder / "archive", "--known-at", DAY, "--reports", reports, calibrations=CALIBRATIONS
    )
