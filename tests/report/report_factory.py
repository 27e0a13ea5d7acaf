"""Synthetic test results for the report's tests: a smooth tire, known numbers, no recordings."""

from __future__ import annotations

import dataclasses
import hashlib
import math

from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit
from toolkit.characteristics.groups import DirectionFit
from toolkit.characteristics.model import Characteristics, Point, Row
from toolkit.estimate import Estimate
from toolkit.findings import Finding
from toolkit.pipeline import TestResult
from toolkit.recording.model import TestInfo
from toolkit.reduction.model import CalibrationUse, Condition, ReducedTest, Tare
from toolkit.tires.comparison import Comparison, ComparisonRow
from toolkit.tires.model import CurveFit, Parameter

LOADS_N = (1112.0, 2522.0, 3705.0, 4897.0, 6103.0)
STEPS_DEG = (0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10)
DEG = math.pi / 180
SHA = "c0ffee" + "0" * 58
NAMES = "B C D E Sh Sv".split()


def formula(values: tuple[float, ...], sa: float) -> float:
    B, C, D, E, Sh, Sv = values
    x = B * (sa + Sh)
    return D * math.sin(C * math.atan(x - E * (x - math.atan(x)))) + Sv


def shape(channel: str, load: float) -> tuple[float, ...]:
    if channel == "FY":
        return (12.0 - load / 1500, 1.3, -1.02 * load + 1.5e-5 * load**2, -0.8, 0.002, 25.0)
    return (18.0, 2.2, 0.035 * load * (load / 4000) ** 0.5, -3.0, 0.004, 1.2)


def info(**changes: object) -> TestInfo:
    base = TestInfo(
        name="altimax-89",
        machine="m15",
        date="2019-06-04",
        operator="A. Operator",
        requestor="R. Requestor",
        special="Asymmetric",
        surface="steel",
        speed_m_s=7.66 / 3.6,
        pressure_Pa=34 * 6894.757293168361,
        rated_load_N=4900.0,
        tire_size="265/35 ZR 18",
        tire_company="Continental",
        tire_DOT="4MY8-009X-0713",
        tire_series="Altimax",
        tire_construction="radial",
        tire_rim="9J x 18",
    )
    return dataclasses.replace(base, **changes)  # type: ignore[arg-type]


def _fit(channel: str, load: float) -> CurveFit:
    errors = (0.11, 0.013, 14.0, 0.09, 0.0006, 1.4)
    units = ("1/rad", "1", "N" if channel == "FY" else "N*m", "1", "rad", "N" if channel == "FY" else "N*m")
    return CurveFit(
        model="magic_formula",
        channel=channel,
        load_N=load,
        axes="SAE",
        n=13,
        dof=7,
        parameters=tuple(
            Parameter(name=n, value=v, unit=u, standard_error=e)
            for n, v, u, e in zip(NAMES, shape(channel, load), units, errors, strict=True)
        ),
        covariance=tuple(tuple(0.0 for _ in NAMES) for _ in NAMES),
        not_determined=(),
        at_bound=(),
        error_percent=1.33,
        scatter_floor_percent=None,
        slope_at_zero=None,
        value_at_zero=None,
        loss="linear",
        converged=True,
        message="ok",
    )


def _estimate(value: float, u: float, unit: str) -> Estimate:
    return Estimate(value=value, u=u, unit=unit, dof=12)


def _rows(load: float, rotation: str, **estimates: Estimate) -> list[Row]:
    return [
        Row(name=name, load_N=load, rotation=rotation, estimate=estimate)
        for name, estimate in estimates.items()
    ]


