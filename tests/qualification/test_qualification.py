"""The qualification passes as packaged, fails on any changed number, and asks for what public QR reaches."""

from __future__ import annotations

import json
import math
import re
import shutil
from datetime import date
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy import linalg

from tests.conftest import SHARED_DATA
from tests.qualification.demonstrated import as_demonstrated, demonstrated
from toolkit.calibration.fit.basis import build_basis
from toolkit.files import read_toml
from toolkit.lab.home import packaged_home
from toolkit.qualification.model import QualificationRecord, correct_digits, printed_check
from toolkit.qualification.numbers import (
    DIGESTS,
    FOLDER,
    SETS,
    check_certified,
    check_e74,
    check_lines,
    check_whole,
    identity,
    read_set,
    solve,
)
from toolkit.qualification.run import check_golden, qualify

DAY = date(2026, 11, 21)
CALIBRATIONS = packaged_home() / "calibrations"


NIST = Path(__file__).resolve().parents[3] / "shared" / "data" / "nist_strd_linear"


def nist_file(name: str) -> tuple[dict[str, tuple[float, float]], float, list[list[float]]]:
    """Read NIST's own file: parameters with their estimate and error, residual sd, rows of y and x."""
    path = next((p for p in NIST.glob("*.dat") if p.stem.lower() == name), None)
    if path is None:
        pytest.skip("NIST's files do not lie beside the checkout")
    lines = path.read_text().splitlines()
    found = [re.match(r"\s+(B\d+)\s+(\S+)\s+(\S+)\s*$", line) for line in lines[:60]]
    certified = {m[1]: (float(m[2]), float(m[3])) for m in found if m}
    sd = next(m for m in (re.match(r"\s+Standard Deviation\s+(\d\S*)", line) for line in lines[:60]) if m)
    return certified, float(sd[1]), [[float(v) for v in line.split()] for line in lines[60:] if line.strip()]


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> QualificationRecord:
    with pytest.MonkeyPatch.context() as patch:
        as_demonstrated(demonstrated(tmp_path_factory)[0], patch)
        return qualify(calibrations=CALIBRATIONS, on=DAY)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the packaged numbers to spoil."""
    return Path(shutil.copytree(FOLDER, tmp_path / "data"))


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1))


def test_everything_passes_as_packaged(record: QualificationRecord) -> None:
    assert record.failed == ()
    assert record.passed
    assert {check.group for check in record.checks} == {
        "packaged numbers", "NIST StRD linear", "ISO/TS 28037", "ASTM E74", "golden vectors", "gates",
    }  # fmt: skip
    assert record.date == DAY
    assert [name for name, _ in record.packages] == ["numpy", "scipy", "statsmodels", "odrpack"]


def test_what_is_not_covered_is_named(record: QualificationRecord) -> None:
    # Records without golden vectors; of the published examples none is left out.
    assert [one.name for one in record.not_covered] == ["m15-r1", "m15-r2"]


def test_every_figure_of_the_straight_lines_is_checked(record: QualificationRecord) -> None:
    checks = [check for check in record.checks if check.group == "ISO/TS 28037"]
    line = {"a", "b", "u_a", "u_b", "cov_ab", "chi2"}
    found: dict[str, set[str]] = {}
    for check in checks:
        found.setdefault(check.name, set()).add(check.quantity)
    assert found == {
        "equal weights": line, "equal weights, x at y = 10.5": {"x0", "u_x0"},
        "unequal weights": line, "unequal weights, x at y = 10.5": {"x0", "u_x0"},
        "uncertainties in both variables": line,
    }  # fmt: skip


def test_the_packaged_lines_are_the_published_ones() -> None:
    """Against the figures collected from the published examples, where they lie beside the checkout."""
    path = SHARED_DATA / "iso_ts_28037_examples" / "examples.json"
    if not path.exists():
        pytest.skip("the published figures do not lie beside the checkout")
    published = [one for one in json.loads(path.read_text()).values() if isinstance(one, dict)]
    ours = read_toml(FOLDER / "iso_ts_28037.toml")["example"]
    assert len(ours) == len(published) == 3
    for one, other in zip(ours, published, strict=True):
        given = {"x", "y", "u_y"} | ({"u_x"} if one["method"] == "odr" else set())
        assert {key: one[key] for key in given} == {key: other[key] for key in given}
        for key, text in one["printed"].items():
            assert float(text) == other[key]
        told = {key: float(value) for key, value in one.get("prediction", {}).items()}
        assert told == other.get("predict", {})


def test_all_eleven_sets_each_with_three_quantities(record: QualificationRecord) -> None:
    checks = [check for check in record.checks if check.group == "NIST StRD linear"]
    assert len(checks) == 33
    assert len({check.name for check in checks}) == 11


def test_pontius_is_asked_for_eleven_digits_at_least() -> None:
    assert read_set("pontius", FOLDER).required[0] >= 11


def test_no_requirement_is_below_public_qr_except_where_it_is_told(record: QualificationRecord) -> None:
    short = {
        (one.name, at)
        for one in (read_set(name, FOLDER) for name in SETS)
        for at in range(3)
        if one.required[at] < math.floor(min(one.public[at], 14.0))
    }
    assert not short
    told = {c.name for c in record.checks if "more than is asked for" in c.note}
    assert told == {name for name, _ in short}


@pytest.mark.parametrize("name", [name for name in SETS if name != "filip"])
def test_the_stated_digits_of_public_qr(name: str) -> None:
    # The stated figure was measured on one machine; another's linear algebra may round otherwise.
    one = read_set(name, FOLDER)
    basis = build_basis(one.terms, one.columns)
    reached = []
    for q, r in (np.linalg.qr(basis.design), linalg.qr(basis.design, mode="economic")):
        solved = [Fraction(float(v)) for v in linalg.solve_triangular(r, q.T @ one.y)]
        raw = [float(sum(a * b for a, b in zip(row, solved, strict=True))) for row in basis.back_exact]
        reached.append(min(correct_digits(a, b) for a, b in zip(raw, one.estimates, strict=True)))
    assert max(reached) == pytest.approx(one.public[0], abs=1.5)


@pytest.mark.parametrize("name", SETS)
def test_the_packaged_numbers_are_nists(name: str) -> None:
    """Against NIST's own file, where it lies beside the checkout."""
    certified, sd, rows = nist_file(name)
    one = read_set(name, FOLDER)
    ours = dict(zip(one.terms, zip(one.estimates, one.errors, strict=True), strict=True))
    several = len(one.columns) > 1
    for parameter, pair in certified.items():
        power = int(parameter[1:])
        term = "intercept" if power == 0 else f"x{power}" if several else "x" if power == 1 else f"x^{power}"
        assert ours.pop(term) == pair
    assert not ours
    assert one.residual_sd == sd
    assert np.column_stack([one.y, *one.columns.values()]).tolist() == rows


