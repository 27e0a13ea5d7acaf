"""Other formats that recordings come in: TDMS, LVM, MDF 4 and MAT-files.

Each reader gives named vectors with the units that its file states; one place makes channels of them, by
the same rules as a header row's. A time axis that a file only implies (a start and an increment) is no
channel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from toolkit.recording.formats.lvm import read_lvm
from toolkit.recording.formats.mat import read_mat
from toolkit.recording.formats.mdf import read_mdf
from toolkit.recording.formats.tdms import read_tdms
from toolkit.recording.formats.vectors import Vectors

if TYPE_CHECKING:
    from toolkit.machine import Machine
    from toolkit.recording.safe_open import Gated

READERS: dict[str, Callable[[Gated, Machine], Vectors]] = {
    "lvm": read_lvm,
    "mat": read_mat,
    "mdf": read_mdf,
    "tdms": read_tdms,
}
"""Kind of a gated file -> its reader."""
