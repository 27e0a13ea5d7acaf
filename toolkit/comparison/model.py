"""Comparison: what was compared, the differences with their uncertainty, and how well repeats agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from toolkit.calibration.records.use import CalibrationUse
from toolkit.characteristics.model import Row
from toolkit.estimate import Estimate
from toolkit.findings import Finding

Mode = Literal["table", "surfaces", "tires", "repeats"]
MODES: tuple[Mode, ...] = get_args(Mode)
Kind = Literal["test", "table", "characteristics"]
# The two tables of a comparison; in each the error of all its decisions together is controlled.
Section = Literal["characteristics", "curves"]
SECTIONS: tuple[Section, ...] = get_args(Section)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One thing that is compared: a test, a maker's table, or a maker's table of characteristics.

    ``label`` is its name in tables and legends, different for each; ``identity`` tells two copies of the
    same data; ``calibration`` is the record that computed a test, and how it stands. ``conditions`` are
    (what, value) as the entry states them, None where it is silent.
    """

    label: str
    kind: Kind
    identity: str
    source: str
    rows: tuple[Row, ...]
    conditions: tuple[tuple[str, str | None], ...] = ()
    calibration: CalibrationUse | None = None
    simulated: bool = False

    def condition(self, name: str) -> str | None:
        """Return what the entry states of a condition."""
        return dict(self.conditions).get(name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One quantity of an entry less that of the reference, at the reference's load.

    ``reference`` ``other`` ``difference`` in SI; ``u_apart`` is the standard uncertainty that the
    difference had if nothing were shared. ``p`` is two-sided for no difference, None where nothing is
    uncertain; ``p_holm`` is adjusted for all decisions of its table; ``significant`` at the table's level.
    """

    part: Section
    name: str
    rotation: str
    SA_rad: float | None
    load_N: float
    label: str
    reference: Estimate
    other: Estimate
    difference: Estimate
    u_apart: float
    p: float | None
    p_holm: float | None
    significant: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A standard deviation [unit of its quantity] with its degrees of freedom and 95 % interval."""

    value: float
    dof: int
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorSpread:
    """What one factor adds: ISO 5725-3 intermediate precision with that factor different.

    ``s`` is sqrt(s_within^2 + s_between^2); ``p`` of the F test that the factor adds nothing, ``p_holm``
    adjusted over the table of that factor; both None where no level holds two tests.
    """

    factor: str
    levels: int
    s: float
    s_between: float | None
    F: float | None
    p: float | None
    p_holm: float | None = None
    significant: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Precision:
    """How well tests of one tire agree in one quantity at one load.

    ``repeatability`` pools tests whose stated factors were all the same, None where no two are;
    ``limit_r`` is the repeatability limit, 1.96 sqrt(2) of it (ISO 5725-6). ``total`` is over all tests.
    ``farthest`` is the test farthest from the mean, ``outlier_p`` its p by Grubbs's test (None for two
    tests); it is an ``outlier`` where the p adjusted over the table is below the level.
    """

    name: str
    rotation: str
    load_N: float
    n: int
    mean: float
    total: Spread
    repeatability: Spread | None
    limit_r: float | None
    factors: tuple[FactorSpread, ...]
    farthest: str
    outlier_p: float | None
    outlier_p_holm: float | None = None
    outlier: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """A factor of the tests: its level in each test, or why it is not told apart.

    ``same_as`` names the factors that changed together with it: their effects are one.
    """

    name: str
    levels: tuple[str | None, ...]
    varied: bool
    same_as: tuple[str, ...]
    note: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """Precision of a set of tests of one tire."""

    precisions: tuple[Precision, ...]
    factors: tuple[Factor, ...]
    reproducibility: str | None
    reproducibility_note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PatternEffect:
    """Pattern and body effect [N·m] of one definition of PRAT at one load."""

    name: str
    load_N: float
    regular: Estimate
    reversed: Estimate
    pattern: Estimate
    body: Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """All of it. ``loads_N`` are the reference's; ``left_out`` says what could not be compared, and why."""

    mode: Mode
    entries: tuple[Entry, ...]
    level: float
    differences: tuple[Difference, ...]
    repeats: Repeats | None
    pattern: tuple[PatternEffect, ...]
    left_out: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def reference(self) -> Entry:
        """The entry that all others are compared with: the first."""
        return self.entries[0]

    @property
    def uses(self) -> tuple[CalibrationUse, ...]:
        """The records that computed the tests, each once."""
        return tuple(dict.fromkeys(entry.calibration for entry in self.entries if entry.calibration))