def test_correct_digits() -> None:
    assert correct_digits(1.0, 1.0) == 15
    assert correct_digits(1.001, 1.0) == pytest.approx(3)
    assert correct_digits(1e-9, 0.0) == pytest.approx(9)
    assert correct_digits(math.nan, 1.0) == 0
    assert correct_digits(5.0, 1.0) == 0


@pytest.mark.parametrize(
    ("printed", "value", "passed"),
    [("676.5", 676.549, True), ("676.5", 676.56, False), ("-0.050", -0.0504, True), ("-0.050", 0.05, False),
     ("2.046e-4", 2.0465e-4 - 1e-12, True), ("2.046e-4", 2.0466e-4, False), ("1", math.nan, False)],
)  # fmt: skip
def test_a_value_must_round_to_the_digits_printed(printed: str, value: float, passed: bool) -> None:
    assert printed_check("g", "n", "q", printed, value).passed is passed


# File, what stands there, what is put in its place.
SPOILED = [
    ("pontius.toml", "1.20001", "1.20002"),
    ("pontius.toml", "0.732059160401003E-06", "0.732059160411003E-06"),
    ("norris.toml", "338.8", "338.9"),
    ("longley.toml", "890420.383607373", "890420.393607373"),
    ("filip.toml", "0.334801051324544E-02", "0.334801051424544E-02"),
    ("wampler1.toml", "1.00000000000000", "1.00000001000000"),
]


@pytest.mark.parametrize(("file", "old", "new"), SPOILED)
def test_a_corrupted_number_of_a_set_fails_by_its_digits(copy: Path, file: str, old: str, new: str) -> None:
    change(copy / file, old, new)
    failed = [check for check in check_certified(copy) if not check.passed]
    assert {check.name.lower() for check in failed} == {file.removesuffix(".toml")}
    assert not check_whole(copy).passed


