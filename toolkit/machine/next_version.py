"""The next version of a machine definition: the old text, its version one higher, and one more correction."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError
from toolkit.files import parse_toml, read_bytes, sha256_bytes
from toolkit.machine.correction import Correction, check_correction
from toolkit.machine.definition import build_machine, machine_file

if TYPE_CHECKING:
    from toolkit.machine.definition import Machine

_OWN = re.compile(r"^\s*(version|supersedes)\s*=")
_NAME = re.compile(r"^\s*name\s*=")


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
    check_correction(correction, str(out))
    path = machine_file(machine)
    data = read_bytes(path)
    old = build_machine(parse_toml(data, where=path), path)
    for one in old.corrections:
        if one.label == correction.label and diagnosed_with != sha256_bytes(data):
            raise ConfigError(
                "the machine has this correction already", where=path, got=one.as_text(),
                expected="an answer of recordings that were diagnosed with this version",
                next_step=f"diagnose the case with machine = {path.name!r}, and correct what is left",
                rule="machine-correction",
            )  # fmt: skip
    made = {"version": old.version + 1, "supersedes": sha256_bytes(data)}
    text = _with_version(data.decode("utf-8"), made) + _block(correction)
    built = build_machine(parse_toml(text.encode(), where=out), out)
    return text, built


def _with_version(text: str, made: dict[str, Any]) -> str:
    lines, inside, done = [], False, False
    for line in text.splitlines():
        inside = inside or line.lstrip().startswith("[")
        if not inside and _OWN.match(line):
            continue
        lines.append(line)
        if not inside and not done and _NAME.match(line):
            lines += [f"{key} = {_value(value)}" for key, value in made.items()]
            done = True
    return "\n".join(lines).rstrip() + "\n"


def _block(one: Correction) -> str:
    applied = one.applied
    entries: dict[str, Any] = {"effect": applied.effect.name}
    entries |= {key: text for key, text in (("channel", applied.channel), ("source", applied.source)) if text}
    entries |= {
        "parameter": one.parameter, "value": one.value, "unit": one.unit, "standard_uncertainty": one.u,
        "reason": one.reason, "by": one.by, "date": one.date, "answer_sha256": one.answer_sha256,
        "case_sha256": one.case_sha256, "code_version": one.code_version,
        "equivalent_to": list(one.equivalent_to),
    }  # fmt: skip
    return "\n[[correction]]\n" + "".join(f"{key} = {_value(value)}\n" for key, value in entries.items())


def _value(one: Any) -> str:
    if isinstance(one, list):
        return f"[{', '.join(_value(each) for each in one)}]"
    if isinstance(one, str):
        return json.dumps(one, ensure_ascii=False).replace("\x7f", "\\u007F")
    return repr(one)
