"""What the machine is told and does over one recording: times, commands, blocks; every row in its place.

The rows between blocks are there too, for effects that need them (a lag remembers the move before the
block); a dwell recording leaves them out of its file, a continuous one keeps them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.errors import ConfigError
from toolkit.simulation import acquisition, carriage, tire
from toolkit.simulation.acquisition import Noise
from toolkit.simulation.plan import Plan
from toolkit.simulation.steps import RunSteps, machine_speed

_LIFT_S = 1.0  # from the lifted wheel to the first load
_MOST_ROWS = 1_048_575  # of an .xlsx sheet, less its header


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One condition: its commanded steps, its rows among all rows (``start`` to ``stop``, settled)."""

    step_SA_rad: float
    step_FZ_N: float
    start: int
    stop: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Timeline:
    """One recording: arrays of shape (n,).

    ``t`` [s] within the recording, ``clock`` [s] of the drum, ``dt`` of the acquisition; ``SA_CMD`` [rad] and
    ``FZ_CMD`` [N] what the machine was told, ``FZ_SET`` [N] the load at which its actuator stops instead;
    ``recorded`` the rows of the file.
    """

    t: Array
    clock: Array
    dt: float
    SA_CMD: Array
    FZ_CMD: Array
    FZ_SET: Array
    noise: Noise
    recorded: NDArray[np.bool_]
    blocks: tuple[Block, ...]


@dataclass(slots=True)
class _Path:
    """Corners of a motion: it is linear between them."""

    t: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)

    def to(self, start: float, target: float, rate: float) -> float:
        """Move from where it stands at ``start`` [s]; return when it arrives."""
        start_value = self.at(np.array([start])).item() if self.t else target
        # A move that was under way ends where it is: the new one goes on from there.
        while self.t and self.t[-1] >= start:
            self.t.pop()
            self.y.pop()
        arrived = start + abs(target - start_value) / rate
        self.t += [start, arrived] if arrived > start else [start]
        self.y += [start_value, target] if arrived > start else [target]
        return arrived

    def at(self, times: Array) -> Array:
        """Return the values at times."""
        return np.interp(times, self.t, self.y)


def dwell(plan: Plan, run: RunSteps, rng: np.random.Generator, extra: np.random.Generator) -> Timeline:
    """Return a recording of settled blocks alone, as the machine makes it.

    ``rng`` draws what is in the file; ``extra`` the noise between blocks, so that it moves no other number.
    """
    protocol, per_turn = plan.machine.protocol, plan.acquisition.rows_per_revolution
    dt = _interval(plan, run)
    settle = round(protocol.settle_revolutions * per_turn)
    keep = round(protocol.average_revolutions * per_turn)
    if run.dwell_s is not None or plan.motion.dwell_s is not None:
        keep = max(1, round((run.dwell_s or plan.motion.dwell_s or 0.0) / dt))
    _refuse_long(len(run.steps) * (settle + keep))
    rates = _rates(plan, run)
    clock = float(rng.uniform(0.0, 60.0))  # the drum turns on between files
    paths = {"SA": _Path(), "CMD": _Path(), "SET": _Path()}
    times: list[Array] = []
    noises: list[Noise] = []
    recorded: list[NDArray[np.bool_]] = []
    blocks: list[Block] = []
    moved = clock - _LIFT_S
    for name in ("CMD", "SET"):
        paths[name].to(moved, 0.0, 1.0)
    paths["SA"].to(moved, run.steps[0][0], 1.0)
    rows = 0
    for angle, load in run.steps:
        stop = carriage.set_load(plan.carriage, step_N=load, rng=rng)
        _move(paths, moved, angle, load, stop, rates)
        between = _between(moved, clock, dt, first=not blocks)
        block = clock + dt * np.arange(settle + keep, dtype=np.float64)
        times += [between, block]
        noises += [acquisition.draw_noise(plan.acquisition, plan.cells, len(between), extra)]
        noises += [acquisition.draw_noise(plan.acquisition, plan.cells, len(block), rng)]
        recorded += [np.zeros(len(between) + settle, dtype=bool), np.ones(keep, dtype=bool)]
        start = rows + len(between) + settle
        blocks.append(Block(step_SA_rad=angle, step_FZ_N=load, start=start, stop=start + keep))
        rows = start + keep
        moved = float(block[-1])
        clock = moved + float(rng.uniform(1.0, 4.0))  # the program waits while the actuator moves
    return _made(paths, np.concatenate(times), dt, noises, np.concatenate(recorded), blocks)


