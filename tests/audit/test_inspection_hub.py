"""A file of a hub that measures the load itself is inspected and audited by the record in force."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.reduction.belt_factory import write_belt
from toolkit.audit.inspection import inspect_file
from toolkit.errors import ColumnError


def test_without_a_record_the_error_says_where_the_load_would_come_from(tmp_path: Path) -> None:
    test = write_belt(tmp_path, load=False)
    with pytest.raises(ColumnError, match="hub's cells") as caught:
        inspect_file(test / "run_0.csv", None)
    assert caught.value.rule == "missing-column"
    assert "--home" in caught.value.next_step
