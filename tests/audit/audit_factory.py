"""Records and files made by hand for the tests of the audit; the numbers are those of the source document."""

from __future__ import annotations

import dataclasses

import numpy as np

from tests.recording.printed import half_last_place
from toolkit.audit.model import Columns
from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit, sealed

TERMS = ("D51", "D52", "E5", "intercept")
# Source document, chapter 4.1: Fy in lb, Mz in lb-ft; "the third term [..] was taken as negative".
FY = (0.99719, 0.99718, 1.0228, 0.6473)
MZ = (-0.15688, 0.16197, 0.0026666, 0.68759)


def record(name, FY=FY, MZ=MZ, *, issued=None, unit="lbf", loads=("lbf", "lbf*ft")):
    def fit(load, load_unit, values, digits):
        return LoadFit(
            load=load, unit=load_unit, terms=TERMS, coefficients=tuple(map(float, values)),
            issued=tuple(map(float, digits)), polarity=(1, 1, 1, 1),
        )  # fmt: skip

    digits = issued or (FY, MZ)
    return sealed(
        CalibrationRecord(
            id=name, instrument="m15", kind="legacy", date="2019-01-01", entered_by="test", zero="included",
            cells=tuple(Indication(name=n, unit=unit) for n in TERMS[:3]),
            loads=(fit("FY", loads[0], FY, digits[0]), fit("MZ", loads[1], MZ, digits[1])),
            golden=Golden(), data=(), settings="{}", inputs_sha256="",
        )
    )  # fmt: skip


def negative(values, index=2):
    return tuple(-v if i == index else v for i, v in enumerate(values))


R1 = record("m15-r1", negative(FY), negative(MZ))
R2 = record("m15-r2")


def columns(FY=FY, MZ=MZ, *, rows=60, seed=3, decimals=None, order=("D51", "D52", "E5")):
    """A file whose own FY and MZ come from the given coefficients, printed to 7 digits or to decimals."""
    rng = np.random.default_rng(seed)

    def printed(values):
        return seven_digits(values) if decimals is None else np.round(values, decimals)

    x = printed(rng.uniform(-500.0, 500.0, (rows, 3)))
    names = ("D51", "D52", "E5")
    read = x[:, [names.index(name) for name in order]]  # what stands under the name of a channel
    y = {
        "FY": printed(read @ np.array(FY[:3]) + FY[3]),
        "MZ": printed(read @ np.array(MZ[:3]) + MZ[3]),
    }
    return from_arrays(x, y)


def from_arrays(x, y):
    return Columns(
        names=("D51", "D52", "E5"), units=("lbf",) * 3, x=x, half_x=half_last_place(x), y=y,
        half_y={load: half_last_place(values) for load, values in y.items()},
        y_units={"FY": "lbf", "MZ": "lbf*ft"},
    )  # fmt: skip


def joined(first, second):
    return from_arrays(
        np.vstack([first.x, second.x]),
        {load: np.concatenate([first.y[load], second.y[load]]) for load in first.y},
    )


def changed(one, load, row, by):
    values = one.y[load].copy()
    values[row] += by
    return dataclasses.replace(one, y={**one.y, load: values})


def seven_digits(values):
    return np.vectorize(lambda v: float(f"{v:.7g}"))(values)
