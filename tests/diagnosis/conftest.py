"""Diagnoses whose simulators run in this process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS


@pytest.fixture(scope="package", autouse=True)
def _in_this_process() -> Iterator[None]:
    """Have a case's code run here: the way to a worker and back is a quarter of a diagnosis of a small case.

    The numbers are the same. Tests of the worker ask for it by `case_worker`; commands always have it.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(diagnose.__kwdefaults__, "limits", None)
        yield


@pytest.fixture
def case_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a case's code run in its worker, as in the laboratory."""
    monkeypatch.setitem(diagnose.__kwdefaults__, "limits", WORKER_LIMITS)