@pytest.mark.parametrize(
    ("old", "new"),
    [("1.00000000000000", '"one"'), ("schema = 1", "schema = "), ("[certified]", "[other]"),
     ("residual_sd = 2", "residual_sd = nan #"), ("    0, 1, 2,", "    0, 1,")],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_a_failed_check(copy: Path, old: str, new: str) -> None:
    change(copy / "wampler5.toml", old, new)
    failed = [check for check in check_certified(copy) if not check.passed]
    assert [check.name for check in failed] == ["wampler5"]
    assert failed[0].note


def test_a_missing_file_is_a_failed_check(copy: Path) -> None:
    for name in ("pontius.toml", "iso_ts_28037.toml", DIGESTS):
        (copy / name).unlink()
    assert not all(check.passed for check in check_certified(copy))
    assert [check.passed for check in check_e74(copy)] == [False]
    assert [check.passed for check in check_lines(copy)] == [False]
    assert not check_whole(copy).passed


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [("iso_ts_28037.toml", "1.757143", "1.757144"), ("iso_ts_28037.toml", "9.3, 10.7", "9.4, 10.7"),
     ("e74_pontius.toml", "676.5", "676.7"), ("e74_pontius.toml", "fit = 2", "fit = 3"),
     ("e74_pontius.toml", '"0.811"', '"F"'), ("iso_ts_28037.toml", "u_y", "u_z"),
     ("iso_ts_28037.toml", "4.674", "4.675"), ("iso_ts_28037.toml", '"0.322"', '"0.323"'),
     ("iso_ts_28037.toml", "u_y0 = 1.0", "u_y0 = -1.0"), ("iso_ts_28037.toml", "2.1597", "2.1598"),
     ("iso_ts_28037.toml", "u_x = [0.2", "u_x = [0.3"), ("iso_ts_28037.toml", '"odr"', '"eiv"')],
)  # fmt: skip
def test_a_corrupted_example_fails(copy: Path, file: str, old: str, new: str) -> None:
    change(copy / file, old, new)
    assert not all(check.passed for check in [*check_lines(copy), *check_e74(copy)])


def test_a_lowered_requirement_is_seen_by_the_digest(copy: Path) -> None:
    before = identity(copy)
    change(copy / "pontius.toml", "required.coefficients = 12", "required.coefficients = 2")
    assert all(check.passed for check in check_certified(copy))
    whole = check_whole(copy)
    assert not whole.passed
    assert whole.reached == "pontius.toml is changed"
    assert identity(copy) != before


def test_a_changed_record_fails_its_golden_vectors(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(CALIBRATIONS, tmp_path / "calibrations"))
    path = folder / "m15-virtual" / "m15-virtual-r1.json"
    path.write_text(
        path.read_text().replace('"coefficients": [', '"coefficients": [-', 1).replace("[--", "[", 1)
    )
    checks, left = check_golden(folder)
    assert [check.passed for check in checks] == [False]
    assert "refused" in checks[0].note
    assert [one.name for one in left] == ["m15-r1", "m15-r2"]


def test_a_registry_without_records_qualifies_nothing(tmp_path: Path) -> None:
    checks, _ = check_golden(tmp_path)
    assert [check.passed for check in checks] == [False]


def test_the_degree_ten_polynomial_against_rational_arithmetic() -> None:
    # Filip by exact normal equations: apart from the certificate and from the solver.
    one = read_set("filip", FOLDER)
    x = [Fraction(float(v)) for v in one.columns["x"]]
    y = [Fraction(float(v)) for v in one.y]
    powers = [*range(1, 11), 0]
    rows = [
        [sum(v ** (i + j) for v in x) for j in powers] + [sum(v**i * w for v, w in zip(x, y, strict=True))]
        for i in powers
    ]
    for i in range(11):
        rows[i] = [v / rows[i][i] for v in rows[i]]
        for k in range(11):
            if k != i:
                rows[k] = [a - rows[k][i] * b for a, b in zip(rows[k], rows[i], strict=True)]
    estimates, _, _ = solve(one)
    assert estimates == pytest.approx([float(row[-1]) for row in rows], rel=1e-13)
