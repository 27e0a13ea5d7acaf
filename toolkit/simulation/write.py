"""Write what the virtual machine made: recordings as LabVIEW writes them, test.toml, truth.json.

Every file says that it is simulated. The files enter their folder together; one that holds anything else is
refused.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.declared import toml_text
from toolkit.errors import OutputError
from toolkit.machine import Protocol
from toolkit.machine.definition import Machine, load_machine, machine_names
from toolkit.publication import publication
from toolkit.recording.labview import write_labview
from toolkit.simulation.cells import CELLS, LOADS, true_coefficients
from toolkit.simulation.plan import Plan
from toolkit.simulation.run import VirtualTest
from toolkit.simulation.session import (
    DECIMALS,
    INDICATION_UNIT,
    LOAD_UNITS,
    VirtualSession,
    check_csv,
    loads_csv,
    reference_sd,
    shunt_step,
)
from toolkit.simulation.steps import machine_speed
from toolkit.simulation.truth import truth_document
from toolkit.staging import PASSING
from toolkit.units import from_si, si_scale

# The further columns of a continuous recording and of a case: their units and digits.


# Unit and decimals of each; angles grow from row to row and do not wrap.
UNITS = {
    "t": ("s", 6),
    "SA_CMD": ("deg", 5),
    "FZ_CMD": ("N", 3),
    "V": ("km/h", 5),
    "TIRE_ANGLE": ("deg", 3),
    "DRUM_ANGLE": ("deg", 3),
    "T_TREAD": ("degC", 4),
    "T_AMBIENT": ("degC", 4),
    "P_INFL": ("kPa", 4),
    "SA": ("deg", 6),
    "FZ": ("N", 4),
    "FY": ("N", 5),
    "MZ": ("N*m", 6),
    **dict.fromkeys(CELLS, ("mV/V", 8)),
}
FURTHER = ("t", "SA_CMD", "FZ_CMD", "V", "TIRE_ANGLE", "DRUM_ANGLE", "T_TREAD", "T_AMBIENT", "P_INFL")


def unit_of(name: str) -> str:
    """Return the unit of a column."""
    return UNITS[name][0]


def shown(signals: Mapping[str, Array], name: str) -> Array:
    """Return a signal [SI] in its column's unit and digits."""
    text, decimals = UNITS[name]
    return np.asarray(np.round(from_si(signals[name], text), decimals) + 0.0, dtype=np.float64)


