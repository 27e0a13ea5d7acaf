"""Small archives for the tests: the generator of the benchmark, and single recordings of given columns."""

from __future__ import annotations

import re
import zipfile

import numpy as np
import openpyxl

from tests.benchmarks import archive_factory as factory

HEADER = {"FZ": "FZ load", "D52": "D52 (Filtered)", "D51": "D51 (Filtered)", "E5": "E5 (Filtered)",
          "SA": "SA (Filtered)", "FY": "Fy", "MZ": "Mz"}  # fmt: skip
FY, MZ = (0.99719, 0.99718, 1.0228, 0.6473), (-0.15688, 0.16197, 0.0026666, 0.68759)


def recording(*, angle=0.0, rows=50, seed=1, FY=FY, MZ=MZ, slope=-300.0):
    """Columns of a recording in lbf, deg, lbf*ft: five loads, a side force that follows the slip angle."""
    rng = np.random.default_rng(seed)
    load = np.repeat([250.0, 567.0, 833.0, 1101.0, 1372.0], rows // 5) + rng.normal(0, 0.5, rows)
    share = np.array([0.3, 0.2, -0.25])
    x = load[:, None] * share + slope / 3 * angle * np.array([0.4, 0.3, 0.3]) * load[:, None] / 1000
    x = factory.printed(x + rng.normal(0, 0.02, (rows, 3)))
    table = {"FZ": load, "D52": x[:, 1], "D51": x[:, 0], "E5": x[:, 2],
             "SA": angle + rng.normal(0, 0.001, rows), "FY": x @ FY[:3] + FY[3],
             "MZ": x @ MZ[:3] + MZ[3]}  # fmt: skip
    return {name: factory.printed(values) for name, values in table.items()}


def write(path, table, headers=HEADER):
    path.parent.mkdir(parents=True, exist_ok=True)
    names = [headers.get(name, name) for name in table]
    path.write_bytes(factory.workbook(np.column_stack(list(table.values())), tuple(names)))


def dated(folder, date, more=""):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "test.toml").write_text(f'schema = 1\nmachine = "m15"\ndate = {date}\n{more}')


def write_saved(path, table, moment):
    """Write a workbook that says of itself when it was saved."""
    book = openpyxl.Workbook()
    book.active.append([HEADER[name] for name in table])
    for row in np.column_stack(list(table.values())).tolist():
        book.active.append(row)
    book.save(path)
    rewrite(path, moment)  # openpyxl stamps the moment of saving


def rewrite(path, moment):
    with zipfile.ZipFile(path) as source:
        parts = {name: source.read(name) for name in source.namelist()}
    core = parts["docProps/core.xml"]
    parts["docProps/core.xml"] = re.sub(rb"(<dcterms:modified[^>]*>)[^<]*", rb"\g<1>" + moment.encode(), core)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in parts.items():
            target.writestr(name, content)
