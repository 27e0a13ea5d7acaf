"""`toolkit calibration apply`: a three-axis rig without a tire, from an empty folder, with its own names."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import commands

# What the rig does: kN per mV/V, with crosstalk. Everything below is judged against it.
TRUE = np.array([[2.0, 0.03, -0.02], [0.01, 1.5, 0.04], [-0.05, 0.02, 5.0]])
CELLS, LOADS = ("gx", "gy", "gz"), ("FX", "FY", "FZ")
NOISE = 2e-5  # mV/V

SESSION = """
instrument = "press-7"
date = 2026-02-03
operator = "first person"
indications = ["gx", "gy", "gz"]
loads = ["FX", "FY", "FZ"]
data = "loads.csv"
zero = "included"
[check]
file = "check.csv"
tolerance = { FX = { value = 2, unit = "N" }, FY = { value = 2, unit = "N" }, FZ = { value = 5, unit = "N" } }
[reference]
standard = "dead weights"
certificate = "C-7"
[reference.uncertainty]
FX = { U = 0.05, k = 2, unit = "N" }
FY = { U = 0.05, k = 2, unit = "N" }
FZ = { U = 0.05, k = 2, unit = "N" }
"""


def write(path: Path, header: list[str], rows: Any) -> None:
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerows([header, *rows])


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty folder after `init`, a session of the rig, `calibrate` and `approve`."""
    folder = tmp_path_factory.mktemp("rig")
    rng = np.random.default_rng(24)
    headers = [*(f"{cell} [mV/V]" for cell in CELLS), *(f"{load} [kN]" for load in LOADS)]

    def rows(cells: np.ndarray) -> np.ndarray:
        return np.column_stack([cells + rng.normal(0, NOISE, cells.shape), cells @ TRUE.T])

    steps = [np.eye(3)[axis] * size for axis in range(3) for size in (0.0, 0.5, 1.0, 1.5, 2.0, 1.0, 0.0)]
    mixed = [np.array(m) for m in ((1.0, 1.0, 1.0), (1.5, -1.0, -1.2), (-1.2, 1.0, 1.5))]
    session = [
        [run_number, "down" if at % 7 > 4 else "up", *row]
        for run_number in range(1, 5)
        for at, row in enumerate(rows(np.array([*steps, *mixed])).tolist())
    ]
    write(folder / "loads.csv", ["run", "direction", *headers], session)
    write(folder / "check.csv", headers, rows(rng.uniform(-1.5, 1.5, (9, 3))).tolist())
    polarity = "".join(
        f'[[polarity]]\nload = "{load}"\nvalue = {{ value = 1, unit = "kN" }}\nindications = {{ '
        + ", ".join(
            f'{cell} = {{ value = {value:.5f}, unit = "mV/V" }}'
            for cell, value in zip(CELLS, np.linalg.inv(TRUE)[:, at], strict=True)
        )
        + " }\n"
        for at, load in enumerate(LOADS)
    )
    (folder / "SESSION.toml").write_text(SESSION + polarity)
    assert commands.said("init", folder / "lab", "-q").code == 0
    calibrated = commands.said("calibrate", folder / "SESSION.toml", "--home", folder / "lab", "-q")
    assert calibrated.code in (0, 1)
    return folder


def approve(folder: Path) -> commands.Said:
    return commands.said(
        "calibration", "approve", "press-7-r1", "--in-force-from", "2026-02-04", "--checked-by",
        "second person", "--reason", "first record", "--home", folder / "lab",
    )  # fmt: skip


CASES = np.array([[0.5, -0.25, 1.0], [1.25, 1.0, -0.75], [0.0, 0.0, 0.0], [-1.0, 0.5, 1.75]])


def indications(path: Path) -> Path:
    header = ["t [s]", *(f"{cell} [uV/V]" for cell in CELLS)]
    write(path, header, np.column_stack([np.arange(4) / 10, CASES * 1e3]).tolist())
    return path


