"""Characteristics: what a requester reads off a test, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.channels import Rotation
from toolkit.estimate import Estimate
from toolkit.findings import Finding
from toolkit.tires.model import CurveFit


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiffness:
    """Cornering [N/rad] and aligning [N·m/rad] stiffness of one load and direction, both positive in SAE.

    ``secant_*`` through the +-1 deg steps (thesis, SAE); ``slope_*`` of the fitted curve at SA = 0.
    None where the conditions that it needs are missing.
    """

    load_N: float
    rotation: Rotation
    secant_cornering: Estimate | None
    secant_aligning: Estimate | None
    slope_cornering: Estimate | None
    slope_aligning: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pull:
    """Pull characteristics of one load [N, N·m] from the forward and the reversed run at SA = 0.

    ``conicity plysteer CRAT PRAT`` by symmetry (machine-fixed axes or their equivalent);
    ``PRAT_at_FY_zero`` the mean of MZ at each direction's own FY = 0;
    ``thesis_CRAT`` and ``thesis_PRAT`` by the formulas of the source document on machine-fixed values, and
    ``thesis_PRAT_at_FY_zero`` its formula on MZ at each direction's own FY = 0;
    ``residual_*`` the single-direction MZ at FY = 0. None where a direction or the curve is missing.
    """

    load_N: float
    conicity: Estimate | None
    plysteer: Estimate | None
    CRAT: Estimate | None
    PRAT: Estimate | None
    PRAT_at_FY_zero: Estimate | None
    thesis_CRAT: Estimate | None
    thesis_PRAT: Estimate | None
    thesis_PRAT_at_FY_zero: Estimate | None
    residual_forward: Estimate | None
    residual_reverse: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class AtAngle:
    """FY [N] and MZ [N·m] of one load and direction at a slip angle of the protocol, off the curves."""

    load_N: float
    rotation: Rotation
    SA_rad: float
    FY: Estimate | None
    MZ: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One condition as measured, with its whole uncertainty.

    ``u_FY`` [N] and ``u_MZ`` [N·m] are standard uncertainties of FY and MZ at the measured slip angle and
    load, from every source that the budget names.
    """

    file: str
    first_row: int
    u_FY: float
    u_MZ: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What makes one characteristic uncertain: (source, standard uncertainty [``unit``]), all of them.

    ``rotation`` is ``both`` for what needs a forward and a reversed run.
    """

    load_N: float
    rotation: str
    name: str
    unit: str
    sources: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionFit:
    """The fitted curves of one direction of rotation at one load."""

    rotation: Rotation
    load_N: float
    FY: CurveFit | None
    MZ: CurveFit | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Characteristics:
    """All of a test: one entry a load (and direction)."""

    fits: tuple[DirectionFit, ...]
    stiffness: tuple[Stiffness, ...]
    pull: tuple[Pull, ...]
    findings: tuple[Finding, ...]
    at_angles: tuple[AtAngle, ...] = ()
    points: tuple[Point, ...] = ()
    budgets: tuple[Budget, ...] = ()
