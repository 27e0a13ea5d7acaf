"""The gate of physics on virtual tests: silent on every effect of its typical size, loud on faulty cells.

    python -m tests.campaigns.physics_gate [--tests 500] [--seed 18]

A test is the whole protocol, forward and reverse. The first ones have one effect each, the others two to six
at random, each within the typical range that its own file states and of either sign where it may have one.
Left out are the four that are faults of the measurement and no physics (`FAULTS`), and dead bands and
hysteresis in the upper half of their range (over 8 % and 1.4 % of the largest value; real cells 0.2 %): a
channel that says nothing over a tenth of its range makes values that no tire has. Faults are shown apart,
with the turns, exchanges and losses of single cells. Prints a table and the exact 95 % limit of the rate of
false alarms; ends with 1 where one was raised.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.registry import Registry
from toolkit.effects.catalogue import effects
from toolkit.effects.effect import Effect, EffectParameter
from toolkit.findings import Finding
from toolkit.lab.home import packaged_home
from toolkit.recording.model import Recording, Series, TestInfo
from toolkit.reduction.model import ReducedTest, Tare
from toolkit.reduction.physics import RULES
from toolkit.reduction.reduce import reduce_test
from toolkit.simulation.file_tire import read_file_tire
from toolkit.simulation.places import channels_of, is_paired, sources_of
from toolkit.simulation.plan import Plan, read_plan, with_effects
from toolkit.simulation.program import program_from
from toolkit.simulation.run import VirtualFile, VirtualTest, simulate

EXAMPLES = Path(__file__).resolve().parents[2] / "toolkit" / "examples" / "virtual"
FAULTS = ("unit_error", "channel_sign", "channel_swap", "rectification")
CELLS = ("D51", "D52", "E5")
# The largest values of the signals over the protocol, in the units in which effects act on them.
SPAN = {
    "D51": 1.1, "D52": 1.1, "E5": 1.25, "FY": 5.3e3, "MZ": 110.0, "MX": 1.6e3, "FZ": 6.1e3, "SA": 10.0,
}  # fmt: skip
MINUTES, KELVIN = 5.0, 10.0
Edit = Callable[[dict[str, np.ndarray], VirtualFile], None]


def base_plan(*, tir: bool = False, rows: int = 25) -> Plan:
    """Return the packaged plan, with the published tire or the tire file (which knows its pressure)."""
    plan = read_plan(EXAMPLES / "test_plan.toml")
    quick = dataclasses.replace(plan.acquisition, rows_per_revolution=rows)
    plan = dataclasses.replace(plan, acquisition=quick)
    if not tir:
        return plan
    tire = dataclasses.replace(plan.tire, plysteer_rad=0.0, aligning_shift_rad=0.0, conicity_N=0.0)
    return dataclasses.replace(plan, tire_file=read_file_tire(EXAMPLES / "tire.tir"), tire=tire)


def virtual_record() -> CalibrationRecord:
    """Return the packaged record of the virtual machine."""
    return Registry(packaged_home() / "calibrations").load("m15-virtual-r1")


def reduced(test: VirtualTest, record: CalibrationRecord, edit: Edit | None = None) -> ReducedTest:
    """Reduce a virtual test without files; ``edit`` changes a file's columns in the machine's units."""
    machine = test.plan.machine
    recordings = []
    for file in test.files:
        columns = {name: np.array(values, dtype=np.float64) for name, values in file.columns.items()}
        if edit is not None:
            edit(columns, file)
        series = tuple(
            Series(symbol=c.symbol, header=c.header, unit=c.unit, role=c.role, values=columns[c.symbol])
            for c in machine.columns
        )
        recordings.append((
            file.name,
            Recording(
                path=Path(file.name), sha256="0" * 64, machine=machine, series=series, simulated=True,
                format="virtual",
            ),
            file.rotation,
        ))  # fmt: skip
    return reduce_test(
        info=TestInfo(name="virtual", machine=machine.name, tire_size="205/55R16"),
        machine=machine,
        record=record,
        recordings=recordings,
        tare=Tare(source="test.toml", values=test.tare, unit=test.tare_unit, u=test.tare_u),
    )


def alarms(test: ReducedTest) -> list[Finding]:
    """Return what the gate of physics found."""
    return [one for one in test.findings if one.rule in (*RULES, "implausible-friction")]


def silent_effects() -> tuple[str, ...]:
    """Return the names of the effects that are physics of the machine and the tire, not faults."""
    return tuple(name for name, one in effects().items() if one.stage != "dynamics" and name not in FAULTS)


def effect_text(name: str, rng: np.random.Generator) -> str:
    """Return an effect at a size within its typical range, at a random place, as `--effect` takes it."""
    one = effects()[name]
    if name == "wrong_calibration":
        return "wrong_calibration=m15-virtual-r1"
    channel, source = _place(one, rng)
    sized = [f"{p.name}:{_size(p, one.name, channel, source, rng):.6g}" for p in one.parameters]
    place = "".join(f".{part}" for part in (source, channel) if part)
    return f"{name}{place}" + (f"={','.join(sized)}" if sized else "")


def _place(one: Effect, rng: np.random.Generator) -> tuple[str | None, str | None]:
    known = channels_of(one)
    if is_paired(one):
        # A load acts on another load, or on a cell.
        source = str(rng.choice([s for s in sources_of(one) if s not in CELLS]))
        return str(rng.choice([c for c in known if c != source])), source
    return (str(rng.choice(known)) if known else None), None


def _size(
    p: EffectParameter, name: str, channel: str | None, source: str | None, rng: np.random.Generator
) -> float:
    low, high = p.typical
    if name in ("dead_band", "hysteresis") and p.relative:
        high = np.sqrt(low * high)  # wider, a cell says nothing over a good part of its range: see `faults`
    value = low * (high / low) ** rng.random() if low * high > 0 else rng.uniform(low, high)
    free = p.bounds[0] < -abs(value) and p.off == 0.0 and low > 0
    if free and name not in ("relaxation", "drum_curvature") and rng.random() < 0.5:
        value = -value
    if not p.relative:
        return float(value)
    span = SPAN[str(channel)]
    scale = {
        "nonlinearity": 1 / span if p.name == "quadratic" else 1 / span**2,
        "zero_drift": span / MINUTES,
        "thermal_drift": span / KELVIN,
        "crosstalk": span / SPAN.get(str(source), 1.0),
    }.get(name, span)
    return float(value * scale)


def drawn(index: int, seed: int) -> tuple[list[str], bool]:
    """Return the effects of a test by its number, and whether its tire is the tire file's."""
    rng = np.random.default_rng([seed, index])
    names = silent_effects()
    chosen = (
        [names[index % len(names)]]
        if index < 3 * len(names)
        else [str(one) for one in rng.choice(names, size=int(rng.integers(2, 7)), replace=False)]
    )
    return [effect_text(name, rng) for name in chosen], "pressure_change" in chosen or rng.random() < 0.3


