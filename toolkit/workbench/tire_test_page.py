"""A test of the home: its recordings, its curves and characteristics, two of them beside each other.

Every part is the answer of a command: `audit` of its folder for the recordings, `process` for the results.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from toolkit.lab.desk.chart import common_ranges
from toolkit.lab.desk.holdings import Reported, rows_of_tests
from toolkit.lab.desk.seen_test import recordings_answer, results_answer, shown_conditions
from toolkit.lab.tire_tests.resolve import Resolved
from toolkit.workbench.bench import Bench, holding
from toolkit.workbench.page import Routes, as_file, page

WINDOW = 100
"""Rows of a list that are asked for at once."""
_MOST_QUERY = 200
_SAME_LOAD = 0.04
SIDES = ("left", "right")


def tests(request: Request) -> Response:
    """Return the list's page: nothing is looked through before it stands."""
    return page(request, "tests", query=query_of(request))


def test_windows(request: Request) -> Response:
    """Return the list of the tests that a text is found in, as windows that are filled when looked at."""
    bench: Bench = request.app.state.bench
    query = query_of(request)
    holdings = bench.holdings(again=not query)  # a person who types is not kept waiting by every letter
    total = sum(query.casefold() in place.casefold() for place in holdings.places["test"].values())
    return page(
        request, "part_tests", total=total, query=query, window=WINDOW, starts=range(0, total, WINDOW)
    )


def test_window(request: Request) -> Response:
    """Return the rows of one window of the list."""
    bench: Bench = request.app.state.bench
    holdings, query = bench.holdings(), query_of(request)
    ids = [
        test_id for test_id, place in holdings.places["test"].items() if query.casefold() in place.casefold()
    ]
    start = int(request.path_params["start"])
    rows = list(rows_of_tests(holdings, ids[start : start + WINDOW], bench.reported()))
    return page(request, "part_test_rows", rows=rows)


def query_of(request: Request) -> str:
    """Return what is typed into the filter of a list."""
    return request.query_params.get("q", "")[:_MOST_QUERY].strip()


def test(request: Request) -> Response:
    """Return a test's page: what its folder says, and a place for each part."""
    bench, test_id, _ = holding(request, "test")
    (row,) = rows_of_tests(bench.holdings(), (test_id,), bench.reported())
    records = _records(bench, row["machine"])
    return page(request, "test", row=row, records=records, record=_record(request, records))


def part(request: Request) -> Response:
    """Return one part of a test's page."""
    name = request.path_params["part"]
    if name == "recordings":
        bench, test_id, folder = holding(request, "test")
        content = bench.remembered(
            f"recordings of {test_id}",
            None,
            lambda: recordings_answer(folder, bench.registry),
            rests_on=_content(folder),
        )  # fmt: skip
        return page(request, "part_recordings", **content)
    if name != "results":
        raise HTTPException(404)
    record = request.query_params.get("record") or None
    suffix = "" if record is None else "?" + urlencode({"record": record})
    return page(
        request, "part_results", test_id=request.path_params["test"], record=record, suffix=suffix,
        **_results_of(request),
    )  # fmt: skip


def beside(request: Request) -> Response:
    """Return the page of two tests beside each other, or of one by two records."""
    for side in SIDES:
        _side(request, side)
    return page(request, "beside", query=urlencode(dict(request.query_params)))


def beside_part(request: Request) -> Response:
    """Return both sides, their charts over the same ranges, and their characteristics in pairs."""
    sides = [_side(request, side) for side in SIDES]
    left, right = (
        {"row": row, **_remembered_results(bench, row["id"], folder, record)}
        for bench, row, folder, record in sides
    )
    for name in left["curves"]["charts"]:
        ranges = common_ranges([side["curves"]["charts"][name] for side in (left, right)])
        for side in (left, right):
            curves = side["curves"]
            side["curves"] = curves | {"charts": curves["charts"] | {name: curves["charts"][name] | ranges}}
    pairs = list(_pairs(left["characteristics"], right["characteristics"]))
    return page(request, "part_beside", sides=(left, right), pairs=pairs)


