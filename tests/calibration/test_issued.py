"""The digits in which a coefficient is issued, and how they are printed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.calibration.issued import issued_text, issued_value


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (244.7, "244.70"), (-1.0, "-1.0000"), (1486.06, "1486.06"), (0.97, "0.97000"), (123460.0, "123460"),
        (0.000123, "0.00012300"), (2.5e-07, "2.5000e-07"), (-1.234567e-09, "-1.234567e-09"), (0.0, "0"),
    ],
)  # fmt: skip
def test_a_last_zero_is_a_digit_that_was_issued(value: float, text: str) -> None:
    assert issued_text(value) == text


@given(
    st.floats(1e-12, 1e12), st.sampled_from((-1.0, 1.0)), st.floats(1e-3, 1e5), st.floats(1.0, 1e5)
)  # fmt: skip
def test_the_text_is_the_value_in_five_digits_or_more(
    size: float, sign: float, extent: float, largest: float
) -> None:
    value = issued_value(sign * size, extent, largest)
    text = issued_text(value)
    assert float(text) == value
    digits = text.partition("e")[0].replace(".", "").lstrip("-0")
    assert len(digits) >= 5