def continuous(plan: Plan, run: RunSteps, rng: np.random.Generator) -> Timeline:
    """Return a recording from the first command to the end of the last block.

    The wheel stands straight under the first load when it begins.
    """
    protocol, dt = plan.machine.protocol, _interval(plan, run)
    turn = dt * plan.acquisition.rows_per_revolution
    settle, average = protocol.settle_revolutions * turn, protocol.average_revolutions * turn
    hold = run.dwell_s or plan.motion.dwell_s or settle + average
    rates = _rates(plan, run)
    clock = float(rng.uniform(0.0, 60.0))
    paths = {"SA": _Path(), "CMD": _Path(), "SET": _Path()}
    now, last = clock, math.nan
    stop = carriage.set_load(plan.carriage, step_N=run.steps[0][1], rng=rng)
    for name, start in (("SA", 0.0), ("CMD", run.steps[0][1]), ("SET", stop)):
        paths[name].to(now, start, 1.0)
    ends: list[tuple[float, float, float]] = []
    now += turn
    for index, (angle, load) in enumerate(run.steps):
        if index and load != last:
            stop = carriage.set_load(plan.carriage, step_N=load, rng=rng)
        last = load
        now = _move(paths, now, angle, load, stop, rates) + hold
        ends.append((angle, load, now))
    rows = int((now - clock) / dt) + 1
    _refuse_long(rows)
    times = clock + dt * np.arange(rows, dtype=np.float64)
    blocks = []
    for angle, load, end in ends:
        at = min(int((end - clock) / dt) + 1, rows)
        blocks.append(
            Block(
                step_SA_rad=angle,
                step_FZ_N=load,
                start=max(at - max(round(min(average, hold) / dt), 1), 0),
                stop=at,
            )
        )
    noise = [acquisition.draw_noise(plan.acquisition, plan.cells, rows, rng)]
    return _made(paths, times, dt, noise, np.ones(rows, dtype=bool), blocks)


def _refuse_long(rows: int) -> None:
    if rows > _MOST_ROWS:
        raise ConfigError(
            "a recording is too long", where="the plan's runs, [motion] and rows_per_revolution",
            got=f"{rows} rows", expected=f"at most {_MOST_ROWS}, as many as a sheet of the machine holds",
            next_step="shorten the dwell, quicken the moves, or split the run", rule="wrong-value",
        )  # fmt: skip


def _interval(plan: Plan, run: RunSteps) -> float:
    speed = machine_speed(run, plan.machine)
    return tire.revolution_time_s(plan.tire, speed) / plan.acquisition.rows_per_revolution


def _rates(plan: Plan, run: RunSteps) -> tuple[float, float]:
    return (
        run.steer_rate_rad_s or plan.motion.steer_rate_rad_s,
        run.load_rate_N_s or plan.motion.load_rate_N_s,
    )


def _move(
    paths: dict[str, _Path], start: float, angle: float, load: float, stop: float, rates: tuple[float, float]
) -> float:
    turned = paths["SA"].to(start, angle, rates[0])
    loaded = paths["SET"].to(start, stop, rates[1])
    paths["CMD"].to(start, load, rates[1])
    return max(turned, loaded)


def _between(start: float, end: float, dt: float, *, first: bool) -> Array:
    count = max(math.ceil((end - start) / dt - 1e-6) - 1, 0)
    rows = start + dt * np.arange(1, count + 1, dtype=np.float64)
    return np.concatenate([[start], rows]) if first else rows


def _made(
    paths: dict[str, _Path],
    clock: Array,
    dt: float,
    noises: list[Noise],
    recorded: NDArray[np.bool_],
    blocks: list[Block],
) -> Timeline:
    return Timeline(
        t=clock - clock[0],
        clock=clock,
        dt=dt,
        SA_CMD=paths["SA"].at(clock),
        FZ_CMD=paths["CMD"].at(clock),
        FZ_SET=paths["SET"].at(clock),
        noise=acquisition.joined(noises),
        recorded=recorded,
        blocks=tuple(blocks),
    )
