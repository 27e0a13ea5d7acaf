"""The next version of a machine definition: the old text, its version one higher, and one more correction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.declared import plain, toml_text
from toolkit.declared.faults import lines_of
from toolkit.errors import ConfigError
from toolkit.files import sha256_bytes
from toolkit.inputs import SETTINGS_FILE, read_input
from toolkit.machine.correction import Correction
from toolkit.machine.definition import machine_file, machine_of_text

if TYPE_CHECKING:
    from toolkit.machine.definition import Machine


def next_version(
    machine: str, correction: Correction, *, out: Path, diagnosed_with: str | None
) -> tuple[str, Machine]:
    """Return text and content of a machine's next version with a correction in it; nothing is written.

    Parameters
    ----------
    machine : name of a packaged machine, or the path of a definition
    out : where the text will lie; it names it in messages
    diagnosed_with : SHA-256 of the definition that the answer's case had, None where it named none

    Raises
    ------
    ConfigError
        no such machine; ``machine-correction``: it is corrected already, or the correction cannot be
    """
    path = machine_file(machine)
    data = read_input(path, SETTINGS_FILE)
    old = machine_of_text(data, path)
    for earlier in old.corrections:
        if earlier.label == correction.label and diagnosed_with != sha256_bytes(data):
            raise ConfigError(
                "the machine has this correction already", where=path, got=earlier.as_text(),
                expected="an answer of recordings that were diagnosed with this version",
                next_step=f"diagnose the case with machine = {path.name!r}, and correct what is left",
                rule="machine-correction",
            )  # fmt: skip
    numbers = {"version": old.version + 1, "supersedes": sha256_bytes(data)}
    text = _with_entries(data.decode("utf-8-sig"), toml_text(numbers))
    text += "\n" + toml_text({"correction": [plain(correction)]})
    return text, machine_of_text(text.encode(), out)


def _with_entries(text: str, entries: str) -> str:
    """Return the text with these entries of its top level below the name, in place of any older ones."""
    places, lines = lines_of(text), text.splitlines()
    older = {places[key,] for key in ("version", "supersedes") if (key,) in places}
    after = places.get(("name",), 0)
    numbered = [line for number, line in enumerate(lines, start=1) if number not in older or number == after]
    after -= sum(number < after for number in older)
    return "\n".join([*numbered[:after], entries.rstrip(), *numbered[after:]]).rstrip() + "\n"