def make_result(
    *,
    both: bool = True,
    fits: bool = True,
    unverified: bool = False,
    findings: tuple[Finding, ...] = (),
    **changes: object,
) -> TestResult:
    """Return a whole test of 13 steps, 5 loads, one or two directions."""
    conditions, direction_fits, stiffness, pull = [], [], [], []
    rotations = ("forward", "reverse") if both else ("forward",)
    for rotation in rotations:
        for step in STEPS_DEG:
            for i, load in enumerate(LOADS_N):
                sa = (step - 0.3) * DEG
                wiggle = 3 * math.sin(7 * step + i)
                fy, mz = formula(shape("FY", load), sa) + wiggle, formula(shape("MZ", load), sa) + wiggle / 30
                file = f"{rotation[0]}{step:+d}"
                conditions.append(
                    Condition(
                        file=file,
                        file_sha256=hashlib.sha256(file.encode()).hexdigest(),
                        rotation=rotation,
                        first_row=1 + 100 * i,
                        last_row=100 * (i + 1),
                        step_SA=step * DEG,
                        step_FZ=load,
                        SA=sa,
                        FZ=load + 11,
                        FY=fy,
                        MZ=mz,
                        sd_SA=0.001,
                        sd_FZ=9.0,
                        u_FY=0.8,
                        u_MZ=0.04,
                        indications=(fy / 3, fy / 3, -fy / 3),
                        FY_file=fy + 4,
                        MZ_file=mz - 0.2,
                        FZ_common=load,
                        FY_common=fy - 0.2,
                        MZ_common=mz,
                        u_FY_common=0.9,
                        u_MZ_common=0.05,
                        u_FY_zero=0.0,
                        u_MZ_zero=0.0,
                        used=True,
                        calibration_sha256=SHA,
                    )
                )
        for load in LOADS_N:
            if fits:
                direction_fits.append(
                    DirectionFit(rotation=rotation, load_N=load, FY=_fit("FY", load), MZ=_fit("MZ", load))
                )
            stiffness += _rows(
                load,
                rotation,
                secant_cornering=_estimate(18 * load - 1e-3 * load**2, 900, "N/rad"),
                secant_aligning=_estimate(0.5 * load + 1e-4 * load**2, 60, "N*m/rad"),
                slope_cornering=_estimate(18.4 * load - 1e-3 * load**2, 1100, "N/rad"),
                slope_aligning=_estimate(0.52 * load + 1e-4 * load**2, 75, "N*m/rad"),
            )
    for load in LOADS_N if both else ():
        pull += _rows(
            load,
            "both",
            conicity=_estimate(20 + 0.01 * load, 6, "N"),
            plysteer=_estimate(-0.03 * load, 25, "N"),
            CRAT=_estimate(0.4 + 1e-4 * load, 0.2, "N*m"),
            PRAT=_estimate(2e-3 * load, 0.3, "N*m"),
            PRAT_at_FY_zero=_estimate(1.8e-3 * load, 0.35, "N*m"),
            thesis_CRAT=_estimate(1.0, 0.2, "N*m"),
            thesis_PRAT=_estimate(0.3, 0.2, "N*m"),
            thesis_PRAT_at_FY_zero=_estimate(0.25, 0.2, "N*m"),
            residual_forward=_estimate(2.5, 0.3, "N*m"),
            residual_reverse=_estimate(-1.5, 0.3, "N*m"),
        )
    return TestResult(
        reduced=ReducedTest(
            info=info(**changes),
            calibration=CalibrationUse(id="m15-r2", sha256=SHA, unverified=unverified),
            conditions=tuple(conditions),
            tare=Tare(source="none", values=(), unit="lbf"),
            averaging="whole block, one revolution of the tire",
            findings=findings,
            code_version="0.1.0",
        ),
        characteristics=Characteristics(
            fits=tuple(direction_fits),
            rows=(*pull, *stiffness),
            findings=(),
            points=tuple(
                Point(file=c.file, first_row=c.first_row, u_FY=c.u_FY, u_MZ=c.u_MZ) for c in conditions
            ),
        ),
    )


def make_record() -> CalibrationRecord:
    """Return a record with the coefficients of the source document's published calibration in shape."""
    terms = ("D51", "D52", "E5", "intercept")
    cells = tuple(Indication(name=n, unit="lbf") for n in ("D51", "D52", "E5"))
    loads = tuple(
        LoadFit(
            load=load,
            unit=unit,
            terms=terms,
            coefficients=c,
            issued=c,
            polarity=(1, 1, 1, 0),
            covariance=tuple(tuple(1e-6 if i == j else 0.0 for j in range(4)) for i in range(4)),
            method="ols",
            n=36,
            dof=32,
            residual_sd=0.8,
        )
        for load, unit, c in (
            ("FY", "lbf", (1.01234567, 1.0214, 1.0223, -0.45)),
            ("MZ", "lbf*ft", (0.1571, -0.1622, 0.0027, 0.0031)),
        )
    )
    return CalibrationRecord(
        id="m15-r2",
        instrument="m15",
        kind="fit",
        date="2019-05-01",
        entered_by="A. Operator",
        zero="included",
        cells=cells,
        loads=loads,
        golden=Golden(),
        data=(),
        settings="{}",
        inputs_sha256="0" * 64,
        sha256=SHA,
    )


def entry(model: str, channel: str, error: float, away: float | None = None, **more: object) -> ComparisonRow:
    told: dict[str, object] = {
        "condition": "pure", "n": 65, "parameters": 8, "converged": True, "not_determined": ()
    } | more  # fmt: skip
    return ComparisonRow(
        model=model, channel=channel, error_percent=error, prediction_error_percent=away, **told
    )  # type: ignore[arg-type]


COMPARISON = Comparison(
    rows=(
        entry("magic_formula", "FY", 1.33, parameters=30),
        entry("magic_formula", "MZ", 7.02, parameters=30, not_determined=("C E at 2 of 5 loads",)),
        entry("tmeasy", "FY", 2.12, 2.5),
        entry("tmeasy", "MZ", 17.2, 19.0, converged=False, not_determined=tuple("abcdef")),
    ),
    floors=(("FY", 0.9), ("MZ", None)),
    seconds=(("magic_formula", 0.02), ("tmeasy", 1.5)),
)
