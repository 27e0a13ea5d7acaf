"""A record of a hub in which each cell is one load."""

from __future__ import annotations

from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit

ARM = 0.32
LOADS = ("FX", "FY", "FZ", "MX", "MY", "MZ")
CELLS = tuple(f"c{load}" for load in LOADS)


def record(u: float = 0.0) -> CalibrationRecord:
    """Return a record in which each cell is one load, 1 N or N*m a count, and its slope has ``u``."""
    cells = tuple(Indication(name=name, unit="count", minimum=-1e4, maximum=1e4) for name in CELLS)
    terms = (*CELLS, "intercept")

    def fit(at: int, load: str) -> LoadFit:
        slope = tuple(float(at == place) for place in range(len(terms)))
        spread = tuple(
            tuple(u**2 if at == i == j else 0.0 for j in range(len(terms))) for i in range(len(terms))
        )
        return LoadFit(
            load=load, unit="N" if load.startswith("F") else "N*m", terms=terms, coefficients=slope,
            issued=slope, polarity=(0,) * len(terms), covariance=spread if u else (),
        )  # fmt: skip

    return CalibrationRecord(
        id="rig-r1", instrument="rig", kind="fit", date="2026-01-01", entered_by="A", zero="tared",
        cells=cells, loads=tuple(fit(i, load) for i, load in enumerate(LOADS)), golden=Golden(), data=(),
        settings="{}", inputs_sha256="", sha256="0" * 64,
    )  # fmt: skip
