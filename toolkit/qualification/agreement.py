"""Two ways to count agreement: correct digits, and units of a printed number's last digit."""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation

from toolkit.errors import ConfigError
from toolkit.qualification.model import Check

CERTIFIED_DIGITS = 15.0


def correct_digits(value: float, certified: float) -> float:
    """Return -log10 of the relative error, absolute where the certified value is 0; 0 to 15.

    >>> round(correct_digits(3.14159, math.pi), 1)
    6.1
    """
    off = abs(value - certified) / (abs(certified) or 1.0)
    if not math.isfinite(off):
        return 0.0
    return CERTIFIED_DIGITS if off == 0 else min(CERTIFIED_DIGITS, max(0.0, -math.log10(off)))


def digits_check(
    group: str, name: str, quantity: str, required: float, reached: float, note: str = ""
) -> Check:
    """Return the check of a number of correct digits."""
    return Check(
        group=group, name=name, quantity=quantity, measure="correct digits", required=required,
        reached=reached, passed=reached >= required, note=note,
    )  # fmt: skip


def printed_check(group: str, name: str, quantity: str, printed: str, value: float) -> Check:
    """Return the check of a value against a printed number: it must round to the digits printed.

    Raises
    ------
    ConfigError
        ``wrong-value``: the printed number is none
    """
    try:
        number = Decimal(printed)
        last = Decimal(1).scaleb(int(number.as_tuple().exponent))
    except (InvalidOperation, ValueError, TypeError) as error:
        raise ConfigError(
            "a packaged number cannot be read", where=f"{group}, {name}, {quantity}", got=printed,
            expected="a decimal number", next_step="install the package again", rule="wrong-value",
        ) from error  # fmt: skip
    off = float(abs(Decimal(value) - number) / last) if math.isfinite(value) else math.inf
    return Check(
        group=group, name=name, quantity=quantity, measure="units of the last digit", required=0.5,
        reached=off if math.isfinite(off) else None, passed=off <= 0.5,
        note=f"printed {printed}, got {value:.9g}",
    )  # fmt: skip