def _pairs(
    left: list[dict[str, Any]], right: list[dict[str, Any]]
) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield the characteristics that both have at one load, within `_SAME_LOAD` of it."""
    for row in left:
        if row["SA_rad"] is not None:
            continue
        near = [
            candidate
            for candidate in right
            if (candidate["name"], candidate["rotation"], candidate["SA_rad"])
            == (row["name"], row["rotation"], None)
            and abs(candidate["load_N"] - row["load_N"]) <= _SAME_LOAD * row["load_N"]
        ]
        if near:
            yield row, min(near, key=lambda candidate: abs(candidate["load_N"] - row["load_N"]))


def _side(request: Request, side: str) -> tuple[Bench, dict[str, Any], Path, str | None]:
    bench: Bench = request.app.state.bench
    test_id = request.query_params.get(side, "")
    folder = bench.path_of("test", test_id)
    if folder is None:
        raise HTTPException(404)
    (row,) = rows_of_tests(bench.holdings(), (test_id,), Reported())
    record = _record(request, _records(bench, row["machine"]), f"{side}_record")
    return bench, row, folder, record


def download(request: Request) -> Response:
    """Return what is seen as a table, or the whole reduced test as `process --out` writes it."""
    bench, test_id, folder = holding(request, "test")
    table_name = request.path_params["what"]
    if table_name == "test.xlsx":
        return _reduced(_resolve(bench, folder, _named(request, bench)))
    if table_name not in ("conditions.csv", "characteristics.csv"):
        raise HTTPException(404)
    results = _results_of(request)
    answer, curves = results["answer"], results["curves"]
    if table_name == "conditions.csv":
        selected = request.query_params.getlist
        places = [int(text) for text in selected("load") if text.isdecimal()]
        asked = [place for place in places if place < len(curves["loads"])]
        loads = asked or list(range(len(curves["loads"])))
        rows = shown_conditions(answer, curves, loads, selected("rotation") or curves["rotations"])
        rows = [
            {
                **row,
                "first_row": row["rows"][0],
                "last_row": row["rows"][1],
                "calibration": answer["calibration"]["id"],
            }
            for row in rows
        ]
        for row in rows:
            del row["rows"]
    else:
        rows = results["characteristics"]
    return _table(rows, f"{test_id}-{table_name}")


def _results_of(request: Request) -> dict[str, Any]:
    bench, test_id, folder = holding(request, "test")
    return _remembered_results(bench, test_id, folder, _named(request, bench))


def _remembered_results(bench: Bench, test_id: str, folder: Path, record: str | None) -> dict[str, Any]:
    return bench.remembered(
        f"results of {test_id} by {record}", None, lambda: results_answer(_resolve(bench, folder, record)),
        rests_on=_content(folder),
    )  # fmt: skip


def _resolve(bench: Bench, folder: Path, record: str | None) -> Resolved:
    from toolkit.lab.tire_tests.resolve import Basis, resolve_test

    # A record that somebody chose to look at may not be in force: the result then says that it is a draft.
    basis = Basis(calibrations=bench.registry.folder, calibration=record, draft=record is not None)
    return resolve_test(folder, basis)


def _reduced(resolved: Resolved) -> Response:
    from toolkit.testfile.write import workbook

    content, _ = workbook(resolved.result, dict(resolved.recordings))
    return as_file(content, "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet", "test.xlsx")


def _table(rows: list[dict[str, Any]], name: str) -> Response:
    import csv
    import io

    stream = io.StringIO(newline="")
    if rows:
        writer = csv.DictWriter(stream, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return as_file(stream.getvalue(), "text/csv; charset=utf-8", name)


def _content(folder: Path) -> str:
    """Return the hash of all that a test rests on: its recordings and its settings files."""
    from toolkit.files import sha256_bytes, sha256_file
    from toolkit.recording.folder import read_test_folder

    test = read_test_folder(folder)
    paths = {*test.files, *folder.glob("*.toml"), *((test.tare_file,) if test.tare_file else ())}
    return sha256_bytes(
        "".join(f"{path.relative_to(folder)!r}:{sha256_file(path)}\n" for path in sorted(paths)).encode()
    )


def _records(bench: Bench, machine: str | None) -> tuple[str, ...]:
    """Return the records of a test's instrument, newest first; none where its ledger cannot be used."""
    if machine not in bench.registry.instruments() or bench.registry.ledger(machine).damage is not None:
        return ()
    return tuple(reversed(tuple(bench.registry.ledger(machine).entered())))


def _record(request: Request, records: tuple[str, ...], key: str = "record") -> str | None:
    record_id = request.query_params.get(key) or None
    if record_id is not None and record_id not in records:
        raise HTTPException(404)
    return record_id


def _named(request: Request, bench: Bench) -> str | None:
    """Return the record that an address names: one that a ledger knows."""
    from toolkit.calibration.registry.registry import ID

    record_id = request.query_params.get("record") or None
    match = None if record_id is None else ID.match(record_id)
    if record_id is None:
        return None
    if match is None or record_id not in _records(bench, match["instrument"]):
        raise HTTPException(404)
    return record_id


ROUTES: Routes = (
    ("GET", "/tests", tests),
    ("GET", "/tests/windows", test_windows),
    ("GET", "/tests/window/{start:int}", test_window),
    ("GET", "/test/{test}", test),
    ("GET", "/test/{test}/part/{part}", part),
    ("GET", "/test/{test}/download/{what}", download),
    ("GET", "/beside", beside),
    ("GET", "/beside/part", beside_part),
)
