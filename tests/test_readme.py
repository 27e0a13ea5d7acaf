"""The examples of README and handbook: every settings file is read, every command and option exists."""

from __future__ import annotations

import csv
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from tests import commands
from toolkit.examples import packaged_fig4_4
from toolkit.recording.folder import read_test_folder

ROOT = Path(__file__).resolve().parents[1]
HANDBOOK = (ROOT / "docs" / "handbook.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = [
    "\n".join(line[4:] for line in block.splitlines())
    for block in re.findall(r"(?:^    .*\n(?:\n(?=    ))?)+", README + HANDBOOK, flags=re.MULTILINE)
]
GROUPS = ("calibration", "template", "session", "machine", "test", "case", "plan")
COMMANDS = [
    line.split("#")[0].split("&&")[0].strip()
    for block in BLOCKS
    for line in block.splitlines()
    if line.startswith("toolkit ")
]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_and_option_exists(line: str) -> None:
    words = shlex.split(line)[1:]
    group = words[:2] if len(words) > 1 and words[1].isalpha() and words[0] in GROUPS else words[:1]
    code, helped, _ = commands.said(*group, "--help")
    assert code == 0
    for option in (word for word in words if word.startswith("--")):
        assert option in helped


def test_the_readme_is_one_screen_with_two_pictures() -> None:
    assert len(README.splitlines()) <= 60
    assert README.count("![") == 2
    first_use = next(block for block in BLOCKS if block.startswith("toolkit init"))
    assert len(first_use.splitlines()) == 6


def test_the_commands_are_there() -> None:
    assert len(COMMANDS) >= 9


def test_the_session_is_one(tmp_path: Path) -> None:
    session = next(block for block in BLOCKS if "indications" in block)
    heads = re.search(r"`(run,direction,[^`]*)`", HANDBOOK)
    assert heads is not None
    columns = heads[1].split(",")
    (tmp_path / "SESSION.toml").write_text(session)
    rng = np.random.default_rng(7)

    def rows(count: int) -> list[list[float]]:
        cells = rng.uniform(-500, 500, (count, 3))
        FY = cells @ [4.4357, 4.4357, 4.5496] + rng.normal(0, 0.3, count)
        MZ = cells @ [-0.2127, 0.2196, 0.0036] + rng.normal(0, 0.01, count)
        return np.column_stack([cells, FY, MZ]).tolist()

    with (tmp_path / "loads.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows([1 + i // 12, "up" if i % 2 else "down", *row] for i, row in enumerate(rows(36)))
    with (tmp_path / "check.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns[2:])
        writer.writerows(rows(6))
    registry = tmp_path / "calibrations"
    registry.mkdir()
    assert commands.said("calibrate", tmp_path / "SESSION.toml", "--calibrations", registry, "-q").code == 0
    assert (registry / "m15" / "m15-r1.json").is_file()


def test_the_test_folder_is_one(tmp_path: Path) -> None:
    block = next(block for block in BLOCKS if "[rotations]" in block).split("\n\n")[0]
    (tmp_path / "test.toml").write_text(block)
    for name in ("tare.xlsx", "run_14.xlsx"):
        (tmp_path / name).write_bytes(packaged_fig4_4()[0].read_bytes())
    test = read_test_folder(tmp_path)
    assert test.tare_file == tmp_path / "tare.xlsx"
    assert test.rotation_of(tmp_path / "run_14.xlsx") == "reverse"
    assert test.info.tire_size == "205/55R16"