def further(signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return the further columns of a continuous recording, under headers with their units."""
    return {f"{name} [{unit_of(name)}]": shown(signals, name) for name in FURTHER}


TRUTH = "truth.json"
TEST = "test.toml"
MACHINE = "machine.toml"
PROTOCOL = "protocol.toml"
SESSION = "SESSION.toml"
# CSV has no place for a remark: the names carry it.
LOADS_CSV = "loads_simulated.csv"
CHECK_CSV = "check_simulated.csv"
_MARK = "# simulated: made by the virtual machine of the toolkit, no real tire was tested\n"


def write_test(test: VirtualTest, folder: Path) -> tuple[Path, ...]:
    """Write a virtual test into a folder; return the files, recordings first.

    Raises
    ------
    OutputError
        the folder holds other files, or cannot be written to
    """
    names = test_names(test)
    check_folder(folder, set(names))
    with publication(folder) as stage:
        for file in test.files:
            settled = test.plan.record == "dwell" and not file.run.sweep
            columns = file.columns if settled else file.columns | further(file.signals)
            write_labview(stage / file.name, test.plan.machine, columns, simulated=True)
        (stage / TEST).write_text(test_toml(test), encoding="utf-8")
        if not _is_packaged(test.plan.machine):
            (stage / MACHINE).write_text(toml_text(test.plan.machine), encoding="utf-8")
        if (protocol := own_protocol(test.plan)) is not None:
            (stage / PROTOCOL).write_text(toml_text(protocol), encoding="utf-8")
        (stage / TRUTH).write_text(_json(truth_document(test)), encoding="utf-8")
    return tuple(folder / name for name in names)


def test_names(test: VirtualTest) -> tuple[str, ...]:
    """Return the names of a virtual test's files, recordings first."""
    definition = () if _is_packaged(test.plan.machine) else (MACHINE,)
    protocol = () if own_protocol(test.plan) is None else (PROTOCOL,)
    return (*(file.name for file in test.files), TEST, *definition, *protocol, TRUTH)


def own_protocol(plan: Plan) -> Protocol | None:
    """Return the protocol of a plan with a slip angle or load that the machine's has not, else None."""
    times: Counter[tuple[str, float, float]] = Counter()
    for run in (run for run in plan.recordings if not run.sweep):
        times.update((run.rotation, angle, load) for angle, load in run.steps)
    angles = tuple(
        angle
        for angle in dict.fromkeys(angle for _, angle, _ in times)
        for _ in range(max(count for (_, step, _), count in times.items() if step == angle))
    )
    loads = tuple(dict.fromkeys(load for _, _, load in times))
    standard = plan.machine.protocol
    if set(angles) <= set(standard.slip_angles_rad) and set(loads) <= set(standard.loads_N):
        return None
    source = f"the plan of the simulated test, {plan.title}; all else as in: {standard.source}"
    return replace(standard, source=source, slip_angles_rad=angles, loads_N=loads)


def _is_packaged(machine: Machine) -> bool:
    """Tell whether a machine's name alone finds it: any other one's definition goes with the test."""
    return machine.name in machine_names() and load_machine(machine.name) == machine


def write_session(session: VirtualSession, folder: Path) -> tuple[Path, ...]:
    """Write a virtual reference-load session into a folder; return the files, SESSION.toml first."""
    files = {
        SESSION: session_toml(session),
        LOADS_CSV: loads_csv(session),
        CHECK_CSV: check_csv(session),
        TRUTH: _json(session_truth(session)),
    }
    check_folder(folder, set(files))
    with publication(folder) as stage:
        for name, text in files.items():
            (stage / name).write_text(text, encoding="utf-8")
    return tuple(folder / name for name in files)


def test_toml(test: VirtualTest) -> str:
    """Return test.toml: what an operator would have written down, and the tare."""
    plan = test.plan
    first = plan.recordings[0].rotation
    label = {
        "size": "205/55R16",
        "company": "simulated",
        "DOT": "SIMULATED",
        "series": "simulated",
        **dict(plan.label),
    }
    speed = float(from_si(plan.machine.drum.speed_m_s, "km/h"))
    road = " (simulated)" if plan.machine.drum.circumference_m is None else " drum (simulated)"
    lines = [
        "schema = 1",
        f"date = {plan.date}",
        f"machine = {_text(plan.machine.name if _is_packaged(plan.machine) else MACHINE)}",
        "simulated = true",
        'operator = "virtual operator"',
        'requestor = "simulated test"',
        f"surface = {_text(plan.machine.drum.surface + road)}",
        f"special = {_text('simulated: ' + plan.title)}",
        f"rotation = {_text(first)}",
        f'speed = {{ value = {round(speed, 6)!r}, unit = "km/h" }}',
        f'pressure = {{ value = {round(float(from_si(plan.pressure_Pa, "psi")), 6)!r}, unit = "psi" }}',
        f'rated_load = {{ value = {plan.tire.nominal_load_N!r}, unit = "N" }}',
        *([] if own_protocol(plan) is None else [f"protocol = {_text(PROTOCOL)}"]),
        "",
        "[tire]",
        *(f"{key} = {_text(value)}" for key, value in label.items()),
    ]
    turned = {file.name: file.rotation for file in test.files if file.rotation != first}
    if on_the_hub := _turned_on_the_hub(test):
        lines.insert(
            lines.index(""), 'reversal = "tire"  # "reverse" are the runs of the tire turned round on its hub'
        )
        turned = dict.fromkeys(on_the_hub, "reverse")
    if turned:
        lines += [
            "",
            "[rotations]",
            *(f"{_text(name)} = {_text(rotation)}" for name, rotation in turned.items()),
        ]
    sweeps = {file.name: machine_speed(file.run, plan.machine) for file in test.files if file.run.sweep}
    if sweeps:
        lines += ["", "[sweeps]  # surface speed of the recordings that are steered in time"]
        lines += [
            f'{_text(name)} = {{ value = {round(float(from_si(speed, "km/h")), 6)!r}, unit = "km/h" }}'
            for name, speed in sweeps.items()
        ]
    values = ", ".join(f"{name} = {value!r}" for name, value in test.tare)
    lines += [
        "",
        f"[tare]  # {test.tare_unit}, wheel mounted and lifted off the drum",
        f"values = {{ {values} }}",
        f"u = {{ {', '.join(f'{name} = {u:.3g}' for name, u in test.tare_u)} }}",
    ]
    return _MARK + "\n".join(lines) + "\n"


def _turned_on_the_hub(test: VirtualTest) -> list[str]:
    """Return the recordings with the tire turned round on its hub, where that alone tells runs apart."""
    if any(file.rotation != "forward" for file in test.files):
        return []
    turned = [file.name for file in test.files if file.run.mounting == "turned"]
    return turned if len(turned) < len(test.files) else []


def session_toml(session: VirtualSession) -> str:
    """Return SESSION.toml for `toolkit calibrate`."""
    plan, sd = session.plan, reference_sd(session.plan)
    quoted = {name: ", ".join(_text(name) for name in names) for name, names in (("i", CELLS), ("l", LOADS))}
    lines = [
        "schema = 1",
        f"instrument = {_text(plan.machine.name)}",
        f"date = {plan.date}",
        'operator = "virtual operator"',
        'temperature = { value = 21.0, unit = "degC" }',
        f"indications = [{quoted['i']}]",
        f"loads = [{quoted['l']}]",
        f"data = {_text(LOADS_CSV)}",
        f"check = {_text(CHECK_CSV)}",
        *([] if session.zeros else ['zero = "tared"  # the amplifier was zeroed before each run']),
        "",
        "[reference]",
        'standard = "simulated reference loads"',
        'certificate = "none: simulated"',
        "",
        "[reference.uncertainty]",
        *(
            f"{load} = {{ U = {2 * sd[load]:.4g}, k = 2, unit = {_text(LOAD_UNITS[load])} }}"
            for load in LOADS
        ),
    ]
    # No serials of real cells: of the machine that the simulated one stands for.
    prefix = f"V{(plan.machine.extends or plan.machine.name).upper()}"
    for name in CELLS:
        lines += ["", f"[cells.{name}]", f"serial = {_text(f'{prefix}-{name}')}", *_electrics(session)]
    if session.zeros:
        lines += ["", "[zero]", 'fit = "tared"  # the amplifier was zeroed before each run']
    for when, values in session.zeros:
        listed = ", ".join(f"{value:.{DECIMALS[plan.session.output]}f}" for value in values)
        lines += ["", "[[zero.readings]]", f"when = {_text(when)}", f"values = [{listed}]"]
    return _MARK + "\n".join(lines) + "\n"


def _electrics(session: VirtualSession) -> list[str]:
    truth = session.plan.session
    lines = []
    if truth.output == "mV":
        lines.append(f'excitation = {{ value = {truth.excitation_V!r}, unit = "V" }}')
    if truth.output == "count":
        scale = float(from_si(truth.count_V_V, INDICATION_UNIT))
        lines.append(f'scale = {{ value = {scale:.12g}, unit = "mV/V" }}  # of one count')
    if session.zeros:
        step = float(from_si(shunt_step(), INDICATION_UNIT))
        lines.append(f'shunt_expected = {{ value = {step:.6f}, unit = "mV/V" }}')
    return lines


def session_truth(session: VirtualSession) -> dict[str, Any]:
    """Return what a perfect fit of the session would find, in mV/V and the units of its loads."""
    plan = session.plan
    per_unit = si_scale(INDICATION_UNIT)
    true = true_coefficients(plan.cells)
    return {
        "schema": 1,
        "generator": "toolkit",
        "content": "truth of a virtual reference-load session",
        "simulated": True,
        "title": plan.title,
        "machine": plan.machine.name,
        "date": plan.date,
        "seed": plan.seed,
        "units": {"indications": INDICATION_UNIT, **LOAD_UNITS},
        "coefficients": {
            load: {
                name: float(value) * per_unit / si_scale(LOAD_UNITS[load])
                for name, value in zip(CELLS, true[load], strict=True)
            }
            for load in LOADS
        },
        "reference_sd": reference_sd(plan),
    }


def check_folder(folder: Path, names: set[str]) -> None:
    """Refuse a folder that holds anything but an earlier output of these names.

    Raises
    ------
    OutputError
        the folder holds other files, or is none
    """
    if not folder.exists():
        return
    strangers = (
        sorted(
            entry.name
            for entry in folder.iterdir()
            if entry.name not in names and not entry.name.startswith(PASSING)
        )
        if folder.is_dir()
        else [folder.name]
    )
    if strangers:
        raise OutputError(
            "the output folder holds other files",
            where=folder,
            got=", ".join(strangers[:3]) + (" ..." if len(strangers) > 3 else ""),
            expected="a new or empty folder, or an earlier output of the same plan",
            next_step="choose another folder with --out; nothing was written",
        )


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
