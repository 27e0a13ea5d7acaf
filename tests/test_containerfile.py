"""The Containerfile installs what the Makefile does, runs as an ordinary user, and starts the command."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "Containerfile").read_text(encoding="utf-8")
LINES = [line.strip() for line in TEXT.replace("\\\n", " ").splitlines() if line and not line.startswith("#")]
COMPILER = {"gcc", "libc6-dev"}  # for FMUs alone, which a laboratory need not write


def test_its_packages_are_those_of_the_makefile_and_a_compiler() -> None:
    (stated,) = re.findall(r"(?m)^APT_PACKAGES := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"))
    (installed,) = re.findall(r"apt-get install (.*?) &&", TEXT.replace("\\\n", " "))
    packages = {word for word in installed.split() if not word.startswith("--")}
    assert packages == set(stated.split()) | COMPILER


def test_its_python_is_the_oldest_that_is_supported() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    oldest = project["requires-python"].removeprefix(">=")
    bases = [line.split()[1] for line in LINES if line.startswith("FROM ")]
    assert set(bases) == {f"python:{oldest}-slim-bookworm"}


def test_libraries_come_by_their_hashes_and_the_wheel_brings_none() -> None:
    (libraries,) = [line for line in LINES if "requirements.lock" in line and line.startswith("RUN")]
    assert "--require-hashes" in libraries
    assert "--no-deps --no-index /wheels" in libraries


def test_it_starts_the_command_as_an_ordinary_user() -> None:
    order = [line.split()[0] for line in LINES]
    assert 'ENTRYPOINT ["toolkit"]' in LINES
    user = next(line.split()[1] for line in LINES if line.startswith("USER "))
    assert user != "root"
    assert any(line.startswith("RUN useradd") and user in line for line in LINES)
    assert order.index("USER") > max(place for place, word in enumerate(order) if word == "RUN")


def test_what_it_copies_is_there() -> None:
    for line in LINES:
        if line.startswith("COPY ") and "--from" not in line:
            assert (ROOT / line.split()[1]).exists()
