"""Only DER passes: every element fills its length, which is as short as it can be."""

from __future__ import annotations

import pytest

from toolkit.trust.seal.check import Forged
from toolkit.trust.seal.cms import demand_plain


# X.690, 8.1.3 and 10.1: an indefinite length, a length longer than needed, trailing and missing bytes.
@pytest.mark.parametrize(
    "message",
    ["3080020101 0000", "308103020101", "30820003020101", "3003020101 00", "3005020101 0000", "300402010100",
     "3006020101", "3003020201", "3f0100", "1f", "30"],
)  # fmt: skip
def test_what_is_not_der_is_no_signature(message: str) -> None:
    with pytest.raises(Forged, match="not DER"):
        demand_plain(bytes.fromhex(message))


def test_der_of_another_kind_is_no_signature() -> None:
    with pytest.raises((Forged, ValueError, KeyError, TypeError)):
        demand_plain(bytes.fromhex("3003020101"))
