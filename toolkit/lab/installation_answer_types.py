"""Answers on the installation, as types: `doctor`, `explain`, `machine show`, ..."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, TypedDict

from toolkit.declared.answers import merged
from toolkit.findings import FindingEntry
from toolkit.qualification.model import Check, NotCovered


class InitAnswer(TypedDict):
    """A laboratory's home."""

    home: Path
    written: Annotated[list[str], "what was not there before"]


class MachineNeed(TypedDict):
    """What this computer has, and what it is needed for."""

    name: str
    ok: bool
    found: str
    needed_for: str


class DoctorAnswer(TypedDict):
    """What this computer lacks."""

    checks: list[MachineNeed]
    mend: Annotated[str | None, "command that mends it; null where nothing is missing"]


FileState = Literal["current", "to migrate", "migrated", "own", "newer", "refused"]


class KeptFileEntry(TypedDict):
    """A file of a home that the toolkit reads again."""

    place: Annotated[str, "in the home"]
    kind: str
    version: Annotated[int | str | None, "schema of the file, or release that shipped it; null where neither"]
    written_by: Annotated[str | None, "version of the toolkit; null where the file does not say"]
    state: Annotated[FileState, "own: the laboratory's; a home with newer files is refused as a whole"]
    reason: Annotated[str | None, "why it is refused"]


class MigrateAnswer(TypedDict):
    """A home, checked whole and brought to this version."""

    home: Path
    dry_run: Annotated[bool, "nothing was written"]
    files: Annotated[list[KeptFileEntry], "empty with --undo"]
    migration: Annotated[str | None, "folder of what was replaced; null where nothing was"]
    undone: Annotated[list[str], "places that --undo put back"]


class DocsAnswer(TypedDict):
    """Where the documentation is."""

    page: Annotated[Path, "its first page"]
    opened: Annotated[bool, "in a browser"]


class OpenAnswer(TypedDict):
    """Where the workbench is served."""

    address: Annotated[str | None, "of whoever sits at this computer"]
    home: Path
    people: NotRequired[Annotated[Mapping[str, str], "address of each person, with --host"]]


class StarterAnswer(TypedDict):
    """A new file, and what is still open in it."""

    path: Path
    guessed: Annotated[Mapping[str, Any], "entries that a recording told"]
    not_guessed: Annotated[list[str], "columns that it did not"]
    open: Annotated[list[str], "required entries that a person fills in"]
    lacking: Annotated[Mapping[str, str], "by entry, what the file that it names must still be given"]


class QualifyAnswer(TypedDict):
    """What this installation computes, held against certified values."""

    passed: bool
    software: str
    python: str
    packages: Annotated[Mapping[str, str], "versions that change numbers"]
    platform: str
    date: str
    numbers_sha256: str
    checks: list[Check]
    not_covered: list[NotCovered]


class CorrectionEntry(TypedDict):
    """A correction of a machine, and the diagnosis that it comes from."""

    effect: str
    channel: str | None
    source: str | None
    parameter: str
    value: Annotated[float, "machine axes"]
    unit: str
    u: Annotated[float, "standard uncertainty"]
    reason: str
    by: Annotated[str, "who decided it"]
    date: str
    answer_sha256: str
    case_sha256: str
    code_version: str
    equivalent_to: Annotated[list[str], "effects that the diagnosis could not tell it from"]


class MachineAnswer(TypedDict):
    """A machine's definition and its corrections."""

    path: Path
    sha256: NotRequired[Annotated[str, "of the file; not of a new one"]]
    name: str
    title: str
    version: int
    supersedes: Annotated[str | None, "definition that it replaces"]
    corrections: list[CorrectionEntry]
    findings: list[FindingEntry]


class RuleEntry(TypedDict):
    """A rule of findings and errors."""

    rule: str
    means: str
    do: str


class ParameterFacts(TypedDict):
    """A parameter of an effect."""

    name: str
    unit: str
    means: str
    typical: Annotated[list[float], "usual least and largest value"]
    relative: Annotated[bool, "whether these are shares of the channel's spread"]


class EffectFacts(TypedDict):
    """An effect that a diagnosis names."""

    effect: str
    means: str
    stage: str
    equation: str
    signature: Annotated[str, "what it does to a recording"]
    separates: Annotated[str, "what tells it from others"]
    needs: str
    source: str
    parameters: list[ParameterFacts]


class CharacteristicFacts(TypedDict):
    """A characteristic of a test."""

    name: str
    title: str
    symbol: str
    unit: str
    means: str
    formula: str
    term: Annotated[str, "of the standard"]
    source: str
    uncertainty: Annotated[str, "sources of its uncertainty"]


class ExplainedCharacteristic(TypedDict):
    """A characteristic of a test, beside the effect of its name where there is one."""

    characteristic: CharacteristicFacts


class Explanations(TypedDict):
    """All rules, effects and characteristics."""

    rules: list[RuleEntry]
    effects: list[EffectFacts]
    characteristics: list[CharacteristicFacts]


EffectAndCharacteristic = merged(ExplainedCharacteristic, EffectFacts, name="EffectAndCharacteristic")
ExplainForms = Explanations | RuleEntry | EffectFacts | ExplainedCharacteristic | EffectAndCharacteristic
"""Of no name, of a rule, and of what is an effect, a characteristic or both."""
