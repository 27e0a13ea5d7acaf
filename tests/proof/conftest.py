"""Tests that draw whole batches draw the light families only: what they ask is not the physics."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from proof.catalogue import CONFOUNDED, FAMILIES

LIGHT = ("beam-python", "beam-columns", "drive-force")


@pytest.fixture(scope="module")
def light_families() -> Iterator[None]:
    """Leave the families and classes that are drawn and fitted in a fraction of a second."""
    with pytest.MonkeyPatch.context() as patch:
        for name in set(FAMILIES) - set(LIGHT):
            patch.delitem(FAMILIES, name)
        for name in [k for k, group in CONFOUNDED.items() if group.family not in LIGHT]:
            patch.delitem(CONFOUNDED, name)
        yield
