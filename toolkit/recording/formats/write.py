"""Recordings in the formats that they came in: for corrected copies, whose originals are never written to.

Every number is written as a double; headers carry their units, and so does the format's own place for them.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.headers import split_header
from toolkit.recording.extras import needed

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Written:
    """One channel to write: symbol, header, unit and values (rows,) in that unit."""

    symbol: str
    header: str
    unit: str
    values: NDArray[np.float64]

    @property
    def name(self) -> str:
        """The header without its unit."""
        return split_header(self.header)[0]


def lvm_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return an LVM file of one segment; a time channel is its column of x values."""
    time = next((column for column in columns if column.symbol == "t"), None)
    others_than_time = [column for column in columns if column is not time]
    rows, many = len(columns[0].values), len(others_than_time)

    def line(*texts: str) -> str:
        return "\t".join(texts)

    head = [
        line("LabVIEW Measurement", ""),
        line("Writer_Version", "2"),
        line("Reader_Version", "2"),
        line("Separator", "Tab"),
        line("Decimal_Separator", "."),
        line("Multi_Headings", "Yes"),
        line("X_Columns", "No" if time is None else "One"),
        line("Description", " ".join(title.split())),
        line("***End_of_Header***", ""),
        "",
        line("Channels", str(many), *[""] * many),
        line("Samples", *[str(rows)] * many, ""),
        line("Y_Unit_Label", *[column.unit for column in others_than_time], ""),
        line("X_Dimension", *["Time"] * many, ""),
        line("X_Unit_Label", *["s" if time is None else time.unit] * many, ""),
        line("***End_of_Header***", *[""] * (many + 1)),
        line("X_Value", *[column.name for column in others_than_time], "Comment"),
    ]
    x = [""] * rows if time is None else [repr(float(v)) for v in time.values]
    body = [
        line(x[row], *[repr(float(column.values[row])) for column in others_than_time], "")
        for row in range(rows)
    ]
    return ("\r\n".join([*head, *body]) + "\r\n").encode()


def mat_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return a MAT-file of version 5 with ``data``, ``headers`` and the remark ``title``."""
    from scipy.io import savemat

    stream: Any = io.BytesIO()
    table = {
        "data": np.column_stack([column.values for column in columns]),
        "headers": np.array([column.header for column in columns], dtype=object),
        "title": title,
    }
    savemat(stream, table)
    return bytes(stream.getvalue())


def mdf_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return an MDF 4.1 file of one channel group, whose master is the time."""
    asammdf: Any = needed("asammdf", extra="mdf", to="write an MDF file", where=title)
    time = next((column for column in columns if column.symbol == "t"), None)
    stamps = np.arange(len(columns[0].values), dtype=np.float64) if time is None else time.values
    stream = io.BytesIO()
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(column.values, stamps, name=column.name, unit=column.unit)
            for column in columns
            if column is not time
        ]
        file.append(signals, comment=title)
        file.save(stream)
    return stream.getvalue()


def tdms_bytes(columns: Sequence[Written], title: str) -> bytes:
    """Return a TDMS file of one group, its channels' units in ``unit_string``."""
    nptdms: Any = needed("nptdms", extra="tdms", to="write a TDMS file", where=title)
    stream = io.BytesIO()
    with nptdms.TdmsWriter(stream) as file:
        file.write_segment(
            [
                nptdms.RootObject(properties={"description": title}),
                *(
                    nptdms.ChannelObject(
                        "recording", column.name, column.values, properties={"unit_string": column.unit}
                    )
                    for column in columns
                ),
            ]
        )
    return stream.getvalue()


WRITERS: dict[str, Callable[[Sequence[Written], str], bytes]] = {
    "lvm": lvm_bytes,
    "mat": mat_bytes,
    "mdf": mdf_bytes,
    "tdms": tdms_bytes,
}
"""Kind of a recording -> its writer."""
