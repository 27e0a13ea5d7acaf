"""An archive whose grades are known because they were made: nothing of `toolkit.audit` is used here.

Recordings as the machine writes them (one header row, 500 rows of five load blocks, numbers in a field of
eight characters) under folders of tests with a date. Each has FY and MZ computed here from a calibration of
the list below, right or wrong in a way that is drawn from a seeded generator.
"""

from __future__ import annotations

import datetime as dt
import itertools
import json
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

CELLS = ("D51", "D52", "E5")
HEADERS = ("FZ load", "D52 (Filtered)", "D51 (Filtered)", "E5 (Filtered)", "SA (Filtered)", "Fy", "Mz")
LOADS = (250.0, 567.0, 833.0, 1101.0, 1372.0)
KNOWN_AT = dt.date(2026, 1, 1)

# Fy [lbf] and Mz [lbf*ft] per lbf of D51, D52, E5, and the constant. The first two are the source document's
# (section 4.1), the accident and its correction; the others drift from it by parts of a percent.
_FY, _MZ = (0.99719, 0.99718, 1.0228, 0.6473), (-0.15688, 0.16197, 0.0026666, 0.68759)


def _drifted(number: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    rng = np.random.default_rng(number)
    FY = tuple(float(f"{v * f:.5g}") for v, f in zip(_FY, rng.normal(1, 0.004, 4), strict=True))
    MZ = tuple(float(f"{v * f:.5g}") for v, f in zip(_MZ, rng.normal(1, 0.004, 4), strict=True))
    return FY, MZ


def _turned(values: tuple[float, ...], *at: int) -> tuple[float, ...]:
    return tuple(-v if i in at else v for i, v in enumerate(values))


EDITIONS: tuple[tuple[dt.date, tuple[float, ...], tuple[float, ...]], ...] = (
    (dt.date(1990, 1, 1), _turned(_FY, 2), _turned(_MZ, 2)),
    (dt.date(1990, 1, 1), _FY, _MZ),
    *((dt.date(1990 + 3 * n, 1, 1), *_drifted(n)) for n in range(1, 11)),
    # Differs from the last one in the fourth digit of one coefficient: coarse files cannot tell the two.
    (dt.date(2022, 1, 1), (_drifted(10)[0][0] + 3e-4, *_drifted(10)[0][1:]), _drifted(10)[1]),
)
"""Day in force, FY, MZ; record ``m15-r<N>`` is entry N - 1. The first is withdrawn, void on every day."""

SHARES = {
    "exact": 0.70, "stale": 0.08, "sign_variant": 0.06, "column_swap": 0.04, "segments": 0.03,
    "single_row": 0.01, "unknown": 0.02, "rounding": 0.02, "ambiguous": 0.01, "undated": 0.02,
    "unreadable": 0.01,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """What is true of one file; ``segments`` are (first row, last row, record), rows from 1."""

    grade: str
    record: str | None = None
    variant: str | None = None
    segments: tuple[tuple[int, int, str | None], ...] = ()


@dataclass(slots=True)
class Archive:
    """The folder, the registry, and the truth by path."""

    folder: Path
    calibrations: Path
    truth: dict[str, Made] = field(default_factory=dict)

    @property
    def grades(self) -> dict[str, int]:
        """How many files have each grade."""
        return dict(Counter(one.grade for one in self.truth.values()))


def make_registry(calibrations: Path) -> None:
    """Enter and approve every edition, and withdraw the first."""
    from toolkit.calibration.registry.approval import approve, withdraw
    from toolkit.calibration.registry.candidate import import_legacy
    from toolkit.calibration.registry.registry import Registry

    registry = Registry(calibrations)
    calibrations.mkdir(parents=True, exist_ok=True)
    for since, FY, MZ in EDITIONS:
        source = calibrations.parent / "source.toml"
        lines = [
            "schema = 1", 'instrument = "m15"', f"date = {since}", 'entered_by = "legacy"',
            'zero = "included"',
            "indications = [" + ", ".join(f'{{ name = "{n}", unit = "lbf" }}' for n in CELLS) + "]",
            "[source]", 'title = "made for a test"', f'place = "edition of {since}"', f'text = "{FY}, {MZ}"',
        ]  # fmt: skip
        for load, unit, values in (("FY", "lbf", FY), ("MZ", "lbf*ft", MZ)):
            told = ", ".join(f"{n} = {v!r}" for n, v in zip((*CELLS, "intercept"), values, strict=True))
            lines += ["[[loads]]", f'load = "{load}"', f'unit = "{unit}"', f"coefficients = {{ {told} }}"]
        source.write_text("\n".join(lines) + "\n")
        record, _ = import_legacy(source, registry)
        if record.id == "m15-r1":
            # Its signs are not the machine's: no approval lets it through, and it is void on every day.
            day = dt.date(2005, 1, 1)
            withdraw(registry, record.id, on=day, void_from=None, reason="sign of E5 wrong", by="a test")
            continue
        decision = approve(
            registry, record.id, in_force_from=since, checked_by="a test", known_on=since, reason="made"
        )
        if not decision.done:
            raise RuntimeError(f"{record.id}: {decision.findings}")


def make_archive(root: Path, *, files: int, rows: int = 500, seed: int = 20260101) -> Archive:
    """Write an archive of ``files`` recordings, thirteen a test, and its registry."""
    made = Archive(folder=root / "archive", calibrations=root / "calibrations")
    make_registry(made.calibrations)
    rng = np.random.default_rng(seed)
    kinds = rng.choice(list(SHARES), p=list(SHARES.values()), size=files)
    for number, kind in enumerate(kinds.tolist()):
        test, at = divmod(number, 13)
        day = dt.date(1991, 1, 1) + dt.timedelta(days=int(test * 12000 / max(files / 13, 1)))
        folder = made.folder / f"{day.year}" / f"test {test:04d}"
        if at == 0:
            folder.mkdir(parents=True)
            (folder / "test.toml").write_text(f'schema = 1\nmachine = "m15"\ndate = {day}\n')
        if kind == "undated":
            folder = made.folder / "loose" / f"{number}"
            folder.mkdir(parents=True)
        name = folder / (f"FM {at}.xlsx" if number % 3 else f"FM {at}")
        told = _write(name, kind, day, rows, rng)
        made.truth[name.relative_to(made.folder).as_posix()] = told
    return made


def _in_force(day: dt.date) -> int:
    return max(i for i, (since, _, _) in enumerate(EDITIONS) if since <= day)


def _id(edition: int) -> str:
    return f"m15-r{edition + 1}"


def _write(path: Path, kind: str, day: dt.date, rows: int, rng: np.random.Generator) -> Made:
    now = _in_force(day)
    if kind == "rounding" and now >= len(EDITIONS) - 2:
        kind = "exact"  # rounded coefficients of the last two may be those of the other
    x, FZ, SA = _cells(rows, rng)
    FY, MZ = EDITIONS[now][1], EDITIONS[now][2]
    whole = (1, rows)
    truth = Made(grade="exact", record=_id(now), segments=((*whole, _id(now)),))
    read = x
    if kind == "ambiguous":
        x = np.round(x, 1)
        read, now = x, len(EDITIONS) - 2
        FY, MZ = EDITIONS[now][1], EDITIONS[now][2]
        truth = Made(grade="ambiguous", segments=((*whole, None),))
    elif kind == "stale":
        other = int(rng.choice([i for i in range(len(EDITIONS)) if i != now]))
        FY, MZ = EDITIONS[other][1], EDITIONS[other][2]
        truth = Made(grade="stale", record=_id(other), segments=((*whole, _id(other)),))
    elif kind == "sign_variant":
        FY, MZ, told = _wrong_signs(FY, MZ, rng)
        truth = Made(grade="sign_variant", record=_id(now), variant=told, segments=((*whole, _id(now)),))
        if now == 1 and told == "E5 negative in FY, MZ":
            truth = Made(grade="stale", record="m15-r1", segments=((*whole, "m15-r1"),))
    elif kind == "column_swap":
        a, b = [(0, 1), (0, 2), (1, 2)][int(rng.integers(3))]
        order = list(range(3))
        order[a], order[b] = b, a
        read = x[:, order]
        told = f"{CELLS[a]}<->{CELLS[b]}"
        truth = Made(grade="column_swap", record=_id(now), variant=told, segments=((*whole, _id(now)),))
    elif kind == "unknown":
        FY, MZ = unknown(FY, MZ)
        truth = Made(grade="unknown", segments=((*whole, None),))
    elif kind == "rounding":
        FY = tuple(v + s * 0.4 * _unit5(v) for v, s in zip(FY, (1, -1, 1, 1), strict=True))
        truth = Made(grade="rounding", record=_id(now), segments=((*whole, _id(now)),))
    elif kind == "undated":
        truth = Made(grade="undated", record=_id(now), segments=((*whole, _id(now)),))
    y = np.column_stack([read @ FY[:3] + FY[3], read @ MZ[:3] + MZ[3]])
    if kind == "segments":
        cut, other = int(rng.integers(20, rows - 20)), 1 if now != 1 else 2
        y[cut:] = np.column_stack([x[cut:] @ e[:3] + e[3] for e in EDITIONS[other][1:]])
        truth = Made(
            grade="stale", record=_id(other), segments=((1, cut, _id(now)), (cut + 1, rows, _id(other)))
        )
    elif kind == "single_row":
        row = int(rng.integers(1, rows - 1))
        y[row, 1] += 0.5
        truth = Made(
            grade="unknown",
            segments=((1, row, _id(now)), (row + 1, row + 1, None), (row + 2, rows, _id(now))),
        )
    table = np.column_stack([FZ, x[:, 1], x[:, 0], x[:, 2], SA, y])
    data = workbook(printed(table) if kind != "ambiguous" else np.round(table, 1))
    if kind == "unreadable":
        data, truth = data[: len(data) // 2], Made(grade="unreadable")
    path.write_bytes(data)
    return truth


def unknown(FY: tuple[float, ...], MZ: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return equations that no edition comes near, for both loads: where one is small the other is not."""
    return (*(v * 1.05 for v in FY[:3]), FY[3] * 1.05 + 2.0), (
        *(v * 1.07 for v in MZ[:3]),
        MZ[3] * 1.07 + 0.5,
    )


def _cells(rows: int, rng: np.random.Generator) -> tuple[NDArray[np.float64], ...]:
    # What the program had in memory is what it printed: Fy and Mz come from the printed indications.
    block = np.repeat(np.arange(5), -(-rows // 5))[:rows]
    load = np.array(LOADS)[block] + rng.normal(0, 1.0, rows)
    angle = float(rng.choice([0, 1, -1, 2, -2, 4, -4, 6, -6, 8, -8, 10, -10]))
    share = np.array([0.36, 0.22, -0.36]) + rng.normal(0, 0.1, 3) - 0.04 * angle * np.array([1, 1, 0.6])
    share = np.where(np.abs(share) < 0.08, 0.08, share)  # a cell without load would prove nothing
    bend = 1 + rng.normal(0, 0.1, (5, 3))
    x = load[:, None] * share * bend[block] + rng.normal(0, 0.02, (rows, 3))
    return printed(x), load, angle - 0.3 + rng.normal(0, 0.001, rows)


def _unit5(value: float) -> float:
    return 10.0 ** (int(np.floor(np.log10(abs(value)))) - 4)


def _wrong_signs(
    FY: tuple[float, ...], MZ: tuple[float, ...], rng: np.random.Generator
) -> tuple[tuple[float, ...], tuple[float, ...], str]:
    at = int(rng.integers(3))
    loads = [("FY", "MZ"), ("FY",), ("MZ",)][int(rng.integers(3))]
    told: dict[str, list[str]] = {}
    for load in loads:
        value = (FY if load == "FY" else MZ)[at]
        told.setdefault("positive" if value < 0 else "negative", []).append(load)
    words = "; ".join(f"{CELLS[at]} {sign} in {', '.join(names)}" for sign, names in told.items())
    return (
        _turned(FY, at) if "FY" in loads else FY,
        _turned(MZ, at) if "MZ" in loads else MZ,
        words,
    )


def printed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values as the acquisition program prints them: eight characters, at most five decimals."""
    size = np.maximum(np.abs(values), 1e-5)
    decimals = np.clip(6 - np.floor(np.log10(size)) - (values < 0), 0, 5)
    return np.rint(values * 10**decimals) / 10**decimals


_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_PARTS = {
    "[Content_Types].xml": '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Override PartName="/xl/workbook.xml" ContentType="application/vnd.openxmlformats-officedocument.'
    'spreadsheetml.sheet.main+xml"/><Override PartName="/xl/worksheets/sheet1.xml" ContentType="application/'
    'vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/></Types>',
    "_rels/.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Id="rId1" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/'
    'officeDocument" Target="xl/workbook.xml"/></Relationships>',
    "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="http://schemas.openxmlformats.org/officeDocument/'
    '2006/relationships"><sheets><sheet name="Sheet1" sheetId="1" r:id="rId1"/></sheets></workbook>',
    "xl/_rels/workbook.xml.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/'
    'relationships"><Relationship Id="rId1" Type="http://schemas.openxmlformats.org/officeDocument/2006/'
    'relationships/worksheet" Target="worksheets/sheet1.xml"/></Relationships>',
}


def workbook(table: NDArray[np.float64], headers: tuple[str, ...] = HEADERS) -> bytes:
    """Return a workbook of one sheet: the headers and the numbers."""
    import io

    head = "".join(
        f'<c r="{letter}1" t="inlineStr"><is><t>{text}</t></is></c>'
        for letter, text in zip("ABCDEFGHIJKL", headers, strict=False)
    )
    lines = [f'<row r="1">{head}</row>']
    for number, values in enumerate(table.tolist(), start=2):
        cells = "".join(
            f'<c r="{letter}{number}"><v>{value!r}</v></c>'
            for letter, value in zip("ABCDEFGHIJKL", values, strict=False)
        )
        lines.append(f'<row r="{number}">{cells}</row>')
    sheet = f'<worksheet xmlns="{_MAIN}"><sheetData>{"".join(lines)}</sheetData></worksheet>'
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target:
        for name, text in itertools.chain(_PARTS.items(), [("xl/worksheets/sheet1.xml", sheet)]):
            target.writestr(name, '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n' + text)
    return stream.getvalue()


def compare(truth: dict[str, Made], answer: dict[str, object]) -> list[str]:
    """Return how a JSON answer of ``toolkit audit`` differs from the truth, one line a file."""
    wrong = []
    files = {one["path"]: one for one in answer["files"]}  # type: ignore[attr-defined]
    for path, one in truth.items():
        got = files.get(path)
        if got is None:
            wrong.append(f"{path}: missing")
            continue
        segments = tuple((s["first_row"], s["last_row"], s["record"]) for s in got["segments"])
        told = Made(grade=got["grade"], record=got["record"], variant=got["variant"], segments=segments)
        if told != one:
            wrong.append(f"{path}: {json.dumps(str(told))} instead of {one}")
    return wrong + [f"{path}: not in the archive" for path in files if path not in truth]
