"""The text of a case file, built: what a test says of its system, and nothing that every case says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from toolkit.declared import toml_text

Named = Mapping[str, Any]
_NONE: Named = {}


def case_text(
    kind: str,
    *,
    title: str | None = None,
    time: str | None = "s",
    axes: str | None = None,
    parameters: Named = _NONE,
    inputs: Named = _NONE,
    outputs: Named = _NONE,
    others: Named = _NONE,
    runs: int = 0,
    **simulation: Any,
) -> str:
    """Return a case of a simulation in sim.py, over the time ``t`` of the files r0.csv and on.

    ``time`` is its unit, None for a table without one; ``axes`` those of a tire.
    A parameter is (value, unit), (value, unit, sd) or (value, unit, sd, bounds), a channel its unit or (unit,
    sd), each of them the mapping that stands in the file where it has other entries. Where there are no
    ``runs``, tables ``[[recording.run]]`` may be written behind the text.
    """
    t = {} if time is None else {"t": {"unit": time, "role": "time"}}
    recording: dict[str, Any] = {} if time is None else {"time": "t"}
    if axes is not None:
        recording["axes"] = axes
    recording["channels"] = t | _channels("input", inputs) | dict(others) | _channels("output", outputs)
    if runs:
        recording["run"] = [{"file": f"r{number}.csv"} for number in range(runs)]
    simulation = {"kind": kind, "path": "sim.py"} | simulation
    if parameters:
        keys = ("value", "unit", "sd", "bounds")
        simulation["parameters"] = {
            name: dict(zip(keys, entry, strict=False)) if isinstance(entry, tuple) else dict(entry)
            for name, entry in parameters.items()
        }
    head = {"schema": 1} | ({} if title is None else {"title": title})
    return toml_text(head | {"simulation": simulation, "recording": recording})


def _channels(role: str, named: Named) -> dict[str, Any]:
    channels = {}
    for name, entry in named.items():
        stated = dict(entry) if isinstance(entry, Mapping) else {}
        if isinstance(entry, tuple):
            stated = {"unit": entry[0], "sd": entry[1]}
        elif isinstance(entry, str):
            stated = {"unit": entry}
        # In the order in which people write it: tests exchange parts of the text.
        channels[name] = {"unit": stated.pop("unit", ""), "role": role, **stated}
    return channels
