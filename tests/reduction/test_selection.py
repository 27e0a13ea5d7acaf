"""Rows are parted by what a model does not read, and by nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.errors import FitError
from toolkit.reduction.selection import of_one_condition


def selected(columns: dict[str, np.ndarray], *reads: str) -> np.ndarray:
    rows = len(next(iter(columns.values())))
    return of_one_condition(columns, reads, rows=rows).rows


@pytest.mark.parametrize(
    ("symbol", "levels", "kept"),
    [
        ("KAPPA", [-0.1, -0.03, 0.0, 0.03, 0.1], 0.0),
        ("KAPPA", [0.0, 0.01, 0.02], 0.0),
        ("IA", np.radians([-4.0, -2.0, 0.5, 2.0, 4.0]), np.radians(0.5)),
        ("IA", np.radians([0.0, 0.5, 1.0]), 0.0),
        ("P", [180e3, 220e3, 260e3], 220e3),
        ("V", [5.0, 20.0, 35.0], 20.0),
        ("T", [293.0, 313.0, 333.0], 313.0),
    ],
)
def test_one_level_is_kept_and_the_others_are_named(symbol: str, levels: list[float], kept: float) -> None:
    rng = np.random.default_rng(3)
    column = np.repeat(levels, 20) + rng.normal(0, 1e-3 * max(np.ptp(levels), 1e-3), 20 * len(levels))
    selection = of_one_condition({symbol: column}, (), rows=len(column))
    assert np.array_equal(selection.rows, np.repeat(np.array(levels) == kept, 20))
    (text,) = selection.apart
    assert text.startswith(symbol)
    assert of_one_condition({symbol: column}, (symbol,), rows=len(column)).left_out == 0


def test_the_level_of_most_rows_is_kept_where_no_level_is_the_middle() -> None:
    pressure = np.repeat([200e3, 250e3], [9, 12])
    assert np.array_equal(selected({"P": pressure}), pressure == 250e3)


def test_scatter_of_one_level_parts_nothing() -> None:
    rng = np.random.default_rng(7)
    columns = {
        "KAPPA": rng.normal(0, 0.002, 60),
        "IA": np.radians(rng.normal(0, 0.08, 60)),
        "P": 220e3 * (1 + rng.normal(0, 0.008, 60)),
        "V": 16.7 * (1 + rng.normal(0, 0.01, 60)),
        "T": np.linspace(300.0, 345.0, 60),
    }
    assert selected(columns).all()


def test_a_sweep_of_slip_or_inclination_is_kept_where_it_passes_zero() -> None:
    slip = np.linspace(-0.2, 0.2, 201)
    assert np.array_equal(selected({"KAPPA": slip}), np.abs(slip) <= 0.01)
    lean = np.radians(np.linspace(-40.0, 40.0, 801))
    assert np.array_equal(selected({"IA": lean}), np.abs(lean) <= np.radians(0.5))


def test_rows_that_travel_backward_are_another_condition_even_of_a_model_that_reads_the_speed() -> None:
    speed = np.repeat([10.0, 20.0, -10.0], [8, 8, 8])
    assert np.array_equal(selected({"V": speed}, "V"), speed > 0)
    assert np.array_equal(selected({"V": -speed}, "V"), speed > 0)


def test_no_row_that_rolls_freely_is_refused() -> None:
    with pytest.raises(FitError) as caught:
        selected({"KAPPA": np.repeat([0.05, 0.1], 9)})
    assert caught.value.rule == "no-pure-slip"


def test_an_inclination_that_all_rows_share_is_said() -> None:
    selection = of_one_condition({"IA": np.full(9, np.radians(3.0))}, (), rows=9)
    assert selection.left_out == 0
    assert selection.stands == ("IA is 3 deg",)
