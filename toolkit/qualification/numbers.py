"""The packaged numbers: one TOML file a certified set, the examples, and the digest of each file.

The examples are lines of ISO/TS 28037, ASTM E74 on the NIST load cell and NIST's certified regressions. The
certified regressions go through the toolkit's own solver and are judged in correct digits. A polynomial of
degree 10 (Filip) is beyond what a term can name: its powers of the centred variable are given as columns, as
the solver builds them for lower degrees, and its results are carried back by the binomial theorem.

Reference: NIST Statistical Reference Datasets, linear least squares.

A straight calibration line y = a + b x is read backwards too: x from an observed y, as ISO/TS 28037 has it.
It carries the uncertainty of the line, with the covariance of its coefficients, and that of the value put in,
to first order: the line's own values and the value put in are taken as independent. It needs a slope that is
known well, u(b) small beside |b|.

Reference: ISO/TS 28037:2010, use of the calibration function (prediction); GUM 5.2.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.odr import fit_odr
from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.calibration.standards.e74 import evaluate_e74
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import is_number, read_toml, sha256_bytes, sha256_file
from toolkit.qualification.model import Check, correct_digits, digits_check, not_run, printed_check


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightLine:
    """y = a + b x. ``a``, ``u_a`` in the unit of y, ``b``, ``u_b`` in y per x, ``cov_ab`` their product.

    Raises
    ------
    ValueError
        a value is no finite number, an uncertainty is negative, or |cov_ab| exceeds u_a u_b
    """

    a: float
    b: float
    u_a: float
    u_b: float
    cov_ab: float

    def __post_init__(self) -> None:
        """Refuse what is no line with a covariance."""
        _finite(a=self.a, b=self.b, u_a=self.u_a, u_b=self.u_b, cov_ab=self.cov_ab)
        _not_negative(u_a=self.u_a, u_b=self.u_b)
        # A computed covariance may pass the product by its rounding, not by more.
        if abs(self.cov_ab) > self.u_a * self.u_b * (1 + 1e-12):
            raise ValueError(f"cov_ab = {self.cov_ab!r} exceeds u_a u_b = {self.u_a * self.u_b!r} in size")

    @classmethod
    def of(cls, fit: TermFit) -> StraightLine:
        """Return the line of a fit in one indication and the intercept; ValueError for other terms."""
        if len(fit.terms) != 2 or fit.terms[1] != "intercept":
            raise ValueError(f"terms {', '.join(fit.terms)} are no straight line")
        b, a = fit.coefficients
        u_b, u_a = fit.standard_errors.tolist()
        return cls(a=a, b=b, u_a=u_a, u_b=u_b, cov_ab=float(fit.covariance[0, 1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """A value from a line and its standard uncertainty ``u``, in the unit of x or of y."""

    value: float
    u: float


def x_from_y(line: StraightLine, y0: float, *, u_y0: float) -> Evaluated:
    """Return x0 = (y0 - a) / b for an observed y0 with standard uncertainty u_y0, in the unit of x.

    u^2(x0) = (u^2(y0) + u^2(a) + x0^2 u^2(b) + 2 x0 cov(a, b)) / b^2

    Raises
    ------
    ValueError
        y0 or u_y0 is no finite number, u_y0 is negative, or the slope is 0 or too small to divide by
    """
    _finite(y0=y0, u_y0=u_y0)
    _not_negative(u_y0=u_y0)
    if line.b == 0:
        raise ValueError("the slope is 0: no x belongs to a y")
    x0 = (y0 - line.a) / line.b
    # The quadratic form as a sum of squares, so that a strong correlation cannot leave a negative variance:
    # (u_a + r x0 u_b)^2 + (1 - r^2) x0^2 u_b^2, with r the correlation of a and b.
    spread, tilt = line.u_a * line.u_b, x0 * line.u_b
    r = max(-1.0, min(1.0, line.cov_ab / spread)) if spread else 0.0
    u = math.hypot(u_y0, line.u_a + r * tilt, math.sqrt((1 - r) * (1 + r)) * tilt) / abs(line.b)
    if not math.isfinite(x0) or not math.isfinite(u):
        raise ValueError(f"the slope {line.b!r} is too small to find x at y = {y0!r}")
    return Evaluated(value=x0, u=u)


def _finite(**values: float) -> None:
    for name, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"{name} = {value!r} is no finite number")


def _not_negative(**values: float) -> None:
    for name, value in values.items():
        if value < 0:
            raise ValueError(f"{name} = {value!r}: a standard uncertainty is not negative")


FOLDER = Path(__file__).with_name("data")
DIGESTS = "digests.toml"
SETS = (
    "norris", "pontius", "noint1", "noint2", "filip", "longley",
    "wampler1", "wampler2", "wampler3", "wampler4", "wampler5",
)  # fmt: skip
QUANTITIES = ("coefficients", "standard_errors", "residual_sd")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CertifiedSet:
    """A certified regression: ``estimates`` and ``errors`` in the order of ``terms``, the intercept last.

    ``required`` and ``public`` are correct digits by quantity, in the order of ``QUANTITIES``.
    """

    name: str
    title: str
    terms: tuple[str, ...]
    estimates: tuple[float, ...]
    errors: tuple[float, ...]
    residual_sd: float
    y: Array
    columns: dict[str, Array]
    required: tuple[float, ...]
    public: tuple[float, ...]


def read_set(name: str, folder: Path) -> CertifiedSet:
    """Read a certified set.

    Raises
    ------
    ConfigError
        the file is missing, no TOML, lacks an entry or holds no number where one belongs
    """
    path = folder / f"{name}.toml"
    stored = read_toml(path)
    try:
        certified = stored["certified"]
        terms: dict[str, Any] = certified["terms"]
        data = {key: numbers(values, path) for key, values in stored["data"].items()}
        pairs = [numbers(pair, path) for pair in terms.values()]
        return CertifiedSet(
            name=str(stored["name"]),
            title=str(stored["title"]),
            terms=tuple(terms),
            estimates=tuple(float(estimate) for estimate, _ in pairs),
            errors=tuple(float(error) for _, error in pairs),
            residual_sd=number(certified["residual_sd"], path),
            y=data.pop("y"),
            columns=data,
            required=tuple(number(stored["required"][quantity], path) for quantity in QUANTITIES),
            public=tuple(number(stored["public_qr"][quantity], path) for quantity in QUANTITIES),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise damaged(path, f"{type(error).__name__}: {error}") from error


def number(value: Any, where: Path) -> float:
    """Return a finite number, or refuse what stands in its place."""
    if not is_number(value):
        raise damaged(where, repr(value))
    return float(value)


def numbers(values: Any, where: Path) -> Array:
    """Return a list of finite numbers as an array (n,)."""
    if not isinstance(values, list) or not values:
        raise damaged(where, repr(values))
    return np.array([number(value, where) for value in values])


def damaged(where: Path, actual: str) -> ConfigError:
    """Return the error of packaged numbers that cannot be used."""
    return ConfigError(
        "the packaged numbers cannot be used", where=where.name, got=actual,
        expected="the file as it was packaged",
        next_step="install the package again", rule="wrong-value",
    )  # fmt: skip


def check_whole(folder: Path) -> Check:
    """Check every packaged file against its digest: a changed requirement shows nowhere else."""
    try:
        listed: dict[str, str] = read_toml(folder / DIGESTS)["sha256"]
        present = {path.name for path in folder.glob("*.toml")} - {DIGESTS}
        changed = [n for n in sorted(present & listed.keys()) if sha256_file(folder / n) != listed[n]]
        differences = [f"{n} is changed" for n in changed]
        differences += [f"{n} is missing" for n in sorted(listed.keys() - present)]
        differences += [f"{n} is not listed" for n in sorted(present - listed.keys())]
    except (ToolkitError, KeyError, AttributeError) as error:
        differences = [f"{DIGESTS} cannot be used: {error}".splitlines()[0]]
    return Check(
        group="packaged numbers", name="files", quantity="sha256", measure="text", required="as listed",
        reached="; ".join(differences) or "as listed", passed=not differences,
    )  # fmt: skip


def identity(folder: Path) -> str:
    """Return one hash of all packaged numbers, as they are."""
    lines = [f"{path.name} {sha256_file(path)}" for path in sorted(folder.glob("*.toml"))]
    return sha256_bytes("\n".join(lines).encode())


CERTIFIED = "NIST StRD linear"
_NAMED_POWERS = 9


def check_certified(folder: Path) -> list[Check]:
    """Solve every certified set; one check a quantity."""
    checks: list[Check] = []
    for name in SETS:
        try:
            checks += _checks(read_set(name, folder))
        except (ToolkitError, np.linalg.LinAlgError, ValueError, KeyError) as error:
            checks.append(not_run(CERTIFIED, name, str(error)))
    return checks


def solve(certified: CertifiedSet) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Return estimates, their standard errors and the residual standard deviation of a certified set."""
    power = len(certified.terms) - 1
    if certified.terms[-2:] == (f"x^{power}", "intercept") and power > _NAMED_POWERS:
        return _high_polynomial(certified.columns["x"], certified.y, power)
    fit = fit_terms(terms=certified.terms, columns=certified.columns, load=certified.y)
    return fit.coefficients, tuple(fit.standard_errors.tolist()), fit.residual_sd