def virtual(index: int, seed: int, record: CalibrationRecord) -> tuple[list[str], VirtualTest]:
    """Simulate a test by its number; return its effects too."""
    texts, tir = drawn(index, seed)
    plan = dataclasses.replace(with_effects(base_plan(tir=tir), texts), seed=seed * 10_000 + index)
    return texts, simulate(plan, others={"m15-virtual-r1": program_from(record)})


def faults(tare: dict[str, float]) -> dict[str, Edit]:
    """Return every single fault of a cell by its name: turned, exchanged with another, dead; and loads."""

    def turned(*cells: str) -> Edit:
        return lambda columns, _: columns.update({c: -columns[c] for c in cells})

    def exchanged(one: str, other: str) -> Edit:
        return lambda columns, _: columns.update({one: columns[other], other: columns[one]})

    def dead(cell: str) -> Edit:
        return lambda columns, _: columns.update({cell: np.full_like(columns[cell], tare[cell])})

    def times(name: str, factor: float) -> Edit:
        return lambda columns, _: columns.update({name: columns[name] * factor})

    def band(cell: str) -> Edit:
        def dead_within(columns: dict[str, np.ndarray], _: VirtualFile) -> None:
            half = 0.15 * SPAN[cell]
            columns[cell] = np.sign(columns[cell]) * np.maximum(abs(columns[cell]) - half, 0.0)

        return dead_within

    lbf = 4.4482216152605
    return {
        **{f"{c} turned": turned(c) for c in CELLS},
        **{f"{a} and {b} exchanged": exchanged(a, b) for a, b in itertools.combinations(CELLS, 2)},
        **{f"{c} dead": dead(c) for c in CELLS},
        "all cells turned": turned(*CELLS),
        "FZ in lbf read as N": times("FZ", 1 / lbf),
        "FZ in kgf read as lbf": times("FZ", 1 / 2.2046226),
        "FZ in N read as lbf": times("FZ", lbf),
        "all cells in lbf read as N": lambda columns, _: columns.update({c: columns[c] / lbf for c in CELLS}),
        "all cells in N read as lbf": lambda columns, _: columns.update({c: columns[c] * lbf for c in CELLS}),
        **{f"{c} with a dead band of 0.3": band(c) for c in CELLS},
        **{f"{c} rectified": (lambda columns, _, c=c: columns.update({c: abs(columns[c])})) for c in CELLS},
        **{f"{c} times {k:g}": times(c, k) for c in CELLS for k in (0.5, 0.7, 1.3, 2.0)},
    }


