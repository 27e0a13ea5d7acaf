"""`toolkit fit --model mf61`: one Magic Formula 6.1 over all loads, and its tire file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.tires.mf61_fit import TireFit
    from toolkit.tires.model import Curve

MODEL = "mf61"
_STAND_IN = 0.3  # m; the forces of a tire file do not depend on it, only how QDZ is written


def fit_global(
    curves: Sequence[Curve], *, radius_m: float | None, source: Path, tir: Path | None
) -> tuple[list[dict[str, Any]], tuple[Finding, ...], str]:
    """Fit, write the tire file where one is asked for, and return JSON entries, findings, text."""
    from toolkit.tires.mf61_fit import fit_mf61
    from toolkit.tires.tir_write import write_tir

    fit = fit_mf61(curves, unloaded_radius_m=radius_m or _STAND_IN)
    findings = []
    if radius_m is None and tir is not None:
        text = (
            f"no tire size is known: UNLOADED_RADIUS is set to {_STAND_IN} m; FX, FY, MZ of the tire file do "
            "not depend on it, a vehicle model's geometry does"
        )
        findings.append(Finding(rule="tir-radius", where=str(source), message=text, level="note"))
    if not fit.converged:
        text = "no two starts of mf61 ended at the same lowest cost"
        findings.append(Finding(rule="not-converged", where=str(source), message=text))
    if fit.at_bound:
        text = f"mf61: {', '.join(fit.at_bound)} stand at their bounds"
        findings.append(Finding(rule="at-bound", where=str(source), message=text, level="note"))
    if tir is not None:
        write_tir(tir, fit, comments=[f"MF 6.1 fitted to {source.name}"], side="UNKNOWN")
    channels = ["FY", *(["MZ"] if fit.error_percent_MZ is not None else [])]
    shown = f"mf61 over all loads (ISO-W): error FY {fit.error_percent_FY:.2f} %"
    if fit.error_percent_MZ is not None:
        shown += f", MZ {fit.error_percent_MZ:.2f} %"
    if tir is not None:
        shown += f"; {tir} written"
    return [_payload(fit, channel, curves) for channel in channels], tuple(findings), shown


def _payload(fit: TireFit, channel: str, curves: Sequence[Curve]) -> dict[str, Any]:
    prefix = "P" if channel == "FY" else "Q"
    parameters = {name: value for name, value in fit.coefficients if name.startswith(prefix)}
    n = sum(len(one.y) for one in curves if one.channel == channel)
    return {
        "model": MODEL,
        "channel": channel,
        "load_N": None,
        "rotation": None,
        "axes": "ISO-W",
        "n": n,
        "dof": n - len(parameters),
        "parameters": parameters,
        "standard_errors": dict.fromkeys(parameters),
        "units": dict.fromkeys(parameters, "1"),
        "not_determined": [],
        "at_bound": [name for name in fit.at_bound if name in parameters],
        "error_percent": fit.error_percent_FY if channel == "FY" else fit.error_percent_MZ,
        "scatter_floor_percent": None,
        "cornering_stiffness_N_per_rad": None,
        "aligning_stiffness_Nm_per_rad": None,
        "loss": "linear",
        "converged": fit.converged,
        "message": "standard errors and the scatter floor are not computed for mf61",
    }
