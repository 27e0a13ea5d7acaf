"""The demonstration makes the certificate of its calibration by the program's own command."""

from __future__ import annotations

from pathlib import Path

import typer

from toolkit.cli import calibration, demo


def test_the_certificate_is_a_step_with_options_that_the_command_has(tmp_path: Path) -> None:
    step = next(one for one in demo._steps(tmp_path) if one.words[:2] == ("calibration", "certificate"))
    command = typer.main.get_command(calibration.app).commands["certificate"]  # type: ignore[attr-defined]
    known = {name for parameter in command.params for name in parameter.opts}
    assert {word for word in step.words if word.startswith("--")} <= known
    template = Path(step.words[step.words.index("--template") + 1])
    assert template.is_file()
    assert template.is_relative_to(tmp_path)


def test_the_certificate_is_told_with_its_uncertainty() -> None:
    loads = {"FY": {"U": 0.2566, "unit": "lbf"}, "MZ": {"U": 0.0312, "unit": "lbf*ft"}}
    told = demo._told_certificate({"pdf": "/x/CC-1.pdf", "pages": 6, "verified": True, "loads": loads})
    assert told.startswith("certificate/CC-1.pdf: 6 pages, verified")
    assert told.endswith("FY 0.26 lbf, MZ 0.031 lbf*ft")
