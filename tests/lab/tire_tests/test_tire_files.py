"""A tire file of a test on a drum says it, with the bounds of a flat road, one of a flat road nothing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from toolkit.findings import Finding
from toolkit.lab.tire_tests.fit_models import FitOrder, fit_table_models
from toolkit.lab.tire_tests.tire_files import write_fit
from toolkit.machine.definition import Drum


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a table of two loads; its forces do not matter here."""
    rows = [
        f"{angle},{load},{-1.05 * load * math.sin(1.35 * math.atan(11.5 * math.radians(angle)))}"
        for load in (2000.0, 4000.0)
        for angle in np.arange(-10, 10.5, 1.0)
    ]
    path = tmp_path_factory.mktemp("table") / "tire.csv"
    path.write_text("SA [deg],FZ [N],FY [N]\n" + "\n".join(rows) + "\n")
    return path


def told(table: Path, tir: Path, road: Drum | None, radius_m: float | None = 0.316) -> list[Finding]:
    fitted = fit_table_models(table, FitOrder(names=("mf52",), axes="SAE", radius_m=radius_m))
    findings = write_fit(
        tir, fitted.globals[0], fitted.data, source=table, side="LEFT", radius_m=radius_m, road=road
    )
    return [finding for finding in findings if finding.rule == "tir-road"]


def drum(road: str, circumference_m: float | None) -> Drum:
    return Drum(
        surface="steel", road=road, circumference_m=circumference_m, speed_m_s=2.0, speed_tolerance_m_s=0.1
    )  # type: ignore[arg-type]


def test_a_drum_is_told_with_the_bounds_of_a_flat_road(table: Path, tmp_path: Path) -> None:
    (finding,) = told(table, tmp_path / "x.tir", drum("convex", 8.5))
    # sqrt(Rd / (Rd + Rt)) = 0.900 of a tire of 316 mm on a drum of 1.353 m, by Pacejka: 1 / k^2, 1 / k^3
    for text in ("outside of a drum of radius 1.353 m", "0.900", "1 and 1.23 times", "1 and 1.37 times"):
        assert text in finding.message
    assert "outside of a drum of radius 1.353 m" in (tmp_path / "x.tir").read_text()


def test_inside_a_drum_the_slopes_of_a_flat_road_are_lower(table: Path, tmp_path: Path) -> None:
    (finding,) = told(table, tmp_path / "x.tir", drum("concave", 8.5))
    assert "inside of a drum" in finding.message
    assert "1 and 0.77 times" in finding.message  # 1 - 0.316 / 1.353


def test_without_a_radius_no_bound_is_made_up(table: Path, tmp_path: Path) -> None:
    (finding,) = told(table, tmp_path / "x.tir", drum("convex", 8.5), radius_m=None)
    assert "times" not in finding.message


@pytest.mark.parametrize("road", [drum("flat", None), None])
def test_a_flat_road_has_nothing_to_tell(road: Drum | None, table: Path, tmp_path: Path) -> None:
    assert told(table, tmp_path / "x.tir", road) == []
    assert "drum" not in (tmp_path / "x.tir").read_text()