def _checks(certified: CertifiedSet) -> list[Check]:
    estimates, errors, sd = solve(certified)
    reached = (
        min(correct_digits(a, b) for a, b in zip(estimates, certified.estimates, strict=True)),
        min(correct_digits(a, b) for a, b in zip(errors, certified.errors, strict=True)),
        correct_digits(sd, certified.residual_sd),
    )
    return [
        digits_check(
            CERTIFIED, certified.name, quantity.replace("_", " "), required, computed, _note(public, required)
        )
        for quantity, required, public, computed in zip(
            QUANTITIES, certified.required, certified.public, reached, strict=True
        )
    ]


def _note(public: float, required: float) -> str:
    short = ", more than is asked for here" if required < math.floor(min(public, 14.0)) else ""
    return f"public QR solvers reach {public:g}{short}"


def _high_polynomial(x: Array, y: Array, degree: int) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    centre = float(np.mean(x))
    half = math.ldexp(1.0, math.frexp(float(np.abs(x - centre).max()))[1])
    z = (x - centre) / half
    names = tuple(f"z{power}" for power in range(1, degree + 1))
    columns = {name: z**power for power, name in enumerate(names, start=1)}
    fit = fit_terms(terms=(*names, "intercept"), columns=columns, load=y)
    powers = (*range(1, degree + 1), 0)
    back = [
        [
            math.comb(j, i) * Fraction(-centre) ** (j - i) / Fraction(half) ** j if j >= i else Fraction(0)
            for j in powers
        ]
        for i in powers
    ]
    solved = [Fraction(value) for value in fit.coefficients]
    estimates = tuple(float(sum(a * b for a, b in zip(row, solved, strict=True))) for row in back)
    matrix = np.array([[float(value) for value in row] for row in back])
    errors = np.sqrt(np.einsum("ij,jk,ik->i", matrix, fit.covariance, matrix))
    return estimates, tuple(errors.tolist()), fit.residual_sd


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
    degree_check = Check(
        group=E74, name="Pontius", quantity="degree of best fit", measure="text", required=str(expected),
        reached=str(best.degree), passed=best.degree == expected,
    )  # fmt: skip
    return [*checks, degree_check]
