"""Published examples: straight lines of ISO/TS 28037, and ASTM E74 on the NIST load cell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from toolkit.calibration.fit.inverse import StraightLine, x_from_y
from toolkit.calibration.fit.odr import fit_odr
from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.calibration.standards.e74 import evaluate_e74
from toolkit.errors import ToolkitError
from toolkit.files import read_toml
from toolkit.qualification.model import Check, not_run, printed_check
from toolkit.qualification.numbers import damaged, number, numbers, read_set

LINES = "ISO/TS 28037"
E74 = "ASTM E74"
LINES_FILE = "iso_ts_28037.toml"
E74_FILE = "e74_pontius.toml"
_BROKEN = (KeyError, TypeError, ValueError, AttributeError, np.linalg.LinAlgError)


def check_lines(folder: Path) -> list[Check]:
    """Solve the straight lines with known uncertainties, of y or of both variables, and predict by them."""
    try:
        examples = read_toml(folder / LINES_FILE)["example"]
        return [check for example in examples for check in _line(example, folder / LINES_FILE)]
    except ToolkitError as error:
        return [not_run(LINES, "examples", str(error))]
    except _BROKEN as error:
        return [not_run(LINES, "examples", str(damaged(folder / LINES_FILE, repr(error))))]


def check_e74(folder: Path) -> list[Check]:
    """Evaluate the NIST load cell by ASTM E74 at each published degree, and choose the degree."""
    try:
        return _e74(read_toml(folder / E74_FILE), folder)
    except ToolkitError as error:
        return [not_run(E74, "Pontius", str(error))]
    except _BROKEN as error:
        return [not_run(E74, "Pontius", str(damaged(folder / E74_FILE, repr(error))))]


def _line(example: dict[str, Any], where: Path) -> list[Check]:
    name = str(example["name"])
    fit = _solved(example, where)
    line = StraightLine.of(fit)
    values = {
        "a": line.a, "b": line.b, "u_a": line.u_a, "u_b": line.u_b, "cov_ab": line.cov_ab,
        "chi2": np.nan if fit.chi2 is None else fit.chi2,
    }  # fmt: skip
    checks = [printed_check(LINES, name, key, text, values[key]) for key, text in example["printed"].items()]
    if "prediction" in example:
        prediction = example["prediction"]
        at = number(prediction["y0"], where)
        solution = x_from_y(line, at, u_y0=number(prediction["u_y0"], where))
        checks += [
            printed_check(LINES, f"{name}, x at y = {at:g}", "x0", prediction["x0"], solution.value),
            printed_check(LINES, f"{name}, x at y = {at:g}", "u_x0", prediction["u_x0"], solution.u),
        ]
    return checks


def _solved(example: dict[str, Any], where: Path) -> TermFit:
    x, y, u = (numbers(example[key], where) for key in ("x", "y", "u_y"))
    terms, columns = ("x", "intercept"), {"x": x}
    if example["method"] == "wls":
        return fit_terms(terms=terms, columns=columns, load=y, u=u)
    if example["method"] != "odr":
        raise damaged(where, f"method {example['method']!r}")
    u_x = set(numbers(example["u_x"], where).tolist())
    if len(u_x) != 1:
        # `fit_odr` knows one uncertainty an indication, as the published example has.
        raise damaged(where, f"u_x {sorted(u_x)}")
    return fit_odr(terms=terms, columns=columns, load=y, u=u, u_cells=np.array([*u_x]))


def _e74(example: dict[str, Any], folder: Path) -> list[Check]:
    data = read_set(example["set"], folder)
    force, runs = data.columns["x"], int(example["runs"])
    run = np.repeat(np.arange(runs), len(force) // runs)
    checks: list[Check] = []
    best = evaluate_e74(force=force, indication=data.y, run=run)
    curves = {curve.degree: curve for curve in best.curves}
    for degree in example["degree"]:
        curve = curves[degree["degree"]]
        lack = curve.lack_of_fit
        values = {"s_m": curve.s_m, "llf": curve.llf, "lack_of_fit_F": np.nan if lack is None else lack.F}
        checks += [
            printed_check(E74, f"Pontius, degree {curve.degree}", key, text, values[key])
            for key, text in degree["printed"].items()
        ]
    expected = int(example["degree_of_best_fit"])
    chosen = Check(
        group=E74, name="Pontius", quantity="degree of best fit", measure="text", required=str(expected),
        reached=str(best.degree), passed=best.degree == expected,
    )  # fmt: skip
    return [*checks, chosen]