def test_a_candidate_is_refused_but_as_a_draft_that_every_row_names(rig: Path, tmp_path: Path) -> None:
    data, out = indications(tmp_path / "data.csv"), tmp_path / "loads.csv"
    words = ["calibration", "apply", "press-7-r1", data, "--out", out, "--home", rig / "lab"]
    code, refused = commands.answer(*words)
    assert (code, refused["error"]["rule"]) == (2, "not-in-force")
    assert not out.exists()
    code, told = commands.answer(*words, "--draft")
    assert told["calibration"]["draft"] is True
    rows = list(csv.DictReader(io.StringIO(out.read_text())))
    assert {row["mark"].split(":")[0] for row in rows} == {"DRAFT, NOT APPROVED"}


def test_the_certificate_of_the_rig(rig: Path, tmp_path: Path) -> None:
    assert approve(rig).code == 0
    certificate = ["calibration", "certificate", "press-7-r1", "--out", tmp_path / "c", "--home", rig / "lab"]
    code, told = commands.answer(*certificate)
    assert code in (0, 1), told
    assert next((tmp_path / "c").glob("*.pdf")).stat().st_size > 10_000


@pytest.mark.parametrize("ending", [".csv", ".xlsx", ".parquet", ".tdms", ".mf4"])
def test_loads_of_every_format_agree_with_the_rig_within_their_uncertainty(
    ending: str, rig: Path, tmp_path: Path
) -> None:
    if "approved" not in status(rig):
        assert approve(rig).code == 0
    out = tmp_path / f"loads{ending}"
    words = ["--home", rig / "lab", "--on", "2026-02-05"]
    code, told = commands.answer(
        "calibration", "apply", "press-7-r1", indications(tmp_path / "d.csv"), "--out", out, *words
    )
    assert code == 0, told
    table = read_back(out)
    truth = 1e3 * CASES @ TRUE.T  # kN to N, by hand
    for at, load in enumerate(LOADS):
        value, U = table[f"{load} [N]"], table[f"U({load}) [N]"]
        assert np.all(np.abs(value - truth[:, at]) <= U), load
        assert np.all((U > 0.02) & (U < 5)), U  # neither nothing nor more than a thousandth of full scale
    np.testing.assert_array_equal(table["t [s]"], np.arange(4) / 10)
    # Written in one format and read in the next: the indications go through, and give the same loads.
    if ending != ".xlsx":
        again = tmp_path / "again.csv"
        source = stripped(out, tmp_path)
        applied = commands.said("calibration", "apply", "press-7-r1", source, "--out", again, *words, "-q")
        assert applied.code == 0
        for load in LOADS:
            np.testing.assert_allclose(read_back(again)[f"{load} [N]"], table[f"{load} [N]"], rtol=1e-12)


def status(rig: Path) -> str:
    return str(commands.answer("calibration", "list", "--home", rig / "lab")[1]["records"][0]["status"])


def read_back(path: Path) -> dict[str, np.ndarray]:
    import pandas as pd

    if path.suffix == ".csv":
        frame = pd.read_csv(path)
    elif path.suffix == ".xlsx":
        frame = pd.read_excel(path, engine="calamine")
    elif path.suffix == ".parquet":
        frame = pd.read_parquet(path)
    elif path.suffix == ".tdms":
        from nptdms import TdmsFile

        file = TdmsFile.read(path)
        assert "press-7-r1" in file.properties["description"]
        return {f"{c.name} [{c.properties['unit_string']}]": c[:] for c in file["recording"].channels()}
    else:
        from asammdf import MDF

        with MDF(path) as mdf:
            signals = {f"{s.name} [{s.unit}]": s.samples for s in mdf.iter_channels()}
            times = next(iter(mdf.iter_channels())).timestamps
        return {**signals, "t [s]": times}
    assert set(frame["calibration"]) == {"press-7-r1"}
    assert set(frame["calibration_sha256"].str.len()) == {64}
    return {name: frame[name].to_numpy() for name in frame if "[" in name}


def stripped(path: Path, folder: Path) -> Path:
    """The file's indications alone, in its own format."""
    from toolkit.recording.formats.mdf import mdf_bytes
    from toolkit.recording.formats.tdms import tdms_bytes
    from toolkit.recording.formats.vectors import Written

    columns = {name: values for name, values in read_back(path).items() if name[0] in "gt"}
    target = folder / f"indications{path.suffix}"
    written = [
        Written(symbol=name.split(" [")[0], header=name, unit=name.split(" [")[1][:-1], values=values)
        for name, values in columns.items()
    ]
    if path.suffix == ".csv":
        write(target, list(columns), np.column_stack(list(columns.values())).tolist())
    elif path.suffix == ".parquet":
        import pandas as pd

        pd.DataFrame(columns).to_parquet(target)
    else:
        target.write_bytes({".tdms": tdms_bytes, ".mf4": mdf_bytes}[path.suffix](written, "indications"))
    return target


