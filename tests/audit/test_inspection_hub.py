"""A file of a hub that measures the load itself is inspected and audited by the record in force."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.reduction.belt_factory import write_belt
from toolkit.audit.inspection import inspect_file
from toolkit.audit.model import columns_of
from toolkit.audit.one_file import changes
from toolkit.channels import Axes
from toolkit.errors import ColumnError
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording
from toolkit.reduction.blocks import Block


@pytest.mark.parametrize("axes", ["SAE", "ISO-W", "adapted-SAE"])
def test_a_block_is_the_step_of_the_protocol_that_was_set(axes: Axes, tmp_path: Path) -> None:
    # Of 6 deg the protocol has one side only: a turned angle would find no step.
    test = write_belt(tmp_path, axes=axes, angles=(0.0, 1.0, -1.0, 6.0))
    recording = read_recording(test / "run_3.csv", load_machine(str(tmp_path / "belt.toml")))
    blocks = tuple(Block(start=start, stop=start + 40, mean_FZ=2000.0) for start in (0, 40))
    found = changes(recording, columns_of(recording), blocks, None)
    assert [block.SA_deg for block in found] == pytest.approx([6.0 if axes == "SAE" else -6.0] * 2)
    assert [block.step_SA_deg for block in found] == [block.SA_deg for block in found]


def test_without_a_record_the_error_says_where_the_load_would_come_from(tmp_path: Path) -> None:
    test = write_belt(tmp_path, load=False)
    with pytest.raises(ColumnError, match="hub's cells") as caught:
        inspect_file(test / "run_0.csv", None)
    assert caught.value.rule == "missing-column"
    assert "--home" in caught.value.next_step
