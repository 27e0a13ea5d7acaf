"""Other formats that recordings come in: TDMS, LVM, MDF 4 and MAT-files, one a file.

A file of this folder checks every length and link of its format before a library reads it, reads named
vectors with the units that the file states, and writes them for corrected copies, whose originals are never
written to. One place makes channels of vectors, by the same rules as a header row's. A time axis that a file
only implies (a start and an increment) is no channel. Every number is written as a double, its unit in the
header and in the format's own place for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from toolkit.machine import Machine
from toolkit.recording.formats.lvm import lvm_bytes, read_lvm
from toolkit.recording.formats.mat import mat_bytes, read_mat
from toolkit.recording.formats.mdf import mdf_bytes, read_mdf
from toolkit.recording.formats.tdms import read_tdms, tdms_bytes
from toolkit.recording.formats.vectors import Vectors, Written

READERS: dict[str, Callable[[bytes, object, Machine], Vectors]] = {
    "lvm": read_lvm,
    "mat": read_mat,
    "mdf": read_mdf,
    "tdms": read_tdms,
}
"""Kind of a file that passed the gate -> its reader: content, place for the messages, machine."""
WRITERS: dict[str, Callable[[Sequence[Written], str], bytes]] = {
    "lvm": lvm_bytes,
    "mat": mat_bytes,
    "mdf": mdf_bytes,
    "tdms": tdms_bytes,
}
"""Kind of a recording -> its writer: columns, title."""
