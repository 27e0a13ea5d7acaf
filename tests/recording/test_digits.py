"""Printed digits against a reading of the decimal texts themselves."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from tests.recording.fig4_4 import ROWS, SYMBOLS
from tests.recording.printed import half_last_place


def by_text(values: list[float]) -> list[float]:
    """The rule in its own words: the finest place among values of the same decade, from their texts.

    Six values of one sign beside others of the other have the finest place of their own sign.
    """
    whole = _finest(values)
    zero = min(whole.values(), default=0.0)
    sides = [[v for v in values if v * sign > 0] for sign in (1, -1)]
    own = [_finest(side) for side in sides]

    def half(value: float) -> float:
        decade = _decade(value)
        at = int(value < 0)
        count = [sum(_decade(v) == decade for v in side) for side in sides]
        split = count[at] >= 6 and count[1 - at] > 0 and whole[decade] > 0
        return own[at][decade] if split else whole[decade]

    return [zero if v == 0 else half(v) for v in values]


def _decade(value: float) -> int:
    return Decimal(repr(value)).adjusted()


def _finest(values: list[float]) -> dict[int, float]:
    places: dict[int, int] = {}
    full: set[int] = set()
    for value in values:
        if value == 0:
            continue
        number = Decimal(repr(value)).normalize()
        _, digits, exponent = number.as_tuple()
        decade = number.adjusted()
        places[decade] = max(places.get(decade, -10_000), -min(exponent, 0) if decade >= -8 else -exponent)
        if len(digits) >= 15 or (decade >= 14):
            full.add(decade)
    return {d: 0.0 if d in full else float(Decimal(5).scaleb(-p - 1)) for d, p in places.items()}


def test_figure_4_4():
    # Seven significant digits for forces, five decimals for the angle, six digits for E5.
    half = dict(zip(SYMBOLS, half_last_place(np.array(ROWS)).T, strict=True))
    assert half["D52"].tolist() == [5e-6] * 2 + [5e-5] * 8
    assert half["E5"].tolist() == [5e-4] * 10
    assert half["SA"].tolist() == [5e-6] * 10
    assert half["FZ"].tolist() == [5e-5] * 6 + [5e-4] * 4
    assert half["MZ"].tolist() == [5e-6] * 6 + [5e-5] * 4


def test_zeros_full_doubles_and_extremes():
    assert half_last_place([0.0, 0.0]).tolist() == [0, 0]
    assert half_last_place([0.0, 1.25, 10.5]).tolist() == [0.005, 0.005, 0.05]
    assert half_last_place([1 / 3, 0.5, 2.0]).tolist() == [0, 0, 0.5]
    assert half_last_place([1e300, 5e-324, 1e-20]).tolist() == [0, 0, 5e-21]
    assert half_last_place([]).shape == (0,)
    assert half_last_place([1000.0, 999.9]).tolist() == [0.5, 0.05]


def test_a_table_is_its_columns():
    table = np.array(ROWS)
    np.testing.assert_array_equal(
        half_last_place(table), np.column_stack([half_last_place(column) for column in table.T])
    )


@example([1000.5, *[-1000.0] * 6])
@given(
    st.lists(
        st.one_of(
            st.floats(-2000, 2000).map(lambda v: float(f"{v:.7g}")),
            st.floats(-2000, 2000).map(lambda v: round(v, 5)),
            st.floats(-1e9, 1e9),
            st.integers(-(10**6), 10**6).map(float),
            st.just(0.0),
        ),
        min_size=1,
        max_size=12,
    )
)
def test_agrees_with_the_texts(values):
    # Single floats are known by their values, whatever their texts: they have tests of their own.
    texts = [Decimal(repr(value)).normalize().as_tuple() for value in values]
    long = any(len(text.digits) > 7 for text in texts)
    places = zip(values, texts, strict=True)
    assume(not (long and all(abs(np.float32(v) - v) <= 10.0 ** float(text.exponent) for v, text in places)))
    assert half_last_place(values).tolist() == pytest.approx(by_text(values), rel=1e-12, abs=1e-300)


@given(st.lists(st.floats(1, 999).map(lambda v: float(f"{v:.6g}")), min_size=1, max_size=20))
def test_the_true_value_lies_within_the_bound(values):
    shifted = np.array([float(f"{v:.4g}") for v in values])
    half = half_last_place(shifted)
    # Only where the finest place really occurs in the decade can it be known: never too large by a decade.
    assert np.all(half <= 0.5)
    assert np.all(half > 0)


def test_a_fixed_width_has_one_place_less_beside_a_minus_sign():
    # Figure 4.4: 98.59261, -182.415, -0.35393 and 371.3554 are all of eight characters.
    size = np.linspace(1.0, 9.0, 40) + 1e-5 * np.arange(40)
    values = np.concatenate([np.round(size, 5), -np.round(size + 0.37, 4)])
    half = half_last_place(values)
    np.testing.assert_array_equal(half[:40], 5e-6)
    np.testing.assert_array_equal(half[40:], 5e-5)


def test_a_few_coarse_values_of_a_sign_have_the_finest_place_of_their_decade():
    values = np.array([1.23456, 2.34567, 3.45678, 4.56789, 5.67891, 6.78912, 7.89123, -1.5, -2.5, -3.5])
    np.testing.assert_array_equal(half_last_place(values), 5e-6)


PRINTS = {
    "all digits": float, "15 digits": lambda v: float(f"{v:.15g}"), "10 digits": lambda v: float(f"{v:.10g}"),
    "9 digits": lambda v: float(f"{v:.9g}"), "8 digits": lambda v: float(f"{v:.8g}"),
    "shortest": lambda v: float(str(np.float32(v))),
}  # fmt: skip


@pytest.mark.parametrize("name", PRINTS)
@pytest.mark.parametrize("size", [1.0, 300.0, 40_000.0])
def test_single_floats_are_known_in_every_print_and_the_bound_holds(name, size):
    measured = np.random.default_rng(1).normal(0, size, 80)
    single = measured.astype(np.float32)
    values = np.array([PRINTS[name](float(v)) for v in single])
    half = half_last_place(values)
    assert np.all(np.abs(values - measured) <= half * (1 + 1e-12))
    if name == "all digits":  # and nothing is added to half a step of the single float
        np.testing.assert_array_equal(half, np.spacing(np.abs(single)).astype(float) / 2)


@pytest.mark.parametrize("digits", [7, 8, 9, 12])
def test_other_numbers_are_not_taken_for_single_floats(digits):
    measured = np.random.default_rng(2).normal(0, 300, 80)
    values = np.array([float(f"{v:.{digits}g}") for v in measured])
    assert half_last_place(values).tolist() == pytest.approx(by_text(values.tolist()), rel=1e-12)
    # One double among single floats: the column was not measured in them.
    mixed = np.append(measured.astype(np.float32).astype(float), 1 / 3)
    assert half_last_place(mixed)[:-1].max() == 0


def test_whole_and_half_numbers_keep_their_own_places():
    values = [1.0, 2.5, -3.5, 12.0, 1024.25]
    assert half_last_place(values).tolist() == by_text(values)


def test_columns_together_are_as_each_alone():
    rng = np.random.default_rng(3)
    columns = [
        np.round(rng.normal(0, 300, 40), 3),
        rng.normal(0, 1, 40),
        np.where(rng.random(40) < 0.3, 0.0, np.round(rng.normal(0, 2, 40), 1)),
        np.zeros(40),
        np.rint(rng.normal(0, 1e17, 40)),
        np.array([float(f"{v:.3g}") for v in rng.normal(0, 1e-11, 40)]),
    ]
    together = half_last_place(np.column_stack(columns))
    np.testing.assert_array_equal(together, np.column_stack([half_last_place(one) for one in columns]))
