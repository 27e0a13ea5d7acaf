"""The answer of ``toolkit plan next``: the run that parts a class, what it parts, with what power."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from toolkit.declared import Entry


@dataclass(frozen=True, slots=True, kw_only=True)
class PartedPair:
    """Two members, of which the first is true."""

    true: Annotated[str, Entry("the member that is true")]
    other: Annotated[str, Entry("the member that it is held against")]
    recorded: Annotated[float, Entry("by how much the recordings prefer the true one, log-likelihood")]
    repeat: Annotated[float, Entry("expected log-evidence of a repeat of the best recording")]
    expected: Annotated[float, Entry("expected log-evidence of the run that is proposed")]


@dataclass(frozen=True, slots=True, kw_only=True)
class NextRunPlan:
    """The answer of ``toolkit plan next``."""

    case_sha256: Annotated[str, Entry("of the case that the answer is of")]
    members: Annotated[tuple[str, ...], Entry("of the class, the likeliest first")]
    lost: Annotated[tuple[str, ...], Entry("members of the answer that could not be fitted")]
    steps: Annotated[tuple[str, ...], Entry("what the operator does")]
    conditions: Annotated[dict[str, str], Entry("of the run")]
    seconds: Annotated[float, Entry("how long it takes, all of its recordings")]
    times: Annotated[int, Entry("how often it is made, one after the other, each a recording of its own")]
    pairs: Annotated[tuple[PartedPair, ...], Entry("what the run parts")]
    power: Annotated[float, Entry("chance that the run alone puts the true member ahead of all others")]
    power_of_repeat: Annotated[float, Entry("the same of a repeat")]
    together: Annotated[tuple[tuple[str, str], ...], Entry("pairs that it does not part")]
    judged: Annotated[int, Entry("runs that were tried")]
    complete: Annotated[bool, Entry("whether the search ended by itself")]
    assumptions: Annotated[tuple[str, ...], Entry("what it rests on")]


ASSUMPTIONS = (
    "the true cause is a member of the class, with parameters near those fitted",
    "the noise of the run is that of the recordings; where rows are denser, its density over time stays",
    "of a longer run noise and parameters are those of the recordings from its first row to its last",
    "inputs stay within what was recorded, or the limits that were given",
    "they change at most four times as fast as recorded, or at the rates that were given",
    "covariates without a limit are as in the recording that is changed",
)
