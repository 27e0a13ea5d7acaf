"""What a drawn case consists of: parameters, channels, runs and the two simulators, nominal and true."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]
Params = dict[str, float]
Effects = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter of the declared simulation: what the case says, and what is true."""

    name: str
    declared: float
    unit: str
    true: float
    sd: float | None = None
    """Prior standard deviation; None: known exactly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A column of the recording."""

    unit: str
    role: str
    sd: float | None = None
    """Noise that the case states for the channel (outputs only); None: not stated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One continuous recording: what truly happened on a fine grid, and when it was sampled."""

    name: str
    fine: Mapping[str, Array]
    """Signals on the fine grid by name, `t` among them [s]."""
    rows: Array
    """Sampling instants [s], inside the fine grid."""
    conditions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectSpec:
    """How a family makes one effect: a base that is scaled to the wanted size."""

    name: str
    base: Mapping[str, Any]
    """Parameters at the typical size, in the truth's own terms."""
    scaled: tuple[str, ...]
    """Those that grow with the size; empty: the effect has one size (a sign, a swap, a unit)."""
    largest: float = 12.0
    """Largest factor on the base that is still physical."""
    reported: Callable[[Mapping[str, Any]], dict[str, float]] | None = None
    """The contract's parameters that can be compared with the answer; None: no comparison of intervals."""
    channel: str | None = None
    either_sign: bool = False
    """The contract leaves the parameter's sign open: magnitudes are compared."""

    def at(self, factor: float) -> dict[str, Any]:
        """Return the parameters at `factor` times the typical size."""
        out = dict(self.base)
        for key in self.scaled:
            out[key] = out[key] * factor
        return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Coloured noise of one output: standard deviation and AR coefficients."""

    sd: float
    ar: tuple[float, ...] = ()
    outliers: float = 0.0
    """Share of rows with a spike of 5 to 10 sd."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A plant with its plan; the same object serves drawing, the oracle and the baselines."""

    family: str
    kind: str
    title: str
    simulation: Mapping[str, Any]
    """The [simulation] table without its parameters."""
    files: Mapping[str, str]
    """Files that the case needs beside its runs (sim.py, tire.tir)."""
    parameters: tuple[Parameter, ...]
    channels: Mapping[str, Channel]
    outputs: tuple[str, ...]
    runs: tuple[Run, ...]
    predict: tuple[Run, ...]
    noise: Mapping[str, Noise]
    inputs: Callable[[Run], pd.DataFrame]
    """Time, inputs and covariates as recorded."""
    nominal: Callable[[pd.DataFrame, Run, Params], dict[str, Array]]
    """The declared simulation at the recorded inputs."""
    truth: Callable[[Run, Params, Effects], dict[str, Array]]
    """What the outputs truly do at the sampling instants, without noise."""
    effects: Mapping[str, EffectSpec]
    axes: str | None = None
    driven: Callable[[Run, Effects], Run] | None = None
    """The run whose measured drivers are as the effects made them; None: no effect moves one."""
    simulated: Mapping[str, str] = field(default_factory=dict)
    """For kind `columns`: output -> column of the other program."""
    written: Callable[[dict[str, Array]], dict[str, Array]] | None = None
    """The measured outputs as the file has them, where it has others (load cells)."""
    timeless: bool = False
    """Steady files without a time channel, printed to so many digits and with no other noise."""
    sessions: tuple[Mapping[str, str], ...] = ()
    """Files of the reference-load sessions, oldest first; the last one's record is the case's record.json.

    Where there are several, all stand in the case's folder: they are the laboratory's registry.
    """

    def true_parameters(self) -> Params:
        """Return the true values by name."""
        return {p.name: p.true for p in self.parameters}

    def declared_parameters(self) -> Params:
        """Return the declared values by name."""
        return {p.name: p.declared for p in self.parameters}

    def free(self) -> tuple[Parameter, ...]:
        """Return the parameters with a prior."""
        return tuple(p for p in self.parameters if p.sd is not None)
