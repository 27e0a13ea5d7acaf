"""Published examples: straight lines of ISO/TS 28037, and ASTM E74 on the NIST load cell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.standards.e74 import evaluate_e74
from toolkit.errors import ToolkitError
from toolkit.files import read_toml
from toolkit.qualification.agreement import printed_check
from toolkit.qualification.model import Check, NotCovered, not_run
from toolkit.qualification.numbers import damaged, numbers, read_set

LINES = "ISO/TS 28037"
E74 = "ASTM E74"
LINES_FILE = "iso_ts_28037.toml"
E74_FILE = "e74_pontius.toml"
_BROKEN = (KeyError, TypeError, ValueError, AttributeError, np.linalg.LinAlgError)


def check_lines(folder: Path) -> tuple[list[Check], list[NotCovered]]:
    """Solve the straight lines with known uncertainties of y; name those that are not covered."""
    checks: list[Check] = []
    left: list[NotCovered] = []
    try:
        for one in read_toml(folder / LINES_FILE)["example"]:
            if one["method"] == "wls":
                checks += _line(one, folder / LINES_FILE)
            else:
                reason = "the toolkit has no fit with uncertainties in both variables yet"
                left.append(NotCovered(name=f"{LINES}, {one['name']}", reason=reason))
        reason = "x at a given y, with its uncertainty: the toolkit has no inverse prediction yet"
        left.append(NotCovered(name=f"{LINES}, predictions", reason=reason))
    except ToolkitError as error:
        checks.append(not_run(LINES, "examples", str(error)))
    except _BROKEN as error:
        checks.append(not_run(LINES, "examples", str(damaged(folder / LINES_FILE, repr(error)))))
    return checks, left


def check_e74(folder: Path) -> list[Check]:
    """Evaluate the NIST load cell by ASTM E74 at each published degree, and choose the degree."""
    try:
        return _e74(read_toml(folder / E74_FILE), folder)
    except ToolkitError as error:
        return [not_run(E74, "Pontius", str(error))]
    except _BROKEN as error:
        return [not_run(E74, "Pontius", str(damaged(folder / E74_FILE, repr(error))))]


def _line(one: dict[str, Any], where: Path) -> list[Check]:
    x, y, u = (numbers(one[key], where) for key in ("x", "y", "u_y"))
    fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=y, u=u)
    b, a = fit.coefficients
    u_b, u_a = fit.standard_errors.tolist()
    values = {
        "a": a, "b": b, "u_a": u_a, "u_b": u_b, "cov_ab": float(fit.covariance[0, 1]),
        "chi2": float(np.sum((fit.residuals / u) ** 2)),
    }  # fmt: skip
    return [
        printed_check(LINES, str(one["name"]), key, text, values[key]) for key, text in one["printed"].items()
    ]


def _e74(found: dict[str, Any], folder: Path) -> list[Check]:
    data = read_set(found["set"], folder)
    force, runs = data.columns["x"], int(found["runs"])
    run = np.repeat(np.arange(runs), len(force) // runs)
    checks: list[Check] = []
    best = evaluate_e74(force=force, indication=data.y, run=run)
    curves = {curve.degree: curve for curve in best.curves}
    for one in found["degree"]:
        curve = curves[one["degree"]]
        lack = curve.lack_of_fit
        values = {"s_m": curve.s_m, "llf": curve.llf, "lack_of_fit_F": np.nan if lack is None else lack.F}
        checks += [
            printed_check(E74, f"Pontius, degree {curve.degree}", key, text, values[key])
            for key, text in one["printed"].items()
        ]
    wanted = int(found["degree_of_best_fit"])
    chosen = Check(
        group=E74, name="Pontius", quantity="degree of best fit", measure="text", required=str(wanted),
        reached=str(best.degree), passed=best.degree == wanted,
    )  # fmt: skip
    return [*checks, chosen]
