"""What tests of the reduction share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from toolkit import pipeline


@pytest.fixture(scope="module")
def reduced_alone() -> Iterator[None]:
    """A test is reduced and not characterised, which takes as long again and which nobody looks at here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "characterise", lambda *_, **__: None)
        yield
