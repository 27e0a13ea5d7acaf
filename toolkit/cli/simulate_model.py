"""`toolkit simulate MODEL.toml --inputs FILE.csv`: the augmented simulation of a diagnosis, run forward."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any


def is_model_file(path: Path) -> bool:
    """Tell whether a file is the model file of a diagnosis; what is no TOML is none."""
    from toolkit.errors import ConfigError
    from toolkit.files import read_toml
    from toolkit.simulation.model_file import is_model

    try:
        return is_model(read_toml(path))
    except ConfigError:
        return False


def model_answer(
    path: Path,
    inputs: Sequence[Path],
    given: Sequence[str],
    out: Path,
    calibrations: Path | None,
    home: Path | None,
) -> tuple[dict[str, Any], str]:
    """Write the outputs of a model on inputs; return the JSON answer and the text for people."""
    from toolkit.cli.console import finding_lines
    from toolkit.cli.diagnose import registry_of
    from toolkit.diagnosis.forward import simulate_model
    from toolkit.files import write_atomic
    from toolkit.simulation.model_file import read_model
    from toolkit.simulation.write import check_folder

    model = read_model(path)
    registry = registry_of(calibrations, home) if model.kind == "machine" else None
    made, findings = simulate_model(model, inputs, registry, conditions=_conditions(given))
    check_folder(out, {name for name, _ in made})
    for name, content in made:
        write_atomic(out / name, content)
    payload = {
        "out": out,
        "simulated": True,
        "kind": "model",
        "model_sha256": model.sha256,
        "case_sha256": model.case_sha256,
        "effects": [one.label for one in model.effects],
        "files": [name for name, _ in made],
        "findings": [one.as_dict() for one in findings],
    }
    lines = [f"{model.title}: {len(made)} files of outputs in {out}  SIMULATED"]
    lines += [f"  effect       {one.label}" for one in model.effects]
    return payload, "\n".join([*lines, *finding_lines(findings)])


def _conditions(given: Sequence[str]) -> dict[str, str]:
    from toolkit.errors import ConfigError

    made = {}
    for one in given:
        key, equals, value = one.partition("=")
        if not key.strip() or not equals or not value.strip() or key.strip() == "file":
            raise ConfigError(
                "a condition is not whole", where="--condition", got=one, expected="KEY=VALUE",
                next_step="write for example --condition rotation=reverse", rule="wrong-value",
            )  # fmt: skip
        made[key.strip()] = value.strip()
    return made
