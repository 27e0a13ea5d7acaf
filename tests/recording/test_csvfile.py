"""What a CSV file that cannot be read is told to be."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolkit.errors import UnreadableError
from toolkit.recording.csvfile import read_lines


def test_a_cell_of_a_page_is_not_told_as_a_matter_of_quotation_marks(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    path.write_text("SA [deg],FZ [N]\n" + "1" * 200_000 + ",1\n")
    with pytest.raises(UnreadableError) as caught:
        read_lines(path.read_bytes(), lambda _header: True, where=path)
    assert "without separators" in str(caught.value.next_step)
