"""One recording in every format, each written by the format's own library; LVM as its specification says."""

from __future__ import annotations

import io

import asammdf
import nptdms
import numpy as np
import scipy.io

HEADER = {"FZ": "FZ load", "D52": "D52 (Filtered)", "D51": "D51 (Filtered)", "E5": "E5 (Filtered)",
          "SA": "SA (Filtered)", "FY": "Fy", "MZ": "Mz"}  # fmt: skip
UNITS = {"FZ": "lbf", "D52": "lbf", "D51": "lbf", "E5": "lbf", "SA": "deg", "FY": "lbf", "MZ": "lb-ft"}


def csv(table):
    rows = zip(*(values.tolist() for values in table.values()), strict=True)
    lines = [",".join(HEADER[name] for name in table), *(",".join(map(repr, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def tdms(table, *, units=UNITS, group="run", kind=np.float64):
    stream = io.BytesIO()
    with nptdms.TdmsWriter(stream) as file:
        file.write_segment(
            [
                nptdms.ChannelObject(
                    group,
                    HEADER[name],
                    values.astype(kind),
                    properties={"unit_string": units[name], "wf_increment": 1.0},
                )
                for name, values in table.items()
            ]
        )
    return stream.getvalue()


def mat(table, *, units=UNITS, compressed=True, **more):
    stream = io.BytesIO()
    scipy.io.savemat(stream, {**table, "units": units, "note": "a remark", **more}, do_compression=compressed)
    return stream.getvalue()


def mat_table(table):
    stream = io.BytesIO()
    headers = np.array([HEADER[name] for name in table], dtype=object)
    scipy.io.savemat(stream, {"data": np.column_stack(list(table.values())), "headers": headers})
    return stream.getvalue()


def signals(table, *, units=UNITS, step=0.01, **more):
    rows = len(next(iter(table.values())))
    return [
        asammdf.Signal(values, np.arange(rows) * step, name=HEADER[name], unit=units[name], **more)
        for name, values in table.items()
    ]


def mdf(*groups, compression=0, version="4.10"):
    """``groups``: lists of signals."""
    stream = io.BytesIO()
    with asammdf.MDF(version=version) as file:
        for group in groups:
            file.append(group)
        file.save(stream, compression=compression)
    return stream.getvalue()


def lvm(table, *, x="One", separator="\t", decimal=".", multi="Yes", segments=1, samples=None, units=UNITS):
    """After the specification's own examples: header, segment headers, names, rows; a special block first."""
    words = {"\t": "Tab", ",": "Comma", ";": "Semicolon"}
    names, rows = list(table), len(next(iter(table.values())))
    many = len(names)
    wide = 2 if x == "Multi" else 1

    def line(*fields):
        return separator.join(fields)

    def tag(name, values):
        return line(name, *([v for value in values for v in ([value] if wide == 1 else [value, ""])]), "")

    def text(value):
        return repr(float(value)).replace(".", decimal)

    lines = [line("LabVIEW Measurement", ""), line("Writer_Version", "2"), line("Reader_Version", "2"),
             line("Separator", words[separator]), f"Decimal_Separator{separator}{decimal}",
             line("Multi_Headings", multi), line("X_Columns", x), line("Time_Pref", "Relative"),
             line("Operator", "M"), line("Date", "2019/06/01"), line("Time", "10:21:19.4390"),
             line("***End_of_Header***", ""), line("", ""),
             "***Start_Special***", "Packet_Notes", "anything at all", "***End_Special***"]  # fmt: skip
    parts = np.array_split(np.arange(rows), segments)
    for number, part in enumerate(parts):
        if number == 0 or multi == "Yes":
            count = str(len(part) if samples is None else samples)
            lines += [line("Channels", str(many), *[""] * many), tag("Samples", [count] * many),
                      tag("Date", ["2019/06/01"] * many), tag("Y_Unit_Label", [units[n] for n in names]),
                      tag("X_Dimension", ["Time"] * many), tag("X0", ["0"] * many),
                      tag("Delta_X", ["0.01"] * many), line("***End_of_Header***", *[""] * many)]  # fmt: skip
            headers = [HEADER[name] for name in names]
            if x == "Multi":
                headers = [word for name in headers for word in ("X_Value", name)]
            else:
                headers = ["X_Value", *headers]
            lines.append(line(*headers, "Comment"))
        for row in part.tolist():
            time = text(row * 0.01)
            values = [text(table[name][row]) for name in names]
            if x == "Multi":
                lines.append(line(*(word for value in values for word in (time, value))))
            else:
                lines.append(line("" if x == "No" else time, *values))
        lines.append("")
    return ("\r\n".join(lines) + "\r\n").encode()


def every(table):
    """File name -> content, the same recording in each of the formats."""
    return {
        "run.csv": csv(table),
        "run.tdms": tdms(table),
        "run.mat": mat(table),
        "table.mat": mat_table(table),
        "run.mf4": mdf(signals(table)),
        "packed.mf4": mdf(signals(table), compression=2),
        "run.lvm": lvm(table),
    }
