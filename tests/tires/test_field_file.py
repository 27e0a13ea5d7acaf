"""Files of the field: one test as the consortium's .mat and as tab-separated text, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from toolkit.errors import ToolkitError
from toolkit.tires.field_file import is_field_file, read_field_file

RATE_HZ, SWEEP = 50, np.radians(4.0)  # samples and rad per second
TAU_S = 0.05  # how late the force comes
CONDITIONS = [(ia, p, fz) for ia in (0.0, 2.0) for p in (80.0, 100.0) for fz in (500.0, 1000.0, 1500.0)]
UNITS = {
    "ET": "sec", "V": "kph", "N": "rpm", "SA": "deg", "IA": "deg", "RL": "cm", "P": "kPa", "FX": "N",
    "FY": "N", "FZ": "N", "MZ": "N-m", "NFY": "none", "TSTC": "deg C", "SL": "none",
}  # fmt: skip


def truth(SA: Any, FZ: Any, IA: Any = 0.0, P: Any = 80e3) -> Any:
    """A tire in SAE axes: FY [N] of slip and inclination [rad], load [N], pressure [Pa]."""
    stiffness = 12.0 * (1 + 0.1 * (P / 80e3 - 1)) * (1 - 0.1 * (FZ / 1000 - 1))
    return -1.4 * FZ * np.sin(1.4 * np.arctan(stiffness / 1.4 * (SA - 0.1 * IA)))


def belt_test(*, sign: float = -1.0) -> dict[str, np.ndarray]:
    """Return the channels of a belt test in the field's units, with the ways between its levels."""
    rng = np.random.default_rng(7)
    leg = np.arange(0, np.radians(8.0), SWEEP / RATE_HZ)
    slip = np.concatenate([leg, leg[::-1], -leg, -leg[::-1]])
    way = np.linspace(0, 1, RATE_HZ // 2)
    rows = []
    for at, (ia, p, fz) in enumerate(CONDITIONS):
        ahead = CONDITIONS[min(at + 1, len(CONDITIONS) - 1)]
        late = np.interp(np.arange(len(slip)) - TAU_S * RATE_HZ, np.arange(len(slip)), slip)
        rows.append(np.column_stack([slip, late, *(np.full(len(slip), x) for x in (ia, p, fz))]))
        rows.append(
            np.column_stack(
                [0 * way, 0 * way, *(a + (b - a) * way for a, b in zip((ia, p, fz), ahead, strict=True))]
            )
        )
    slip, late, ia, p, fz = np.vstack(rows).T
    fz = fz * (1 + rng.normal(0, 0.01, len(fz)))
    p = p + rng.normal(0, 0.3, len(p))
    FY = truth(late, fz, np.radians(ia), p * 1e3) + rng.normal(0, 3, len(fz))
    n = len(slip)
    return {
        "ET": np.arange(n) / RATE_HZ, "V": np.full(n, 40.0), "N": np.full(n, 500.0), "SA": np.degrees(slip),
        "IA": ia, "RL": np.full(n, 22.0), "P": p, "FX": rng.normal(0, 5, n), "FY": FY, "FZ": sign * fz,
        "MZ": -0.03 * FY, "NFY": FY / fz, "TSTC": np.full(n, 50.0), "SL": rng.normal(0, 0.002, n),
    }  # fmt: skip


def write_mat(path: Path, channels: dict[str, np.ndarray]) -> Path:
    cells = {
        key: np.array([list(texts)], dtype=object)
        for key, texts in (("name", channels), ("units", [UNITS[name] for name in channels]))
    }
    remarks = {"source": "made for a test", "tireid": "none", "testid": "Cornering"}
    savemat(path, {**{n: v[:, None] for n, v in channels.items()}, "channel": cells, **remarks})
    return path


def write_dat(path: Path, channels: dict[str, np.ndarray], *, title: str = "Round 0; run 1; SI\n") -> Path:
    lines = ["\t".join(channels), "\t".join(UNITS[name] for name in channels)]
    lines += ["\t".join(map(repr, row)) for row in np.column_stack(list(channels.values())).tolist()]
    path.write_text(title + "\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def channels() -> dict[str, np.ndarray]:
    return belt_test()


def test_both_forms_hold_the_same_test_in_si(channels: dict[str, np.ndarray], tmp_path: Path) -> None:
    files = [
        read_field_file(write_mat(tmp_path / "run.mat", channels)),
        read_field_file(write_dat(tmp_path / "run.dat", channels)),
        read_field_file(write_dat(tmp_path / "bare.dat", channels, title="")),
    ]
    for file in files:
        np.testing.assert_allclose(file.columns["SA"], np.radians(channels["SA"]), rtol=1e-12)
        np.testing.assert_allclose(file.columns["P"], channels["P"] * 1e3, rtol=1e-12)
        np.testing.assert_allclose(file.columns["V"], channels["V"] / 3.6, rtol=1e-12)
        np.testing.assert_allclose(file.columns["MZ"], channels["MZ"], rtol=1e-12)
        np.testing.assert_allclose(file.columns["FZ"], channels["FZ"], rtol=1e-12)
        assert file.passed == ("N", "RL", "NFY", "TSTC")


@pytest.mark.parametrize(("form", "separator"), [("{}_{}", ","), ("{} [{}]", ";"), ("{} ({})", "\t")])
def test_units_may_stand_beside_the_names(
    form: str, separator: str, channels: dict[str, np.ndarray], tmp_path: Path
) -> None:
    lines = write_dat(tmp_path / "run.dat", channels, title="").read_text().splitlines()
    names = [form.format(name, UNITS[name]) for name in channels]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(line.replace("\t", separator) for line in ["\t".join(names), *lines[2:]]))
    assert is_field_file(path)
    columns = read_field_file(path).columns
    for name, values in read_field_file(tmp_path / "run.dat").columns.items():
        np.testing.assert_array_equal(columns[name], values)


def test_decimal_commas_are_read_where_semicolons_or_tabs_part_the_cells(
    channels: dict[str, np.ndarray], tmp_path: Path
) -> None:
    points = write_dat(tmp_path / "run.dat", channels, title="")
    commas = tmp_path / "commas.dat"
    commas.write_text(points.read_text().replace(".", ","))
    expected = read_field_file(points)
    for name, values in read_field_file(commas).columns.items():
        np.testing.assert_array_equal(values, expected.columns[name])


def test_the_axes_follow_from_the_sign_of_the_load(channels: dict[str, np.ndarray], tmp_path: Path) -> None:
    turned = channels | {"FZ": -channels["FZ"]}
    assert read_field_file(write_mat(tmp_path / "sae.mat", channels)).axes == "SAE"
    assert read_field_file(write_mat(tmp_path / "iso.mat", turned)).axes == "ISO-W"


def test_us_units_are_read(channels: dict[str, np.ndarray], tmp_path: Path) -> None:
    # 1 lbf = 4.4482216152605 N, 1 ft = 0.3048 m, 1 psi = 1 lbf / in2 = 6894.757 Pa, 1 mph = 0.44704 m/s.
    path = write_dat(tmp_path / "us.dat", channels)
    lines = path.read_text().splitlines()
    units = dict(zip(channels, lines[2].split("\t"), strict=True))
    units |= {"V": "mph", "P": "psi", "FY": "lb", "FZ": "lb", "FX": "lb", "MZ": "ft-lb"}
    path.write_text("\n".join([*lines[:2], "\t".join(units.values()), *lines[3:]]))
    columns = read_field_file(path).columns
    for name, factor in (("V", 0.44704), ("P", 6894.757293), ("FY", 4.4482216), ("MZ", 4.4482216 * 0.3048)):
        np.testing.assert_allclose(columns[name], channels[name] * factor, rtol=1e-7)


def test_what_is_none_of_them_is_told_apart(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("SA [deg],FZ [N],FY [N]\n1,1000,-300\n")
    (tmp_path / "b.dat").write_bytes(bytes(range(256)))
    (tmp_path / "e.dat").write_text("")
    for name in ("t.csv", "b.dat", "e.dat", "none.dat", "."):
        assert not is_field_file(tmp_path / name)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda c: {k: v for k, v in c.items() if k != "FZ"}, "missing-column"),
        (lambda c: c | {"FY": np.where(np.arange(len(c["FY"])) == 9, np.nan, c["FY"])}, "nan-cell"),
        (lambda c: c | {"FY": c["FY"][:-1]}, "no-data"),
    ],
)
def test_a_file_that_is_not_whole_is_refused(
    change: Any, rule: str, channels: dict[str, np.ndarray], tmp_path: Path
) -> None:
    with pytest.raises(ToolkitError) as caught:
        read_field_file(write_mat(tmp_path / "bad.mat", change(channels)))
    assert caught.value.rule == rule


@pytest.mark.parametrize(
    ("line", "old", "new", "rule"),
    [(2, "kPa", "smoots", "unknown-unit"), (2, "kPa", "N", "unit-dimension"), (7, "\t", " ", "ragged-row"),
     (7, "40.0", "n/a", "text-cell")],
)  # fmt: skip
def test_a_text_that_cannot_be_read_is_refused_with_its_place(
    line: int, old: str, new: str, rule: str, channels: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = write_dat(tmp_path / "bad.dat", channels)
    lines = path.read_text().splitlines()
    lines[line] = lines[line].replace(old, new, 1)
    path.write_text("\n".join(lines))
    with pytest.raises(ToolkitError) as caught:
        read_field_file(path)
    assert caught.value.rule == rule
    assert "bad.dat" in str(caught.value.where)


def test_a_mat_file_of_another_form_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "other.mat", {"FZ": np.ones((3, 1)), "units": {"FZ": "N"}})
    with pytest.raises(ToolkitError) as caught:
        read_field_file(tmp_path / "other.mat")
    assert caught.value.rule == "unreadable"