def limit(alarmed: int, tests: int) -> float:
    """Return the exact upper 97.5 % limit of a rate (Clopper and Pearson)."""
    from scipy.stats import beta

    return 1.0 if alarmed == tests else float(beta.ppf(0.975, alarmed + 1, tests - alarmed))


def main() -> int:
    """Run the campaign and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--tests", type=int, default=500)
    parser.add_argument("--seed", type=int, default=18)
    parser.add_argument("--faults", type=int, default=100, help="tests that get every fault too")
    chosen = parser.parse_args()
    record = virtual_record()
    used: Counter[str] = Counter()
    seen: Counter[str] = Counter()
    alarmed = 0
    for index in range(chosen.tests):
        texts, test = virtual(index, chosen.seed, record)
        used.update(text.split(".")[0].split("=")[0] for text in texts)
        if found := alarms(reduced(test, record)):
            alarmed += 1
            told = "".join(f"  {one.rule} {one.message}\n" for one in found)
            sys.stdout.write(f"alarm {index}: {texts}\n{told}")
        # The last ones: with more effects than one.
        if index >= chosen.tests - chosen.faults:
            for name, edit in faults(dict(test.tare)).items():
                seen[name] += bool(alarms(reduced(test, record, edit)))
    sys.stdout.write(
        f"{chosen.tests} virtual tests with effects, {alarmed} alarms (95 %: to "
        f"{100 * limit(alarmed, chosen.tests):.2f} %); each effect in {min(used.values())} to "
        f"{max(used.values())} of them\n\nfault, seen with effects, and what tells it without:\n"
    )
    alone = simulate(base_plan())
    with_fault = min(chosen.faults, chosen.tests)
    for name, edit in faults(dict(alone.tare)).items():
        rules = Counter(one.rule for one in alarms(reduced(alone, record, edit)))
        told = ", ".join(f"{n} {rule}" for rule, n in rules.items()) or "nothing"
        sys.stdout.write(f"{name:28s} {seen[name]:4d} of {with_fault}  {told}\n")
    return 1 if alarmed else 0


if __name__ == "__main__":
    sys.exit(main())