def test_what_cannot_be_applied_is_refused_and_leaves_nothing(rig: Path, tmp_path: Path) -> None:
    if "approved" not in status(rig):
        assert approve(rig).code == 0
    good = indications(tmp_path / "good.csv").read_text()
    for text, out, rule in (
        (good.replace("gy [uV/V]", "gy"), "o.csv", "unknown-unit"),
        (good.replace("gy [uV/V]", "gy [N]"), "o.csv", "unit-dimension"),
        (good.replace("gy [uV/V]", "hy [uV/V]"), "o.csv", "missing-column"),
        (good.replace("t [s]", "FX [N]"), "o.csv", "doubled-column"),
        (good.replace("t [s]", "extrapolated [1]"), "o.csv", "doubled-column"),
        (good.replace("-250.0", "n/a"), "o.csv", "text-cell"),
        (good, "o.doc", "output-name"),
        (good, "good.csv", "original"),
    ):
        path = tmp_path / ("data.csv" if out != "good.csv" else "good.csv")
        path.write_text(text)
        before = sorted(tmp_path.iterdir())
        words = [path, "--out", tmp_path / out, "--home", rig / "lab", "--on", "2026-02-05"]
        code, told = commands.answer("calibration", "apply", "press-7-r1", *words)
        assert (code, told["error"]["rule"]) == (2, rule), told
        assert sorted(tmp_path.iterdir()) == before


def test_more_rows_than_a_worksheet_has_are_refused(
    rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("toolkit.lab.records.applied._SHEET_ROWS", 3)
    words = [
        indications(tmp_path / "data.csv"),
        "--out",
        tmp_path / "o.xlsx",
        "--home",
        rig / "lab",
        "--draft",
    ]
    code, told = commands.answer("calibration", "apply", "press-7-r1", *words)
    assert (code, told["error"]["rule"], told["error"]["got"]) == (2, "output-name", "4 rows")
    assert not (tmp_path / "o.xlsx").exists()


def test_a_row_beyond_the_calibrated_range_is_a_finding(rig: Path, tmp_path: Path) -> None:
    if "approved" not in status(rig):
        assert approve(rig).code == 0
    data = tmp_path / "data.csv"
    write(data, [f"{cell} [mV/V]" for cell in CELLS], [[9.0, 0.0, 0.0], [0.1, 0.1, 0.1], [9.0, -9.0, 0.0]])
    words = [data, "--out", tmp_path / "o.csv", "--home", rig / "lab", "--on", "2026-02-05"]
    code, told = commands.answer("calibration", "apply", "press-7-r1", *words)
    assert code == 1
    rules = [finding["rule"] for finding in told["findings"]]
    assert rules == ["no-tare", "beyond-range", "beyond-range"]
    # Who is handed the file alone sees which rows they are.
    assert read_back(tmp_path / "o.csv")["extrapolated [1]"].tolist() == [1, 0, 2]
    assert math.isclose(told["loads"]["FX"]["largest"], 18e3, rel_tol=1e-3)


def test_the_commands_from_an_empty_folder_as_a_person_types_them(
    rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Init, calibrate and apply with relative names, from the folder itself."""
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    monkeypatch.chdir(tmp_path)
    for name in ("SESSION.toml", "loads.csv", "check.csv"):
        (tmp_path / name).write_bytes((rig / name).read_bytes())
    indications(tmp_path / "data.csv")
    typed = [
        "init .", "calibrate SESSION.toml",
        "calibration approve press-7-r1 --in-force-from 2026-02-04 --checked-by second --reason first",
        "calibration apply press-7-r1 data.csv --out loads.xlsx --on 2026-02-05",
    ]  # fmt: skip
    for line in typed:
        done = commands.said(*line.split())
        assert done.code in (0, 1), done.out + done.err
    assert (tmp_path / "loads.xlsx").is_file()
